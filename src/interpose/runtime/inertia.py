"""Leave a key as the motion came to it: inertialisation of a transition's ends.

After Bollo 2018 (`Inertialization: High-Performance Animation Transitions in Gears of War`, GDC): the difference
between the velocity with which the known motion comes to the start and that with which the transition leaves it is
carried on and dies away within half a second. A joint's offset is dv t (1 - t / T)^2: none at the key, of the missing
velocity there, and gone, with its first derivative, at T; it brakes by 4 dv / T at most. Angles are treated as
positions are, in rotation vectors. The end is treated as the beginning, with time reversed, where frames after the
target are known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation

FADE_SECONDS = 0.5
"""Seconds in which an offset dies away, or the whole transition where that is shorter."""


@dataclass(frozen=True, eq=False)
class NeighbourPose:
    """A pose a frame before the start or after the target, and how many seconds from it."""

    root: Float[ndarray, "batch 3"]
    local: Float[ndarray, "batch joint 4"]
    seconds: float


def leave(
    root: Float[ndarray, "batch frame 3"],
    local: Float[ndarray, "batch frame joint 4"],
    before: NeighbourPose,
    step: float,
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame joint 4"]]:
    """Transitions, both keys included, that continue from the pose known before their first frame.

    ``step``: seconds between the transitions' frames. The first and the last frame stay as they are.
    """
    t = np.arange(root.shape[1]) * step
    fade = min(FADE_SECONDS, t[-1])
    share = t * np.maximum(1.0 - t / fade, 0.0) ** 2
    speed = (root[:, 0] - before.root) / before.seconds - (root[:, 1] - root[:, 0]) / step
    turn = _turn(before.local, local[:, 0]) / before.seconds - _turn(local[:, 0], local[:, 1]) / step
    offset = rotation.from_rotation_vector(share[:, None, None] * turn[:, None])
    return root + share[:, None] * speed[:, None], rotation.multiply(local, offset)


def arrive(
    root: Float[ndarray, "batch frame 3"],
    local: Float[ndarray, "batch frame joint 4"],
    after: NeighbourPose,
    step: float,
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame joint 4"]]:
    """:func:`leave` for the last frame: the pose after it is known."""
    root, local = leave(root[:, ::-1], local[:, ::-1], after, step)
    return root[:, ::-1], local[:, ::-1]


def _turn(a: Float[ndarray, "batch joint 4"], b: Float[ndarray, "batch joint 4"]) -> Float[ndarray, "batch joint 3"]:
    """The rotation from ``a`` to ``b``, in a's frame, as a rotation vector."""
    return rotation.to_rotation_vector(rotation.multiply(rotation.inverse(a), b))
