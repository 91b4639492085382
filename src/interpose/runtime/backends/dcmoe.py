"""Method ``dcmoe``: the autoregressive roll-out, from one start pose or a few frames to a target (Chu and Yang 2024,
3).

Everything that a frame needs is in the ONNX step; here is only what surrounds it: the base between the two keys, the
state of a start whose phase and velocity are unknown, and the count of frames left. On the base the last step arrives
at the target exactly (see `interpose.models.dcmoe`).
"""

from __future__ import annotations

import numpy as np

from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.runtime import planner
from interpose.runtime.backends import dcmoe_both_ends, dcmoe_state
from interpose.runtime.backends.backend import Abilities, trained
from interpose.runtime.gap_batch import GapBatch, Generated
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import continued, local_of


class DCMoEBackend:
    """The steps along the planner's base, or with a backward network from both ends."""

    name = "dcmoe"
    summary = "mixture of experts, frame by frame along the plan"

    def abilities(self, model: Session | None) -> Abilities | None:
        return trained(model) if model is not None and model.method == "dcmoe" else None

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        assert model is not None
        if model.steps_backward:
            return dcmoe_both_ends.generate(model, batch)
        return roll_out(model, batch)


BACKEND = DCMoEBackend()


def roll_out(session: Session, batch: GapBatch) -> Generated:
    """The frames of each gap, all rows together; after a shorter one its target is approached no further."""
    drawn = planner.noise(batch.draws, (session.plan_latent,)) if session.has_planner else None
    base = planner.base(session, batch, drawn, LONGEST_PLAN_STEPS)[0].astype(np.float32)
    state = dcmoe_state.initial_state(batch.context, dcmoe_state.initial_phases(session, batch.draws))
    state = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()}
    fixed = dcmoe_state.steering(session, batch.target, batch.styles, batch.style_strength)
    given = np.array([path is not None for path in batch.paths])
    keys = dcmoe_state.path_keys(batch.paths, batch.longest)
    fixed["path_known"][given] = 1.0
    hips, six, contacts = [], [], []
    predicted = dcmoe_state.resting_path(batch.context)
    for step in range(batch.longest):
        path = predicted if session.feeds_path_back else fixed["path"]
        if given.any():
            share = batch.path_control if step else 1.0
            path = np.where(given[:, None, None], share * keys[:, step] + (1.0 - share) * predicted, path)
        moving = fixed | {
            "base": base[:, step],
            "base_next": base[:, step + 1],
            "frames_left": np.array([[max(n + 1 - step, 1)] for n in batch.frames], dtype=np.float32),
            "path": path.astype(np.float32),
        }
        out = session.step(state | moving)
        state = dcmoe_state.after(out)
        predicted = out["next_path"]
        hips.append(state["hips"])
        six.append(state["rotations"])
        contacts.append(out["contacts"])
    if not batch.longest:
        return Generated(np.zeros((len(batch), 0, 3)), np.zeros((len(batch), 0, 22, 4)), np.zeros((len(batch), 0, 4)))
    local = continued(batch.context_local[:, -1], local_of(np.stack(six, axis=1).astype(float)))
    return Generated(np.stack(hips, axis=1).astype(float), local, np.stack(contacts, axis=1).astype(float))
