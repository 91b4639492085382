"""Where the built front end is."""

from __future__ import annotations

from pathlib import Path

PACKAGED = Path(__file__).resolve().parent / "static"


def find() -> Path | None:
    """The folder of the built front end."""
    made = Path(__file__).resolve().parents[3] / "web" / "dist"
    return PACKAGED if PACKAGED.is_dir() else made if made.is_dir() else None
