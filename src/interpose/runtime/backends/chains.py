"""Two chains of frames that become one motion."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features.stitch import shares, smoothed

ChainFrame = dict[str, ndarray]
"""One frame of a chain, the network's outputs by name."""


def joined(
    chains: tuple[list[ChainFrame], list[ChainFrame]], steps: int, buffer: int, both: bool = True
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
        out.append((smoothed(mixed, steps) if both else mixed)[:, 1:-1])
    hips, turned, contacts = out
    return hips, turned, contacts
