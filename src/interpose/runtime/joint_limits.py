"""Limits that a body has, whatever a network says: knees and elbows bend one way, and nothing goes through the floor.

The keys of a transition stay as they are; a limit that a key breaks by itself is let go near that key.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.skeleton import HUMANOID, LEG_CHAINS

NEAR_KEY_FRAMES = 8
"""Frames over which a limit that a key breaks comes back."""
DEEPEST = 0.005
"""Metres under the floor that are let be, unless a key lies deeper."""
_NO_FEET = [joint for joint in range(len(HUMANOID)) if joint not in LEG_CHAINS[:, 2:]]
_SPREAD_FRAMES = 6
"""Frames before and after one that is under the floor over which the body is raised."""


@dataclass(frozen=True)
class _Hinge:
    """A limb whose middle joint bends one way. chain: its three joints. side: 1 where the middle joint lies before the
    straight between its neighbours, as a knee does, -1 where it lies behind. slack: metres that it may lie on the
    other side; recordings reach 1 cm at knees and 4 cm at elbows."""

    chain: tuple[int, int, int]
    side: float
    slack: float


_HINGES = tuple(
    _Hinge((HUMANOID.index(side + a), HUMANOID.index(side + b), HUMANOID.index(side + c)), sign, slack)
    for side in ("Left", "Right")
    for a, b, c, sign, slack in (("UpLeg", "Leg", "Foot", 1.0, 0.01), ("Arm", "ForeArm", "Hand", -1.0, 0.02))
)


def hinged(
    root: Float[ndarray, "batch frame 3"], local: Float[ndarray, "batch frame 22 4"]
) -> Float[ndarray, "batch frame 22 4"]:
    """Local rotations whose knees and elbows bend one way; hands and feet stay where they are and as they are turned.

    A knee far behind the straight from hip to ankle goes to its mirror image before it. Near the limit it turns back,
    so that nothing jumps; the limb is straighter there, and its end moves by less than a millimetre.
    """
    world = kinematics.global_rotations(local, HUMANOID.parents)
    places = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)
    out = local
    for hinge in _HINGES:
        first, middle, last = hinge.chain
        along = rotation.unit(places[..., last, :] - places[..., first, :])
        bone = places[..., middle, :] - places[..., first, :]
        off = bone - _dot(bone, along) * along
        ahead = rotation.rotate(world[..., first, :], np.broadcast_to(rotation.FORWARD, bone.shape))
        ahead = hinge.side * rotation.unit(ahead - _dot(ahead, along) * along)
        bend = _dot(off, ahead)[..., 0]
        bound = _bound(bend, -hinge.slack)
        wrong = bend < bound
        wrong[:, [0, -1]] = False
        if not wrong.any():
            continue
        if out is local:
            out = local.copy()
        beyond = (bend - bound)[wrong] / (2.0 * bound)[wrong]
        new = -bend[wrong] + 2.0 * bound[wrong] * np.exp(-beyond)
        new_off = off[wrong] + (new - bend[wrong])[:, None] * ahead[wrong]
        turned = []
        for joint, part in ((first, bone), (middle, places[..., last, :] - places[..., middle, :])):
            straight = _dot(part, along)[wrong]  # of the bone, along the limb
            side = new_off if joint == first else -new_off
            longer = np.sum(off[wrong] ** 2 - new_off**2, axis=-1, keepdims=True)
            kept = np.sqrt(np.maximum(straight**2 + longer, 0.0)) * np.where(straight < 0.0, -1.0, 1.0)
            after = kept * along[wrong] + side
            turned.append(rotation.multiply(rotation.between(part[wrong], after), world[wrong][:, joint]))
        turned.append(world[wrong][:, last])
        above = world[wrong][:, HUMANOID.parents[first]]
        for joint, now in zip(hinge.chain, turned, strict=True):
            out[*np.nonzero(wrong), joint] = rotation.multiply(rotation.inverse(above), now)
            above = now
    return out


def above_floor(
    root: Float[ndarray, "batch frame 3"], local: Float[ndarray, "batch frame 22 4"]
) -> Float[ndarray, "batch frame 3"]:
    """The hips raised where a joint would be under the floor, y = 0, by more than one is at the keys. Feet and toes are
    left to the foot lock, which lifts them by the legs."""
    world = kinematics.global_rotations(local, HUMANOID.parents)
    lowest = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)[..., _NO_FEET, 1].min(axis=-1)
    deep = np.minimum(lowest[:, [0, -1]], -DEEPEST)
    between = np.linspace(0.0, 1.0, root.shape[1])
    need = np.maximum(deep[:, :1] + between * (deep[:, 1:] - deep[:, :1]) - lowest, 0.0)
    need[:, [0, -1]] = 0.0
    if not need.any():
        return root
    # At least what is needed, and smooth: the largest need around each frame, blurred by less than that reach.
    raised = gaussian_filter1d(maximum_filter1d(need, 2 * _SPREAD_FRAMES + 1, axis=1), _SPREAD_FRAMES / 3.0, axis=1)
    frames = np.arange(root.shape[1])
    near = np.clip(np.minimum(frames, frames[::-1]) / (_SPREAD_FRAMES + 1.0), 0.0, 1.0)
    out = root.copy()
    out[..., 1] += np.maximum(raised * near, need)
    return out


def _bound(values: Float[ndarray, "batch frame"], limit: float) -> Float[ndarray, "batch frame"]:
    """The lower limit of each frame: ``limit``, and towards a key that lies below it more and more the key's own."""
    frames = np.arange(values.shape[1])
    bound = np.full(values.shape, limit)
    for key, away in ((values[:, :1], frames), (values[:, -1:], frames[::-1])):
        share = np.clip(1.0 - away / NEAR_KEY_FRAMES, 0.0, 1.0)
        bound = np.minimum(bound, limit + share * np.minimum(key - limit, 0.0))
    return bound


def _dot(a: Float[ndarray, "*batch 3"], b: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 1"]:
    return np.sum(a * b, axis=-1, keepdims=True)
