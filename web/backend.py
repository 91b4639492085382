"""The packaging backend that pyproject.toml names: hatchling, with the studio's front end built into the wheel.

An editable installation has no need of it: from a source checkout the studio builds its front end when it first starts.
Node is asked for only where a wheel is built on a machine that has none that fits.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.build import *  # noqa: F403
from hatchling.build import build_wheel as _build_wheel
from hatchling.build import get_requires_for_build_wheel as _requires

sys.path.insert(0, str(Path(__file__).resolve().parent))
import build as front


def get_requires_for_build_wheel(config_settings: dict[str, Any] | None = None) -> list[str]:
    """What hatchling needs, and a Node where there is none."""
    pinned = [line.split()[0] for line in (front.WEB / "node.txt").read_text().splitlines() if "==" in line]
    return [*_requires(config_settings), *([] if front.find_node() else pinned)]


def build_wheel(
    wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None
) -> str:
    """The wheel, with `web/dist` in it as `interpose/studio/static` (pyproject.toml, force-include)."""
    front.build()
    return _build_wheel(wheel_directory, config_settings, metadata_directory)
