"""Joint frames read from a motion, for rigs of no known family whose rest pose does not show a body.

Relies on three facts: people are mostly upright; knees bend backward and elbows forward; rigs whose bones lie along one
axis have their other axes square to the body.
"""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

from interpose import rotation
from interpose.motion import Motion
from interpose.rotation import unit
from interpose.skeleton import HUMANOID

_OBSERVED_FRAMES = 256
_MOST_WRIST_TURN = np.radians(75.0)  # a hand that is turned by less on average is turned itself, not its frame
_LOW_SHARE = 0.1  # share of the frames, the lowest, that show the foot on the floor
_MINOR = 0.05  # weight of the torso's directions against those of a bent limb
_AXIS_FRAMES = tuple(
    m
    for order in itertools.permutations(range(3))
    for signs in itertools.product((1.0, -1.0), repeat=3)
    if np.linalg.det(m := np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0
)


def square(frame: Float[ndarray, "3 3"], within: float) -> Float[ndarray, "3 3"]:
    """The nearest frame along the axes if it is less than ``within`` radians away, else the frame itself."""
    nearest = max(_AXIS_FRAMES, key=lambda m: float(np.trace(m.T @ frame)))
    turn = rotation.from_matrix(nearest.T @ frame)
    return nearest if float(rotation.angle(turn)) < within else frame


def joint_frames(motion: Motion, joints: dict[str, int]) -> dict[str, Float[ndarray, "4"]]:
    """For each joint the rotation from its own axes to those of a T-pose with feet pointed down.

    Directions are averaged over the frames in each joint's own frame, those of hinges weighted by their bend.
    """
    motion = motion[:: max(1, len(motion) // _OBSERVED_FRAMES)]
    world, points = motion.global_rotations(), motion.global_positions()
    at = {name: points[:, joint] for name, joint in joints.items()}
    top = next((at[n] for n in ("Head", "Neck", "Spine2", "LeftArm") if n in at), at["Hips"] + rotation.UP)
    up = unit(top - at["Hips"])
    left = unit(at["LeftUpLeg"] - at["RightUpLeg"])
    forward = unit(np.cross(left, up))
    out: dict[str, Float[ndarray, "4"]] = {}

    def own(name: str, v: Float[ndarray, "frame 3"]) -> Float[ndarray, "3"]:
        return rotation.rotate(rotation.inverse(world[:, joints[name]]), v).mean(axis=0)

    def put(name: str, first: Float[ndarray, "3"], second: Float[ndarray, "3"], ours: Float[ndarray, "3 3"]) -> None:
        """Brings the direction `first`, and `second` as far as possible, to the first two columns of `ours`."""
        first = unit(first)
        second = unit(second - (second @ first) * first)
        theirs = np.stack([first, second, np.cross(first, second)], axis=1)
        out[name] = rotation.from_matrix(square(ours @ theirs.T, np.radians(50.0)))

    def basis(first: tuple[int, int, int], second: tuple[int, int, int]) -> Float[ndarray, "3 3"]:
        a, b = np.array(first, dtype=float), np.array(second, dtype=float)
        return np.stack([a, b, np.cross(a, b)], axis=1)

    for name in ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"):
        if name in joints:
            put(name, own(name, left), own(name, up), basis((1, 0, 0), (0, 1, 0)))
    for side, sign in (("Left", 1), ("Right", -1)):
        thigh, shin, foot, toe = (side + part for part in ("UpLeg", "Leg", "Foot", "Toe"))
        hinge = np.cross(unit(at[shin] - at[thigh]), unit(at[foot] - at[shin]))
        for bone, child in ((thigh, shin), (shin, foot)):
            put(bone, own(bone, at[child] - at[bone]), own(bone, hinge + _MINOR * left), basis((0, -1, 0), (1, 0, 0)))
        if toe in joints:
            hinge = np.cross(unit(at[toe] - at[foot]), unit(at[foot] - at[shin]))
            put(foot, own(foot, at[toe] - at[foot]), own(foot, hinge + _MINOR * left), basis((0, -1, 0), (1, 0, 0)))
            out[toe] = rotation.multiply(out[foot], _mean_turn(world, joints[foot], joints[toe]))
        collar, arm, fore, hand = (side + part for part in ("Shoulder", "Arm", "ForeArm", "Hand"))
        if collar in joints and arm in joints:
            put(collar, own(collar, at[arm] - at[collar]), own(collar, forward), basis((sign, 0, 0), (0, 0, 1)))
        if arm in joints and fore in joints and hand in joints:
            upper, lower = unit(at[fore] - at[arm]), unit(at[hand] - at[fore])
            hinge = np.cross(upper, lower)
            for bone, along in ((arm, upper), (fore, lower)):
                ahead = np.cross(hinge, along) + _MINOR * forward
                put(bone, own(bone, along), own(bone, ahead), basis((sign, 0, 0), (0, 0, 1)))
            turn = _mean_turn(world, joints[fore], joints[hand])
            if float(rotation.angle(turn)) < _MOST_WRIST_TURN:
                turn = rotation.IDENTITY
            out[hand] = rotation.multiply(out[fore], rotation.from_matrix(square(rotation.to_matrix(turn), np.pi)))
    for name, joint in joints.items():
        if name not in out:
            parent = HUMANOID.names[HUMANOID.parents[HUMANOID.index(name)]]
            parent = parent if parent in out else "Hips"
            out[name] = rotation.multiply(out[parent], _mean_turn(world, joints[parent], joint))
    return out


def planted(motion: Motion, joints: dict[str, int]) -> tuple[float, float] | None:
    """The ankle's height (metres) and the downward pitch from ankle to toe (radians) where the feet are lowest.

    None where the skeleton has no toes or the foot is not planted: a pitch outside 10 to 60 degrees, or an ankle lower
    than 4 or higher than 25 hundredths of the leg.
    """
    if "LeftToe" not in joints or "RightToe" not in joints:
        return None
    points = motion[:: max(1, len(motion) // _OBSERVED_FRAMES)].global_positions()
    heights, pitches, legs = [], [], []
    for side in ("Left", "Right"):
        knee, ankle, toe = (points[:, joints[side + part]] for part in ("Leg", "Foot", "Toe"))
        low = np.argsort(ankle[:, 1] + toe[:, 1])[: max(1, int(_LOW_SHARE * len(points)))]
        bone = toe[low] - ankle[low]
        heights.append(float(np.median(ankle[low, 1])))
        pitches.append(float(np.median(np.arctan2(-bone[:, 1], np.hypot(bone[:, 0], bone[:, 2])))))
        legs.append(2.0 * float(np.linalg.norm(ankle[0] - knee[0])))
    height, pitch, leg = min(heights), pitches[int(np.argmin(heights))], float(np.mean(legs))
    if not (0.04 * leg < height < 0.25 * leg and np.radians(10.0) < pitch < np.radians(60.0)):
        return None
    return height, pitch


def _mean_turn(world: Float[ndarray, "frame joint 4"], parent: int, joint: int) -> Float[ndarray, "4"]:
    """The mean rotation of a joint in its parent's frame."""
    turns = rotation.multiply(rotation.inverse(world[:, parent]), world[:, joint])
    return Rotation.from_quat(turns).mean().as_quat()
