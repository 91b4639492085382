"""Analytic inverse kinematics of a limb of two bones (hip, knee, ankle), with soft reach near full extension."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.rotation import unit

SOFT_SHARE = 0.02
"""Share of the limb's length, at its end, over which stretching is damped."""
_SURE_BEND = 0.06
"""Metres between the knee and the straight from hip to ankle from which the bending plane is reliable."""
_STRAIGHT = 1e-6


def soft_reach(
    wanted: Float[ndarray, "*batch"], present: Float[ndarray, "*batch"], length: float
) -> Float[ndarray, "*batch"]:
    """The distance that a limb of ``length`` reaches if its ends are now ``present`` apart and should be ``wanted``.

    That is ``wanted`` up to 98 % of the length or the present distance; beyond that it approaches the length without
    reaching it, so that a knee never snaps straight (Nicholson 2009, `Soft IK`). Metres.
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
    """World rotations that turn the thigh and the shin so that the ankle comes to ``target`` while the hip stays.

    The law of cosines gives the knee's angle; the bending plane is carried along by the shortest turn from the old to
    the new direction of the limb (Kovar et al. 2002, section 4; Holden 2017, `Simple Two Joint IK`). Where the limb is
    too straight for a reliable plane, or bent backwards, and has to bend more, the knee moves towards ``forward``. A
    target out of reach is approached as far as the bones allow. Positions in metres.
    """
    thigh, shin = _length(knee - hip), _length(ankle - knee)
    old = ankle - hip
    present, wanted = _length(old), _length(target - hip)
    reach = np.clip(wanted, np.abs(thigh - shin) * (1.0 + 1e-9) + 1e-9, thigh + shin)
    reach = np.where(np.abs(wanted - present) < 1e-9, present, reach)
    # The knee in the bending plane: x along the limb, y off it.
    x = (thigh**2 + reach**2 - shin**2) / (2.0 * reach)
    y = np.sqrt(np.maximum(thigh**2 - x**2, 0.0))

    along = unit(old)
    out = (knee - hip) - _dot(knee - hip, along) * along
    ahead = unit(forward - _dot(forward, along) * along)
    unsure = np.maximum(y - _length(out), _STRAIGHT) * np.clip(1.0 - _length(out) / _SURE_BEND, 0.0, 1.0)
    pole = out + unsure * ahead

    new = np.where(wanted > 1e-9, target - hip, old)
    turn = rotation.between(old, new)
    new_along, new_pole = unit(new), unit(rotation.rotate(turn, pole))
    new_knee = hip + x * new_along + y * new_pole
    new_ankle = hip + reach * new_along

    hinge, new_hinge = np.cross(along, pole), np.cross(new_along, new_pole)
    before = np.stack([_frame(knee - hip, hinge), _frame(ankle - knee, hinge)])
    after = np.stack([_frame(new_knee - hip, new_hinge), _frame(new_ankle - new_knee, new_hinge)])
    turned = rotation.from_matrix(after @ np.swapaxes(before, -1, -2))
    return turned[0], turned[1]


def _frame(bone: Float[ndarray, "*batch 3"], hinge: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3 3"]:
    """Columns: along the bone, across it in the bending plane, along the hinge."""
    a = unit(bone)
    c = unit(hinge - _dot(hinge, a) * a)
    return np.stack([a, np.cross(c, a), c], axis=-1)


def _dot(a: Float[ndarray, "*batch 3"], b: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 1"]:
    return np.sum(a * b, axis=-1, keepdims=True)


def _length(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 1"]:
    return np.linalg.norm(v, axis=-1, keepdims=True)
