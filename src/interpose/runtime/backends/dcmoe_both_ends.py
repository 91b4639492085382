"""DC-MoE stitched from both ends: a forward and a backward network that meet in the middle of the gap.

What Ren et al. 2024 do for S-CVAE, for Chu and Yang's network: the backward one was trained on motion that runs
backwards. Each step is led to the other chain's newest frame on the interpolation base: with D what that frame differs
by from its base, a base that is moved by D leads there exactly. Style, path and time are kept: the backward network
sees the path from its end.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.runtime import poses
from interpose.runtime.backends import chains, dcmoe
from interpose.runtime.backends.chains import Made
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path
from interpose.stitch_layout import schedule

BUFFER = 2
"""K: the chains share 2K frames."""


def generate_batch(
    session: Session,
    start_root: Float[ndarray, "batch context 3"],
    start_local: Float[ndarray, "batch context 22 4"],
    target_root: Float[ndarray, "batch 3"],
    target_local: Float[ndarray, "batch 22 4"],
    frames: int | Sequence[int],
    style: list[str | None] | None = None,
    seed: int = 0,
    vary: bool = False,
    paths: Sequence[Path | None] | None = None,
    arriving: Float[ndarray, "batch 22 3"] | None = None,
    strength: float = 1.0,
) -> Made:
    """As `interpose.runtime.backends.dcmoe.generate_batch`, for a model that has a backward network, too.

    arriving: the joints' velocities at the target, where they are known.
    """
    count = len(start_root)
    phases = dcmoe.initial_phases(session, count, seed, vary)
    styles, ways = style or [None] * count, list(paths or [None] * count)

    def make(rows: list[int], length: int) -> Made:
        return _of_length(
            session,
            (start_root[rows], start_local[rows]),
            (target_root[rows], target_local[rows]),
            length,
            [styles[row] for row in rows],
            phases[rows],
            [ways[row] for row in rows],
            None if arriving is None else arriving[rows],
            strength,
        )

    return chains.by_length(frames, target_root, target_local, make)


def _of_length(
    session: Session,
    start: tuple[Float[ndarray, "batch context 3"], Float[ndarray, "batch context 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: int,
    style: list[str | None],
    phases: Float[ndarray, "batch 13 10 2"],
    paths: list[Path | None],
    arriving: Float[ndarray, "batch 22 3"] | None,
    strength: float,
) -> Made:
    """Gaps of one length."""
    steps, count = frames + 1, len(target[0])
    context = poses.pose_of(*start)
    goal = poses.pose_of(target[0][:, None], target[1][:, None])
    base = poses.interpolation((start[0][:, -1], start[1][:, -1]), target, frames).astype(np.float32)
    states = [dcmoe.initial_state(context, phases), dcmoe.initial_state(goal, np.zeros_like(phases))]
    if arriving is not None:
        states[1] |= {"velocities": -arriving, "velocity_known": np.ones((count, 1))}
    states = [{k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()} for state in states]
    keys = [states[0], states[1]]
    seen = [dcmoe.guidance(paths, frames), dcmoe.guidance([_reversed(path) for path in paths], frames)]
    given = np.array([[float(path is not None)] for path in paths], dtype=np.float32)
    fixed = dcmoe.steering(session, poses.last(goal), style, strength) | {"path_known": given}
    made: tuple[list[chains.Frame], list[chains.Frame]] = ([], [])
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
            "path": seen[side][:, min(gone, frames - 1)].astype(np.float32),
        }
        said = session.run("back" if side else "step", states[side] | control)
        states[side] = dcmoe.after(said)
        made[side].append(states[side] | {"contacts": said["contacts"]})
        at[side] = move.made
    hips, turned, contacts = chains.joined(made, steps, BUFFER)
    return hips, poses.continued(start[1][:, -1], poses.local_of(turned)), contacts


def _reversed(path: Path | None) -> Path | None:
    return None if path is None else path[::-1]
