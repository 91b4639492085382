"""In-betweening methods as functions of batched windows, on the data set's own skeleton, in metres.

``interp`` and ``zero-velocity`` are the two baselines of Harvey et al. 2020, section 5.3, in the exact form of
LaFAN1's evaluation code. :func:`from_model` makes a method of a model folder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.evaluate.lafan1 import PAST

Generate = Callable[[ndarray, ndarray, ndarray, ndarray, int], tuple[ndarray, ndarray]]
"""``(context_root (window, context, 3), context_local (window, context, joint, 4), target_root (window, 3),
target_local (window, joint, 4), frames) -> (root (window, frames, 3), local (window, frames, joint, 4))``.

The last context frame is the start key. The signs of the quaternions that come back go on from it, as they do in the
clips; L2Q counts on it.
"""


@dataclass(frozen=True)
class Method:
    """A name for the tables, what generates the frames between, and how many frames it knows before them."""

    name: str
    generate: Generate
    context_frames: int = PAST


def _interp(
    context_root: Float[ndarray, "window context 3"],
    context_local: Float[ndarray, "window context joint 4"],
    target_root: Float[ndarray, "window 3"],
    target_local: Float[ndarray, "window joint 4"],
    frames: int,
) -> tuple[Float[ndarray, "window frame 3"], Float[ndarray, "window frame joint 4"]]:
    t = np.arange(1, frames + 1) / (frames + 1)
    start = context_root[:, -1:]
    root = start + t[:, None] * (target_root[:, None] - start)
    return root, _slerp(context_local[:, -1][:, None], target_local[:, None], t[:, None])


def _slerp(
    a: Float[ndarray, "*#batch 4"], b: Float[ndarray, "*#batch 4"], t: Float[ndarray, "*#batch"]
) -> Float[ndarray, "*batch 4"]:
    """SLERP that keeps the sign of ``a`` and is linear, then normalised, where the cosine is above 0.99."""
    cosine = np.sum(a * b, axis=-1)
    b = np.where(cosine[..., None] < 0.0, -b, b)
    cosine = np.minimum(np.abs(cosine), 1.0)
    linear = 1.0 - cosine < 0.01
    angle = np.arccos(np.where(linear, 0.0, cosine))
    of_a = np.where(linear, 1.0 - t, np.sin((1.0 - t) * angle) / np.sin(angle))
    of_b = np.where(linear, t, np.sin(t * angle) / np.sin(angle))
    q = of_a[..., None] * a + of_b[..., None] * b
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def _zero_velocity(
    context_root: Float[ndarray, "window context 3"],
    context_local: Float[ndarray, "window context joint 4"],
    target_root: Float[ndarray, "window 3"],
    target_local: Float[ndarray, "window joint 4"],
    frames: int,
) -> tuple[Float[ndarray, "window frame 3"], Float[ndarray, "window frame joint 4"]]:
    return np.repeat(context_root[:, -1:], frames, axis=1), np.repeat(context_local[:, -1:], frames, axis=1)


INTERP = Method("interp", _interp)
"""The root on a straight line, the local rotations by SLERP, frame k of n at k / (n + 1)."""
ZERO_VELOCITY = Method("zero-velocity", _zero_velocity)
"""The start pose, held."""


def from_model(name: str, folder: Path, context_frames: int = 1, seed: int = 0) -> Method:
    raise NotImplementedError
