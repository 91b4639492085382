"""How each joint is turned when the character stands in the humanoid's T-pose.

It is read from the rest pose where that shows a body, else from the profile's joint frames, else from a motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget.naming import NamedJoints
from interpose.retarget.observe import joint_frames, planted, square
from interpose.retarget.profiles import JointFrames
from interpose.rotation import unit
from interpose.skeleton import HUMANOID, Skeleton

_DOWNWARD = np.array([0.0, -1.0, 0.0])
_LEFTWARD = np.array([1.0, 0.0, 0.0])
_TOE = HUMANOID.offsets[HUMANOID.index("LeftToe")]
_FOOT_PITCH = float(np.arctan2(-_TOE[1], _TOE[2]))
_BALL_HEIGHT = 0.02  # of the toe joint above the floor, as a share of the leg, where nothing else is known
_ANKLE_HEIGHT = 0.1  # of the ankle where there is no toe
_SIDES = ("Left", "Right")


@dataclass(frozen=True)
class Stance:
    """leg_length, ankle_height (of a flat foot): metres. rest_global, hip_centre: as in `mapping.Mapping`."""

    rest_global: Float[ndarray, "22 4"]
    leg_length: float
    ankle_height: float
    hip_centre: Float[ndarray, "3"]


def stance(skeleton: Skeleton, found: NamedJoints, motion: Motion | None) -> Stance:
    """The T-pose of the joints found.

    Where the rest pose shows a body, its left, up and forward give the torso's frame, and each limb bone is brought to
    its T-pose direction by the smallest rotation, parents first, which keeps its twist. Raises InputError where neither
    the rest pose, nor the profile, nor a motion shows the joint frames.
    """
    points = skeleton.rest_positions()
    joints = {name: j for name, j in zip(HUMANOID.names, found.joints, strict=True) if j is not None}
    at = {name: points[j] for name, j in joints.items()}
    body = _body_frame(at)
    frames = found.known.frames if found.known is not None and body is None else None
    seen: tuple[float, float] | None = None
    turned = {} if frames is None else {name: _axes(_group(name, frames)) for name in joints}
    if body is not None:
        turned = {name: rotation.inverse(body) for name in joints}
    elif frames is None or not _fits(turned, at):
        if motion is None:
            raise InputError(
                "the skeleton's rest pose does not show a body; give a motion to read the joint frames from"
            )
        frames, turned = None, joint_frames(motion, joints)
        seen = planted(motion, joints)
    flat = _FOOT_PITCH if frames is None or frames.foot_pitch is None else frames.foot_pitch
    pitch = _align_legs(turned, at, frames, flat if seen is None else seen[1])
    _align_arms(turned, at)
    leg = float(np.mean([_length(at, s + "UpLeg", s + "Leg") + _length(at, s + "Leg", s + "Foot") for s in _SIDES]))
    feet = [_length(at, s + "Foot", s + "Toe") for s in _SIDES if s + "Toe" in at]
    ankle = float(np.mean(feet)) * np.sin(pitch) + _BALL_HEIGHT * leg if feet else _ANKLE_HEIGHT * leg
    known = None if found.known is None else found.known.ankle_height
    if seen is not None:
        ankle = seen[0]
    elif known is not None and abs(known * leg - ankle) < 0.08 * leg:
        ankle = known * leg
    centre = (at["LeftUpLeg"] + at["RightUpLeg"]) / 2 - at["Hips"]
    rests = np.array([turned.get(name, rotation.IDENTITY) for name in HUMANOID.names])
    return Stance(rests, leg, float(ankle), centre)


def _length(at: dict[str, Float[ndarray, "3"]], a: str, b: str) -> float:
    return float(np.linalg.norm(at[b] - at[a]))


def _fits(turned: dict[str, Float[ndarray, "4"]], at: dict[str, Float[ndarray, "3"]]) -> bool:
    """Whether a profile's joint frames bring every limb bone of this skeleton to its T-pose direction."""
    for side, out in (("Left", _LEFTWARD), ("Right", -_LEFTWARD)):
        for bone, child, expected in (("UpLeg", "Leg", _DOWNWARD), ("Leg", "Foot", _DOWNWARD), ("Arm", "ForeArm", out)):
            if side + bone in at and side + child in at:
                direction = rotation.rotate(turned[side + bone], at[side + child] - at[side + bone])
                if float(unit(direction) @ expected) < 0.8:
                    return False
    return True


def _axes(spelled: str) -> Float[ndarray, "4"]:
    """The rotation from a joint's axes, given as in `JointFrames`, to the T-pose's left, up and forward."""
    rows = np.zeros((3, 3))
    for row, axis in enumerate(spelled.split()):
        rows[row, "xyz".index(axis[1])] = 1.0 if axis[0] == "+" else -1.0
    return rotation.from_matrix(rows)


def _group(name: str, frames: JointFrames) -> str:
    if name == "Hips":
        return frames.hips
    leg = name.endswith(("UpLeg", "Leg", "Foot", "Toe"))
    if name.startswith("Left"):
        return frames.left_leg if leg else frames.left_arm
    if name.startswith("Right"):
        return frames.right_leg if leg else frames.right_arm
    return frames.torso


def _body_frame(at: dict[str, Float[ndarray, "3"]]) -> Float[ndarray, "4"] | None:
    """The body's left, up and forward in the rest pose as a rotation from the T-pose's axes; None if there is no body.

    A body has its legs opposite to its spine, and its shoulders on the same sides as its hips. A frame within 30
    degrees of the axes counts as exactly along them, as rest poses are built square.
    """
    top = next((at[n] for n in ("Head", "Neck", "Spine2") if n in at), None)
    across = unit(at["LeftUpLeg"] - at["RightUpLeg"])
    legs = [unit(at[s + "Foot"] - at[s + "UpLeg"]) for s in _SIDES]
    down = legs[0] + legs[1]
    up = unit(top - at["Hips"]) if top is not None else -unit(down)
    if any(float(leg @ up) > -0.5 for leg in legs):
        return None
    if "LeftArm" in at and "RightArm" in at and float(unit(at["LeftArm"] - at["RightArm"]) @ across) < 0.5:
        return None
    left = unit(across - (across @ up) * up)
    if float(left @ across) < 0.5:
        return None
    return rotation.from_matrix(square(np.stack([left, up, np.cross(left, up)], axis=1), np.radians(30.0)))


def _align_legs(
    turned: dict[str, Float[ndarray, "4"]], at: dict[str, Float[ndarray, "3"]], frames: JointFrames | None, pitch: float
) -> float:
    """Brings thighs and shins straight down and the soles flat; returns the pitch of a flat foot, radians.

    pitch: of a flat foot where the rest pose does not show it.
    """
    pitches = []
    for side in _SIDES:
        thigh, shin, foot, toe = (side + part for part in ("UpLeg", "Leg", "Foot", "Toe"))
        carried = rotation.IDENTITY
        for bone, child in ((thigh, shin), (shin, foot)):
            turned[bone] = rotation.multiply(carried, turned[bone])
            fix = rotation.between(rotation.rotate(turned[bone], at[child] - at[bone]), _DOWNWARD)
            turned[bone] = rotation.multiply(fix, turned[bone])
            carried = rotation.multiply(fix, carried)
        pitches.append(pitch)
        if toe not in at and frames is None:
            continue  # without a toe the foot counts as flat in the rest pose
        bone = rotation.rotate(turned[foot], at[toe] - at[foot]) if toe in at else _DOWNWARD
        slope = float(np.arctan2(-bone[1], np.hypot(bone[0], bone[2])))
        if frames is None and np.radians(5.0) < slope < np.radians(65.0):
            pitches[-1] = slope  # the rest pose stands on its soles: only the heading is straightened
            fix = rotation.from_rotation_vector(np.array([0.0, -np.arctan2(bone[0], bone[2]), 0.0]))
            bend = rotation.IDENTITY
        else:
            flat = np.array([0.0, -np.sin(pitch), np.cos(pitch)])
            fix = rotation.multiply(rotation.between(rotation.rotate(carried, bone), flat), carried)
            bend = rotation.from_rotation_vector(-(0.0 if frames is None else frames.toe_bend) * _LEFTWARD)
        turned[foot] = rotation.multiply(fix, turned[foot])
        if toe in at:
            turned[toe] = rotation.multiply(bend, rotation.multiply(fix, turned[toe]))
    return float(np.mean(pitches))


def _align_arms(turned: dict[str, Float[ndarray, "4"]], at: dict[str, Float[ndarray, "3"]]) -> None:
    """Brings upper arms and forearms straight to the side; the hand follows the forearm, the collar stays."""
    for side, out in (("Left", _LEFTWARD), ("Right", -_LEFTWARD)):
        arm, fore, hand = (side + part for part in ("Arm", "ForeArm", "Hand"))
        carried = rotation.IDENTITY
        for bone, child in ((arm, fore), (fore, hand)):
            if bone in at and child in at:
                turned[bone] = rotation.multiply(carried, turned[bone])
                fix = rotation.between(rotation.rotate(turned[bone], at[child] - at[bone]), out)
                turned[bone] = rotation.multiply(fix, turned[bone])
                carried = rotation.multiply(fix, carried)
        if hand in at:
            turned[hand] = rotation.multiply(carried, turned[hand])
