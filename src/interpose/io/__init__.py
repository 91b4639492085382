"""Files to and from :class:`~interpose.motion.Motion`: the only place with degrees, centimetres and other axes."""

from __future__ import annotations

import os
from pathlib import Path

from interpose.errors import InputError
from interpose.io import bvh
from interpose.motion import Motion


def read(path: str | os.PathLike[str]) -> Motion:
    """The motion in a file, by its suffix (.bvh). Raises InputError where it cannot be read."""
    if Path(path).suffix.lower() != ".bvh":
        raise InputError(f"{path}: only .bvh files can be read")
    return bvh.read(path)


def write(path: str | os.PathLike[str], motion: Motion) -> None:
    """Writes a motion in the format of the path's suffix (.bvh, .glb). Raises InputError where that cannot be done."""
    match Path(path).suffix.lower():
        case ".bvh":
            bvh.write(path, motion)
        case ".glb":
            from interpose.io import gltf

            gltf.write(path, [motion])
        case _:
            raise InputError(f"{path}: only .bvh and .glb files can be written")
