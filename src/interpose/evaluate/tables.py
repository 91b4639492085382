"""Results of an evaluation as rows, and the rows as JSON, CSV, Markdown and a figure.

Every file is written whole or not at all.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from interpose.errors import InputError
from interpose.evaluate.metrics import Scores, interval
from interpose.io.files import write_whole

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
RATED = ("L2P", "L2Q", "L2Q_aligned", "NPSS", "ADE", "SLDE", "foot_slide")
"""The metrics for which a ratio to interpolation says something."""
TICKS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.5, 2, 3, 4, 5, 7, 10, 20, 50)


@dataclass(frozen=True)
class Row:
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


def scored(
    found: Mapping[str, Scores],
    base: Mapping[str, Scores],
    method: str,
    protocol: str,
    frames: int,
    context_frames: int,
    seed: int = 0,
) -> Iterator[Row]:
    """A row for each metric of a method, with 95 % intervals by bootstrap over windows.

    base: interp's scores on the same windows, for the ratios of the metrics in :data:`RATED`; empty for none.
    """
    for name, score in found.items():
        draws = score.bootstrap(seed)
        low, high = interval(draws)
        ratio = ratio_low = ratio_high = float("nan")
        if name in RATED and name in base and base[name].value > 0.0:
            ratio = score.value / base[name].value
            of_base = base[name].bootstrap(seed)
            ratios = np.divide(draws, of_base, out=np.full_like(draws, np.nan), where=of_base > 0.0)
            ratio_low, ratio_high = interval(ratios)
        yield Row(method, protocol, frames, name, score.value, ratio, low, high, context_frames, ratio_low, ratio_high)


def write(rows: Sequence[Row], folder: Path, heading: str) -> list[Path]:
    """Write ``results.json``, ``.csv``, ``.md`` and, where matplotlib is installed, ``l2p.png``; returns the paths."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: the folder cannot be made: {(error.strerror or str(error)).lower()}") from None
    texts = {"json": to_json(rows), "csv": to_csv(rows), "md": to_markdown(rows, heading)}
    paths = []
    for suffix, text in texts.items():
        paths.append(folder / f"results.{suffix}")
        write_whole(paths[-1], text.encode())
    figure = folder / "l2p.png"
    if draw(rows, figure):
        paths.append(figure)
    return paths


def to_json(rows: Sequence[Row]) -> str:
    """A list of objects, one a row; what is not a number is null."""
    plain = [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(row).items()} for row in rows]
    return json.dumps(plain, indent=1) + "\n"


def to_csv(rows: Sequence[Row]) -> str:
    """One line a row under a header; what is not a number is ``nan``."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(Row.__dataclass_fields__), lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return text.getvalue()


def to_markdown(rows: Sequence[Row], heading: str) -> str:
    """``heading``, then one table a metric: a line a method, a column a length, the ratio to interp in brackets."""
    parts = [heading]
    for metric in _ordered(rows):
        mine = [row for row in rows if row.metric == metric]
        lengths = sorted({row.frames for row in mine})
        unit, digits = METRICS[metric]
        cells = {(row.method, row.context_frames, row.frames): _cell(row, digits) for row in mine}
        lines = [f"## {metric} ({unit})\n"]
        lines.append("| method | context | " + " | ".join(f"{n} frames" if n else "all" for n in lengths) + " |")
        lines.append("|---|---|" + "---|" * len(lengths))
        for method, context in dict.fromkeys((row.method, row.context_frames) for row in mine):
            values = [cells.get((method, context, n), "-") for n in lengths]
            lines.append(f"| {method} | {context} | " + " | ".join(values) + " |")
        parts.append("\n".join(lines) + "\n")
    return "\n".join(parts)


def draw(rows: Sequence[Row], path: Path) -> bool:
    """Draw the ratio of L2P to interp over the transition length, a line a method; False without matplotlib."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return False
    chosen = [row for row in rows if row.metric == "L2P" and not math.isnan(row.ratio_to_interp)]
    figure = Figure(figsize=(6.4, 4.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.axhline(1.0, color="0.6", linewidth=1.0, label="interp")
    for method, context in dict.fromkeys((row.method, row.context_frames) for row in chosen if row.method != "interp"):
        line = sorted((r for r in chosen if (r.method, r.context_frames) == (method, context)), key=lambda r: r.frames)
        frames = [row.frames for row in line]
        label = f"{method}, {context} known frame{'s' if context > 1 else ''}"
        (drawn,) = axes.plot(frames, [row.ratio_to_interp for row in line], marker="o", label=label)
        low, high = [row.ratio_ci_low for row in line], [row.ratio_ci_high for row in line]
        axes.fill_between(frames, low, high, color=drawn.get_color(), alpha=0.15, linewidth=0.0)
    axes.set_xlabel("transition length (frames at 30 Hz)")
    axes.set_ylabel("L2P / L2P of interp")
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.set_yticks([tick for tick in TICKS if low <= tick <= high], minor=False)
    axes.set_yticks([], minor=True)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xticks(sorted({row.frames for row in chosen}))
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    write_whole(path, picture.getvalue())
    return True


def _ordered(rows: Sequence[Row]) -> list[str]:
    present = {row.metric for row in rows}
    return [metric for metric in METRICS if metric in present]


def _cell(row: Row, digits: int) -> str:
    if math.isnan(row.value):
        return "-"
    ratio = "" if math.isnan(row.ratio_to_interp) or row.method == "interp" else f" ({row.ratio_to_interp:.2f})"
    return f"{row.value:.{digits}f}{ratio}"
