"""How each joint is turned when the character stands in the humanoid's T-pose.

A rest pose (all rotations zero) that shows a standing, A-posed or lying body says it by itself: the body's left, up and
forward give the torso's frame, and each limb bone is brought to its T-pose direction by the smallest rotation, parents
first, so that its twist is kept. In rigs whose bones all lie along one axis (LaFAN1, Bandai-Namco) the rest pose shows
nothing; there the joint frames of the profile are used.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget.naming import Found
from interpose.retarget.profiles import Frames
from interpose.skeleton import HUMANOID, Skeleton

_DOWN = np.array([0.0, -1.0, 0.0])
_LEFT = np.array([1.0, 0.0, 0.0])
_TOE = HUMANOID.offsets[HUMANOID.index("LeftToe")]
_FOOT_PITCH = float(np.arctan2(-_TOE[1], _TOE[2]))
_BALL_HEIGHT = 0.02  # of the toe joint above the floor as a share of the leg, where nothing else is known


@dataclass(frozen=True)
class Stance:
    """rest_global: (22, 4). leg_length: metres. ankle_height: of a flat foot, metres. hip_centre: see Mapping."""

    rest_global: Float[ndarray, "22 4"]
    leg_length: float
    ankle_height: float
    hip_centre: Float[ndarray, "3"]


def stance(skeleton: Skeleton, found: Found, motion: Motion | None) -> Stance:
    """The T-pose of the joints found."""
    zero = np.tile(rotation.IDENTITY, (len(skeleton), 1))
    points = _rest_positions(skeleton)
    at = {name: points[j] for name, j in zip(HUMANOID.names, found.joints, strict=True) if j is not None}
    body = _body_frame(at)
    frames = found.known.frames if found.known is not None else None
    if body is not None:
        start = {name: rotation.inverse(body) for name in HUMANOID.names}
        frames = None
    elif frames is not None:
        start = {name: _axes(_group(name, frames)) for name in HUMANOID.names}
    else:
        raise InputError("the skeleton's rest pose is not that of a body")
    del zero, motion
    turned = dict(start)
    pitch = _align_legs(turned, at, frames)
    _align_arms(turned, at)
    leg = np.mean(
        [
            np.linalg.norm(at[s + "Leg"] - at[s + "UpLeg"]) + np.linalg.norm(at[s + "Foot"] - at[s + "Leg"])
            for s in ("Left", "Right")
        ]
    )
    feet = [np.linalg.norm(at[s + "Toe"] - at[s + "Foot"]) for s in ("Left", "Right") if s + "Toe" in at]
    if found.known is not None and found.known.ankle_height is not None:
        ankle = found.known.ankle_height * leg
    elif feet:
        ankle = np.mean(feet) * np.sin(pitch) + _BALL_HEIGHT * leg
    else:
        ankle = -_TOE[1] * leg / 0.8587
    centre = (at["LeftUpLeg"] + at["RightUpLeg"]) / 2 - at["Hips"]
    rests = np.array([turned[n] if n in at else rotation.IDENTITY for n in HUMANOID.names])
    return Stance(rests, float(leg), float(ankle), centre)


def _rest_positions(skeleton: Skeleton) -> Float[ndarray, "joint 3"]:
    out = [np.zeros(3)]
    for joint, parent in enumerate(skeleton.parents[1:], start=1):
        out.append(out[parent] + skeleton.offsets[joint])
    return np.array(out)


def _axes(spelled: str) -> Float[ndarray, "4"]:
    """The rotation that brings a joint's axes, named as in `Frames`, to the T-pose's left, up and forward."""
    rows = np.zeros((3, 3))
    for row, word in enumerate(spelled.split()):
        rows[row, "xyz".index(word[1])] = 1.0 if word[0] == "+" else -1.0
    return rotation.from_matrix(rows)


def _group(name: str, frames: Frames) -> str:
    if name == "Hips":
        return frames.hips
    leg = name.endswith(("UpLeg", "Leg", "Foot", "Toe"))
    if name.startswith("Left"):
        return frames.left_leg if leg else frames.left_arm
    if name.startswith("Right"):
        return frames.right_leg if leg else frames.right_arm
    return frames.torso


def _unit(v: Float[ndarray, "3"]) -> Float[ndarray, "3"]:
    return v / max(float(np.linalg.norm(v)), 1e-12)


def _body_frame(at: dict[str, Float[ndarray, "3"]]) -> Float[ndarray, "4"] | None:
    """The body's left, up and forward in the rest pose as a rotation from the T-pose's axes; None where it shows no body.

    A body has its legs opposite to its spine and its shoulders on the same sides as its hips. Frames within 30 degrees
    of the axes are taken to be exactly along them: rest poses are built square.
    """
    top = next((at[n] for n in ("Head", "Neck", "Spine2") if n in at), None)
    across = _unit(at["LeftUpLeg"] - at["RightUpLeg"])
    legs = [_unit(at[s + "Foot"] - at[s + "UpLeg"]) for s in ("Left", "Right")]
    down = legs[0] + legs[1]
    up = _unit(top - at["Hips"]) if top is not None else -_unit(down)
    if any(float(leg @ up) > -0.5 for leg in legs):
        return None
    if "LeftArm" in at and "RightArm" in at and float(_unit(at["LeftArm"] - at["RightArm"]) @ across) < 0.5:
        return None
    left = _unit(across - (across @ up) * up)
    if float(left @ across) < 0.5:
        return None
    frame = np.stack([left, up, np.cross(left, up)], axis=1)
    squares = [
        np.eye(3)[list(p)] * np.array(s)[:, None]
        for p in itertools.permutations(range(3))
        for s in itertools.product((1.0, -1.0), repeat=3)
    ]
    nearest = max((m for m in squares if np.linalg.det(m) > 0), key=lambda m: float(np.trace(m.T @ frame)))
    turn = rotation.from_matrix(nearest.T @ frame)
    return rotation.from_matrix(nearest if float(rotation.angle(turn)) < np.radians(30.0) else frame)


def _align_legs(
    turned: dict[str, Float[ndarray, "4"]], at: dict[str, Float[ndarray, "3"]], frames: Frames | None
) -> float:
    """Bring thighs and shins straight down and the soles flat; returns the pitch of a flat foot."""
    pitches = []
    for side in ("Left", "Right"):
        thigh, shin, foot, toe = (side + part for part in ("UpLeg", "Leg", "Foot", "Toe"))
        carried = rotation.IDENTITY
        for bone, child in ((thigh, shin), (shin, foot)):
            turned[bone] = rotation.multiply(carried, turned[bone])
            fix = rotation.between(rotation.rotate(turned[bone], at[child] - at[bone]), _DOWN)
            turned[bone] = rotation.multiply(fix, turned[bone])
            carried = rotation.multiply(fix, carried)
        pitch = _FOOT_PITCH
        points = rotation.rotate(turned[foot], at[toe] - at[foot]) if toe in at else _DOWN
        slope = float(np.arctan2(-points[1], np.hypot(points[0], points[2])))
        if frames is None and np.radians(5.0) < slope < np.radians(65.0):
            pitch = slope  # the rest pose stands on its soles: only the heading is straightened
            heading = rotation.from_rotation_vector(np.array([0.0, -np.arctan2(points[0], points[2]), 0.0]))
            turned[foot] = rotation.multiply(heading, turned[foot])
            turned[toe] = rotation.multiply(heading, turned[toe])
        elif frames is not None or toe in at:
            pitch = _FOOT_PITCH if frames is None or frames.foot_pitch is None else frames.foot_pitch
            bend = 0.0 if frames is None else frames.toe_bend
            flat = np.array([0.0, -np.sin(pitch), np.cos(pitch)])
            fix = rotation.multiply(rotation.between(rotation.rotate(carried, points), flat), carried)
            turned[foot] = rotation.multiply(fix, turned[foot])
            raised = rotation.from_rotation_vector(-bend * _LEFT)
            turned[toe] = rotation.multiply(raised, rotation.multiply(fix, turned[toe]))
        pitches.append(pitch)
    return float(np.mean(pitches))


def _align_arms(turned: dict[str, Float[ndarray, "4"]], at: dict[str, Float[ndarray, "3"]]) -> None:
    """Bring upper arms and forearms straight to the side; the hand goes with the forearm, the collar stays."""
    for side, out in (("Left", _LEFT), ("Right", -_LEFT)):
        arm, fore, hand = (side + part for part in ("Arm", "ForeArm", "Hand"))
        carried = rotation.IDENTITY
        for bone, child in ((arm, fore), (fore, hand)):
            if bone in at and child in at:
                turned[bone] = rotation.multiply(carried, turned[bone])
                fix = rotation.between(rotation.rotate(turned[bone], at[child] - at[bone]), out)
                turned[bone] = rotation.multiply(fix, turned[bone])
                carried = rotation.multiply(fix, carried)
        turned[hand] = rotation.multiply(carried, turned[hand])
