"""Reads and writes motions in any format of `interpose.io.registry`."""

from __future__ import annotations

import os
from collections.abc import Mapping

from interpose.io.files import read_whole, write_whole
from interpose.io.registry import reader_of, writer_of
from interpose.motion import Motion


def read(path: str | os.PathLike[str]) -> Motion:
    """The motion in a file: metres, Y up, with the file's :class:`~interpose.motion.SourceLayout`.

    The format is recognised by the contents; the extension decides where that fails. Raises InputError, with the line
    if there is one, for a file that cannot be read or is not a complete motion.
    """
    return parse(read_whole(path), os.fspath(path))


def parse(data: bytes, name: str) -> Motion:
    """Reads the bytes of a file; ``name`` stands for its path. See :func:`read`."""
    return reader_of(data, name).load().parse(data, name)


def write(
    path: str | os.PathLike[str],
    motion: Motion,
    unchanged_rows: Mapping[int, int] | None = None,
    name: str = "motion",
) -> None:
    """Writes a motion in the format of the path's extension, the file whole or absent.

    ``unchanged_rows[i] = f`` gives frame i the text of row f of the file that the motion was read from, digit for
    digit; None gives it to every frame whose pose is, to the last bit, that of a row. It has no effect where the
    motion comes from a file of another format, or where the format does not keep text. ``name`` is the animation's,
    for formats that name it.

    Raises InputError where the extension is unknown or the path cannot be written.
    """
    write_whole(path, serialize(motion, os.fspath(path), unchanged_rows, name))


def serialize(
    motion: Motion, path: str, unchanged_rows: Mapping[int, int] | None = None, name: str = "motion"
) -> bytes:
    """The bytes of the file that :func:`write` writes; of ``path`` only the extension counts."""
    return writer_of(path).load().serialize(motion, unchanged_rows, name)
