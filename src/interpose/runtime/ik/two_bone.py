"""Analytic inverse kinematics of a limb of two bones: hip, knee, ankle.

The law of cosines gives the knee's angle, the old bending plane its direction, as in Holden's `Simple Two Joint IK`
(2017) and Kovar et al. 2002 (`Footskate Cleanup for Motion Capture Editing`, section 4). Near full extension the limb
approaches its length smoothly, as in Nicholson's `Soft IK` (2009), so that a knee never snaps straight.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation

SOFT_SHARE = 0.02
"""The last part of the limb's length, over which further stretching is damped."""

_CLEAR = 0.06
"""Metres that a knee stands out from the line hip to ankle when its bending plane is sure."""

_STRAIGHT = 1e-6


def soft_reach(
    wanted: Float[ndarray, "*batch"], present: Float[ndarray, "*batch"], length: float
) -> Float[ndarray, "*batch"]:
    """How far apart the ends of a limb of ``length`` may be that are ``present`` apart and ``wanted`` that far.

    What is wanted, up to 98 % of the length or where the limb is now; beyond, ever less, and never the whole length.
    A limb that is as straight as that already keeps its reach.
    """
    begin = np.maximum(present, (1.0 - SOFT_SHARE) * length)
    room = np.maximum(length * (1.0 - 1e-5) - begin, 0.0)
    beyond = np.maximum(wanted - begin, 0.0)
    damped = begin + room * (1.0 - np.exp(-beyond / np.maximum(room, 1e-9)))
    return np.where(wanted > begin, damped, wanted)


def two_bone_ik(
    hip: Float[ndarray, "*batch 3"],
    knee: Float[ndarray, "*batch 3"],
    ankle: Float[ndarray, "*batch 3"],
    target: Float[ndarray, "*batch 3"],
    forward: Float[ndarray, "*batch 3"],
) -> tuple[Float[ndarray, "*batch 4"], Float[ndarray, "*batch 4"]]:
    """The world rotations by which thigh and shin turn so that the ankle comes to ``target``, the hip staying.

    The knee keeps its bending plane, carried along by the shortest turn of the line from hip to ankle. Where the limb
    is so straight that its plane is unsure, or bent backwards, and has to bend more, the knee comes out towards
    ``forward``. A target out of reach is approached as far as the bones allow. Positions in metres.
    """
    thigh, shin = _length(knee - hip), _length(ankle - knee)
    old = ankle - hip
    present, wanted = _length(old), _length(target - hip)
    reach = np.clip(wanted, np.abs(thigh - shin) * (1.0 + 1e-9) + 1e-9, thigh + shin)
    reach = np.where(np.abs(wanted - present) < 1e-9, present, reach)
    x = (thigh**2 + reach**2 - shin**2) / (2.0 * reach)
    y = np.sqrt(np.maximum(thigh**2 - x**2, 0.0))

    along = _unit(old)
    out = (knee - hip) - _dot(knee - hip, along) * along
    ahead = _unit(forward - _dot(forward, along) * along)
    unsure = np.maximum(y - _length(out), _STRAIGHT) * np.clip(1.0 - _length(out) / _CLEAR, 0.0, 1.0)
    pole = out + unsure * ahead

    line = np.where(wanted > 1e-9, target - hip, old)
    turn = rotation.between(old, line)
    new_along, new_pole = _unit(line), _unit(rotation.rotate(turn, pole))
    new_knee = hip + x * new_along + y * new_pole
    new_ankle = hip + reach * new_along

    hinge, new_hinge = np.cross(along, pole), np.cross(new_along, new_pole)
    before = np.stack([_frame(knee - hip, hinge), _frame(ankle - knee, hinge)])
    after = np.stack([_frame(new_knee - hip, new_hinge), _frame(new_ankle - new_knee, new_hinge)])
    turned = rotation.from_matrix(after @ np.swapaxes(before, -1, -2))
    return turned[0], turned[1]


def _frame(bone: Float[ndarray, "*batch 3"], hinge: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3 3"]:
    """Columns: along the bone, across it in the bending plane, along the hinge."""
    a = _unit(bone)
    c = _unit(hinge - _dot(hinge, a) * a)
    return np.stack([a, np.cross(c, a), c], axis=-1)


def _dot(a: Float[ndarray, "*batch 3"], b: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 1"]:
    return np.sum(a * b, axis=-1, keepdims=True)


def _length(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 1"]:
    return np.linalg.norm(v, axis=-1, keepdims=True)


def _unit(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3"]:
    return v / np.maximum(_length(v), 1e-12)
