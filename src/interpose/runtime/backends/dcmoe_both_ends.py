"""DC-MoE stitched from both ends: a forward and a backward network that meet in the middle of the gap.

What Ren et al. 2024 do for S-CVAE, for Chu and Yang's network; the backward one was trained on motion that runs
backwards.
"""

from __future__ import annotations

import numpy as np

from interpose.features.stitch import schedule
from interpose.runtime import planner
from interpose.runtime.backends import chains, dcmoe_state
from interpose.runtime.gap_batch import GapBatch, Generated, by_length
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, continued, last, local_of, pose_of

BUFFER = 2
"""K: the chains share 2K frames."""


def generate(session: Session, batch: GapBatch) -> Generated:
    """The frames of each gap, for a model that has a backward network, too."""
    return by_length(batch, lambda rows: _stitch(session, rows))


def _stitch(session: Session, batch: GapBatch) -> Generated:
    """Gaps of one length. Each step is led to the other chain's newest frame: with D what that frame differs by from
    its base, a base that is moved by D leads there exactly. The backward network sees the path from its end."""
    steps, count = batch.longest + 1, len(batch)
    phases = dcmoe_state.initial_phases(session, batch.draws)
    goal = pose_of(batch.target_root[:, None], batch.target_local[:, None])
    base = planner.base(session, batch, None)[0].astype(np.float32)
    states = [dcmoe_state.initial_state(batch.context, phases), dcmoe_state.initial_state(goal, np.zeros_like(phases))]
    if batch.arriving is not None:
        states[1] |= {"velocities": -batch.arriving, "velocity_known": np.ones((count, 1))}
    states = [{k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()} for state in states]
    keys = [states[0], states[1]]
    turned_back = [_reversed(path) for path in batch.paths]
    seen = [dcmoe_state.path_keys(paths, batch.longest) for paths in (batch.paths, turned_back)]
    given = np.array([[float(path is not None)] for path in batch.paths], dtype=np.float32)
    fixed = dcmoe_state.steering(session, last(goal), batch.styles, batch.style_strength) | {"path_known": given}
    made: tuple[list[chains.ChainFrame], list[chains.ChainFrame]] = ([], [])
    at = [0, steps]
    for move in schedule(steps, BUFFER):
        side = int(move.backward)
        aim = keys[1 - side] if move.to_key else states[1 - side]
        away = np.concatenate([aim["hips"], aim["rotations"].reshape(count, -1)], axis=-1) - base[:, move.aim]
        gone = at[side] if not side else steps - at[side]
        control = fixed | {f"target_{name}": aim[name] for name in ("hips", "rotations", "positions")}
        control |= {
            "base": base[:, at[side]] + away,
            "base_next": base[:, move.made] + away,
            "frames_left": np.full((count, 1), move.left, dtype=np.float32),
            "path": seen[side][:, min(gone, batch.longest - 1)].astype(np.float32),
        }
        out = session.run("back" if side else "step", states[side] | control)
        states[side] = dcmoe_state.after(out)
        made[side].append(states[side] | {"contacts": out["contacts"]})
        at[side] = move.made
    hips, turned, contacts = chains.joined(made, steps, BUFFER)
    return Generated(hips, continued(batch.context_local[:, -1], local_of(turned)), contacts)


def _reversed(path: Path | None) -> Path | None:
    return None if path is None else path[::-1]
