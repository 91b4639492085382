"""The autoregressive roll-out of DC-MoE, from one start pose or a few frames to a target (Chu and Yang 2024, 3).

Everything that a frame needs is in the ONNX step; here is only what surrounds it: the interpolation base between the
two keys, the state of a start whose phase and velocity are unknown (its past clamped to it, phases of no amplitude),
and the count of frames left. On the base the last step leads into the target exactly (see `interpose.models.dcmoe`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import CHANNELS, CONTACTS, HISTORY, KEY_STEP, KEYS, RATE, SIDE_KEYS, state_shapes
from interpose.runtime import planner
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, Pose, bases, continued, last, local_of, pose_of
from interpose.stitch_layout import LONGEST_PLAN, spread


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
    arriving: Float[ndarray, "batch 22 3"] | None = None,
    strength: float = 1.0,
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"], Float[ndarray, "batch frame 4"]]:
    """The ``frames`` frames between start and target at 30 Hz: hips, local rotations, contact probabilities.

    The last context frame is the start key. Where the rows' ``frames`` differ, a shorter row is followed by its target.
    style: a label a row, None to leave it free. ``vary`` starts the rows in different phases and along different plans,
    so that they become variants of one another; otherwise the seed changes nothing. paths: for each row the root's way
    from start to target, frames + 2 rows, or None to leave it to the network. control: how much the path counts beside
    the root that the network foresees, 0 to 1. arriving: the joints' velocities at the target, where they are known.
    strength: of the styles (`interpose.runtime.model_folder.Session.style_weights`). Raises InputError for an unknown
    style.
    """
    count = len(start_root)
    each = [frames] * count if isinstance(frames, int) else list(frames)
    longest = max(each, default=0)
    context = pose_of(start_root, start_local)
    target = pose_of(target_root, target_local)
    way = list(paths or [None] * count)
    labels = list(style or [None] * count)
    drawn = planner.noise((session.plan_latent,), count, seed, vary)
    base = led(
        session,
        context,
        (start_root[:, -1], start_local[:, -1]),
        (target_root, target_local),
        each,
        session.style_weights(labels, strength),
        drawn,
        way,
        control,
        arriving,
    ).astype(np.float32)
    state = initial_state(context, initial_phases(session, count, seed, vary))
    state = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()}
    fixed = steering(session, target, labels, strength)
    given = np.array([path is not None for path in way])
    keys = guidance(way, longest)
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


def led(
    session: Session,
    context: Pose,
    start: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: Sequence[int],
    style: Float[ndarray, "batch style"],
    drawn: Float[ndarray, "batch unit"],
    paths: Sequence[Path | None],
    control: float = 1.0,
    arriving: Float[ndarray, "batch 22 3"] | None = None,
) -> Float[ndarray, "batch time pose"]:
    """The base that the steps walk along, keys included: interpolation, or where the model has a planner what that
    foresees, of the latents that noise ``drawn`` gives, its root laid on the path. Gaps that are longer than plans are
    trained for have none.

    context: poses (batch, frame, ...) up to the start key.
    """
    base = bases(start, target, list(frames))
    if not session.plans:
        return base
    leaving = None
    if context.hips.shape[1] > 1:
        leaving = (context.positions[:, -1] - context.positions[:, -2]) * RATE
    steps = [n + 1 for n in frames]
    goal = pose_of(*target)
    told = planner.ends(last(context), leaving, goal, arriving, steps, style, paths, control)
    added = planner.plan(session, told, drawn)[0]
    for length in {n for n in steps if n <= LONGEST_PLAN}:
        rows = [row for row, n in enumerate(steps) if n == length]
        base[rows, : length + 1] += np.einsum("ta,bac->btc", spread(length), added[rows])
    return planner.laid(base, paths, control)


def foreseen(
    session: Session,
    context: tuple[Float[ndarray, "1 context 3"], Float[ndarray, "1 context 22 4"]],
    target: tuple[Float[ndarray, "1 3"], Float[ndarray, "1 22 4"]],
    frames: int,
    style: str | None,
    strength: float,
) -> Float[ndarray, "{frames} 3"]:
    """Where the hips of a gap's likeliest plan go between its keys; no step is made."""
    start = context[0][:, -1], context[1][:, -1]
    weights, drawn = session.style_weights([style], strength), np.zeros((1, session.plan_latent))
    return led(session, pose_of(*context), start, target, [frames], weights, drawn, [None])[0, 1:-1, :3]


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


def steering(session: Session, target: Pose, style: list[str | None], strength: float = 1.0) -> dict[str, ndarray]:
    """What stays the same through a gap: the target, the styles, no path."""
    count = len(style)
    return {
        "target_hips": target.hips.astype(np.float32),
        "target_rotations": target.rotations.astype(np.float32),
        "target_positions": target.positions.astype(np.float32),
        "style": session.style_weights(style, strength),
        "path": np.zeros((count, SIDE_KEYS, 6), dtype=np.float32),
        "path_known": np.full((count, 1), float(session.feeds_path_back), dtype=np.float32),
    }


def resting_path(context: Pose) -> Float[ndarray, "batch 6 6"]:
    """Future root keys of a figure that stays where it is: where a network that is fed its own prediction begins."""
    key = np.concatenate([context.hips[:, -1, ::2], context.facing[:, -1], np.zeros((len(context.hips), 2))], axis=-1)
    return np.repeat(key[:, None], SIDE_KEYS, axis=1).astype(np.float32)
