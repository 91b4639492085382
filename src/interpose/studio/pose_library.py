"""The bundled poses, on any humanoid rig."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from interpose import retarget
from interpose.demo import poses
from interpose.demo.poses import DemoPose
from interpose.motion import Motion, concatenate
from interpose.studio.rigs import Clip

POSES: dict[str, DemoPose] = {
    "Stand": poses.STAND,
    "Walk, left foot": poses.WALK_LEFT,
    "Walk, right foot": poses.WALK_RIGHT,
    "Run, left foot": poses.RUN_LEFT,
    "Run, right foot": poses.mirrored(poses.RUN_LEFT),
    "Wary": poses.WARY,
    "Aeroplane": poses.AEROPLANE,
    "Angry": poses.ANGRY,
    "Drunk": poses.DRUNK,
    "Chicken": poses.CHICKEN,
    "Karate": poses.KARATE,
}
"""By the name shown in the studio."""


def posed(clip: Clip) -> Motion:
    """One frame for each of :data:`POSES` on the rig: on the floor, hips above the origin, facing +Z.

    Joints beyond the 22, such as fingers, are as in the file's first frame. Raises InputError if the rig is not a
    humanoid.
    """
    mapping, like = clip.humanoid, clip.motion[0]
    like = replace(like, root_positions=np.zeros((1, 3)))
    if like.translations is not None:
        places = like.translations.copy()
        places[:, 0] = 0.0
        like = replace(like, translations=places)
    on_rig = retarget.from_humanoid(_stood(), mapping, like)
    away = on_rig.global_positions()[:, mapping.hips] * [1.0, 0.0, 1.0]
    moved = on_rig.translations
    if moved is not None:
        moved = moved.copy()
        moved[:, 0] -= away
    return replace(on_rig, root_positions=on_rig.root_positions - away, translations=moved, rate=clip.motion.rate)


@cache
def _stood() -> Motion:
    """The poses on the 22 joints. Placing them on the floor takes a tenth of a second."""
    return concatenate(*(poses.pose(one) for one in POSES.values()))
