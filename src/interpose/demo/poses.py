"""Key poses for the demo, posed by hand.

A pose is a table of joint angles on the 22-joint humanoid, whose T-pose looks along +Z with its left hand at +X.
Angles are degrees about the parent's X, Y and Z, turned about Z first, then Y, then X; joints that are not named keep
the T-pose. What they do:

    X  + bends the trunk and head forward, swings a leg or a hanging arm back, bends a knee, points a foot down,
         rolls a bent forearm inwards about the upper arm
    Y  + turns to the left; on a forearm - (left) or + (right) bends the elbow
    Z  - lowers the left arm, + lowers the right one; + leans the trunk to the right and lifts the left arm or leg

:func:`pose` then sets the figure on the floor: soles that are to be down are made level, the longer leg is bent until
both reach, and the root's height follows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import root_scalar
from scipy.spatial.transform import Rotation

from interpose import rotation
from interpose.motion import Motion
from interpose.skeleton import HUMANOID, MODEL_RATE, global_positions, global_rotations, local_rotations

ANKLE, BALL = 0.0945, 0.020
"""Height of the ankle and of the toe joint above the sole of a flat foot, metres."""

_UP = np.array([0.0, 1.0, 0.0])
_AHEAD = np.array([0.0, 0.0, 1.0])
_HEEL = np.array([0.0, -ANKLE, -0.05])
_TIP = np.array([0.0, -BALL, 0.07])
Angles = Mapping[str, tuple[int, int, int]]


@dataclass(frozen=True)
class Pose:
    """angles: see above. flat: sides whose whole sole is down. ball: sides that stand on the ball of the foot."""

    angles: Angles
    flat: tuple[str, ...] = ("Left", "Right")
    ball: tuple[str, ...] = ()


STAND = Pose(
    {
        "Spine1": (2, 0, 0),
        "Neck": (6, 0, 0),
        "Head": (-6, 0, 0),
        "LeftShoulder": (0, 0, -5),
        "LeftArm": (4, 0, -72),
        "LeftForeArm": (8, -16, 0),
        "RightShoulder": (0, 0, 5),
        "RightArm": (4, 0, 72),
        "RightForeArm": (8, 16, 0),
        "LeftUpLeg": (-3, 6, 2),
        "LeftLeg": (5, 0, 0),
        "RightUpLeg": (-3, -6, -2),
        "RightLeg": (5, 0, 0),
    }
)

WALK_LEFT = Pose(
    {
        "Hips": (3, -7, 0),
        "Spine": (0, 5, 0),
        "Spine1": (2, 5, 0),
        "Spine2": (1, 4, 0),
        "Neck": (5, -4, 0),
        "Head": (-8, -3, 0),
        "LeftShoulder": (0, 0, -5),
        "LeftArm": (22, 0, -76),
        "LeftForeArm": (4, -14, 0),
        "RightShoulder": (0, 0, 5),
        "RightArm": (-20, 0, 76),
        "RightForeArm": (10, 28, 0),
        "LeftUpLeg": (-27, 7, 3),
        "LeftLeg": (8, 0, 0),
        "RightUpLeg": (13, 3, -4),
        "RightLeg": (16, 0, 0),
    },
    flat=("Left",),
    ball=("Right",),
)

RUN_LEFT = Pose(
    {
        "Hips": (9, -8, 0),
        "Spine": (3, 6, 0),
        "Spine1": (3, 7, 0),
        "Spine2": (3, 6, 0),
        "Neck": (2, -6, 0),
        "Head": (-14, -5, 0),
        "LeftShoulder": (0, 6, -4),
        "LeftArm": (42, 0, -70),
        "LeftForeArm": (6, -86, 0),
        "RightShoulder": (0, 6, 4),
        "RightArm": (-26, 0, 72),
        "RightForeArm": (26, 88, 0),
        "LeftUpLeg": (-42, 8, 2),
        "LeftLeg": (34, 0, 0),
        "RightUpLeg": (14, 4, -4),
        "RightLeg": (84, 0, 0),
        "RightFoot": (24, 0, 0),
        "RightToe": (8, 0, 0),
    },
    flat=("Left",),
)

WARY = Pose(
    {
        "Hips": (14, 4, 0),
        "Spine": (7, 3, 0),
        "Spine1": (8, 4, 0),
        "Spine2": (4, 4, 2),
        "Neck": (-4, -4, 0),
        "Head": (-14, -16, 0),
        "LeftShoulder": (0, -8, 0),
        "LeftArm": (-4, -58, -26),
        "LeftForeArm": (0, -34, 0),
        "LeftHand": (0, 0, 28),
        "RightShoulder": (0, 8, 0),
        "RightArm": (8, 48, 34),
        "RightForeArm": (6, 52, 0),
        "RightHand": (0, 0, -24),
        "LeftUpLeg": (-62, 8, 3),
        "LeftLeg": (58, 0, 0),
        "RightUpLeg": (-26, -12, -4),
        "RightLeg": (54, 0, 0),
    },
    flat=("Left",),
    ball=("Right",),
)

AEROPLANE = Pose(
    {
        "Hips": (6, 0, 4),
        "Spine": (2, 0, 5),
        "Spine1": (3, 0, 6),
        "Spine2": (2, 0, 5),
        "Neck": (0, 0, -8),
        "Head": (-8, 0, -8),
        "LeftShoulder": (0, 0, 4),
        "LeftArm": (0, 6, 2),
        "LeftForeArm": (0, -4, 0),
        "RightShoulder": (0, 0, -4),
        "RightArm": (0, -6, -2),
        "RightForeArm": (0, 4, 0),
        "LeftUpLeg": (-30, 5, -1),
        "LeftLeg": (20, 0, 0),
        "RightUpLeg": (8, -5, -9),
        "RightLeg": (22, 0, 0),
    },
    flat=("Left",),
    ball=("Right",),
)

ANGRY = Pose(
    {
        "Hips": (12, 0, 0),
        "Spine": (7, 0, 0),
        "Spine1": (8, 0, 0),
        "Spine2": (6, 0, 0),
        "Neck": (10, 0, 0),
        "Head": (-18, 0, 0),
        "LeftShoulder": (0, -6, 4),
        "LeftArm": (18, 0, -52),
        "LeftForeArm": (34, -64, 0),
        "LeftHand": (0, 0, -24),
        "RightShoulder": (0, 6, -4),
        "RightArm": (14, 0, 54),
        "RightForeArm": (34, 70, 0),
        "RightHand": (0, 0, 24),
        "LeftUpLeg": (-42, 10, 9),
        "LeftLeg": (36, 0, 0),
        "RightUpLeg": (-20, -12, -9),
        "RightLeg": (34, 0, 0),
    }
)

DRUNK = Pose(
    {
        "Hips": (-2, 8, -7),
        "Spine": (4, 0, 9),
        "Spine1": (6, 4, 9),
        "Spine2": (8, 4, 5),
        "Neck": (14, 0, 6),
        "Head": (10, 10, 8),
        "LeftShoulder": (0, 0, 2),
        "LeftArm": (-16, 0, -46),
        "LeftForeArm": (0, -44, 0),
        "LeftHand": (0, 0, -26),
        "RightShoulder": (0, 0, 8),
        "RightArm": (12, 0, 66),
        "RightForeArm": (8, 20, 0),
        "RightHand": (0, 0, 20),
        "LeftUpLeg": (-22, 14, 14),
        "LeftLeg": (20, 0, 0),
        "RightUpLeg": (4, -16, -5),
        "RightLeg": (12, 0, 0),
    }
)

CHICKEN = Pose(
    {
        "Hips": (16, 0, 0),
        "Spine": (5, 0, 0),
        "Spine1": (4, 0, 0),
        "Spine2": (2, 0, 0),
        "Neck": (22, 0, 0),
        "Head": (-34, 0, 0),
        "LeftShoulder": (0, 0, 6),
        "LeftArm": (4, 10, -34),
        "LeftForeArm": (66, -132, 0),
        "RightShoulder": (0, 0, -6),
        "RightArm": (4, -10, 34),
        "RightForeArm": (66, 132, 0),
        "LeftUpLeg": (-54, 10, 3),
        "LeftLeg": (46, 0, 0),
        "RightUpLeg": (-22, -10, -4),
        "RightLeg": (44, 0, 0),
    },
    flat=("Left",),
    ball=("Right",),
)

KARATE = Pose(
    {
        "Hips": (4, -24, 0),
        "Spine": (2, 2, 0),
        "Spine1": (3, 4, 0),
        "Spine2": (2, 6, 0),
        "Neck": (2, 6, 0),
        "Head": (-6, 8, 0),
        "LeftShoulder": (0, -10, 4),
        "LeftArm": (-10, -62, -8),
        "LeftForeArm": (-40, -52, 0),
        "RightShoulder": (0, -4, 0),
        "RightArm": (26, 0, 58),
        "RightForeArm": (10, 100, 0),
        "LeftUpLeg": (-58, 22, 4),
        "LeftLeg": (60, 0, 0),
        "RightUpLeg": (14, -18, -12),
        "RightLeg": (14, 0, 0),
    }
)


def mirrored(source: Pose) -> Pose:
    """The same pose with left and right exchanged."""
    swap = {"Left": "Right", "Right": "Left"}

    def other(name: str) -> str:
        return next((swap[s] + name.removeprefix(s) for s in swap if name.startswith(s)), name)

    angles = {other(name): (x, -y, -z) for name, (x, y, z) in source.angles.items()}
    return Pose(angles, tuple(swap[s] for s in source.flat), tuple(swap[s] for s in source.ball))


WALK_RIGHT = mirrored(WALK_LEFT)


def pose(source: Pose, ground: tuple[float, float] = (0.0, 0.0), heading: float = 0.0) -> Motion:
    """One frame of the 22-joint humanoid on the floor y = 0.

    ``ground``: where the hips are, (x, z) metres. ``heading``: which way it looks, degrees from +Z towards +X.
    """
    bends = {"Left": 0.0, "Right": 0.0}
    down = (*source.flat, *source.ball)
    if len(down) == 2:
        heights = _soles(_levelled(source, bends))
        longer = min(down, key=heights.__getitem__)
        other = next(side for side in down if side != longer)

        def gap(bend: float) -> float:
            found = _soles(_levelled(source, {**bends, longer: bend}))
            return found[longer] - found[other]

        bends[longer] = root_scalar(gap, bracket=(0.0, 60.0)).root
    local = _levelled(source, bends)
    root = np.array([ground[0], -min(_soles(local).values()), ground[1]])
    local[0] = rotation.multiply(rotation.from_rotation_vector(np.deg2rad(heading) * _UP), local[0])
    return Motion(HUMANOID, root[None], local[None], MODEL_RATE)


def _levelled(source: Pose, bends: Mapping[str, float]) -> Float[ndarray, "22 4"]:
    """Local rotations with each leg's bend (degrees) added, level soles and level toes where they are to be down."""
    local = np.tile(rotation.IDENTITY, (len(HUMANOID), 1))
    for name, angles in source.angles.items():
        local[HUMANOID.index(name)] = Rotation.from_euler("XYZ", angles, degrees=True).as_quat()
    for side, bend in bends.items():
        for name, share in (("UpLeg", -1.0), ("Leg", 2.0), ("Foot", -1.0)):
            joint = HUMANOID.index(side + name)
            turn = Rotation.from_euler("X", share * bend, degrees=True).as_quat()
            local[joint] = rotation.multiply(local[joint], turn)
    world = global_rotations(local, HUMANOID.parents)
    for side in source.flat:
        for name in ("Foot", "Toe"):
            world[HUMANOID.index(side + name)] = rotation.twist(world[HUMANOID.index(side + "Foot")], _UP)
    for side in source.ball:
        foot, toe = HUMANOID.index(side + "Foot"), HUMANOID.index(side + "Toe")
        ahead = rotation.rotate(world[foot], _AHEAD)
        world[toe] = rotation.between(_AHEAD, ahead * [1.0, 0.0, 1.0])
        world[foot] = rotation.multiply(rotation.between(ahead * [1.0, 0.0, 1.0], ahead), world[toe])
    return local_rotations(world, HUMANOID.parents)


def _soles(local: Float[ndarray, "22 4"]) -> dict[str, float]:
    """Height of each foot's lowest point below the hips, metres (negative)."""
    world = global_rotations(local, HUMANOID.parents)
    at = global_positions(np.zeros(3), world, HUMANOID.parents, HUMANOID.offsets)

    def lowest(side: str) -> float:
        points = (("Foot", _HEEL), ("Toe", _TIP), ("Toe", -BALL * _UP))
        joints = [(HUMANOID.index(side + name), point) for name, point in points]
        return min(float((at[joint] + rotation.rotate(world[joint], point))[1]) for joint, point in joints)

    return {side: lowest(side) for side in ("Left", "Right")}
