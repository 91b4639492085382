"""Rotations for NumPy: unit quaternions, scalar last (x, y, z, w), as arrays of shape (..., 4). Angles are radians.

A quaternion named ``q_ab`` turns vectors of frame b into frame a, and ``multiply(q_ab, q_bc)`` is ``q_ac``.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.transform import Rotation

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
UP, FORWARD = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
"""The world's axes: Y is up; a T-pose faces +Z, its left at +X."""


def multiply(a: Float[ndarray, "*#batch 4"], b: Float[ndarray, "*#batch 4"]) -> Float[ndarray, "*batch 4"]:
    """The rotation that applies ``b`` first and then ``a``, normalised. Shapes broadcast."""
    ax, ay, az, aw = np.moveaxis(a, -1, 0)
    bx, by, bz, bw = np.moveaxis(b, -1, 0)
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))  # SciPy's product is several times slower for few joints
    out[..., 0] = aw * bx + ax * bw + ay * bz - az * by
    out[..., 1] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 2] = aw * bz + ax * by - ay * bx + az * bw
    out[..., 3] = aw * bw - ax * bx - ay * by - az * bz
    return out / np.sqrt(np.sum(out * out, axis=-1, keepdims=True))


def inverse(q: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch 4"]:
    """The inverse rotation: the conjugate of a unit quaternion."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def unit(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3"]:
    """Vectors at length one; the zero vector stays."""
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)


def rotate(q: Float[ndarray, "*#batch 4"], v: Float[ndarray, "*#batch 3"]) -> Float[ndarray, "*batch 3"]:
    """The vectors ``v`` turned by ``q``. Shapes broadcast."""
    return np.squeeze(to_matrix(q) @ v[..., None], axis=-1)


def to_matrix(q: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch 3 3"]:
    """Rotation matrices that multiply column vectors."""
    return Rotation.from_quat(q).as_matrix()


def from_matrix(m: Float[ndarray, "*batch 3 3"]) -> Float[ndarray, "*batch 4"]:
    """Quaternions of rotation matrices; one that is not quite orthogonal gives the nearest rotation."""
    return Rotation.from_matrix(m).as_quat()


def to_6d(q: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch 6"]:
    """The first two columns of the rotation matrix, concatenated (Zhou et al. 2019, `On the Continuity of Rotation
    Representations in Neural Networks`)."""
    m = to_matrix(q)
    return np.concatenate([m[..., :, 0], m[..., :, 1]], axis=-1)


def from_6d(x: Float[ndarray, "*batch 6"]) -> Float[ndarray, "*batch 4"]:
    """Quaternions from any two independent vectors by Gram-Schmidt (Zhou et al. 2019, section B)."""
    a, b = x[..., :3], x[..., 3:]
    first = a / np.linalg.norm(a, axis=-1, keepdims=True)
    b = b - np.sum(first * b, axis=-1, keepdims=True) * first
    second = b / np.linalg.norm(b, axis=-1, keepdims=True)
    whole = np.stack([first, second, np.cross(first, second)], axis=-1)
    return Rotation.from_matrix(whole, assume_valid=True).as_quat()


def to_rotation_vector(q: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch 3"]:
    """Axis times angle, the angle in [0, pi]."""
    return Rotation.from_quat(q).as_rotvec()


def from_rotation_vector(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 4"]:
    """The rotation by ``|v|`` radians about ``v``."""
    return Rotation.from_rotvec(v).as_quat()


def angle(q: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch"]:
    """The angle of the rotation ``q``, in [0, pi]."""
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(q[..., :3], axis=-1), np.abs(q[..., 3])))


def wrapped(turn: Float[ndarray, "*batch"] | float) -> Float[ndarray, "*batch"]:
    """An angle without its whole turns, in [-pi, pi)."""
    return np.asarray(np.remainder(np.asarray(turn) + np.pi, 2.0 * np.pi) - np.pi)


def slerp(
    a: Float[ndarray, "*#batch 4"], b: Float[ndarray, "*#batch 4"], t: Float[ndarray, "*#batch"]
) -> Float[ndarray, "*batch 4"]:
    """Spherical interpolation along the shorter arc; ``t = 0`` gives ``a`` and ``t = 1`` gives ``b`` (up to sign)."""
    step = to_rotation_vector(multiply(inverse(a), b)) * np.asarray(t)[..., None]
    return multiply(a, from_rotation_vector(step))


def twist(q: Float[ndarray, "*batch 4"], axis: Float[ndarray, "3"]) -> Float[ndarray, "*batch 4"]:
    """The part of ``q`` that turns about ``axis``, so that ``q = swing * twist``.

    Undefined where ``q`` is half a turn about an axis perpendicular to ``axis``; the identity is returned there.
    """
    axis = axis / np.linalg.norm(axis)
    along = np.sum(q[..., :3] * axis, axis=-1, keepdims=True)
    part = np.concatenate([along * axis, q[..., 3:]], axis=-1)
    norm = np.linalg.norm(part, axis=-1, keepdims=True)
    return np.where(norm > 1e-9, part / np.maximum(norm, 1e-9), IDENTITY)


def between(a: Float[ndarray, "*#batch 3"], b: Float[ndarray, "*#batch 3"]) -> Float[ndarray, "*batch 4"]:
    """The smallest rotation from the direction of ``a`` to that of ``b``; opposite ones turn about any normal."""
    a = a / np.linalg.norm(a, axis=-1, keepdims=True)
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    a, b = np.broadcast_arrays(a, b)
    w = 1.0 + np.sum(a * b, axis=-1, keepdims=True)
    helper = np.where(np.abs(a[..., :1]) > 0.9, UP, np.array([1.0, 0.0, 0.0]))
    normal = np.cross(a, helper)
    q = np.where(w > 1e-14, np.concatenate([np.cross(a, b), w], -1), np.concatenate([normal, np.zeros_like(w)], -1))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def continuous(q: Float[ndarray, "frame *batch 4"]) -> Float[ndarray, "frame *batch 4"]:
    """The same rotations, their signs chosen so that consecutive frames lie in the same hemisphere."""
    flips = np.sum(q[1:] * q[:-1], axis=-1) < 0
    sign = np.concatenate([np.ones((1, *flips.shape[1:])), 1.0 - 2.0 * (np.cumsum(flips, axis=0) % 2)])
    return q * sign[..., None]
