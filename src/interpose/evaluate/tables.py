"""Results of an evaluation as rows, and the rows as JSON, CSV and Markdown."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from interpose.evaluate.metrics import Scores, interval

TRUTH = "truth"
"""The name of the recorded motion, which has the metrics that need no comparison."""
METRICS = {
    "L2P": ("no unit", 3),
    "L2Q": ("no unit", 3),
    "L2Q_aligned": ("no unit", 3),
    "NPSS": ("no unit", 4),
    "ADE": ("m", 3),
    "SLDE": ("m", 3),
    "APD": ("m", 3),
    "MMPE": ("m", 3),
    "foot_slide": ("cm a frame in contact", 2),
    "foot_slide_speed": ("m/s", 3),
    "foot_slide_share": ("of samples in contact", 2),
    "arrival_position": ("m", 4),
    "key_acceleration": ("m/s²", 1),
    "jerk_ratio": ("of the truth's", 2),
    "seam_speed": ("of the gap's", 2),
    "seam_acceleration": ("of the gap's", 2),
    "path_deviation": ("m", 3),
    "duration_error_median": ("of the true duration", 2),
    "duration_within_20": ("share of suggestions within 20 %", 2),
    "diversity": ("m between the roots of seven variants", 3),
}
"""Metric to unit and printed digits, in the order of the tables."""
RATIO_METRICS = ("L2P", "L2Q", "L2Q_aligned", "NPSS", "ADE", "SLDE", "foot_slide")
"""The metrics whose ratio to interpolation's means something."""


@dataclass(frozen=True)
class ResultRow:
    """One number of a table, with the bootstrap intervals of the value and of its ratio to interp's.

    NaN where there is none: the ratio of a metric that compares with no truth, or a metric with no sample.
    """

    method: str
    protocol: str
    frames: int
    metric: str
    value: float
    ratio_to_interp: float
    ci_low: float
    ci_high: float
    context_frames: int
    ratio_ci_low: float
    ratio_ci_high: float


def rows_of(
    protocol: str,
    length: int,
    found: Mapping[str, Mapping[str, Scores]],
    base: Mapping[str, Scores],
    seed: int = 0,
    context_frames: int = 1,
) -> list[ResultRow]:
    """A row for each metric of each method on gaps of one length, with 95 % intervals by bootstrap over windows.

    found: scores by method and metric. base: interp's scores on the same windows, for the ratios of the metrics in
    :data:`RATIO_METRICS`; empty for none. The recorded motion has no ratios.
    """
    rows = []
    for method, scores in found.items():
        for name, score in scores.items():
            draws = score.bootstrap(seed)
            ratio = ratio_low = ratio_high = float("nan")
            if method != TRUTH and name in RATIO_METRICS and name in base and base[name].value > 0.0:
                ratio = score.value / base[name].value
                of_base = base[name].bootstrap(seed)
                ratios = np.divide(draws, of_base, out=np.full_like(draws, np.nan), where=of_base > 0.0)
                ratio_low, ratio_high = interval(ratios)
            row = method, protocol, length, name, score.value, ratio, *interval(draws)
            rows.append(ResultRow(*row, context_frames, ratio_low, ratio_high))
    return rows


def to_json(rows: Sequence[ResultRow]) -> str:
    """A list of objects, one a row; what is not a number is null."""
    plain = [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(row).items()} for row in rows]
    return json.dumps(plain, indent=1) + "\n"


def to_csv(rows: Sequence[ResultRow]) -> str:
    """One line a row under a header; what is not a number is ``nan``."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(ResultRow.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()


def to_markdown(rows: Sequence[ResultRow], heading: str) -> str:
    """``heading``, then one table a metric: a row a method, a column a length, the ratio to interp in brackets."""
    parts = [heading]
    for metric, (unit, digits) in METRICS.items():
        mine = [row for row in rows if row.metric == metric]
        if not mine:
            continue
        lengths = sorted({row.frames for row in mine})
        cells = {(row.method, row.context_frames, row.frames): _cell(row, digits) for row in mine}
        methods = dict.fromkeys((row.method, row.context_frames) for row in mine)
        body = [[*map(str, method), *(cells.get((*method, n), "-") for n in lengths)] for method in methods]
        header = ["method", "context", *(f"{n} frames" if n else "all" for n in lengths)]
        parts.append(f"## {metric} ({unit})\n\n{table(header, body)}")
    return "\n".join(parts)


def table(header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    rows = [header, ["---"] * len(header), *body]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in rows)


def _cell(row: ResultRow, digits: int) -> str:
    if math.isnan(row.value):
        return "-"
    ratio = "" if math.isnan(row.ratio_to_interp) or row.method == "interp" else f" ({row.ratio_to_interp:.2f})"
    return f"{row.value:.{digits}f}{ratio}"
