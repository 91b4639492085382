"""Converts between the browser's poses, rows of 32-bit floats as described in `protocol`, and `Motion`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from interpose.errors import InputError
from interpose.motion import Motion

UNIT_TOLERANCE = 1e-2
"""Allowed deviation of a quaternion's length from one."""
FARTHEST_JOINT = 1e5
"""Largest coordinate of a root or a joint in metres."""


def width(motion: Motion) -> int:
    """Number of floats of one pose of this motion's rig."""
    return 3 + (4 if motion.translations is None else 7) * len(motion.skeleton)


def of_motion(motion: Motion) -> Float32[ndarray, "frame row"]:
    """One row per frame."""
    parts = [motion.root_positions, motion.local_rotations.reshape(len(motion), -1)]
    if motion.translations is not None:
        parts.append(motion.translations.reshape(len(motion), -1))
    return np.concatenate(parts, axis=1).astype(np.float32)


def to_motion(rows: ndarray, like: Motion, what: str) -> Motion:
    """The poses in some rows, with the rig, rate and layout of ``like``. ``what`` names them in error messages.

    Raises InputError if they are not rows of that rig, a quaternion is not normalised, or a position is too far away.
    """
    wide = width(like)
    if rows.ndim != 2 or rows.shape[1] != wide or not len(rows):
        raise InputError(
            f"{what} has the shape {'x'.join(map(str, rows.shape))}; it needs one row of {wide} numbers per frame, and "
            f"at least one row"
        )
    held = rows.astype(float)
    joints = len(like.skeleton)
    root, turned = held[:, :3], held[:, 3 : 3 + 4 * joints].reshape(len(held), joints, 4)
    moved = None if like.translations is None else held[:, 3 + 4 * joints :].reshape(len(held), joints, 3)
    for places in (root, moved):
        if places is not None and not np.abs(places).max() <= FARTHEST_JOINT:
            raise InputError(f"{what} has a joint more than {FARTHEST_JOINT:.0f} m from the origin; move it closer")
    lengths = np.linalg.norm(turned, axis=-1)
    wrong = np.argwhere(~(np.abs(lengths - 1.0) <= UNIT_TOLERANCE))
    if len(wrong):
        frame, joint = wrong[0].tolist()
        raise InputError(
            f"{what}: the rotation of {like.skeleton.names[joint]} in frame {frame} has the length "
            f"{lengths[frame, joint]:.3g}; it must be 1"
        )
    if moved is not None:
        moved[:, 0] = root
    return replace(like, root_positions=root, local_rotations=turned / lengths[..., None], translations=moved)
