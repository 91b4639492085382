"""Synthetic characters: a body in a T-pose, named as asked, that can be rebuilt with another rest pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.motion import Motion, from_global
from interpose.skeleton import Skeleton


@dataclass(frozen=True)
class Rig:
    """Joint names from the root down. Limbs are spelled with "*" for the side; extra: (name, parent, offset)."""

    profile: str
    hips: str
    spine: tuple[str, ...]
    neck: tuple[str, ...]
    head: str
    leg: tuple[str, ...]
    arm: tuple[str, ...]
    sides: tuple[str, str] = ("Left", "Right")
    root: str | None = None
    hip_stub: str | None = None
    extra: tuple[tuple[str, str, tuple[float, float, float]], ...] = ()


def build(rig: Rig) -> Skeleton:
    """A T-pose that looks along +Z, 1.6 m tall, its feet's bones 27 degrees down."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[tuple[float, float, float]] = []

    def add(name: str, parent: str | None, offset: tuple[float, float, float]) -> str:
        names.append(name)
        parents.append(-1 if parent is None else names.index(parent))
        offsets.append(offset)
        return name

    top = add(rig.root, None, (0.0, 0.0, 0.0)) if rig.root else None
    hips = add(rig.hips, top, (0.0, 0.9, 0.0) if rig.root else (0.0, 0.0, 0.0))
    for spelled, sign in zip(rig.sides, (1.0, -1.0), strict=True):
        parent = hips
        places = [
            (0.09 * sign, -0.03, 0.0),
            (0.0, -0.4, 0.0),
            (0.0, -0.38, 0.0),
            (0.0, -0.08, 0.157),
            (0.0, -0.01, 0.05),
        ]
        if rig.hip_stub is not None:
            parent = add(rig.hip_stub.replace("*", spelled), hips, (0.05 * sign, -0.03, 0.0))
            places[0] = (0.04 * sign, 0.0, 0.0)
        for name, place in zip(rig.leg, places, strict=False):
            parent = add(name.replace("*", spelled), parent, place)
    parent = hips
    for name in rig.spine:
        parent = add(name, parent, (0.0, 0.36 / len(rig.spine), 0.0))
    chest = parent
    for name in (*rig.neck, rig.head):
        parent = add(name, parent, (0.0, 0.2 / (1 + len(rig.neck)), 0.0))
    for spelled, sign in zip(rig.sides, (1.0, -1.0), strict=True):
        parent = chest
        places = [
            (0.03 * sign, 0.12, 0.0),
            (0.13 * sign, 0.0, 0.0),
            (0.28 * sign, 0.0, 0.0),
            (0.24 * sign, 0.0, 0.0),
            (0.08 * sign, 0.0, 0.0),
        ]
        for name, place in zip(rig.arm, places, strict=False):
            parent = add(name.replace("*", spelled), parent, place)
    for name, parent, offset in rig.extra:
        add(name, parent, offset)
    return Skeleton(tuple(names), tuple(parents), np.array(offsets))


def repose(skeleton: Skeleton, motion: Motion, turns: dict[str, Float[ndarray, "4"]]) -> tuple[Skeleton, Motion]:
    """The same character and motion with another rest pose.

    turns: for each joint that is turned, its global rotation from the old rest pose to the new; others are not turned.
    """
    change = np.array([turns.get(name, rotation.IDENTITY) for name in skeleton.names])
    parent = [max(p, 0) for p in skeleton.parents]
    offsets = rotation.rotate(change[parent], skeleton.offsets)
    other = Skeleton(skeleton.names, skeleton.parents, offsets)
    world = rotation.multiply(motion.global_rotations(), rotation.inverse(change)[None])
    return other, from_global(other, motion.root_positions, world, motion.rate)


def random_motion(skeleton: Skeleton, seed: int, frames: int = 6, spread: float = 0.5) -> Motion:
    """A motion whose joints are turned by about `spread` radians."""
    rng = np.random.default_rng(seed)
    local = rotation.from_rotation_vector(rng.normal(0.0, spread, (frames, len(skeleton), 3)))
    root = rng.normal(0.0, 1.0, (frames, 3)) + np.array([0.0, 0.9, 0.0])
    return Motion(skeleton, root, rotation.continuous(local), 30.0)


def about(axis: str, degrees: float) -> Float[ndarray, "4"]:
    """A rotation about x, y or z."""
    return rotation.from_rotation_vector(np.radians(degrees) * np.eye(3)["xyz".index(axis)])


_FINGERS = (("LeftHandIndex1", "LeftHand", (0.09, 0.0, 0.02)), ("LeftHandIndex2", "LeftHandIndex1", (0.03, 0.0, 0.0)))

RIGS = (
    Rig(
        "LaFAN1",
        "Hips",
        ("Spine", "Spine1", "Spine2"),
        ("Neck",),
        "Head",
        ("*UpLeg", "*Leg", "*Foot", "*Toe"),
        ("*Shoulder", "*Arm", "*ForeArm", "*Hand"),
    ),
    Rig(
        "100STYLE",
        "Hips",
        ("Chest", "Chest2", "Chest3", "Chest4"),
        ("Neck",),
        "Head",
        ("*Hip", "*Knee", "*Ankle", "*Toe"),
        ("*Collar", "*Shoulder", "*Elbow", "*Wrist"),
    ),
    Rig(
        "Bandai-Namco",
        "Hips",
        ("Spine", "Chest"),
        ("Neck",),
        "Head",
        ("UpperLeg_*", "LowerLeg_*", "Foot_*", "Toes_*"),
        ("Shoulder_*", "UpperArm_*", "LowerArm_*", "Hand_*"),
        ("L", "R"),
        root="joint_Root",
    ),
    Rig(
        "CMU",
        "hip",
        ("lowerback", "upperback", "thorax"),
        ("lowerneck", "upperneck"),
        "head",
        ("*femur", "*tibia", "*foot", "*toes"),
        ("*clavicle", "*humerus", "*radius", "*wrist", "*hand"),
        ("l", "r"),
        hip_stub="*hipjoint",
    ),
    Rig(
        "CMU",
        "Hips",
        ("LowerBack", "Spine", "Spine1"),
        ("Neck", "Neck1"),
        "Head",
        ("*UpLeg", "*Leg", "*Foot", "*ToeBase"),
        ("*Shoulder", "*Arm", "*ForeArm", "*Hand"),
        extra=(("LHipJoint", "Hips", (0.01, 0.0, 0.0)), ("RHipJoint", "Hips", (-0.01, 0.0, 0.0))),
    ),
    Rig(
        "CMU",
        "hip",
        ("abdomen", "chest"),
        ("neck",),
        "head",
        ("*Thigh", "*Shin", "*Foot", "*Toe"),
        ("*Collar", "*Shldr", "*ForeArm", "*Hand"),
        ("l", "r"),
        hip_stub="*Buttock",
    ),
    Rig(
        "Mixamo",
        "mixamorig:Hips",
        ("mixamorig:Spine", "mixamorig:Spine1", "mixamorig:Spine2"),
        ("mixamorig:Neck",),
        "mixamorig:Head",
        ("mixamorig:*UpLeg", "mixamorig:*Leg", "mixamorig:*Foot", "mixamorig:*ToeBase", "mixamorig:*Toe_End"),
        ("mixamorig:*Shoulder", "mixamorig:*Arm", "mixamorig:*ForeArm", "mixamorig:*Hand"),
        extra=(("mixamorig:HeadTop_End", "mixamorig:Head", (0.0, 0.18, 0.0)),),
    ),
    Rig(
        "Mixamo",
        "Hips",
        ("Spine", "Spine1", "Spine2"),
        ("Neck",),
        "Head",
        ("*UpLeg", "*Leg", "*Foot", "*ToeBase"),
        ("*Shoulder", "*Arm", "*ForeArm", "*Hand"),
        extra=_FINGERS,
    ),
    Rig(
        "Rokoko",
        "Hips",
        ("Spine", "Spine1", "Spine2", "Spine3", "Spine4"),
        ("Neck",),
        "Head",
        ("*Thigh", "*Shin", "*Foot", "*Toe"),
        ("*Shoulder", "*Arm", "*ForeArm", "*Hand"),
        extra=_FINGERS,
    ),
    Rig(
        "SMPL",
        "Pelvis",
        ("Spine1", "Spine2", "Spine3"),
        ("Neck",),
        "Head",
        ("*_Hip", "*_Knee", "*_Ankle", "*_Foot"),
        ("*_Collar", "*_Shoulder", "*_Elbow", "*_Wrist"),
        ("L", "R"),
        extra=(("L_Hand", "L_Wrist", (0.08, 0.0, 0.0)), ("R_Hand", "R_Wrist", (-0.08, 0.0, 0.0))),
    ),
    Rig(
        "SMPL",
        "m_avg_Pelvis",
        ("m_avg_Spine1", "m_avg_Spine2", "m_avg_Spine3"),
        ("m_avg_Neck",),
        "m_avg_Head",
        ("m_avg_*_Hip", "m_avg_*_Knee", "m_avg_*_Ankle", "m_avg_*_Foot"),
        ("m_avg_*_Collar", "m_avg_*_Shoulder", "m_avg_*_Elbow", "m_avg_*_Wrist", "m_avg_*_Hand"),
        ("L", "R"),
        root="m_avg_root",
    ),
    Rig(
        "SMPL",
        "pelvis",
        ("spine1", "spine2", "spine3"),
        ("neck",),
        "head",
        ("*_hip", "*_knee", "*_ankle", "*_foot"),
        ("*_collar", "*_shoulder", "*_elbow", "*_wrist"),
        ("left", "right"),
    ),
    Rig(
        "SMPL",
        "Pelvis",
        ("Torso", "Spine", "Chest"),
        ("Neck",),
        "Head",
        ("*_Hip", "*_Knee", "*_Ankle", "*_Toe"),
        ("*_Thorax", "*_Shoulder", "*_Elbow", "*_Wrist", "*_Hand"),
        ("L", "R"),
    ),
    Rig(
        "Unreal",
        "pelvis",
        ("spine_01", "spine_02", "spine_03"),
        ("neck_01",),
        "head",
        ("thigh_*", "calf_*", "foot_*", "ball_*"),
        ("clavicle_*", "upperarm_*", "lowerarm_*", "hand_*"),
        ("l", "r"),
        root="root",
        extra=(("upperarm_twist_01_l", "upperarm_l", (0.1, 0.0, 0.0)), ("calf_twist_01_r", "calf_r", (0.0, -0.2, 0.0))),
    ),
    Rig(
        "Unreal",
        "pelvis",
        ("spine_01", "spine_02", "spine_03", "spine_04", "spine_05"),
        ("neck_01", "neck_02"),
        "head",
        ("thigh_*", "calf_*", "foot_*", "ball_*"),
        ("clavicle_*", "upperarm_*", "lowerarm_*", "hand_*"),
        ("l", "r"),
        root="root",
    ),
    Rig(
        "Rigify",
        "DEF-spine",
        ("DEF-spine.001", "DEF-spine.002", "DEF-spine.003"),
        ("DEF-spine.004", "DEF-spine.005"),
        "DEF-spine.006",
        ("DEF-thigh.*", "DEF-shin.*", "DEF-foot.*", "DEF-toe.*"),
        ("DEF-shoulder.*", "DEF-upper_arm.*", "DEF-forearm.*", "DEF-hand.*"),
        ("L", "R"),
        extra=(("DEF-pelvis.L", "DEF-spine", (0.05, 0.05, 0.0)), ("DEF-thigh.L.001", "DEF-thigh.L", (0.0, -0.2, 0.0))),
    ),
    Rig(
        "Rigify",
        "ORG-spine",
        ("ORG-spine.001", "ORG-spine.002", "ORG-spine.003"),
        ("ORG-spine.004", "ORG-spine.005"),
        "ORG-spine.006",
        ("ORG-thigh.*", "ORG-shin.*", "ORG-foot.*", "ORG-toe.*"),
        ("ORG-shoulder.*", "ORG-upper_arm.*", "ORG-forearm.*", "ORG-hand.*"),
        ("L", "R"),
    ),
    Rig(
        "Biped",
        "Bip01 Pelvis",
        ("Bip01 Spine", "Bip01 Spine1", "Bip01 Spine2"),
        ("Bip01 Neck",),
        "Bip01 Head",
        ("Bip01 * Thigh", "Bip01 * Calf", "Bip01 * Foot", "Bip01 * Toe0"),
        ("Bip01 * Clavicle", "Bip01 * UpperArm", "Bip01 * Forearm", "Bip01 * Hand"),
        ("L", "R"),
        root="Bip01",
    ),
    Rig(
        "similar names",
        "rig:pelvis",
        ("rig:back_A", "rig:back_B"),
        ("rig:neck",),
        "rig:head",
        ("rig:*UpperLeg", "rig:*LowerLeg", "rig:*Foot", "rig:*Toes"),
        ("rig:*Shoulder", "rig:*UpperArm", "rig:*LowerArm", "rig:*Hand"),
    ),
    Rig(
        "hierarchy",
        "a1",
        ("a2", "a3", "a4"),
        ("a5",),
        "a6",
        ("*b1", "*b2", "*b3", "*b4", "*b5"),
        ("*c1", "*c2", "*c3", "*c4"),
        ("x", "y"),
        root="a0",
        extra=(("f1", "xc4", (0.08, 0.0, 0.0)), ("f2", "yc4", (-0.08, 0.0, 0.0))),
    ),
)
"""One rig of each dialect that is known by name, one that is only similar, and one whose names say nothing."""
