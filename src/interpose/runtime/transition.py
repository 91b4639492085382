"""Transitions for one gap on the user's rig: every step from the keys to the finished frames.

keys -> the 22 joints (`retarget`) -> 30 Hz (`resampling`) -> the backend -> known velocities at the ends kept
(`inertia`) -> feet kept on the ground (`feet`) -> the user's rate and rig, what the 22 joints lack interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose import retarget
from interpose.data.contacts import CONTACT_INDICES
from interpose.gallery.paths import retime
from interpose.motion import Motion, concatenate, sample
from interpose.runtime import confidence, inertia, joint_limits
from interpose.runtime.feet import lock
from interpose.runtime.gap_batch import Batch, Generated, batch_of, draws
from interpose.runtime.guidance import Guidance
from interpose.runtime.inertia import NeighbourPose
from interpose.runtime.interpolate import aligned
from interpose.runtime.poses import Path, pose_of
from interpose.runtime.request import Request
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, model_steps, recent, to_user_rate
from interpose.skeleton import HUMANOID

LANDING_FRAMES = 3
"""Frames from the start key in which a foot that comes to it in motion is left free."""
LANDING_SPEED = 0.5
"""Metres a second from which on it is in motion."""


@dataclass(frozen=True, eq=False)
class Transition:
    """One transition: its frames on the rig with both ends, and how far its root strays from its path on average.

    deviation: metres on the rig; None where it had no path. confidence: 0 to 1, None where it is not known.
    """

    motion: Motion
    deviation: float | None
    confidence: float | None = None


@dataclass(frozen=True, eq=False)
class KnownFrames:
    """What is known around gaps, on the 22 joints: frames up to the start, the target, and the poses beyond both."""

    context: Batch
    goal: tuple[Float[ndarray, "batch 1 3"], Float[ndarray, "batch 1 22 4"]]
    before: NeighbourPose | None
    after: NeighbourPose | None

    @property
    def arriving(self) -> Float[ndarray, "batch 22 3"] | None:
        """The joints' velocities at the target, where they are known."""
        if self.after is None:
            return None
        here, there = pose_of(self.goal[0][:, 0], self.goal[1][:, 0]), pose_of(self.after.root, self.after.local)
        return np.asarray((there.positions - here.positions) / self.after.seconds)

    def take(self, rows: list[int]) -> KnownFrames:
        """Of some rows."""
        beyond = [
            None if b is None else NeighbourPose(b.root[rows], b.local[rows], b.seconds)
            for b in (self.before, self.after)
        ]
        (root, local), (goal_root, goal_local) = self.context, self.goal
        return KnownFrames((root[rows], local[rows]), (goal_root[rows], goal_local[rows]), *beyond)


def generate(
    starts: Sequence[Motion],
    target: Motion,
    frames: Sequence[int],
    guidance: Sequence[Guidance],
    request: Request,
    mapping: retarget.Mapping,
) -> list[Transition]:
    """A transition of so many ``frames`` for each of ``starts`` by its guidance, with its ends, on the rig, at its
    rate.

    The starts are equally long and end in the same key; what they hold before it is context. ``target`` begins with its
    key; what follows is known, too, and the transition arrives with its velocity. The ends come out as the keys are,
    but for rounding: they go through the same steps as the frames between them.
    """
    rate = starts[0].rate
    steps = [model_steps(n, rate) for n in frames]
    paths = [None if g.path is None else retime(g.path, n) for g, n in zip(guidance, steps, strict=True)]
    keys = _keys(starts, target, mapping)
    batch = batch_of(
        keys.context,
        keys.goal,
        [n - 1 for n in steps],
        styles=[g.style for g in guidance],
        paths=paths,
        draws=draws(request.seed, len(starts)),
        arriving=keys.arriving,
        style_strength=request.style_strength,
        path_control=request.path_control,
    )
    made, sure = confidence.judged(request.model, batch, request.backend.generate(request.model, batch))
    on_grid: dict[int, tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 22 4"]]] = {}
    for size in sorted(set(frames)):
        rows = [row for row, n in enumerate(frames) if n == size]
        finished = _finished(keys.take(rows), made.take(rows, model_steps(size, rate) - 1), size, rate)
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
        Transition(
            on_rig[end - n - 2 : end],
            None if path is None else path_deviation(root, path) / mapping.scale,
            None if sure is None else float(sure[row]),
        )
        for row, (n, end, path, root) in enumerate(zip(frames, ends, paths, made.root, strict=True))
    ]


def path_deviation(root: Float[ndarray, "frame 3"], path: Path) -> float:
    """The mean distance on the ground between a generated root and its path, metres."""
    inner = path[1:-1, :2]
    return float(np.linalg.norm(root[: len(inner), [0, 2]] - inner, axis=-1).mean()) if len(inner) else 0.0


def _keys(starts: Sequence[Motion], target: Motion, mapping: retarget.Mapping) -> KnownFrames:
    """The known frames around the gaps, at the model's rate."""
    count, rate = len(starts), starts[0].rate
    before = after = None
    if len(starts[0]) > 1:
        ago = min(rate / MODEL_RATE, len(starts[0]) - 1.0)
        root, local = _stacked([sample(start, np.array([len(start) - 1.0 - ago])) for start in starts], mapping)
        before = NeighbourPose(root[:, 0], local[:, 0], ago / rate)
    if len(target) > 1:
        ahead = min(rate / MODEL_RATE, len(target) - 1.0)
        root, local = _stacked([sample(target, np.array([ahead]))] * count, mapping)
        after = NeighbourPose(root[:, 0], local[:, 0], ahead / rate)
    context = _stacked([recent(start, CONTEXT) for start in starts], mapping)
    return KnownFrames(context, _stacked([target[0]] * count, mapping), before, after)


def _finished(
    keys: KnownFrames, made: Generated, frames: int, rate: float
) -> list[tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 22 4"]]]:
    """Transitions of one length joined with their keys, velocities and feet kept, at the user's rate: frames + 2."""
    root = np.concatenate([keys.context[0][:, -1:], made.root, keys.goal[0]], axis=1)
    local = np.concatenate([keys.context[1][:, -1:], made.local, keys.goal[1]], axis=1)
    contacts = np.pad(made.contacts, ((0, 0), (1, 1), (0, 0)), mode="edge")
    step = (frames + 1) / rate / (root.shape[1] - 1)
    if keys.before is not None:
        contacts[:, :LANDING_FRAMES] *= ~_moving(keys.before, keys.context)[:, None]
        root, local = inertia.leave(root, local, keys.before, step)
    if keys.after is not None:
        root, local = inertia.arrive(root, local, keys.after, step)
    root = joint_limits.above_floor(root, local)
    local = joint_limits.hinged(root, local)
    local = lock.plant_batch(root, local, contacts)
    past = keys.context[0].shape[1] - 1
    root = np.concatenate([keys.context[0][:, :-1], root], axis=1)
    local = np.concatenate([keys.context[1][:, :-1], local], axis=1)
    return [to_user_rate(r, q, past, frames, rate) for r, q in zip(root, local, strict=True)]


def _moving(before: NeighbourPose, context: Batch) -> Bool[ndarray, "batch 4"]:
    """Which foot joints come to the start key in motion: such a foot does not stand there yet."""
    here, there = pose_of(context[0][:, -1], context[1][:, -1]), pose_of(before.root, before.local)
    moved = (here.positions - there.positions)[:, CONTACT_INDICES]
    return np.linalg.norm(moved, axis=-1) > LANDING_SPEED * before.seconds


def _stacked(
    motions: Sequence[Motion], mapping: retarget.Mapping
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]:
    """Motions of one length on the 22 joints: hips positions and local rotations."""
    first, rest = motions[0], motions[1:]
    on22 = retarget.to_humanoid(concatenate(first, *(aligned(first, m)[1] for m in rest)), mapping)
    shape = (len(motions), len(first))
    return on22.root_positions.reshape(*shape, 3), on22.local_rotations.reshape(*shape, len(HUMANOID), 4)
