"""The layout of a BVH file: what it holds besides poses, kept to write the same file again."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose.motion import SourceLayout
from interpose.skeleton import Skeleton

CHANNEL_NAMES = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")


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
