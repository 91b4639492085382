"""Writes BVH files, in the layout of the file that a motion was read from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.io.bvh_layout import BvhLayout, decode, default_layout, encode
from interpose.io.bvh_read import rate_of
from interpose.io.bvh_text import parse_numbers
from interpose.motion import Motion
from interpose.skeleton import Skeleton


def serialize(motion: Motion, unchanged_rows: Mapping[int, int] | None = None, name: str = "motion") -> bytes:
    """A motion as BVH. For ``unchanged_rows`` see :func:`interpose.io.write`; ``name`` is not used.

    A motion that was read from BVH and still has its skeleton gets the file's own hierarchy, channels, unit and line
    ends; any other motion gets :func:`~interpose.io.bvh_layout.default_layout`. New rows have the Euler angles closest
    to the previous row.

    Raises ValueError for poses that are not finite, and for ``unchanged_rows`` that do not fit the motion or its file.
    """
    if not (np.isfinite(motion.root_positions).all() and np.isfinite(motion.local_rotations).all()):
        raise ValueError("the motion has values that are not finite")
    layout = motion.layout
    if not isinstance(layout, BvhLayout) or not _fits(layout, motion.skeleton):
        if unchanged_rows and isinstance(layout, BvhLayout):
            raise ValueError("rows can be kept only while the motion has the skeleton of its BVH file")
        motion, unchanged_rows = _depth_first(motion), {}
        layout = default_layout(motion.skeleton, motion.translations is not None)
    kept = _same_rows(layout, motion) if unchanged_rows is None else unchanged_rows
    rows = _rows(layout, motion, kept)
    time = layout.frame_time
    if not time or rate_of(time) != motion.rate:
        time = f"{1.0 / motion.rate:.10f}"
    row_end = layout.row_end + layout.newline
    head = f"{layout.head[0]}{len(motion)}{layout.head[1]}{time}{layout.newline}"
    return (head + row_end.join(rows) + row_end).encode(layout.encoding)


def _fits(layout: BvhLayout, skeleton: Skeleton) -> bool:
    own = layout.skeleton
    same = own is skeleton or (own.names == skeleton.names and own.parents == skeleton.parents)
    return same and np.allclose(own.offsets, skeleton.offsets, rtol=0.0, atol=1e-7)


def _depth_first(motion: Motion) -> Motion:
    # BVH nests children in their parent, so joints are in depth-first order.
    parents = motion.skeleton.parents
    order: list[int] = []
    pending = [0]
    while pending:
        joint = pending.pop()
        order.append(joint)
        pending.extend(child for child in reversed(range(len(parents))) if parents[child] == joint)
    if order == sorted(order):
        return motion
    skeleton = Skeleton(
        tuple(motion.skeleton.names[j] for j in order),
        tuple(-1 if j == 0 else order.index(parents[j]) for j in order),
        motion.skeleton.offsets[order],
    )
    moved = None if motion.translations is None else motion.translations[:, order]
    return replace(motion, skeleton=skeleton, local_rotations=motion.local_rotations[:, order], translations=moved)


def _same_rows(layout: BvhLayout, motion: Motion) -> dict[int, int]:
    if not layout.rows:
        return {}
    values = parse_numbers(layout.rows).reshape(-1, layout.channel_count)
    rows = _pose_bytes(*decode(layout, values))
    source = {row: frame for frame, row in enumerate(rows)}
    poses = _pose_bytes(motion.root_positions, motion.local_rotations, motion.translations)
    # Two rows may hold the same pose in different digits: a frame at its original position keeps its own.
    own = {frame: frame for frame, (row, pose) in enumerate(zip(rows, poses, strict=False)) if row == pose}
    return {frame: source[row] for frame, row in enumerate(poses) if row in source} | own


def _pose_bytes(
    root: Float[ndarray, "frame 3"],
    rotations: Float[ndarray, "frame joint 4"],
    moved: Float[ndarray, "frame joint 3"] | None,
) -> list[bytes]:
    parts = [root, rotations.reshape(len(root), -1)] + ([] if moved is None else [moved.reshape(len(root), -1)])
    return [row.tobytes() for row in np.concatenate(parts, axis=1)]


def _rows(layout: BvhLayout, motion: Motion, kept: Mapping[int, int]) -> list[str]:
    frames = len(motion)
    if any(not 0 <= out < frames or not 0 <= frame < len(layout.row_bounds) for out, frame in kept.items()):
        raise ValueError(
            f"unchanged_rows names frames outside the {frames} written or the {len(layout.row_bounds)} read"
        )
    rows = [layout.row(kept[i]) if i in kept else "" for i in range(frames)]
    generated = np.array([i not in kept for i in range(frames)])
    edges = np.flatnonzero(np.diff(generated, prepend=False, append=False))
    for start, stop in zip(edges[0::2], edges[1::2], strict=True):
        near = rows[start - 1] if start > 0 else rows[stop] if stop < frames else "0 " * layout.channel_count
        previous = np.array(near.split(), dtype=float)
        moved = None if motion.translations is None else motion.translations[start:stop]
        values = encode(layout, motion.root_positions[start:stop], motion.local_rotations[start:stop], moved, previous)
        form = " ".join([f"%.{layout.decimals}f"] * layout.channel_count)
        rows[start:stop] = [form % tuple(row) for row in np.round(values, layout.decimals) + 0.0]
    return rows
