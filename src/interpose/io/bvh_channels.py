"""Converts BVH channel values (degrees, the file's unit) to poses and back.

A joint's rotation is the product of its rotation channels in file order: ``Zrotation Yrotation Xrotation`` means
``R = Rz Ry Rx`` (intrinsic ZYX). A position channel replaces the joint's OFFSET on its axis; it is not affected by the
joint's own rotation, in any channel order.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial.transform import Rotation

from interpose import rotation
from interpose.io.bvh_layout import BvhLayout

_AXES = "XYZ"


def decode(
    layout: BvhLayout, values: Float[ndarray, "frame channel"]
) -> tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame joint 4"], Float[ndarray, "frame joint 3"] | None]:
    """Root positions, local rotations and translations (see :class:`~interpose.motion.Motion`) of rows of channels."""
    frames, joints = len(values), len(layout.channels)
    root = np.tile(layout.offsets[0], (frames, 1))
    translations = np.tile(layout.offsets, (frames, 1, 1)) if layout.has_joint_positions else None
    for joint, axis, column in _position_columns(layout):
        metres = values[:, column] * layout.metres_per_unit
        if joint == 0:
            root[:, axis] = metres
        if translations is not None:
            translations[:, joint, axis] = metres
    rotations = np.empty((frames, joints, 4))
    for order, (members, columns) in _rotation_groups(layout).items():
        rotations[:, members] = _compose(order, values, columns)
    return root, rotations, translations


def encode(
    layout: BvhLayout,
    root: Float[ndarray, "frame 3"],
    rotations: Float[ndarray, "frame joint 4"],
    translations: Float[ndarray, "frame joint 3"] | None,
    previous: Float[ndarray, "channel"],
) -> Float[ndarray, "frame channel"]:
    """Rows of channels, the inverse of :func:`decode`, with the Euler angles closest to the previous row.

    ``previous`` is the row before the first. What a joint's channels cannot express is left out: a
    joint with one rotation channel keeps its twist about that axis, one with two channels the closest such pair.
    """
    values = np.empty((len(root), layout.channel_count))
    positions = layout.skeleton.offsets[None] if translations is None else translations
    for joint, axis, column in _position_columns(layout):
        metres = root[:, axis] if joint == 0 else positions[:, joint, axis]
        values[:, column] = metres / layout.metres_per_unit
    for order, (members, columns) in _rotation_groups(layout).items():
        if order:
            values[:, columns] = _nearest_angles(order, rotations[:, members], previous[columns])
    return values


def _position_columns(layout: BvhLayout) -> list[tuple[int, int, int]]:
    flat = [(joint, name) for joint, names in enumerate(layout.channels) for name in names]
    return [(j, _AXES.index(name[0]), column) for column, (j, name) in enumerate(flat) if name.endswith("position")]


def _rotation_groups(layout: BvhLayout) -> dict[str, tuple[list[int], Int[ndarray, "joint axis"]]]:
    # The joints of each rotation order, such as "ZYX", and the columns of their angles.
    groups: dict[str, tuple[list[int], list[list[int]]]] = defaultdict(lambda: ([], []))
    first = 0
    for joint, names in enumerate(layout.channels):
        turns = [(name[0], first + i) for i, name in enumerate(names) if name.endswith("rotation")]
        members, columns = groups["".join(axis for axis, _ in turns)]
        members.append(joint)
        columns.append([column for _, column in turns])
        first += len(names)
    return {order: (members, np.array(columns, dtype=int)) for order, (members, columns) in groups.items()}


def _compose(
    order: str, values: Float[ndarray, "frame channel"], columns: Int[ndarray, "joint axis"]
) -> Float[ndarray, "frame joint 4"]:
    # The product of the quaternions about the single axes. SciPy's from_euler takes 1 us per rotation, twice as long
    # as parsing its three numbers.
    q = [np.zeros((len(values), len(columns))) for _ in range(4)]
    q[3] += 1.0
    for number, (axis, column) in enumerate(zip(order, columns.T, strict=True)):
        half = values[:, column]
        half *= np.pi / 360.0
        sine, cosine = np.sin(half), np.cos(half)
        i = _AXES.index(axis)
        j, k = (i + 1) % 3, (i + 2) % 3
        if number == 0:
            q[i], q[3] = sine, cosine
        else:
            q[i], q[3] = q[i] * cosine + q[3] * sine, q[3] * cosine - q[i] * sine
            q[j], q[k] = q[j] * cosine + q[k] * sine, q[k] * cosine - q[j] * sine
    return np.stack(q, axis=-1)


def _nearest_angles(
    order: str, rotations: Float[ndarray, "frame joint 4"], before: Float[ndarray, "joint axis"]
) -> Float[ndarray, "frame joint axis"]:
    # A rotation has two Euler triples, (a, b, c) and (a + 180, 180 - b, c + 180). The distance between the triples of
    # two frames stays the same when both are exchanged, so which one is closer is a running parity of exchanges.
    if len(order) == 1:
        axis = np.eye(3)[_AXES.index(order)]
        about = rotation.twist(rotations, axis)
        angles = np.rad2deg(2.0 * np.arctan2(about[..., :3] @ axis, about[..., 3]))[..., None]
        return np.unwrap(np.concatenate([before[None], angles]), period=360.0, axis=0)[1:]
    full = order + "".join(set(_AXES) - set(order))
    one = Rotation.from_quat(rotations).as_euler(full, degrees=True, suppress_warnings=True)
    other = np.array([180.0, 180.0, 180.0]) + one * np.array([1.0, -1.0, 1.0])
    if len(order) == 2:
        swap = np.abs(_wrap(other[..., 2])) < np.abs(_wrap(one[..., 2]))
        angles = np.where(swap[..., None], other, one)[..., :2]
    else:
        earlier = np.concatenate([before[None], one[:-1]])
        flips = np.abs(_wrap(other - earlier)).sum(-1) < np.abs(_wrap(one - earlier)).sum(-1)
        angles = np.where((np.cumsum(flips, axis=0) % 2 == 1)[..., None], other, one)
    return np.unwrap(np.concatenate([before[None], angles]), period=360.0, axis=0)[1:]


def _wrap(degrees: Float[ndarray, "*shape"]) -> Float[ndarray, "*shape"]:
    return (degrees + 180.0) % 360.0 - 180.0
