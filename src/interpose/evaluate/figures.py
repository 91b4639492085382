"""Figures of evaluations: curves and confusion matrices, where matplotlib is installed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.evaluate.tables import ResultRow
from interpose.gallery.plots.canvas import png
from interpose.io.files import write_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # what checks types while tests run cannot see them
    Axes = Figure = Any

RATIO_TICKS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1, 1.2, 1.5, 2, 3, 4, 5, 7, 10, 20, 50)
NUMBERED_STYLES = 20
"""A confusion matrix of more styles has no numbers in its cells."""


def _draw(path: Path, size: tuple[float, float], dpi: int, paint: Callable[[Figure], None]) -> None:
    """Write a figure of so many inches; nothing without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return
    figure = Figure(figsize=size, dpi=dpi, layout="constrained")
    paint(figure)
    write_whole(path, png(figure))


def _curve(axes: Axes, frames: Sequence[int], values: Any, band: tuple[Any, Any] | None, **look: Any) -> None:
    """Values over frames, with a band around them."""
    (drawn,) = axes.plot(frames, values, **look)
    if band is not None:
        axes.fill_between(frames, *band, color=drawn.get_color(), alpha=0.2, linewidth=0.0)


def _finish(axes: Axes, below: str, beside: str) -> None:
    axes.set_xlabel(below)
    axes.set_ylabel(beside)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)


def draw_ratios(rows: Sequence[ResultRow], path: Path) -> None:
    """L2P over interp's by the length of the gap, a curve a method with its interval; nothing without matplotlib."""

    def paint(figure: Figure) -> None:
        axes = figure.add_subplot()
        axes.axhline(1.0, color="0.6", linewidth=1.0, label="interp")
        for method, context in dict.fromkeys((r.method, r.context_frames) for r in rows if r.method != "interp"):
            mine = [row for row in rows if (row.method, row.context_frames) == (method, context)]
            mine.sort(key=lambda row: row.frames)
            band = [row.ratio_ci_low for row in mine], [row.ratio_ci_high for row in mine]
            label = f"{method}, {context} known frame{'s' if context > 1 else ''}"
            ratios = [row.ratio_to_interp for row in mine]
            _curve(axes, [row.frames for row in mine], ratios, band, marker="o", label=label)
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        axes.set_yticks([tick for tick in RATIO_TICKS if low <= tick <= high], minor=False)
        axes.set_yticks([], minor=True)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_xticks(sorted({row.frames for row in rows}))
        _finish(axes, "length of the gap (frames at 30 Hz)", "L2P / L2P of interp")

    _draw(path, (6.4, 4.0), 150, paint)


def draw_errors(errors: Mapping[str, Sequence[Float[ndarray, "frame"]]], path: Path) -> None:
    """Figure 6 of Ren et al. 2024: the mean displacement of the joints in each frame, a curve a method, a band over its
    samples. errors: metres, by method. nothing without matplotlib.
    """

    def paint(figure: Figure) -> None:
        axes = figure.add_subplot()
        for name, samples in errors.items():
            each = 100.0 * np.stack(list(samples))
            band = (each.min(axis=0), each.max(axis=0)) if len(each) > 1 else None
            colour = "0.6" if name == "interp" else None
            _curve(axes, range(1, each.shape[1] + 1), each.mean(axis=0), band, label=name, color=colour)
        axes.set_ylim(bottom=0.0)
        _finish(axes, "frame of the gap", "mean displacement of the joints (cm)")

    _draw(path, (6.4, 4.0), 150, paint)


def draw_confusion(
    matrices: Sequence[Mapping[str, Float[ndarray, "style style"]]], styles: Sequence[str], path: Path
) -> None:
    """Confusion matrices by their titles, a row of pictures a mapping; nothing without matplotlib.

    A matrix counts how often gaps with the requested style of a row were classified as the style of a column.
    """
    size = 1.2 + 0.34 * len(styles)

    def paint(figure: Figure) -> None:
        places = figure.subplots(len(matrices), len(matrices[0]), squeeze=False, sharex=True, sharey=True)
        for beside, named in zip(places, matrices, strict=True):
            for axes, (title, counts) in zip(beside, named.items(), strict=True):
                shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
                axes.imshow(shares, vmin=0.0, vmax=1.0, cmap="Blues")
                for (i, j), share in np.ndenumerate(shares):
                    if share >= 0.005 and len(styles) <= NUMBERED_STYLES:
                        colour = "white" if share > 0.5 else "black"
                        axes.text(j, i, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=colour)
                axes.set_title(title, fontsize=9)
                axes.set_xticks(range(len(styles)), styles, rotation=90, fontsize=7)
                axes.set_yticks(range(len(styles)), styles, fontsize=7)
            beside[0].set_ylabel("requested", fontsize=8)
        figure.supxlabel("classified as, % of the row", fontsize=8)

    _draw(path, (size * len(matrices[0]), 1.05 * size * len(matrices)), 110, paint)
