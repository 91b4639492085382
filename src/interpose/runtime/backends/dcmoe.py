"""Method ``dcmoe``: the autoregressive roll-out, from one start pose or a few frames to a target (Chu and Yang 2024,
3).

Everything that a frame needs is in the ONNX step; here is only what surrounds it: the base between the two keys, the
state of a start whose phase and velocity are unknown, and the count of frames left. On the base the last step arrives
at the target exactly (see `interpose.models.dcmoe`).

A model with a backward network, which was trained on motion that runs backwards, stitches from both ends: the two meet
in the middle of the gap, as Ren et al. 2024 do for S-CVAE.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import CHANNELS, HISTORY, KEY_STEP, KEYS, RATE, SIDE_KEYS, state_shapes
from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.features.stitch import schedule
from interpose.runtime import planner
from interpose.runtime.backends.backend import Abilities, trained
from interpose.runtime.backends.stitch import ChainFrame, joined
from interpose.runtime.gap_batch import Draw, GapBatch, Generated, by_length
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, Pose, continued, last, local_of, pose_of

CHAIN_BUFFER = 2
"""K of a model with a backward network: the chains share 2K frames."""


class DCMoEBackend:
    """The steps along the planner's base, or with a backward network from both ends."""

    name = "dcmoe"
    summary = "mixture of experts, frame by frame along the plan"

    def abilities(self, model: Session | None) -> Abilities | None:
        return trained(model) if model is not None and model.method == "dcmoe" else None

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        assert model is not None
        if model.steps_backward:
            return by_length(batch, lambda rows: _stitch(model, rows))
        return roll_out(model, batch)


BACKEND = DCMoEBackend()


def roll_out(session: Session, batch: GapBatch) -> Generated:
    """The frames of each gap, all rows together; after a shorter one its target is approached no further."""
    drawn = planner.noise(batch.draws, (session.plan_latent,)) if session.has_planner else None
    base = planner.base(session, batch, drawn, LONGEST_PLAN_STEPS)[0].astype(np.float32)
    state = initial_state(batch.context, initial_phases(session, batch.draws))
    state = {k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()}
    fixed = steering(session, batch.target, batch.styles, batch.style_strength)
    given = np.array([path is not None for path in batch.paths])
    keys = path_keys(batch.paths, batch.longest)
    fixed["path_known"][given] = 1.0
    hips, six, contacts = [], [], []
    predicted = resting_path(batch.context)
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
        state = after(out)
        predicted = out["next_path"]
        hips.append(state["hips"])
        six.append(state["rotations"])
        contacts.append(out["contacts"])
    if not batch.longest:
        return Generated(np.zeros((len(batch), 0, 3)), np.zeros((len(batch), 0, 22, 4)), np.zeros((len(batch), 0, 4)))
    local = continued(batch.context_local[:, -1], local_of(np.stack(six, axis=1).astype(float)))
    return Generated(np.stack(hips, axis=1).astype(float), local, np.stack(contacts, axis=1).astype(float))


def _stitch(session: Session, batch: GapBatch) -> Generated:
    """Gaps of one length. Each step is led to the other chain's newest frame: with D what that frame differs by from
    its base, a base that is moved by D leads there exactly. The backward network sees the path from its end."""
    steps, count = batch.longest + 1, len(batch)
    phases = initial_phases(session, batch.draws)
    goal = pose_of(batch.target_root[:, None], batch.target_local[:, None])
    base = planner.base(session, batch, None)[0].astype(np.float32)
    states = [initial_state(batch.context, phases), initial_state(goal, np.zeros_like(phases))]
    if batch.arriving is not None:
        states[1] |= {"velocities": -batch.arriving, "velocity_known": np.ones((count, 1))}
    states = [{k: np.ascontiguousarray(v, dtype=np.float32) for k, v in state.items()} for state in states]
    keys = [states[0], states[1]]
    turned_back = [None if path is None else path[::-1] for path in batch.paths]
    seen = [path_keys(paths, batch.longest) for paths in (batch.paths, turned_back)]
    given = np.array([[float(path is not None)] for path in batch.paths], dtype=np.float32)
    fixed = steering(session, last(goal), batch.styles, batch.style_strength) | {"path_known": given}
    made: tuple[list[ChainFrame], list[ChainFrame]] = ([], [])
    at = [0, steps]
    for move in schedule(steps, CHAIN_BUFFER):
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
        states[side] = after(out)
        made[side].append(states[side] | {"contacts": out["contacts"]})
        at[side] = move.made
    hips, turned, contacts = joined(made, steps, CHAIN_BUFFER)
    return Generated(hips, continued(batch.context_local[:, -1], local_of(turned)), contacts)


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
