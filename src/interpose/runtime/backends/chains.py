"""What both stitching run times share: gaps sorted by their length, and two chains that become one motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.stitch_layout import pressed, shares

Made = tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"], Float[ndarray, "batch frame 4"]]
"""Hips, local rotations and contact probabilities of the frames between the keys."""
Frame = dict[str, ndarray]
"""What a network says of one frame of a chain, by name."""


def by_length(
    frames: int | Sequence[int],
    target_root: Float[ndarray, "batch 3"],
    target_local: Float[ndarray, "batch 22 4"],
    make: Callable[[list[int], int], Made],
) -> Made:
    """Gaps of all lengths from ``make(rows, length)``, which makes those of one; shorter ones end in their targets."""
    count = len(target_root)
    each = [frames] * count if isinstance(frames, int) else list(frames)
    longest = max(each, default=0)
    hips = np.repeat(target_root[:, None], longest, axis=1)
    local = np.repeat(target_local[:, None], longest, axis=1)
    contacts = np.zeros((count, longest, 4))
    for length in sorted(set(each) - {0}):
        rows = [row for row, n in enumerate(each) if n == length]
        hips[rows, :length], local[rows, :length], contacts[rows, :length] = make(rows, length)
    return hips, local, contacts


def joined(
    chains: tuple[list[Frame], list[Frame]], steps: int, buffer: int, both: bool = True
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 turn"], Float[ndarray, "batch frame 4"]]:
    """Hips, rotations and contacts of the frames between the keys: both chains, each in the order in which it made its
    frames, blended where they overlap and smoothed there. Rotations are not yet proper again."""
    out = []
    for name in ("hips", "rotations", "contacts"):
        first = chains[0][0][name]
        whole = np.zeros((2, len(first), steps + 1, *first.shape[1:]))
        for number, chain in enumerate(chains):
            for i, frame in enumerate(chain, start=1):
                whole[number, :, steps - i if number else i] = frame[name]
        of_back = shares(steps, buffer, both).reshape(-1, *[1] * (first.ndim - 1))
        mixed = (1.0 - of_back) * whole[0] + of_back * whole[1]
        mixed[:, 0], mixed[:, -1] = mixed[:, 1], mixed[:, -2]
        out.append((pressed(mixed, steps) if both else mixed)[:, 1:-1])
    hips, turned, contacts = out
    return hips, turned, contacts
