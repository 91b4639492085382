"""The packaging backend that pyproject.toml names: hatchling, which asks for a Node only where it needs one.

A wheel brings the studio's front end built (`hook`), and that takes Node. Where the machine has one that fits, nothing
more is installed; `[build-system]` could not say so.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.build import *  # noqa: F403
from hatchling.build import get_requires_for_build_wheel as _requires

sys.path.insert(0, str(Path(__file__).resolve().parent))
import build as front


def get_requires_for_build_wheel(config_settings: dict[str, Any] | None = None) -> list[str]:
    """What hatchling needs, and a Node where there is none."""
    pinned = [line.split()[0] for line in (front.WEB / "node.txt").read_text().splitlines() if "==" in line]
    return [*_requires(config_settings), *([] if front.find_node() else pinned)]
