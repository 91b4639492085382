"""Poses as the browser has them, rows of 32-bit floats, and as the library has them: see `protocol`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float32
from numpy import ndarray

from interpose.errors import InputError
from interpose.motion import Motion

UNIT = 1e-2
"""By how much the length of a quaternion from the browser may differ from one."""
FARTHEST = 1e5
"""Metres from the origin at most, for a root or for the place of a joint."""


def width(motion: Motion) -> int:
    """Floats of one pose of the rig of a motion."""
    return 3 + (4 if motion.translations is None else 7) * len(motion.skeleton)


def of_motion(motion: Motion) -> Float32[ndarray, "frame row"]:
    """A row a frame."""
    parts = [motion.root_positions, motion.local_rotations.reshape(len(motion), -1)]
    if motion.translations is not None:
        parts.append(motion.translations.reshape(len(motion), -1))
    return np.concatenate(parts, axis=1).astype(np.float32)


def to_motion(rows: ndarray, like: Motion, what: str) -> Motion:
    """The poses of some rows, with the rig, rate and layout of ``like``; ``what`` names them in messages.

    Raises InputError where they are not rows of that rig, a quaternion is far from one, or a place is out of reach.
    """
    wide = width(like)
    if rows.ndim != 2 or rows.shape[1] != wide or not len(rows):
        raise InputError(
            f"{what} has the shape {'x'.join(map(str, rows.shape))}; a pose of this rig has {wide} numbers, in a row a "
            f"frame and at least one"
        )
    held = rows.astype(float)
    joints = len(like.skeleton)
    root, turned = held[:, :3], held[:, 3 : 3 + 4 * joints].reshape(len(held), joints, 4)
    moved = None if like.translations is None else held[:, 3 + 4 * joints :].reshape(len(held), joints, 3)
    for places in (root, moved):
        if places is not None and not np.abs(places).max() <= FARTHEST:
            raise InputError(f"{what} has a joint that is more than {FARTHEST:.0f} m away; bring it nearer")
    lengths = np.linalg.norm(turned, axis=-1)
    wrong = np.argwhere(~(np.abs(lengths - 1.0) <= UNIT))
    if len(wrong):
        frame, joint = wrong[0].tolist()
        raise InputError(
            f"{what}: the rotation of {like.skeleton.names[joint]} in frame {frame} has the length "
            f"{lengths[frame, joint]:.3g}; a quaternion of a rotation has the length 1"
        )
    if moved is not None:
        moved[:, 0] = root
    return replace(like, root_positions=root, local_rotations=turned / lengths[..., None], translations=moved)
