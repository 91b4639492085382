"""Find the humanoid's joints in a skeleton: by names where a profile fits, by the hierarchy where none does."""

from __future__ import annotations

import re
from dataclasses import dataclass

from interpose.errors import InputError
from interpose.retarget import hierarchy
from interpose.retarget.profiles import PROFILES, Profile, bare, plain
from interpose.skeleton import HUMANOID, Skeleton

REQUIRED = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")
_LIMB_ENDS = ("Head", "LeftHand", "RightHand", "LeftForeArm", "RightForeArm", "LeftArm", "RightArm")


@dataclass(frozen=True)
class Found:
    """joints: for each of the 22 the source joint or None. torso: unmapped joints between mapped ones of spine or neck."""

    profile: str
    known: Profile | None
    joints: tuple[int | None, ...]
    torso: tuple[int, ...]


def find(skeleton: Skeleton) -> Found:
    """The best profile's joints; else those of similar names; else those that the hierarchy and rest pose suggest.

    Raises InputError naming the hips or leg joints that cannot be found.
    """
    best: tuple[int, Profile, dict[str, int]] | None = None
    for profile in PROFILES:
        limbs = _by_profile(skeleton, profile)
        if (
            all(name in limbs for name in REQUIRED)
            and _consistent(skeleton, limbs)
            and (best is None or len(limbs) > best[0])
        ):
            best = (len(limbs), profile, limbs)
    if best is not None:
        return _complete(skeleton, best[1].name, best[1], best[2])
    limbs = _by_synonyms(skeleton)
    if all(name in limbs for name in REQUIRED) and _consistent(skeleton, limbs):
        return _complete(skeleton, "similar names", None, limbs)
    guessed = hierarchy.guess(skeleton)
    if guessed is not None:
        return _complete(skeleton, "hierarchy", None, guessed)
    lacking = [name for name in REQUIRED if name not in limbs] or list(REQUIRED)
    raise InputError(
        f"no humanoid was found in the skeleton ({', '.join(skeleton.names[:6])}{', …' if len(skeleton) > 6 else ''}): "
        f"missing {', '.join(lacking)}; hips with two whole legs are needed"
    )


def _by_profile(skeleton: Skeleton, profile: Profile) -> dict[str, int]:
    index: dict[str, int] = {}
    for joint, name in enumerate(skeleton.names):
        index.setdefault(plain(name), joint)
    return {ours: index[plain(theirs)] for ours, theirs in profile.joints().items() if plain(theirs) in index}


_SYNONYMS = {
    "Hips": "hips hip pelvis root cog",
    "Head": "head",
    "UpLeg": "upleg upperleg thigh upperthigh hip hipjoint legupper femur",
    "Leg": "leg lowerleg knee shin calf leglower tibia",
    "Foot": "foot ankle feet",
    "Toe": "toe toes toebase ball toe0 forefoot",
    "Shoulder": "shoulder collar clavicle collarbone scapula",
    "Arm": "arm upperarm shoulder shldr armupper humerus uparm",
    "ForeArm": "forearm lowerarm elbow armlower radius loarm",
    "Hand": "hand wrist palm",
}


def _by_synonyms(skeleton: Skeleton) -> dict[str, int]:
    sided: dict[tuple[str, str], int] = {}
    for joint, name in enumerate(skeleton.names):
        side, part = split_side(name)
        sided.setdefault((side, part), joint)
    found: dict[str, int] = {}
    for role, words in _SYNONYMS.items():
        for side in ("",) if role in ("Hips", "Head") else ("Left", "Right"):
            for word in words.split():
                joint = sided.get((side, word))
                if joint is not None and joint not in found.values():
                    found[side + role] = joint
                    break
    return found


def split_side(name: str) -> tuple[str, str]:
    """("Left", "Right" or "", the rest of the name, plain): "L_Thigh", "thigh.l" and "LeftThigh" give the same."""
    words = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", bare(name))
    for spelled, side in (("left", "Left"), ("right", "Right"), ("l", "Left"), ("r", "Right")):
        for position in (0, -1):
            if words and words[position].lower() == spelled:
                del words[position]
                return side, "".join(words).lower()
    return "", "".join(words).lower()


def _consistent(skeleton: Skeleton, limbs: dict[str, int]) -> bool:
    """Whether every limb's joints hang below one another and below the hips."""
    for name, joint in limbs.items():
        above = HUMANOID.parents[HUMANOID.index(name)]
        while above >= 0 and HUMANOID.names[above] not in limbs:
            above = HUMANOID.parents[above]
        if above >= 0 and limbs[HUMANOID.names[above]] not in ancestors(skeleton, joint):
            return False
    return True


def ancestors(skeleton: Skeleton, joint: int) -> list[int]:
    """The joints above, nearest first."""
    out = []
    while (joint := skeleton.parents[joint]) >= 0:
        out.append(joint)
    return out


def _complete(skeleton: Skeleton, name: str, known: Profile | None, limbs: dict[str, int]) -> Found:
    """Add spine and neck, which lie between the hips and the arms or the head."""
    hips = limbs["Hips"]

    def chain(joint: int) -> list[int]:
        line = [joint, *ancestors(skeleton, joint)]
        return line[: line.index(hips)][::-1] if hips in line else []

    limbs = dict(limbs)
    arms = [c for s in ("Left", "Right") if (a := limbs.get(s + "Shoulder", limbs.get(s + "Arm"))) and (c := chain(a))]
    torso: list[int] = []
    if arms or "Head" in limbs:
        head = chain(limbs["Head"]) if "Head" in limbs else []
        lines = [line[:-1] for line in arms] or [head[:-1]]
        spine = _shared(lines)
        if not arms and len(spine) > 1:
            spine = spine[:-1]  # without arms the last joint below the head is taken for the neck
        if spine:
            limbs["Spine2"] = spine[-1]
        if len(spine) > 1:
            limbs["Spine"] = spine[0]
        if len(spine) > 2:
            limbs["Spine1"] = spine[(len(spine) - 1) // 2]
        neck = [joint for joint in head[:-1] if joint not in spine]
        if neck:
            limbs["Neck"] = neck[0]
        torso = [joint for joint in (*spine, *neck) if joint not in limbs.values()]
    joints = tuple(limbs.get(ours) for ours in HUMANOID.names)
    return Found(name, known, joints, tuple(torso))


def _shared(lines: list[list[int]]) -> list[int]:
    first = lines[0]
    return [joint for joint in first if all(joint in line for line in lines)]
