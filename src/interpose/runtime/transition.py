"""The model's transitions for one gap on the user's rig: every step from the keys to the finished frames.

keys -> the 22 joints (`retarget`) -> 30 Hz (`resampling`) -> the model's roll-out along the path of a plan (`guidance`,
`rollout`) -> known velocities at the ends kept (`inertia`) -> feet kept on the ground (`feet`) -> the user's rate
(`resampling`) -> the user's rig, what the 22 joints lack interpolated (`retarget`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose import retarget
from interpose.data.contacts import INDICES
from interpose.gallery.paths import retime
from interpose.motion import Motion, concatenate, sample
from interpose.runtime import inertia, methods
from interpose.runtime.backends import dcmoe
from interpose.runtime.feet import lock
from interpose.runtime.guidance import Plan
from interpose.runtime.interpolate import aligned
from interpose.runtime.model_folder import Session
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, model_steps, recent, to_user_rate
from interpose.skeleton import HUMANOID

LANDING = 3
"""Frames from the start key in which a foot that comes to it in motion is left free."""
LANDING_SPEED = 0.5
"""Metres a second from which on it is in motion."""


Batch = tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]
"""Hips positions and local rotations of motions of one length on the 22 joints."""


Rolled = tuple[Float[ndarray, "_ _ 3"], Float[ndarray, "_ _ 22 4"], Float[ndarray, "_ _ 4"]]
"""The same of the frames between the keys, with their contacts."""


@dataclass(frozen=True, eq=False)
class Made:
    """One transition: its frames on the rig with both ends, and how far its root strays from its path on average.

    deviation: metres on the rig; None where it had no path.
    """

    motion: Motion
    deviation: float | None


@dataclass(frozen=True, eq=False)
class Beyond:
    """A pose a model's frame before the start or after the target, and how many seconds from it."""

    root: Float[ndarray, "batch 3"]
    local: Float[ndarray, "batch 22 4"]
    seconds: float


@dataclass(frozen=True, eq=False)
class Keys:
    """What is known around gaps, on the 22 joints: frames up to the start, the target, and the poses beyond both."""

    context: Batch
    goal: tuple[Float[ndarray, "batch 1 3"], Float[ndarray, "batch 1 22 4"]]
    before: Beyond | None
    after: Beyond | None

    @property
    def arriving(self) -> Float[ndarray, "batch 22 3"] | None:
        """The joints' velocities at the target, where they are known."""
        if self.after is None:
            return None
        here = Motion(HUMANOID, self.goal[0][:, 0], self.goal[1][:, 0], MODEL_RATE).global_positions()
        there = Motion(HUMANOID, self.after.root, self.after.local, MODEL_RATE).global_positions()
        return np.asarray((there - here) / self.after.seconds)

    def take(self, rows: list[int]) -> Keys:
        """Of some rows."""
        beyond = [
            None if b is None else Beyond(b.root[rows], b.local[rows], b.seconds) for b in (self.before, self.after)
        ]
        (root, local), (goal_root, goal_local) = self.context, self.goal
        return Keys((root[rows], local[rows]), (goal_root[rows], goal_local[rows]), *beyond)


def generate(
    starts: list[Motion],
    target: Motion,
    frames: list[int],
    plans: list[Plan],
    session: Session,
    mapping: retarget.Mapping,
    seed: int = 0,
    control: float = 1.0,
    strength: float = 1.0,
) -> list[Made]:
    """A transition of so many ``frames`` for each of ``starts`` by its plan, with its ends, on the rig and at its rate.

    The starts are equally long and end in the same key; what they hold before it is context. ``target`` begins with its
    key; what follows is known, too, and the transition arrives with its velocity. The ends come out as the keys are,
    but for rounding: they take the same way as the frames between them. strength: of the plans' styles.
    """
    rate = starts[0].rate
    steps = [model_steps(n, rate) for n in frames]
    paths = [None if p.path is None else retime(p.path, n) for p, n in zip(plans, steps, strict=True)]
    keys = _keys(starts, target, mapping)
    made = methods.generate_batch(
        session,
        *keys.context,
        keys.goal[0][:, 0],
        keys.goal[1][:, 0],
        [n - 1 for n in steps],
        style=[plan.style for plan in plans],
        seed=seed,
        vary=True,
        paths=paths,
        control=control,
        arriving=keys.arriving,
        strength=strength,
    )
    on_grid: dict[int, tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 22 4"]]] = {}
    for size in sorted(set(frames)):
        rows = [row for row, n in enumerate(frames) if n == size]
        inner = model_steps(size, rate) - 1
        finished = _finished(keys.take(rows), *_rows(made, rows, inner), size, rate)
        on_grid |= dict(zip(rows, finished, strict=True))
    # All transitions go back to the rig in one call: that is much faster than one at a time. What the 22 joints lack
    # (fingers, twists, animated offsets) follows the rig's own interpolation.
    roots, locals_ = zip(*(on_grid[row] for row in range(len(frames))), strict=True)
    whole = Motion(HUMANOID, np.concatenate(roots), np.concatenate(locals_), rate)
    details = sample(
        concatenate(*aligned(starts[0][-1], target[0])), np.concatenate([np.linspace(0.0, 1.0, n + 2) for n in frames])
    )
    on_rig = retarget.from_humanoid(whole, mapping, details)
    ends = np.cumsum([n + 2 for n in frames]).tolist()
    return [
        Made(on_rig[end - n - 2 : end], None if path is None else dcmoe.strayed(root, path) / mapping.scale)
        for n, end, path, root in zip(frames, ends, paths, made[0], strict=True)
    ]


def _rows(made: Rolled, rows: list[int], inner: int) -> Rolled:
    return made[0][rows, :inner], made[1][rows, :inner], made[2][rows, :inner]


def _keys(starts: list[Motion], target: Motion, mapping: retarget.Mapping) -> Keys:
    """The known frames around the gaps, at the model's rate."""
    count, rate = len(starts), starts[0].rate
    before = after = None
    if len(starts[0]) > 1:
        ago = min(rate / MODEL_RATE, len(starts[0]) - 1.0)
        root, local = _stacked([sample(start, np.array([len(start) - 1.0 - ago])) for start in starts], mapping)
        before = Beyond(root[:, 0], local[:, 0], ago / rate)
    if len(target) > 1:
        ahead = min(rate / MODEL_RATE, len(target) - 1.0)
        root, local = _stacked([sample(target, np.array([ahead]))] * count, mapping)
        after = Beyond(root[:, 0], local[:, 0], ahead / rate)
    context = _stacked([recent(start, CONTEXT) for start in starts], mapping)
    return Keys(context, _stacked([target[0]] * count, mapping), before, after)


def _finished(
    keys: Keys,
    made_root: Float[ndarray, "batch inner 3"],
    made_local: Float[ndarray, "batch inner 22 4"],
    contacts: Float[ndarray, "batch inner 4"],
    frames: int,
    rate: float,
) -> list[tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 22 4"]]]:
    """Transitions of one length joined with their keys, velocities and feet kept, at the user's rate: frames + 2."""
    root = np.concatenate([keys.context[0][:, -1:], made_root, keys.goal[0]], axis=1)
    local = np.concatenate([keys.context[1][:, -1:], made_local, keys.goal[1]], axis=1)
    contacts = np.pad(contacts, ((0, 0), (1, 1), (0, 0)), mode="edge")
    step = (frames + 1) / rate / (root.shape[1] - 1)
    if keys.before is not None:
        known = keys.before
        contacts[:, :LANDING] *= ~_moving(known, keys.context)[:, None]
        root, local = inertia.leave(root, local, known.root, known.local, step, known.seconds)
    if keys.after is not None:
        known = keys.after
        root, local = inertia.arrive(root, local, known.root, known.local, step, known.seconds)
    local = lock.plant_batch(root, local, contacts)
    past = keys.context[0].shape[1] - 1
    root = np.concatenate([keys.context[0][:, :-1], root], axis=1)
    local = np.concatenate([keys.context[1][:, :-1], local], axis=1)
    return [to_user_rate(r, q, past, frames, rate) for r, q in zip(root, local, strict=True)]


def _moving(before: Beyond, context: Batch) -> Bool[ndarray, "batch 4"]:
    """Which foot joints come to the start key in motion: such a foot does not stand there yet."""

    def feet_of(root: Float[ndarray, "batch 3"], local: Float[ndarray, "batch 22 4"]) -> Float[ndarray, "batch 4 3"]:
        return Motion(HUMANOID, root, local, MODEL_RATE).global_positions()[:, INDICES]

    way = feet_of(context[0][:, -1], context[1][:, -1]) - feet_of(before.root, before.local)
    return np.linalg.norm(way, axis=-1) > LANDING_SPEED * before.seconds


def _stacked(
    motions: list[Motion], mapping: retarget.Mapping
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]:
    """Motions of one length on the 22 joints: hips positions and local rotations."""
    first, rest = motions[0], motions[1:]
    on22 = retarget.to_humanoid(concatenate(first, *(aligned(first, m)[1] for m in rest)), mapping)
    shape = (len(motions), len(first))
    return on22.root_positions.reshape(*shape, 3), on22.local_rotations.reshape(*shape, len(HUMANOID), 4)
