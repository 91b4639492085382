"""Hatchling's build hook: puts the studio's built front end into a wheel. An editable installation builds it later."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).resolve().parent))
import build as front


class FrontEnd(BuildHookInterface[Any]):
    """`web/dist` as `interpose/studio/page`."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version != "editable":
            build_data["force_include"][str(front.build())] = "interpose/studio/page"
