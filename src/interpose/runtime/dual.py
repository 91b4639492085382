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

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.runtime import rollout
from interpose.runtime.rollout import Path, Pose
from interpose.runtime.session import Session
from interpose.stitching import pressed, schedule, shares

BUFFER = 2
"""K: the chains share 2K frames."""

Made = tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"], Float[ndarray, "batch frame 4"]]


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
) -> Made:
    """As `interpose.runtime.rollout.generate_batch`, for a model that has a backward network, too.

    arriving: the joints' velocities at the target, where they are known.
    """
    count = len(start_root)
    each = [frames] * count if isinstance(frames, int) else list(frames)
    longest = max(each, default=0)
    hips = np.repeat(target_root[:, None], longest, axis=1)
    local = np.repeat(target_local[:, None], longest, axis=1)
    contacts = np.zeros((count, longest, 4))
    phases = rollout.initial_phases(session, count, seed, vary)
    styles, ways = style or [None] * count, list(paths or [None] * count)
    for length in sorted(set(each) - {0}):
        rows = [row for row, n in enumerate(each) if n == length]
        made = _of_length(
            session,
            (start_root[rows], start_local[rows]),
            (target_root[rows], target_local[rows]),
            length,
            [styles[row] for row in rows],
            phases[rows],
            [ways[row] for row in rows],
            None if arriving is None else arriving[rows],
        )
        hips[rows, :length], local[rows, :length], contacts[rows, :length] = made
    return hips, local, contacts


def _of_length(
    session: Session,
    start: tuple[Float[ndarray, "batch context 3"], Float[ndarray, "batch context 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: int,
    style: list[str | None],
    phases: Float[ndarray, "batch 13 10 2"],
    paths: list[Path | None],
    arriving: Float[ndarray, "batch 22 3"] | None,
) -> Made:
    """Gaps of one length."""
    steps, count = frames + 1, len(target[0])
    context = rollout.pose_of(*start)
    goal = rollout.pose_of(target[0][:, None], target[1][:, None])
    base = rollout.interpolation((start[0][:, -1], start[1][:, -1]), target, frames).astype(np.float32)
    states = [rollout.initial_state(context, phases), rollout.initial_state(goal, np.zeros_like(phases))]
    if arriving is not None:
        states[1] |= {"velocities": -arriving, "velocity_known": np.ones((count, 1))}
    states = [{k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()} for state in states]
    keys = [states[0], states[1]]
    seen = [rollout.guidance(paths, frames), rollout.guidance([_reversed(path) for path in paths], frames)]
    given = np.array([[float(path is not None)] for path in paths], dtype=np.float32)
    fixed = rollout.steering(session, _last(goal), style) | {"path_known": given}
    made: list[list[tuple[int, dict[str, ndarray]]]] = [[], []]
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
        states[side] = rollout.after(said)
        made[side].append((move.made, states[side] | {"contacts": said["contacts"]}))
        at[side] = move.made
    out = []
    for name in ("hips", "rotations", "contacts"):
        shape = made[0][0][1][name].shape[1:]
        whole = np.zeros((2, count, steps + 1, *shape))
        for number, chain in enumerate(made):
            for frame, said in chain:
                whole[number, :, frame] = said[name]
        of_back = shares(steps, BUFFER).reshape(-1, *[1] * len(shape))
        mixed = (1.0 - of_back) * whole[0] + of_back * whole[1]
        mixed[:, 0], mixed[:, -1] = mixed[:, 1], mixed[:, -2]
        out.append(pressed(mixed, steps)[:, 1:-1])
    local = kinematics.local_rotations(rotation.from_6d(out[1]), rollout.PARENTS)
    signed = np.concatenate([start[1][:, -1:], local], axis=1).swapaxes(0, 1)
    return out[0], rotation.continuous(signed).swapaxes(0, 1)[:, 1:], out[2]


def _last(context: Pose) -> Pose:
    return Pose(context.hips[:, -1], context.rotations[:, -1], context.positions[:, -1], context.facing[:, -1])


def _reversed(path: Path | None) -> Path | None:
    return None if path is None else path[::-1]
