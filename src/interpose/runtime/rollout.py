"""The autoregressive roll-out of DC-MoE, from one start pose or a few frames to a target (Chu and Yang 2024, 3).

Everything that a frame needs is in the ONNX step; here is only what surrounds it: the interpolation base between the
two keys, the state of a start whose phase and velocity are unknown (its past clamped to it, phases of no amplitude),
and the count of frames left. On the base the last step leads into the target exactly (see `interpose.models.dcmoe`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.features import CHANNELS, CONTACTS, HISTORY, JOINTS, KEY_STEP, KEYS, RATE, SIDE_KEYS, state_shapes
from interpose.runtime.session import Session
from interpose.skeleton import HUMANOID

PARENTS = HUMANOID.parents
POSE = 3 + JOINTS * 6
Path = Float[ndarray, "_ 3"]
"""The root's way on the ground at 30 Hz: x, z in metres and yaw in radians, unwrapped, both keys included."""
_UP, _FORWARD = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Pose:
    """A batch of poses as the step takes them. rotations: ``q_world_joint`` as 6-D. facing: of the hips, (x, z)."""

    hips: Float[ndarray, "*batch 3"]
    rotations: Float[ndarray, "*batch 22 6"]
    positions: Float[ndarray, "*batch 22 3"]
    facing: Float[ndarray, "*batch 2"]


def pose_of(root: Float[ndarray, "*batch 3"], local: Float[ndarray, "*batch 22 4"]) -> Pose:
    """Poses of :data:`~interpose.skeleton.HUMANOID` from hips positions and local rotations."""
    world = kinematics.global_rotations(local, PARENTS)
    positions = kinematics.global_positions(root, world, PARENTS, HUMANOID.offsets)
    facing = rotation.rotate(rotation.twist(world[..., 0, :], _UP), _FORWARD)[..., ::2]
    return Pose(root, rotation.to_6d(world), positions, facing)


def interpolation(
    start: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: int,
) -> Float[ndarray, "batch time pose"]:
    """The base A from start to target, both included (frames + 2): hips linear, rotations SLERPed, as (hips, 6-D)."""
    t = np.linspace(0.0, 1.0, frames + 2)
    root = start[0][:, None] + t[:, None] * (target[0] - start[0])[:, None]
    local = rotation.slerp(start[1][:, None], target[1][:, None], t[:, None])
    six = rotation.to_6d(kinematics.global_rotations(local, PARENTS))
    return np.concatenate([root, six.reshape(*six.shape[:2], -1)], axis=-1)


def initial_state(context: Pose, phases: Float[ndarray, "batch 13 10 2"]) -> dict[str, ndarray]:
    """The state at the last of the context frames (batch, frame, ...); before the first one the figure stands still."""
    count, known = context.hips.shape[:2]
    track = np.concatenate([context.hips[..., ::2], context.facing], axis=-1)
    index = np.maximum(np.arange(known - HISTORY - 1, known), 0)
    velocity = np.zeros_like(context.positions[:, -1])
    if known > 1:
        velocity = (context.positions[:, -1] - context.positions[:, -2]) * RATE
    # A window's keys move on with every frame, so the frames between them are filled too; before the context the phases
    # are unknown, as they are in training.
    at = np.arange(HISTORY) / KEY_STEP
    low = np.minimum(at.astype(int), SIDE_KEYS - 1)
    part = (at - low)[:, None, None]
    past = (1.0 - part) * phases[:, low] + part * phases[:, low + 1]
    past[:, : max(0, HISTORY - known)] = 0.0
    return {
        "hips": context.hips[:, -1],
        "rotations": context.rotations[:, -1],
        "positions": context.positions[:, -1],
        "velocities": velocity,
        "velocity_known": np.full((count, 1), float(known > 1)),
        "track": track[:, index],
        "phase_past": past,
        "phase_future": phases[:, SIDE_KEYS + 1 :],
    }


def initial_phases(session: Session, count: int, seed: int, vary: bool) -> Float[ndarray, "batch 13 10 2"]:
    """Unknown phases (no amplitude), or with ``vary`` drawn for all rows but the first of seed 0.

    So variants begin in other gaits. A row's window depends on the seed and the row alone, and no two rows have the
    same one until all of the model's have been drawn.
    """
    phases = np.zeros((count, KEYS, CHANNELS, 2))
    bank = session.phase_bank
    if vary and len(bank):
        order = np.random.default_rng(seed).permutation(len(bank))
        drawn = slice(0 if seed else 1, count)
        phases[drawn] = bank[order[np.arange(count)[drawn] % len(bank)]]
    return phases


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
    control: float = 1.0,
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"], Float[ndarray, "batch frame 4"]]:
    """The ``frames`` frames between start and target at 30 Hz: hips, local rotations, contact probabilities.

    The last context frame is the start key. Where the rows' ``frames`` differ, a shorter row is followed by its target.
    style: a label a row, None to leave it free. ``vary`` starts the rows in different phases, so that they become
    variants of one another; otherwise the seed changes nothing. paths: for each row the root's way from start to
    target, frames + 2 rows, or None to leave it to the network. control: how much the path counts beside the root that
    the network foresees, 0 to 1. Raises InputError for an unknown style.
    """
    count = len(start_root)
    each = [frames] * count if isinstance(frames, int) else list(frames)
    longest = max(each, default=0)
    context = pose_of(start_root, start_local)
    target = pose_of(target_root, target_local)
    base = _bases((start_root[:, -1], start_local[:, -1]), (target_root, target_local), each).astype(np.float32)
    state = initial_state(context, initial_phases(session, count, seed, vary))
    state = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()}
    fixed = steering(session, target, style or [None] * count)
    given = np.array([path is not None for path in paths or [None] * count])
    keys = guidance(list(paths or [None] * count), longest)
    fixed["path_known"][given] = 1.0
    hips, six, contacts = [], [], []
    foreseen = resting_path(context)
    for step in range(longest):
        path = fixed["path"] if not session.feeds_path_back else foreseen
        if given.any():
            share = control if step else 1.0
            path = np.where(given[:, None, None], share * keys[:, step] + (1.0 - share) * foreseen, path)
        moving = fixed | {
            "base": base[:, step],
            "base_next": base[:, step + 1],
            "frames_left": np.array([[max(n + 1 - step, 1)] for n in each], dtype=np.float32),
            "path": path.astype(np.float32),
        }
        said = session.step(state | moving)
        state = after(said)
        foreseen = said["next_path"]
        hips.append(state["hips"])
        six.append(state["rotations"])
        contacts.append(said["contacts"])
    if not longest:
        return np.zeros((count, 0, 3)), np.zeros((count, 0, 22, 4)), np.zeros((count, 0, len(CONTACTS)))
    local = continued(start_local[:, -1], local_of(np.stack(six, axis=1).astype(float)))
    return np.stack(hips, axis=1).astype(float), local, np.stack(contacts, axis=1).astype(float)


def local_of(six: Float[ndarray, "*batch 22 6"]) -> Float[ndarray, "*batch 22 4"]:
    """Local rotations from global ones as 6-D."""
    return kinematics.local_rotations(rotation.from_6d(six), PARENTS)


def continued(
    start: Float[ndarray, "batch joint 4"], local: Float[ndarray, "batch frame joint 4"]
) -> Float[ndarray, "batch frame joint 4"]:
    """``local`` with the signs that go on without a jump from the start key's."""
    whole = np.concatenate([start[:, None], local], axis=1)
    return rotation.continuous(whole.swapaxes(0, 1)).swapaxes(0, 1)[:, 1:]


def last(context: Pose) -> Pose:
    """The last frame of poses (batch, frame, ...)."""
    return Pose(context.hips[:, -1], context.rotations[:, -1], context.positions[:, -1], context.facing[:, -1])


def _bases(
    start: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: list[int],
) -> Float[ndarray, "batch time pose"]:
    """Each row's :func:`interpolation`; after a shorter one its target stands still."""
    longest = max(frames, default=0)
    out = np.empty((len(frames), longest + 2, POSE))
    for length in set(frames):
        rows = [row for row, n in enumerate(frames) if n == length]
        made = interpolation((start[0][rows], start[1][rows]), (target[0][rows], target[1][rows]), length)
        out[rows, : length + 2] = made
        out[rows, length + 2 :] = made[:, -1:]
    return out


def guidance(paths: list[Path | None], frames: int) -> Float[ndarray, "batch {frames} 6 6"]:
    """What the input `path` shows of each row's path at each step: root, facing and velocity at the six keys ahead.

    Beyond a path's end its last frame goes on being shown, as in training. Rows without a path have zeros.
    """
    out = np.zeros((len(paths), frames, SIDE_KEYS, 6))
    for row, path in enumerate(paths):
        if path is not None:
            at = np.arange(frames)[:, None] + KEY_STEP * np.arange(1, SIDE_KEYS + 1)
            here = np.minimum(at, len(path) - 1)
            before = np.maximum(here - 1, 0)
            out[row, ..., :2] = path[here, :2]
            out[row, ..., 2], out[row, ..., 3] = np.sin(path[here, 2]), np.cos(path[here, 2])
            out[row, ..., 4:] = (path[here, :2] - path[before, :2]) * RATE
    return out


def strayed(root: Float[ndarray, "frame 3"], path: Path) -> float:
    """The mean distance on the ground between the generated root and the path."""
    way = path[1:-1, :2]
    return float(np.linalg.norm(root[: len(way), [0, 2]] - way, axis=-1).mean()) if len(way) else 0.0


def after(said: dict[str, ndarray]) -> dict[str, ndarray]:
    """The state that a step leaves, of which the velocity is known."""
    state = {name: said[f"next_{name}"] for name in state_shapes() if name != "velocity_known"}
    return state | {"velocity_known": np.ones((len(state["hips"]), 1), dtype=np.float32)}


def steering(session: Session, target: Pose, style: list[str | None]) -> dict[str, ndarray]:
    """What stays the same through a gap: the target, the styles, no path."""
    count = len(style)
    return {
        "target_hips": target.hips.astype(np.float32),
        "target_rotations": target.rotations.astype(np.float32),
        "target_positions": target.positions.astype(np.float32),
        "style": session.style_weights(style),
        "path": np.zeros((count, SIDE_KEYS, 6), dtype=np.float32),
        "path_known": np.full((count, 1), float(session.feeds_path_back), dtype=np.float32),
    }


def resting_path(context: Pose) -> Float[ndarray, "batch 6 6"]:
    """Future root keys of a figure that stays where it is: where a network that is fed its own prediction begins."""
    key = np.concatenate([context.hips[:, -1, ::2], context.facing[:, -1], np.zeros((len(context.hips), 2))], axis=-1)
    return np.repeat(key[:, None], SIDE_KEYS, axis=1).astype(np.float32)
