"""The humanoid's joints in a skeleton: by a profile's names, by similar names, or by the hierarchy."""

from __future__ import annotations

import re
from dataclasses import dataclass

from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget import hierarchy
from interpose.retarget.profiles import PROFILES, Profile, bare, plain
from interpose.skeleton import HUMANOID, Skeleton

REQUIRED = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")

_SYNONYMS = {
    "Hips": "hips hip pelvis cog root",
    "Head": "head",
    "UpLeg": "upleg upperleg thigh upperthigh femur hip legupper",
    "Leg": "leg lowerleg shin calf knee tibia leglower",
    "Foot": "foot ankle",
    "Toe": "toe toes toebase ball toe0 forefoot",
    "Shoulder": "collar clavicle collarbone scapula shoulder",
    "Arm": "arm upperarm uparm shldr humerus shoulder armupper",
    "ForeArm": "forearm lowerarm loarm elbow radius armlower",
    "Hand": "hand wrist palm",
}
_SIDED_NAMES = {name for role, names in _SYNONYMS.items() if role not in ("Hips", "Head") for name in names.split()}


@dataclass(frozen=True)
class NamedJoints:
    """The humanoid in a skeleton. known: the profile, where one fits. joints, torso: as in `mapping.Mapping`."""

    profile: str
    known: Profile | None
    joints: tuple[int | None, ...]
    torso: tuple[int, ...]


def find(skeleton: Skeleton, motion: Motion | None = None) -> NamedJoints:
    """The joints of the best profile, else those with similar names, else those found by the hierarchy.

    Raises InputError, naming the hips or leg joints that are missing.
    """
    candidates = [(profile, _by_profile(skeleton, profile)) for profile in PROFILES]
    fitting = [(profile, limbs) for profile, limbs in candidates if _usable(skeleton, limbs)]
    if fitting:
        known, limbs = max(fitting, key=lambda fit: len(fit[1]) + bool(fit[0].mark))
        return _complete(skeleton, known.name, known, limbs)
    similar = _by_synonyms(skeleton)
    if _usable(skeleton, similar):
        return _complete(skeleton, "similar names", None, similar)
    named = sum(name in similar for name in REQUIRED)
    guessed = hierarchy.guess(skeleton, motion)
    if guessed is not None and named < len(REQUIRED) / 2:
        return _complete(skeleton, "hierarchy", None, guessed)
    lacking = [name for name in REQUIRED if name not in similar] or ["legs that hang below the hips"]
    names = ", ".join(skeleton.names[:6]) + (", …" if len(skeleton) > 6 else "")
    raise InputError(
        f"no humanoid was found in the skeleton ({names}): missing {', '.join(lacking)}; "
        "hips with two legs of thigh, shin and foot are needed"
    )


def split_side(name: str) -> tuple[str, str]:
    """The side ("Left", "Right" or "") and the rest of a joint's name: "L_Thigh", "thigh.l" and "LeftThigh" are the
    same."""
    tokens = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", bare(name))
    for spelled, side in (("left", "Left"), ("right", "Right"), ("l", "Left"), ("r", "Right")):
        for position in (0, -1):
            if tokens and tokens[position].lower() == spelled:
                del tokens[position]
                return side, "".join(tokens).lower()
    joined = "".join(tokens).lower()
    if joined[1:] in _SIDED_NAMES and joined[0] in "lr":
        return ("Left" if joined[0] == "l" else "Right"), joined[1:]
    for spelled, side in (("left", "Left"), ("right", "Right")):
        if joined.startswith(spelled):
            return side, joined[len(spelled) :]
    return "", joined


def _by_profile(skeleton: Skeleton, profile: Profile) -> dict[str, int]:
    index: dict[str, int] = {}
    for joint, name in sorted(enumerate(skeleton.names), key=lambda item: item[1].upper().startswith("ORG")):
        index.setdefault(plain(name), joint)
    if profile.mark and plain(profile.mark) not in index:
        return {}
    return {ours: index[plain(theirs)] for ours, theirs in profile.joints().items() if plain(theirs) in index}


def _by_synonyms(skeleton: Skeleton) -> dict[str, int]:
    sided: dict[tuple[str, str], int] = {}
    for joint, name in enumerate(skeleton.names):
        sided.setdefault(split_side(name), joint)
    found: dict[str, int] = {}
    for role, names in _SYNONYMS.items():
        for side in ("",) if role in ("Hips", "Head") else ("Left", "Right"):
            joints = [sided[side, name] for name in names.split() if (side, name) in sided]
            joint = next((joint for joint in joints if joint not in found.values()), None)
            if joint is not None:
                found[side + role] = joint
    for side in ("Left", "Right"):  # a lone "shoulder" is the upper arm, as rigs may lack a collar
        if side + "Arm" not in found and side + "Shoulder" in found and side + "ForeArm" in found:
            found[side + "Arm"] = found.pop(side + "Shoulder")
    return found


def _usable(skeleton: Skeleton, limbs: dict[str, int]) -> bool:
    """Whether hips and legs exist, and each limb's joints descend from one another and from the hips."""
    if any(name not in limbs for name in REQUIRED) or len(set(limbs.values())) < len(limbs):
        return False
    for name, joint in limbs.items():
        above = HUMANOID.parents[HUMANOID.index(name)]
        while above >= 0 and HUMANOID.names[above] not in limbs:
            above = HUMANOID.parents[above]
        if above >= 0 and limbs[HUMANOID.names[above]] not in _ancestors(skeleton, joint):
            return False
    return True


def _ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints above, nearest first."""
    out = []
    while (joint := skeleton.parents[joint]) >= 0:
        out.append(joint)
    return out


def _complete(skeleton: Skeleton, name: str, known: Profile | None, limbs: dict[str, int]) -> NamedJoints:
    """Adds spine and neck, the joints between the hips and the arms or the head.

    The spine's last joint is Spine2, the first of two or more Spine, and the middle one of three or more Spine1
    (100STYLE's Chest, Chest2, Chest4). The neck's first joint is Neck.
    """
    limbs = dict(limbs)

    def above(joint: int) -> list[int]:
        ancestors = _ancestors(skeleton, joint)
        return ancestors[: ancestors.index(limbs["Hips"])][::-1]

    tops = [limbs[s + "Shoulder"] if s + "Shoulder" in limbs else limbs.get(s + "Arm") for s in ("Left", "Right")]
    arms = [above(joint) for joint in tops if joint is not None]
    head = above(limbs["Head"]) if "Head" in limbs else []
    chains = arms or [head[:-1] or head]  # without arms the joint below the head counts as the neck
    spine = [joint for joint in chains[0] if all(joint in chain for chain in chains)]
    if spine:
        limbs["Spine2"] = spine[-1]
    if len(spine) > 1:
        limbs["Spine"] = spine[0]
    if len(spine) > 2:
        limbs["Spine1"] = spine[(len(spine) - 1) // 2]
    neck = [joint for joint in head if joint not in spine]
    if neck:
        limbs["Neck"] = neck[0]
    torso = tuple(joint for joint in (*spine, *neck) if joint not in limbs.values())
    return NamedJoints(name, known, tuple(limbs.get(ours) for ours in HUMANOID.names), torso)
