"""What a file of joint rotations leaves open when it says nothing of the body: how large it is, and where its floor is.

AMASS gives joint rotations and the root's way, and leaves the bone lengths to a body model that we do not have;
Human3.6M's exponential maps leave them to another file. Their readers pose a skeleton of our own, and :func:`grounded`
fits it: a foot that stands does not move, so the size is right where the root's way cancels the foot's way about it,
and the floor is under the lowest toes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from interpose.motion import Motion, velocities

TOE_HEIGHT = 0.017
"""Metres from the floor to the toe joint (the ball of the foot) of a standing foot of our skeletons' size."""

STILL = 0.15
"""m/s: a toe that moves slower stands, or is held."""

SIZES = (0.75, 1.3)
"""The sizes that are believed: from a child to a tall adult, as a share of our skeletons'."""

_STANDING = 0.4  # m/s: a toe that moves faster does not stand, however wrong the size is
_SWEEPING = 0.3  # m/s about the root: a standing toe tells the size only while the root moves over it
_LOW = 0.1  # metres above the lowest places of the toes
_SECONDS = 0.5  # of such toes that are needed
_UNEXPLAINED = 0.3  # share of the toes' speed about the root that may be left over
_ROUNDS = 10


def grounded(motion: Motion, toes: Sequence[int]) -> Motion:
    """The motion on a skeleton of the performer's size, its floor at y = 0. The root's way on the ground is kept.

    motion: Y up. toes: the toe joints. The floor is under the 5th percentile of the heights at which a toe is still, so
    that a few bad frames do not raise the clip, and of all heights of the lower toe where none ever is.
    """
    factor = size(motion, toes)
    sized = resized(motion, factor)
    points = sized.global_positions()[:, list(toes)]
    still = np.linalg.norm(velocities(points, motion.rate), axis=-1) < STILL
    heights = points[still, 1] if still.any() else points[..., 1].min(axis=1)
    floor = float(np.percentile(heights, 5.0)) - factor * TOE_HEIGHT
    return replace(sized, root_positions=sized.root_positions - np.array([0.0, floor, 0.0]))


def resized(motion: Motion, factor: float) -> Motion:
    """The same poses on a skeleton ``factor`` times as large; the root's way stays as it is."""
    return replace(motion, skeleton=replace(motion.skeleton, offsets=motion.skeleton.offsets * factor))


def size(motion: Motion, toes: Sequence[int]) -> float:
    """How many times as large as its skeleton the performer is, within :data:`SIZES`; 1 where the feet do not tell.

    Least squares over the frames in which a low toe nearly stands while the root moves over it: there the root's
    velocity is minus the size times the toe's velocity about the root.
    """
    points = motion.global_positions()[:, list(toes)]
    about = velocities(points - motion.root_positions[:, None], motion.rate)
    root = np.broadcast_to(velocities(motion.root_positions, motion.rate)[:, None], about.shape)
    low = points[..., 1] < np.percentile(points[..., 1], 5.0) + _LOW
    sweeping = low & (np.linalg.norm(about, axis=-1) > _SWEEPING)
    found = 1.0
    for _ in range(_ROUNDS):
        standing = sweeping & (np.linalg.norm(root + found * about, axis=-1) < _STANDING)
        if np.count_nonzero(standing) < _SECONDS * motion.rate:
            return 1.0
        way, turn = root[standing], about[standing]
        found = float(np.clip(-np.sum(way * turn) / np.sum(turn * turn), *SIZES))
        left = np.sum((way + found * turn) ** 2) / np.sum((found * turn) ** 2)
        if left > _UNEXPLAINED**2:
            return 1.0
    return found
