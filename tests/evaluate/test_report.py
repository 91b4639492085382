"""What an evaluation leaves in its folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from interpose.errors import InputError
from interpose.evaluate import report
from interpose.evaluate.tables import ResultRow

NAN = float("nan")
ROWS = [
    ResultRow("interp", "lafan1", 15, "L2P", 1.0, 1.0, 0.9, 1.1, 10, 1.0, 1.0),
    ResultRow("dcmoe", "lafan1", 15, "L2P", 0.7, 0.7, 0.6, 0.8, 1, 0.65, 0.75),
]


def test_write_makes_the_folder_and_leaves_nothing_else_in_it(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    report.write(ROWS, tmp_path / "a" / "b", "# Results\n")
    written = {path.name for path in (tmp_path / "a" / "b").iterdir()}
    assert written == {"results.json", "results.csv", "results.md", "l2p.png"}


def test_without_matplotlib_there_are_tables_and_no_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    report.write(ROWS, tmp_path, "# Results\n")
    assert {path.name for path in tmp_path.iterdir()} == {"results.json", "results.csv", "results.md"}


def test_a_folder_that_cannot_be_made_is_the_inputs_fault(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="the folder cannot be made"):
        report.write(ROWS, tmp_path / "file" / "out", "# Results\n")
