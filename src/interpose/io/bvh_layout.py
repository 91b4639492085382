"""The layout of a BVH file: what it holds besides poses, and how its channels (degrees, the file's unit) become poses.

A joint's rotation is the product of its rotation channels in file order: ``Zrotation Yrotation Xrotation`` means
``R = Rz Ry Rx`` (intrinsic ZYX). A position channel replaces the joint's OFFSET on its axis; it is not affected by the
joint's own rotation, in any channel order.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.spatial.transform import Rotation

from interpose import rotation
from interpose.motion import SourceLayout
from interpose.skeleton import Skeleton

CHANNEL_NAMES = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
_AXES = "XYZ"


@dataclass(frozen=True, eq=False)
class BvhLayout:
    """What a BVH file holds besides its poses. A motion keeps all of it when it is cut.

    skeleton: as in the Motion. offsets: (joint, 3), the OFFSET of every joint including the root, metres.
    channels: for each joint its channels in file order, e.g. ``("Xposition", "Zrotation")``.
    end_sites, end_offsets: the parent joint of each end site, and its offset (site, 3), metres.
    metres_per_unit: length of the file's unit.
    head: the file's text up to the frame count, and from there to the frame time. frame_time: the text of the number.
    encoding, newline, row_end: of the text; ``row_end`` is between a row's last number and the newline.
    decimals: digits after the point in generated rows.
    rows: the file's motion block; empty for a layout that was not read from a file.
    """

    skeleton: Skeleton
    offsets: Float[ndarray, "joint 3"]
    channels: tuple[tuple[str, ...], ...]
    end_sites: tuple[int, ...]
    end_offsets: Float[ndarray, "site 3"]
    metres_per_unit: float
    head: tuple[str, str]
    frame_time: str
    encoding: str = "utf-8"
    newline: str = "\n"
    row_end: str = ""
    decimals: int = 6
    rows: bytes = field(default=b"", repr=False)

    @property
    def channel_count(self) -> int:
        """Numbers per row."""
        return sum(map(len, self.channels))

    @property
    def has_joint_positions(self) -> bool:
        """Whether a joint other than the root has a position channel."""
        return any(name.endswith("position") for names in self.channels[1:] for name in names)

    @cached_property
    def row_bounds(self) -> Int[ndarray, "frame 2"]:
        """Where each row's text starts and ends in ``rows``, without the blanks around it."""
        printed = np.frombuffer(self.rows, np.uint8) > 32
        edges = np.flatnonzero(np.diff(printed, prepend=False, append=False))
        starts, ends = edges[0::2], edges[1::2]
        count = self.channel_count
        return np.stack([starts[::count], ends[count - 1 :: count]], axis=1)

    @property
    def nbytes(self) -> int:
        """Bytes of ``rows``."""
        return len(self.rows)

    def row(self, frame: int) -> str:
        """The text of one row of the file."""
        start, end = self.row_bounds[frame]
        return self.rows[start:end].decode("ascii")

    def joined(self, frame: int, other: SourceLayout | None, other_frame: int) -> tuple[BvhLayout, bool]:
        """See :meth:`SourceLayout.joined <interpose.motion.SourceLayout.joined>`."""
        rows = [self.row(frame)]
        if (
            isinstance(other, BvhLayout)
            and (self.channels, self.metres_per_unit) == (other.channels, other.metres_per_unit)
            and np.array_equal(self.offsets, other.offsets)
        ):
            rows.append(other.row(other_frame))
        return replace(self, rows="\n".join(rows).encode()), len(rows) == 2


def default_layout(skeleton: Skeleton, joint_positions: bool = False) -> BvhLayout:
    """The layout for a motion that is not from a BVH file: centimetres, six channels for the root, rotation order ZYX.

    With ``joint_positions`` every joint has six channels. A joint without children gets an end site at half its own
    offset. The joints must be in depth-first order. Raises ValueError for a name that BVH cannot represent.
    """
    if bad := [name for name in skeleton.names if name != name.strip() or not name or set(name) & set("{}\r\n")]:
        raise ValueError(f"BVH cannot hold the joint name {bad[0]!r}")
    rotations = ("Zrotation", "Yrotation", "Xrotation")
    moving = (*CHANNEL_NAMES[:3], *rotations)
    channels = tuple(moving if joint_positions or j == 0 else rotations for j in range(len(skeleton)))
    offsets = np.concatenate([np.zeros((1, 3)), skeleton.offsets[1:]])
    leaves = tuple(j for j in range(len(skeleton)) if j not in skeleton.parents)
    end_offsets = 0.5 * offsets[list(leaves)]
    layout = BvhLayout(skeleton, offsets, channels, leaves, end_offsets, 0.01, ("", "\nFrame Time: "), "")
    return replace(layout, head=(_hierarchy(layout), layout.head[1]))


def _hierarchy(layout: BvhLayout) -> str:
    lines = ["HIERARCHY"]
    ends = dict(zip(layout.end_sites, layout.end_offsets, strict=True))
    opened: list[int] = []

    def offset(metres: Float[ndarray, "3"]) -> str:
        return "OFFSET " + " ".join(f"{x:.6f}" for x in metres / layout.metres_per_unit + 0.0)

    def close() -> None:
        joint = opened.pop()
        tab = "\t" * len(opened)
        if joint in ends:
            lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\t{offset(ends[joint])}", f"{tab}\t}}"])
        lines.append(f"{tab}}}")

    for joint, (name, parent) in enumerate(zip(layout.skeleton.names, layout.skeleton.parents, strict=True)):
        while opened and opened[-1] != parent:
            close()
        tab, channels = "\t" * len(opened), layout.channels[joint]
        lines.extend([f"{tab}{'JOINT' if opened else 'ROOT'} {name}", f"{tab}{{"])
        lines.append(f"{tab}\t{offset(layout.offsets[joint])}")
        lines.append(f"{tab}\tCHANNELS {len(channels)} {' '.join(channels)}")
        opened.append(joint)
    while opened:
        close()
    return "\n".join([*lines, "MOTION", "Frames: "])


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
