"""The table of file formats. A new format is one module in this folder and one entry in :data:`FORMATS`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import PurePath
from typing import Any

from interpose.errors import InputError


@dataclass(frozen=True)
class Format:
    """A file format and the module that handles it, which is imported on first use.

    name: as in messages. module: its full name. reads, writes: the lower-case extensions of files that it reads and
    writes. A module that reads has two functions, a module that writes has the third::

        recognises(data: bytes) -> bool              # whether this looks like the format, whatever the file's name
        parse(data: bytes, name: str) -> Motion      # raises InputError; name stands for the path in messages
        serialize(motion: Motion, unchanged_rows: Mapping[int, int] | None, name: str) -> bytes   # see `io.write`
    """

    name: str
    module: str
    reads: tuple[str, ...] = ()
    writes: tuple[str, ...] = ()

    def load(self) -> Any:
        """The module."""
        return import_module(self.module)


FORMATS = (
    Format("BVH", "interpose.io.bvh_read", reads=(".bvh",)),
    Format("BVH", "interpose.io.bvh_write", writes=(".bvh",)),
    Format("AMASS", "interpose.io.amass", reads=(".npz",)),
    Format("Human3.6M exponential maps", "interpose.io.h36m", reads=(".txt",)),
    Format("binary glTF", "interpose.io.gltf", writes=(".glb",)),
)

READERS = {suffix: each for each in FORMATS for suffix in each.reads}
"""Formats that can be read, by extension."""

WRITERS = {suffix: each for each in FORMATS for suffix in each.writes}
"""Formats that can be written, by extension."""


def reader_of(data: bytes, name: str) -> Format:
    """The format to read a file's bytes as: by its contents, and by its extension where no format recognises them.

    Raises InputError, naming the formats that can be read, where neither is known.
    """
    by_name = READERS.get(PurePath(name).suffix.lower())
    likely = [by_name] if by_name else []
    for each in (*likely, *READERS.values()):
        if each.load().recognises(data):
            return each
    if by_name is None:
        raise InputError(f"{name}: not a motion file of a known format; {readable()} can be read")
    return by_name


def writer_of(path: str) -> Format:
    """The format of an output file. Raises InputError for an extension that cannot be written."""
    found = WRITERS.get(PurePath(path).suffix.lower())
    if found is None:
        raise InputError(f"{path}: the output's name must end in {listed(WRITERS)}")
    return found


def readable() -> str:
    """The formats that can be read, with their extensions, for messages and help."""
    return listed(f"{each.name} ({suffix})" for suffix, each in READERS.items())


def listed(items: Iterable[str]) -> str:
    """``a, b or c``."""
    *first, last = items
    return f"{', '.join(first)} or {last}" if first else last
