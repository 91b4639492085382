"""The layout of files whose frames cannot be written back unchanged."""

from __future__ import annotations

from dataclasses import dataclass

from interpose.motion import SourceLayout


@dataclass(frozen=True)
class UnitLayout:
    """Holds the unit of a file and nothing else; see :class:`~interpose.motion.SourceLayout`."""

    metres_per_unit: float
    nbytes: int = 0

    def joined(self, frame: int, other: SourceLayout | None, other_frame: int) -> tuple[UnitLayout, bool]:
        """No row of either file."""
        return self, False
