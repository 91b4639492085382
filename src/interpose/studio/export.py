"""A whole motion from the browser as the bytes of a BVH or a GLB file."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy import ndarray
from pydantic import TypeAdapter

from interpose import io, rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.studio import pose_rows
from interpose.studio.protocol import Export
from interpose.studio.rigs import Clip

EXPORT: TypeAdapter[Export] = TypeAdapter(Export)

NEAR = 2e-6
"""Metres a metre, and radians: by how much 32-bit floats may have changed a pose."""


def export(asked: Export, arrays: Mapping[str, ndarray], clip: Clip) -> bytes:
    """The file. Raises InputError where the frames are none of the rig's.

    Of the rows that are to come out digit for digit, those whose pose is not the file's own any more are written from
    the pose: what a person sees is what comes out.
    """
    if set(arrays) != {"frames"}:
        raise InputError("an export has one array, frames")
    motion = pose_rows.to_motion(arrays["frames"], clip.motion, "the motion")
    return io.serialize(motion, f"motion.{asked.format}", _same(asked.rows, motion, clip.motion))


def _same(named: list[tuple[int, int]], motion: Motion, source: Motion) -> dict[int, int]:
    """Those of the rows that are the source's still."""
    for frame, row in named:
        if frame >= len(motion) or row >= len(source):
            raise InputError(
                f"frame {frame} is to be row {row} of the file, but there are {len(motion)} frames and {len(source)} "
                f"rows; send rows that are there"
            )
    if not named:
        return {}
    frames, sources = np.array(named).T
    turn = rotation.multiply(rotation.inverse(motion.local_rotations[frames]), source.local_rotations[sources])
    far = rotation.angle(turn).max(axis=-1)
    pairs = [(motion.root_positions[frames], source.root_positions[sources])]
    if motion.translations is not None and source.translations is not None:
        pairs.append((motion.translations[frames, 1:], source.translations[sources, 1:]))
    for here, there in pairs:
        scale = np.maximum(np.abs(there), 1.0)
        far = np.maximum(far, (np.abs(here - there) / scale).reshape(len(frames), -1).max(axis=-1, initial=0.0))
    return {frame: row for (frame, row), away in zip(named, far.tolist(), strict=True) if away <= NEAR}
