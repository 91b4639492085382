"""Motion files, the only code with degrees, centimetres and other axes; `interpose.io.registry` lists the formats."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from interpose.io.motion_files import parse as parse
    from interpose.io.motion_files import read as read
    from interpose.io.motion_files import serialize as serialize
    from interpose.io.motion_files import write as write


def __getattr__(name: str) -> object:
    # Imported at first use: the command line's help needs the registry alone, not NumPy.
    if name not in ("parse", "read", "serialize", "write"):
        raise AttributeError(f"module 'interpose.io' has no attribute '{name}'")
    return getattr(import_module("interpose.io.motion_files"), name)
