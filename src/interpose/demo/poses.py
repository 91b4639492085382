"""Key poses for the demo, posed by hand; `poses.json` holds them.

A pose is a table of joint angles on the 22-joint humanoid, whose T-pose looks along +Z with its left hand at +X.
Angles are degrees about the parent's X, Y and Z, turned about Z first, then Y, then X; joints that are not named keep
the T-pose. What they do:

    X  + bends the trunk and head forward, swings a leg or a hanging arm back, bends a knee, points a foot down,
         rolls a bent forearm inwards about the upper arm
    Y  + turns to the left; on a forearm - (left) or + (right) bends the elbow
    Z  - lowers the left arm, + lowers the right one; + leans the trunk to the right and lifts the left arm or leg

:func:`pose` then sets the character on the floor: soles that are to be down are made level, the longer leg is bent
until both reach, and the root's height follows.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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

_AHEAD = np.array([0.0, 0.0, 1.0])
_HEEL = np.array([0.0, -ANKLE, -0.05])
_TIP = np.array([0.0, -BALL, 0.07])


@dataclass(frozen=True)
class DemoPose:
    """angles: see above. flat: sides whose whole sole is down. ball: sides that stand on the ball of the foot."""

    angles: Mapping[str, Sequence[int]]
    flat: tuple[str, ...]
    ball: tuple[str, ...]


_POSES = {
    name: DemoPose(entry["angles"], tuple(entry["flat"]), tuple(entry["ball"]))
    for name, entry in json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8")).items()
}
STAND, WALK_LEFT, RUN_LEFT = _POSES["stand"], _POSES["walk-left"], _POSES["run-left"]
WARY, AEROPLANE, ANGRY = _POSES["wary"], _POSES["aeroplane"], _POSES["angry"]
DRUNK, CHICKEN, KARATE = _POSES["drunk"], _POSES["chicken"], _POSES["karate"]


def mirrored(source: DemoPose) -> DemoPose:
    """The same pose with left and right exchanged."""
    swap = {"Left": "Right", "Right": "Left"}

    def other(name: str) -> str:
        return next((swap[s] + name.removeprefix(s) for s in swap if name.startswith(s)), name)

    angles = {other(name): (x, -y, -z) for name, (x, y, z) in source.angles.items()}
    return DemoPose(angles, tuple(swap[s] for s in source.flat), tuple(swap[s] for s in source.ball))


WALK_RIGHT = mirrored(WALK_LEFT)


def pose(source: DemoPose, ground: tuple[float, float] = (0.0, 0.0), heading: float = 0.0) -> Motion:
    """One frame of the 22-joint humanoid on the floor y = 0.

    ``ground``: where the hips are, (x, z) metres. ``heading``: the direction it faces, degrees from +Z towards +X.
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
    local[0] = rotation.multiply(rotation.from_rotation_vector(np.deg2rad(heading) * rotation.UP), local[0])
    return Motion(HUMANOID, root[None], local[None], MODEL_RATE)


def _levelled(source: DemoPose, bends: Mapping[str, float]) -> Float[ndarray, "22 4"]:
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
            world[HUMANOID.index(side + name)] = rotation.twist(world[HUMANOID.index(side + "Foot")], rotation.UP)
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
        points = (("Foot", _HEEL), ("Toe", _TIP), ("Toe", -BALL * rotation.UP))
        joints = [(HUMANOID.index(side + name), point) for name, point in points]
        return min(float((at[joint] + rotation.rotate(world[joint], point))[1]) for joint, point in joints)

    return {side: lowest(side) for side in ("Left", "Right")}
