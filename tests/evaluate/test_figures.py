"""Figures: curves, confusion matrices and contact sheets are pictures, and what is missing without matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from interpose.evaluate import figures
from interpose.evaluate.tables import ResultRow

RATIOS = [
    ResultRow(method, "lafan1", frames, "L2P", 0.7, ratio, 0.6, 0.8, 1, ratio - 0.1, ratio + 0.1)
    for method, frames, ratio in (("interp", 5, 1.0), ("dcmoe", 5, 0.7), ("dcmoe", 15, 0.6))
]


def colours(path: Path) -> int:
    with Image.open(path) as picture:
        return len(picture.convert("RGB").getcolors(1_000_000) or [])


def test_curves_are_pictures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    figures.draw_ratios(RATIOS, tmp_path / "l2p.png")
    with Image.open(tmp_path / "l2p.png") as picture:
        assert picture.size == (960, 600)
    errors = {"interp": [np.linspace(0.0, 0.1, 8)], "stitch": [np.full(8, 0.02), np.full(8, 0.04)]}
    figures.draw_errors(errors, tmp_path / "errors.png")
    assert colours(tmp_path / "l2p.png") > 10
    assert colours(tmp_path / "errors.png") > 10


def test_confusion_matrices_are_pictures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    counts = np.array([[3.0, 1.0], [0.0, 0.0]])
    figures.draw_confusion([{"x1, own keys": counts}, {"x1, other keys": counts.T}], ["A", "B"], tmp_path / "c.png")
    assert colours(tmp_path / "c.png") > 10


def test_without_matplotlib_nothing_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    figures.draw_ratios(RATIOS, tmp_path / "l2p.png")
    assert list(tmp_path.iterdir()) == []
