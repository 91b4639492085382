"""Writing BVH: verbatim rows, nearest Euler angles, default layouts, and files that are whole or absent."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

Save = Callable[[str | bytes], Path]
"""

"""


def rows_of(path: Path) -> list[str]:
    """The row texts of a BVH file."""
    text = path.read_text()
    return text[text.index("Frame Time") :].splitlines()[1:]
