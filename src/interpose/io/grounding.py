"""The skeleton, size and floor of a motion without bone lengths.

AMASS leaves bone lengths to a body model that is not used here, Human3.6M's exponential maps to another file. Their
readers pose a skeleton of our own, and :func:`grounded` scales it: a standing foot does not move, so the size is right
where the root's motion cancels the foot's motion relative to the root. The floor is under the lowest toes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from interpose.motion import Motion, SourceLayout, velocities
from interpose.skeleton import Skeleton

TOE_HEIGHT = 0.017
"""Metres from the floor to the toe joint (the ball of the foot) of a standing foot of our skeletons' size."""

STILL_SPEED = 0.15
"""m/s; a slower toe is on the floor or held."""

SIZE_RANGE = (0.75, 1.3)
"""Accepted sizes, from a child to a tall adult, as multiples of our skeletons'."""

_STANDING_SPEED = 0.4  # m/s; a faster toe does not stand, however wrong the size is
_SWEEPING_SPEED = 0.3  # m/s relative to the root: a standing toe shows the size only while the root moves over it
_LOW_HEIGHT = 0.1  # metres above the lowest toe positions
_NEEDED_SECONDS = 0.5  # of such toes
_LARGEST_RESIDUAL = 0.3  # share of the toes' speed relative to the root
_ROUNDS = 10


@dataclass(frozen=True)
class UnitLayout:
    """The unit of a file whose frames cannot be written back; see :class:`~interpose.motion.SourceLayout`."""

    metres_per_unit: float
    nbytes: int = 0

    def joined(self, frame: int, other: SourceLayout | None, other_frame: int) -> tuple[UnitLayout, bool]:
        """No row of either file."""
        return self, False


def skeleton_of(joints: Sequence[tuple[str, str | None, tuple[float, float, float]]]) -> Skeleton:
    """A skeleton from each joint's name, its parent's name (None for the root) and its offset, metres."""
    names = tuple(name for name, _, _ in joints)
    parents = tuple(-1 if parent is None else names.index(parent) for _, parent, _ in joints)
    return Skeleton(names, parents, np.array([offset for _, _, offset in joints]))


def grounded(motion: Motion, toes: Sequence[int]) -> Motion:
    """The motion on a skeleton of the performer's size, the floor at y = 0. The root path on the ground is kept.

    motion: Y up. toes: the toe joints. The floor is under the 5th percentile of the heights of still toes, so that a
    few bad frames do not raise the clip; where no toe is ever still, of the lower toe's heights.
    """
    factor = size(motion, toes)
    scaled = replace(motion, skeleton=replace(motion.skeleton, offsets=motion.skeleton.offsets * factor))
    points = scaled.global_positions()[:, list(toes)]
    still = np.linalg.norm(velocities(points, motion.rate), axis=-1) < STILL_SPEED
    heights = points[still, 1] if still.any() else points[..., 1].min(axis=1)
    floor = float(np.percentile(heights, 5.0)) - factor * TOE_HEIGHT
    return replace(scaled, root_positions=scaled.root_positions - np.array([0.0, floor, 0.0]))


def size(motion: Motion, toes: Sequence[int]) -> float:
    """The performer's size as a multiple of the skeleton's, within :data:`SIZE_RANGE`; 1 where the feet do not show it.

    Least squares over the frames in which a low toe nearly stands while the root moves over it: there the root's
    velocity is minus the size times the toe's velocity relative to the root.
    """
    points = motion.global_positions()[:, list(toes)]
    relative = velocities(points - motion.root_positions[:, None], motion.rate)
    root = np.broadcast_to(velocities(motion.root_positions, motion.rate)[:, None], relative.shape)
    low = points[..., 1] < np.percentile(points[..., 1], 5.0) + _LOW_HEIGHT
    sweeping = low & (np.linalg.norm(relative, axis=-1) > _SWEEPING_SPEED)
    found = 1.0
    for _ in range(_ROUNDS):
        standing = sweeping & (np.linalg.norm(root + found * relative, axis=-1) < _STANDING_SPEED)
        if np.count_nonzero(standing) < _NEEDED_SECONDS * motion.rate:
            return 1.0
        root_velocity, toe_velocity = root[standing], relative[standing]
        found = float(np.clip(-np.sum(root_velocity * toe_velocity) / np.sum(toe_velocity**2), *SIZE_RANGE))
        residual = np.sum((root_velocity + found * toe_velocity) ** 2) / np.sum((found * toe_velocity) ** 2)
        if residual > _LARGEST_RESIDUAL**2:
            return 1.0
    return found
