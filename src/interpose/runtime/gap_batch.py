"""Gaps as a backend takes them and what it gives back: batched, on the 22 joints at 30 Hz."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import RATE
from interpose.runtime.poses import Path, Pose, last, pose_of

Batch = tuple[Float[ndarray, "batch _ 3"], Float[ndarray, "batch _ 22 4"]]
"""Hips positions and local rotations of motions of one length."""
Draw = tuple[int, int] | None
"""What a row draws its random numbers from, a seed and a number; None for the likeliest motion."""


def draws(seed: int, count: int) -> tuple[Draw, ...]:
    """Of ``count`` variants. The first one of seed 0 is the likeliest motion."""
    return tuple((seed, row) if seed or row else None for row in range(count))


@dataclass(frozen=True, eq=False)
class GapBatch:
    """Gaps to fill, a row each.

    context_root, context_local: the known frames up to the start key, which comes last. target_root, target_local: the
    target key. frames: between the keys. styles: labels (`style_blend`), None to leave the style free. paths: of the
    root, frames + 2 rows, None for no constraint. arriving: the joints' velocities at the target, m/s, where they are
    known. style_strength, path_control: as in `interpose.runtime.request.Request`.
    """

    context_root: Float[ndarray, "batch context 3"]
    context_local: Float[ndarray, "batch context 22 4"]
    target_root: Float[ndarray, "batch 3"]
    target_local: Float[ndarray, "batch 22 4"]
    frames: tuple[int, ...]
    styles: tuple[str | None, ...]
    paths: tuple[Path | None, ...]
    draws: tuple[Draw, ...]
    arriving: Float[ndarray, "batch 22 3"] | None = None
    style_strength: float = 1.0
    path_control: float = 1.0

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def longest(self) -> int:
        """Frames of the longest gap."""
        return max(self.frames, default=0)

    @property
    def keys(self) -> tuple[tuple[ndarray, ndarray], tuple[ndarray, ndarray]]:
        """Hips positions and local rotations at the start and at the target."""
        return (self.context_root[:, -1], self.context_local[:, -1]), (self.target_root, self.target_local)

    @cached_property
    def context(self) -> Pose:
        """The context as the networks take it, (batch, frame, ...)."""
        return pose_of(self.context_root, self.context_local)

    @property
    def start(self) -> Pose:
        return last(self.context)

    @cached_property
    def target(self) -> Pose:
        return pose_of(self.target_root, self.target_local)

    @property
    def leaving(self) -> Float[ndarray, "batch 22 3"] | None:
        """The joints' velocities at the start, m/s, where frames before it are known."""
        if self.context_root.shape[1] < 2:
            return None
        return (self.context.positions[:, -1] - self.context.positions[:, -2]) * RATE

    def take(self, rows: Sequence[int]) -> GapBatch:
        """Some of the gaps."""
        index, some = list(rows), {}
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, ndarray):
                some[field.name] = value[index]
            elif isinstance(value, tuple):
                some[field.name] = tuple(value[row] for row in index)
        return replace(self, **some)


def batch_of(
    context: Batch,
    target: Batch,
    frames: int | Sequence[int],
    *,
    styles: Sequence[str | None] | str | None = None,
    paths: Sequence[Path | None] | None = None,
    draws: Sequence[Draw] | None = None,
    arriving: Float[ndarray, "batch 22 3"] | None = None,
    style_strength: float = 1.0,
    path_control: float = 1.0,
) -> GapBatch:
    """Gaps from ``context`` to the first frames of ``target``; what is left out is the same for all rows: the frames
    and the style where they are one, no path, the likeliest motion."""
    count = len(context[0])
    return GapBatch(
        context[0],
        context[1],
        target[0][:, 0],
        target[1][:, 0],
        (frames,) * count if isinstance(frames, int) else tuple(frames),
        (styles,) * count if styles is None or isinstance(styles, str) else tuple(styles),
        (None,) * count if paths is None else tuple(paths),
        (None,) * count if draws is None else tuple(draws),
        arriving,
        style_strength,
        path_control,
    )


@dataclass(frozen=True, eq=False)
class Generated:
    """The frames between the keys; a shorter row is followed by its target.

    contacts: probabilities that LeftFoot, LeftToe, RightFoot, RightToe stand. chain_distance: of a method that makes
    two chains, how far apart their joints are in the middle, metres (MMPE, Ren et al. 2024, equation 13), NaN where
    only one comes so far.
    """

    root: Float[ndarray, "batch frame 3"]
    local: Float[ndarray, "batch frame 22 4"]
    contacts: Float[ndarray, "batch frame 4"]
    chain_distance: Float[ndarray, "batch"] | None = None

    def take(self, rows: Sequence[int], frames: int) -> Generated:
        """The first ``frames`` frames of some rows."""
        index = list(rows)
        return Generated(self.root[index, :frames], self.local[index, :frames], self.contacts[index, :frames])


def by_length(batch: GapBatch, generate: Callable[[GapBatch], Generated]) -> Generated:
    """Gaps of all lengths from ``generate``, which makes those of one; shorter ones end in their targets."""
    longest = batch.longest
    root = np.repeat(batch.target_root[:, None], longest, axis=1)
    local = np.repeat(batch.target_local[:, None], longest, axis=1)
    contacts = np.zeros((len(batch), longest, 4))
    distance = np.full(len(batch), np.nan)
    for length in sorted(set(batch.frames) - {0}):
        rows = [row for row, frames in enumerate(batch.frames) if frames == length]
        made = generate(batch.take(rows))
        root[rows, :length], local[rows, :length], contacts[rows, :length] = made.root, made.local, made.contacts
        if made.chain_distance is not None:
            distance[rows] = made.chain_distance
    return Generated(root, local, contacts, distance)
