"""The model's transitions for one gap on the user's rig: every step from the keys to the finished frames.

keys -> the 22 joints (`retarget`) -> 30 Hz (`resampling`) -> the model's roll-out (`rollout`) -> known velocities at
the ends kept (`inertia`) -> feet kept on the ground (`feet`) -> the user's rate (`resampling`) -> the user's rig, what
the 22 joints lack interpolated (`retarget`).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose import retarget
from interpose.data.contacts import INDICES
from interpose.motion import Motion, concatenate, sample
from interpose.runtime import feet, inertia, rollout
from interpose.runtime.interpolate import aligned
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, model_steps, recent, to_user_rate
from interpose.runtime.session import Session
from interpose.skeleton import HUMANOID

LANDING = 3
"""Frames from the start key in which a foot that comes to it in motion is left free."""
LANDING_SPEED = 0.5
"""Metres a second from which on it is in motion."""


def generate(
    starts: list[Motion],
    target: Motion,
    frames: int,
    session: Session,
    mapping: retarget.Mapping,
    styles: list[str | None],
    seed: int = 0,
) -> list[Motion]:
    """A transition for each of ``starts``, in its style, with its ends: ``frames`` + 2 frames on the rig, at its rate.

    The starts are equally long and end in the same key; what they hold before it is context. ``target`` begins with its
    key; what follows is known, too, and the transition arrives with its velocity. The ends come out as the keys are,
    but for rounding: they take the same way as the frames between them.
    """
    count, rate = len(starts), starts[0].rate
    steps = model_steps(frames, rate)
    step = (frames + 1) / rate / steps
    context = _stacked([recent(start, CONTEXT) for start in starts], mapping)
    goal = _stacked([target[0]] * count, mapping)
    made_root, made_local, contacts = rollout.generate_batch(
        session, *context, goal[0][:, 0], goal[1][:, 0], steps - 1, style=styles, seed=seed, vary=True
    )
    root = np.concatenate([context[0][:, -1:], made_root, goal[0]], axis=1)
    local = np.concatenate([context[1][:, -1:], made_local, goal[1]], axis=1)
    contacts = np.pad(contacts, ((0, 0), (1, 1), (0, 0)), mode="edge")
    if len(starts[0]) > 1:
        ago = min(rate / MODEL_RATE, len(starts[0]) - 1.0)
        poses = _stacked([sample(start, np.array([len(start) - 1.0 - ago])) for start in starts], mapping)
        contacts[:, :LANDING] *= ~_moving(poses, context, ago / rate)[:, None]
        root, local = inertia.leave(root, local, poses[0][:, 0], poses[1][:, 0], step, ago / rate)
    if len(target) > 1:
        ahead = min(rate / MODEL_RATE, len(target) - 1.0)
        poses = _stacked([sample(target, np.array([ahead]))] * count, mapping)
        root, local = inertia.arrive(root, local, poses[0][:, 0], poses[1][:, 0], step, ahead / rate)
    local = feet.plant_batch(root, local, contacts)
    before = context[0].shape[1] - 1
    root = np.concatenate([context[0][:, :-1], root], axis=1)
    local = np.concatenate([context[1][:, :-1], local], axis=1)
    on_grid = [to_user_rate(r, q, before, frames, rate) for r, q in zip(root, local, strict=True)]
    # All transitions go back to the rig in one call: that is much faster than one at a time. What the 22 joints lack
    # (fingers, twists, animated offsets) follows the rig's own interpolation.
    whole = Motion(HUMANOID, np.concatenate([r for r, _ in on_grid]), np.concatenate([q for _, q in on_grid]), rate)
    keys = concatenate(*aligned(starts[0][-1], target[0]))
    details = sample(keys, np.tile(np.linspace(0.0, 1.0, frames + 2), count))
    on_rig = retarget.from_humanoid(whole, mapping, details)
    size = frames + 2
    return [on_rig[i * size : (i + 1) * size] for i in range(count)]


def _moving(
    before: tuple[Float[ndarray, "batch 1 3"], Float[ndarray, "batch 1 22 4"]],
    context: tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]],
    seconds: float,
) -> Bool[ndarray, "batch 4"]:
    """Which foot joints come to the start key in motion: such a foot does not stand there yet."""

    def feet_of(root: Float[ndarray, "batch 3"], local: Float[ndarray, "batch 22 4"]) -> Float[ndarray, "batch 4 3"]:
        return Motion(HUMANOID, root, local, MODEL_RATE).global_positions()[:, INDICES]

    way = feet_of(context[0][:, -1], context[1][:, -1]) - feet_of(before[0][:, 0], before[1][:, 0])
    return np.linalg.norm(way, axis=-1) > LANDING_SPEED * seconds


def _stacked(
    motions: list[Motion], mapping: retarget.Mapping
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]:
    """Motions of one length on the 22 joints: hips positions and local rotations."""
    first, rest = motions[0], motions[1:]
    on22 = retarget.to_humanoid(concatenate(first, *(aligned(first, m)[1] for m in rest)), mapping)
    shape = (len(motions), len(first))
    return on22.root_positions.reshape(*shape, 3), on22.local_rotations.reshape(*shape, len(HUMANOID), 4)
