"""Method ``plan``: the planner's spline alone, without steps or generators."""

from __future__ import annotations

import numpy as np

from interpose import skeleton as kinematics
from interpose.data import contacts
from interpose.features import RATE
from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.runtime import planner
from interpose.runtime.backends.backend import Abilities, trained
from interpose.runtime.gap_batch import GapBatch, Generated, by_length
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import continued, local_of
from interpose.skeleton import HUMANOID


class PlanBackend:
    """What every table compares the other trained methods with: how much they add to their common planner."""

    name = "plan"
    summary = "the planner alone: eight predicted poses and a spline"

    def abilities(self, model: Session | None) -> Abilities | None:
        return None if model is None or not model.has_planner else trained(model, longest_steps=LONGEST_PLAN_STEPS)

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        assert model is not None
        return by_length(batch, lambda rows: _follow(model, rows))


BACKEND = PlanBackend()


def _follow(model: Session, batch: GapBatch) -> Generated:
    """Gaps of one length. Contacts are those that the motion itself shows: low and slow feet."""
    base, _ = planner.base(model, batch, planner.noise(batch.draws, (model.plan_latent,)), LONGEST_PLAN_STEPS)
    inner = base[:, 1:-1]
    local = local_of(inner[..., 3:].reshape(*inner.shape[:2], len(HUMANOID), 6))
    world = kinematics.global_rotations(local, HUMANOID.parents)
    positions = kinematics.global_positions(inner[..., :3], world, HUMANOID.parents, HUMANOID.offsets)
    standing = np.stack([contacts.detect(motion, RATE) for motion in positions]).astype(float)
    return Generated(inner[..., :3], continued(batch.context_local[:, -1], local), standing)
