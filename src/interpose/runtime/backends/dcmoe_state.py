"""What a step of DC-MoE takes beside the base: the state that a roll-out carries, and what steers it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import CHANNELS, HISTORY, KEY_STEP, KEYS, RATE, SIDE_KEYS, state_shapes
from interpose.runtime.gap_batch import Draw
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, Pose


def initial_state(context: Pose, phases: Float[ndarray, "batch 13 10 2"]) -> dict[str, ndarray]:
    """The state at the last of the context frames (batch, frame, ...); before the first one the character stands
    still."""
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


def initial_phases(session: Session, draws: Sequence[Draw]) -> Float[ndarray, "batch 13 10 2"]:
    """Unknown phases (no amplitude) for the likeliest motion; for variants windows of the model's bank, so that they
    begin in other gaits. No two numbers of a seed have the same one until all of the bank have been drawn."""
    phases = np.zeros((len(draws), KEYS, CHANNELS, 2))
    bank = session.phase_bank
    for row, draw in enumerate(draws):
        if draw is not None and len(bank):
            seed, number = draw
            phases[row] = bank[np.random.default_rng(seed).permutation(len(bank))[number % len(bank)]]
    return phases


def path_keys(paths: Sequence[Path | None], frames: int) -> Float[ndarray, "batch {frames} 6 6"]:
    """What the input `path` shows of each row's path at each step: root, facing and velocity at the six keys ahead.

    Beyond a path's end its last frame is repeated, as in training. Rows without a path have zeros.
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


def after(out: dict[str, ndarray]) -> dict[str, ndarray]:
    """The state that a step leaves, of which the velocity is known."""
    state = {name: out[f"next_{name}"] for name in state_shapes() if name != "velocity_known"}
    return state | {"velocity_known": np.ones((len(state["hips"]), 1), dtype=np.float32)}


def steering(session: Session, target: Pose, styles: Sequence[str | None], strength: float = 1.0) -> dict[str, ndarray]:
    """What stays the same through a gap: the target, the styles, no path."""
    count = len(styles)
    return {
        "target_hips": target.hips.astype(np.float32),
        "target_rotations": target.rotations.astype(np.float32),
        "target_positions": target.positions.astype(np.float32),
        "style": session.style_weights(styles, strength),
        "path": np.zeros((count, SIDE_KEYS, 6), dtype=np.float32),
        "path_known": np.full((count, 1), float(session.feeds_path_back), dtype=np.float32),
    }


def resting_path(context: Pose) -> Float[ndarray, "batch 6 6"]:
    """Future root keys of a character that stays where it is: where a network that is fed its own prediction begins."""
    key = np.concatenate([context.hips[:, -1, ::2], context.facing[:, -1], np.zeros((len(context.hips), 2))], axis=-1)
    return np.repeat(key[:, None], SIDE_KEYS, axis=1).astype(np.float32)
