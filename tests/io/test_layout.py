"""The layout of formats without rows to write back."""

from __future__ import annotations

from interpose.io.layout import UnitLayout
from interpose.motion import SourceLayout


def test_it_holds_a_unit_and_joins_nothing() -> None:
    layout = UnitLayout(0.001)
    assert isinstance(layout, SourceLayout)
    assert (layout.metres_per_unit, layout.nbytes) == (0.001, 0)
    assert layout.joined(0, UnitLayout(0.001), 3) == (layout, False)
