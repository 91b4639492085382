"""Offsets of a character's pose from the network's, which keep its velocity through a change of target.

Inertialisation (Bollo 2018) one frame at a time: an offset begins with the velocity that the change took away and fades
to zero, with its first derivative, within :data:`FADE_FRAMES` frames or at the target. Angles are rotation vectors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose import rotation
from interpose.features import JOINTS
from interpose.runtime import inertia
from interpose.runtime.resampling import MODEL_RATE

FADE_FRAMES = inertia.FADE_SECONDS * MODEL_RATE


@dataclass(frozen=True, eq=False)
class Fade:
    """Offsets that fade, a row a character: of the hips in metres, then of each joint's local rotation.

    value; speed: a frame. left: frames until both are zero.
    """

    value: Float[ndarray, "row part 3"]
    speed: Float[ndarray, "row part 3"]
    left: Float[ndarray, "row"]


def none(rows: int, parts: int = 1 + JOINTS) -> Fade:
    """No offset."""
    zero = np.zeros((rows, parts, 3))
    return Fade(zero, zero.copy(), np.zeros(rows))


def kicked(fade: Fade, rows: Bool[ndarray, "row"], speed: Float[ndarray, "some part 3"]) -> Fade:
    """The offsets of ``rows`` given that much more speed, and the full time to fade."""
    faster = fade.speed.copy()
    faster[rows] += speed
    return Fade(fade.value, faster, np.where(rows, FADE_FRAMES, fade.left))


def advanced(fade: Fade, frames_left: Float[ndarray, "row"]) -> Fade:
    """The offsets a frame later, gone when ``frames_left`` frames from now are over.

    They follow the cubic from their value and speed to zero and rest.
    """
    left = np.minimum(fade.left, frames_left)
    time = np.maximum(left, 1.0)[:, None, None]
    bend = -(3.0 * fade.value + 2.0 * fade.speed * time) / time**2
    turn = (2.0 * fade.value + fade.speed * time) / time**3
    going = (left > 1.0)[:, None, None]
    value = np.where(going, fade.value + fade.speed + bend + turn, 0.0)
    speed = np.where(going, fade.speed + 2.0 * bend + 3.0 * turn, 0.0)
    return Fade(value, speed, np.where(left > 1.0, left - 1.0, 0.0))


def velocity(
    before: tuple[Float[ndarray, "row 3"], Float[ndarray, "row joint 4"]],
    after: tuple[Float[ndarray, "row 3"], Float[ndarray, "row joint 4"]],
) -> Float[ndarray, "row part 3"]:
    """From each pose to the next (hips, local rotations): metres, and rotation vectors in the first one's frames."""
    turn = rotation.to_rotation_vector(rotation.multiply(rotation.inverse(before[1]), after[1]))
    return np.concatenate([(after[0] - before[0])[:, None], turn], axis=1)


def shown(
    fade: Fade, hips: Float[ndarray, "row 3"], local: Float[ndarray, "row joint 4"]
) -> tuple[Float[ndarray, "row 3"], Float[ndarray, "row joint 4"]]:
    """The poses with their offsets."""
    rows = np.flatnonzero(fade.left > 0.0)
    if not len(rows):
        return hips, local
    turned = local.copy()
    turned[rows] = rotation.multiply(local[rows], rotation.from_rotation_vector(fade.value[rows, 1:]))
    return hips + fade.value[:, 0], turned
