"""Writes a whole motion from the browser as a BVH or GLB file."""

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

FLOAT32_TOLERANCE = 2e-6
"""Relative change of positions, and radians, that 32-bit floats may cause."""


def export(header: Export, arrays: Mapping[str, ndarray], clip: Clip) -> bytes:
    """The bytes of the file. Raises InputError if the frames are not of the rig.

    Rows are copied digit for digit only if their pose is still that of the source file.
    """
    if set(arrays) != {"frames"}:
        raise InputError("an export needs one array, frames")
    motion = pose_rows.to_motion(arrays["frames"], clip.motion, "the motion")
    return io.serialize(motion, f"motion.{header.format}", _unchanged(header.rows, motion, clip.motion))


def _unchanged(named: list[tuple[int, int]], motion: Motion, source: Motion) -> dict[int, int]:
    """The named rows whose pose is still that of the source."""
    for frame, row in named:
        if frame >= len(motion) or row >= len(source):
            raise InputError(
                f"frame {frame} is given as row {row} of the file, but there are {len(motion)} frames and "
                f"{len(source)} rows"
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
    return {frame: row for (frame, row), away in zip(named, far.tolist(), strict=True) if away <= FLOAT32_TOLERANCE}
