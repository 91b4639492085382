"""Method ``interp``: the root on a straight line, the local rotations by SLERP (Harvey et al. 2020, section 5)."""

from __future__ import annotations

import numpy as np

from interpose import rotation
from interpose.runtime.backends.backend import Abilities
from interpose.runtime.gap_batch import GapBatch, Generated, by_length
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import continued


class InterpBackend:
    """Interpolation. On a user's own skeleton, and where a model cannot serve, `interpose.runtime.interpolate`."""

    name = "interp"
    summary = "interpolation: a straight line and SLERP"

    def abilities(self, model: Session | None) -> Abilities:
        return Abilities(longest_steps=None, any_rig=True)

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        return by_length(batch, _interpolate)


BACKEND = InterpBackend()


def _interpolate(batch: GapBatch) -> Generated:
    """Gaps of one length."""
    (root, local), (goal_root, goal_local) = batch.keys
    t = np.arange(1, batch.longest + 1) / (batch.longest + 1)
    hips = root[:, None] + t[:, None] * (goal_root - root)[:, None]
    turned = rotation.slerp(local[:, None], goal_local[:, None], t[:, None])
    return Generated(hips, continued(local, turned), np.zeros((len(batch), batch.longest, 4)))
