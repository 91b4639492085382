from __future__ import annotations

import csv
import json
from dataclasses import fields

from interpose.evaluate import tables
from interpose.evaluate.tables import ResultRow

NAN = float("nan")
ROWS = [
    ResultRow("truth", "lafan1", 15, "foot_slide", 0.14, NAN, 0.1, 0.2, 10, NAN, NAN),
    ResultRow("interp", "lafan1", 5, "L2P", 0.3, 1.0, 0.2, 0.4, 10, 1.0, 1.0),
    ResultRow("interp", "lafan1", 15, "L2P", 1.0, 1.0, 0.9, 1.1, 10, 1.0, 1.0),
    ResultRow("dcmoe", "lafan1", 15, "L2P", 0.7, 0.7, 0.6, 0.8, 1, 0.65, 0.75),
]


def test_json_is_a_list_of_rows_with_null_for_what_is_no_number() -> None:
    rows = json.loads(tables.to_json(ROWS))
    assert rows[0]["value"] == 0.14
    assert rows[0]["ratio_to_interp"] is None
    assert set(rows[3]) >= {
        "method", "protocol", "frames", "metric", "value", "ratio_to_interp", "ci_low", "ci_high", "context_frames"
    }  # fmt: skip


def test_csv_reads_back() -> None:
    rows = list(csv.DictReader(tables.to_csv(ROWS).splitlines()))
    assert [row["method"] for row in rows] == ["truth", "interp", "interp", "dcmoe"]
    assert list(rows[0]) == [field.name for field in fields(ResultRow)]
    assert float(rows[3]["ratio_ci_low"]) == 0.65


def test_markdown_has_a_table_a_metric_and_leaves_gaps_where_there_is_no_number() -> None:
    text = tables.to_markdown(ROWS, "# Results\n")
    assert text.startswith("# Results\n")
    assert text.index("## L2P") < text.index("## foot_slide (cm a frame in contact)")
    assert "| interp | 10 | 0.300 | 1.000 |" in text
    assert "| dcmoe | 1 | - | 0.700 (0.70) |" in text
    assert "| truth | 10 | 0.14 |" in text


def test_every_metric_of_the_design_has_a_unit() -> None:
    named = {"L2P", "L2Q", "L2Q_aligned", "NPSS", "APD", "ADE", "SLDE", "MMPE", "foot_slide", "arrival_position"}
    assert named <= set(tables.METRICS)
