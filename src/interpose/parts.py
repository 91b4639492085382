"""Which parts of a target pose are given: joints, groups of joints, or only its place on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from interpose.errors import InputError
from interpose.skeleton import HUMANOID, LEG_BONES

GROUND = "ground"
_LEGS = tuple(side + bone for side in ("Left", "Right") for bone in LEG_BONES)
GROUPS: dict[str, tuple[str, ...]] = {
    "hips": ("Hips",),
    "hands": ("LeftHand", "RightHand"),
    "left-hand": ("LeftHand",),
    "right-hand": ("RightHand",),
    "feet": ("LeftFoot", "LeftToe", "RightFoot", "RightToe"),
    "left-foot": ("LeftFoot", "LeftToe"),
    "right-foot": ("RightFoot", "RightToe"),
    "head": ("Head",),
    "upper": tuple(name for name in HUMANOID.names if name not in ("Hips", *_LEGS)),
    "lower": ("Hips", *_LEGS),
}
"""The joints that each group stands for."""


@dataclass(frozen=True)
class Parts:
    """The given parts of a target pose. joints: indices of the 22, ascending, each given with its position and
    rotation. ground: whether the hips' place on the ground and their facing are given."""

    joints: tuple[int, ...]
    ground: bool = False

    def __str__(self) -> str:
        """The text that :func:`parse` reads."""
        return ",".join([HUMANOID.names[joint] for joint in self.joints] + [GROUND] * self.ground)

    @property
    def whole(self) -> bool:
        """Whether the whole pose is given."""
        return len(self.joints) == len(HUMANOID)

    @property
    def known(self) -> Bool[ndarray, "22"]:
        """A mask of the given joints."""
        return np.isin(np.arange(len(HUMANOID)), self.joints)


def parse(text: str) -> Parts:
    """The parts named in a list such as `hips,left-hand`. Raises InputError for an empty list or an unknown name."""
    joints: set[int] = set()
    names = [name.strip() for name in text.split(",")]
    by_name = {name.lower(): name for name in HUMANOID.names}
    for name in names:
        if name.lower() == GROUND:
            continue
        found = GROUPS.get(name.lower(), (by_name.get(name.lower(), ""),))
        if found == ("",):
            raise InputError(
                f"there is no target joint '{name}'; give {', '.join(GROUPS)}, {GROUND}, or joints of the 22, such as "
                f"{', '.join(HUMANOID.names[:3])}, separated by commas"
            )
        joints |= {HUMANOID.index(each) for each in found}
    return Parts(tuple(sorted(joints)), any(name.lower() == GROUND for name in names))
