"""Joint names of common humanoid rigs, and their joint frames where the rest pose hides them.

Spine and neck are read from the hierarchy (`naming`), because their number varies within a family of rigs.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from interpose.skeleton import ARM_BONES, LEG_BONES


@dataclass(frozen=True)
class JointFrames:
    """Joint frames in a T-pose, for rigs whose rest pose (all rotations zero) is not a human pose.

    Each string gives the joint's own axes that point to the character's left, up and forward, as in "+z +x +y".
    foot_pitch: downward pitch from ankle to toe of a flat foot, radians, None for the humanoid's. toe_bend: upward turn
    of the toe from the foot then, radians. Measured on planted feet (both joints slower than 0.15 m/s).
    """

    hips: str
    torso: str
    left_leg: str
    right_leg: str
    left_arm: str
    right_arm: str
    foot_pitch: float | None
    toe_bend: float


@dataclass(frozen=True)
class Profile:
    """Joint names of one family of rigs; "*" stands for the side, spelled as in ``sides`` (left, right).

    legs: thigh, shin, foot, toe. arms: collar, upper arm, forearm, hand. ankle_height: of a flat foot, as a share of
    the leg's length, where it was measured. mark: a joint that distinguishes this family from others with the same
    limbs.
    """

    name: str
    hips: str
    head: str
    legs: str
    arms: str
    sides: tuple[str, str] = ("Left", "Right")
    ankle_height: float | None = None
    frames: JointFrames | None = None
    mark: str = ""

    def joints(self) -> dict[str, str]:
        """This family's name for each joint of the humanoid but spine and neck."""
        named = {"Hips": self.hips, "Head": self.head}
        for side, spelled in zip(("Left", "Right"), self.sides, strict=True):
            for ours, theirs in zip((*LEG_BONES, *ARM_BONES), (*self.legs.split(), *self.arms.split()), strict=True):
                named[side + ours] = theirs.replace("*", spelled)
        return named


_LAFAN1_FRAMES = JointFrames(
    hips="+z +x +y",
    torso="+z +x +y",
    left_leg="-z -x +y",
    right_leg="-z -x +y",
    left_arm="+x +z -y",
    right_arm="-x -z -y",
    foot_pitch=None,
    toe_bend=0.37446,  # 21.455 degrees in every frame, as LaFAN1's toes were not captured
)
_BANDAI_FRAMES = JointFrames(
    hips="-y +x +z",
    torso="+z +x +y",
    left_leg="+y -x +z",
    right_leg="+y +x -z",
    left_arm="+x +y +z",
    right_arm="+x -y -z",
    foot_pitch=0.691,  # 39.6 degrees
    toe_bend=0.285,  # 16.3 degrees
)

_UPPER = ("L", "R")
_LOWER = ("l", "r")

PROFILES = (
    Profile(
        "LaFAN1",
        "Hips",
        "Head",
        "*UpLeg *Leg *Foot *Toe",
        "*Shoulder *Arm *ForeArm *Hand",
        ankle_height=0.0745 / 0.8587,
        frames=_LAFAN1_FRAMES,
    ),
    Profile(
        "100STYLE", "Hips", "Head", "*Hip *Knee *Ankle *Toe", "*Collar *Shoulder *Elbow *Wrist", ankle_height=0.1345
    ),
    Profile(
        "Bandai-Namco",
        "Hips",
        "Head",
        "UpperLeg_* LowerLeg_* Foot_* Toes_*",
        "Shoulder_* UpperArm_* LowerArm_* Hand_*",
        _UPPER,
        ankle_height=0.1461,
        frames=_BANDAI_FRAMES,
    ),
    Profile("Mixamo", "Hips", "Head", "*UpLeg *Leg *Foot *ToeBase", "*Shoulder *Arm *ForeArm *Hand"),
    Profile("CMU", "Hips", "Head", "*UpLeg *Leg *Foot *ToeBase", "*Shoulder *Arm *ForeArm *Hand", mark="LHipJoint"),
    Profile("CMU", "hip", "head", "*femur *tibia *foot *toes", "*clavicle *humerus *radius *wrist", _LOWER),
    Profile("CMU", "root", "head", "*femur *tibia *foot *toes", "*clavicle *humerus *radius *wrist", _LOWER),
    Profile("CMU", "hip", "head", "*Thigh *Shin *Foot *Toe", "*Collar *Shldr *ForeArm *Hand", _LOWER),
    Profile("Rokoko", "Hips", "Head", "*Thigh *Shin *Foot *Toe", "*Shoulder *Arm *ForeArm *Hand"),
    Profile("SMPL", "Pelvis", "Head", "*_Hip *_Knee *_Ankle *_Foot", "*_Collar *_Shoulder *_Elbow *_Wrist", _UPPER),
    Profile("SMPL", "Pelvis", "Head", "*_Hip *_Knee *_Ankle *_Foot", "*_Collar *_Shoulder *_Elbow *_Wrist"),
    Profile("SMPL", "Pelvis", "Head", "*_Hip *_Knee *_Ankle *_Toe", "*_Thorax *_Shoulder *_Elbow *_Wrist", _UPPER),
    Profile(
        "Unreal", "pelvis", "head", "thigh_* calf_* foot_* ball_*", "clavicle_* upperarm_* lowerarm_* hand_*", _LOWER
    ),
    Profile(
        "Rigify", "spine", "spine.006", "thigh.* shin.* foot.* toe.*", "shoulder.* upper_arm.* forearm.* hand.*", _UPPER
    ),
    Profile("Rigify", "hips", "head", "thigh.* shin.* foot.* toe.*", "shoulder.* upper_arm.* forearm.* hand.*", _UPPER),
    Profile("Biped", "Pelvis", "Head", "*Thigh *Calf *Foot *Toe0", "*Clavicle *UpperArm *Forearm *Hand", _UPPER),
)

_PREFIX = re.compile(
    r"^(?:mixamorig\d*[_\-. ]*|[mf]_avg_|(?:def|org)[_\-. ]+|bip\d+[_\-. ]+|character\d+_|cc_base_"
    r"|valvebiped[.](?:bip\d+_)?)",
    re.IGNORECASE,
)


def bare(name: str) -> str:
    """A joint name without namespace and rig prefix: "mixamorig:LeftUpLeg" becomes "LeftUpLeg"."""
    name = re.split(r"[:|]", name)[-1].strip()
    return _PREFIX.sub("", name) or name


def plain(name: str) -> str:
    """:func:`bare` without separators and case: "DEF-thigh.L" becomes "thighl"."""
    return re.sub(r"[^a-z0-9]", "", bare(name).lower())
