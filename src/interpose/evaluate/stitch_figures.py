"""The figures 6 and 8 of Ren et al. 2024: errors along time, and samples of one gap."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.evaluate.fill import Carrier, Contender, fill
from interpose.evaluate.lafan1 import Windows
from interpose.io.files import write_whole
from interpose.motion import Motion, concatenate
from interpose.render.sheet import SheetRow, compose, draw_rows, save

SHOWN = 6
"""Samples of one gap in figure 8."""


def draw_errors(errors: Mapping[str, Sequence[Float[ndarray, "sample frame"]]], path: Path) -> bool:
    """Figure 6: the mean displacement of the joints in each frame, a line a method, a shadow over its samples.

    ``errors``: metres, by method; a method that draws has several. False without matplotlib.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return False
    figure = Figure(figsize=(6.4, 4.0), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for name, parts in errors.items():
        each = 100.0 * np.concatenate(list(parts))
        frames = np.arange(1, each.shape[1] + 1)
        (line,) = axes.plot(frames, each.mean(axis=0), label=name, color="0.6" if name == "interp" else None)
        if len(each) > 1:
            axes.fill_between(
                frames, each.min(axis=0), each.max(axis=0), color=line.get_color(), alpha=0.25, linewidth=0
            )
    axes.set_xlabel("frame of the gap")
    axes.set_ylabel("mean displacement of the joints (cm)")
    axes.set_ylim(bottom=0.0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    write_whole(path, picture.getvalue())
    return True


def draw_samples(windows: Windows, method: Contender, carrier: Carrier, frames: int, path: Path) -> None:
    """Figure 8: the likeliest motion and :data:`SHOWN` samples of one gap, and the truth, a row each.

    The gap is the one whose root goes as far as that of nine tenths of the windows.
    """
    far = np.linalg.norm(windows.root[:, frames - 1] - windows.root[:, 0], axis=-1)
    one = windows.one(int(np.argsort(far)[int(0.9 * (len(far) - 1))]))
    last = slice(frames - 1, frames)
    start, target = (one.root[:, :1], one.local[:, :1]), (one.root[:, last], one.local[:, last])

    def row(label: str, seed: int | None) -> SheetRow:
        made = fill(method, start, target, frames - 2, carrier=carrier, draws=[None if seed is None else (seed, 0)])
        parts = [Motion(one.skeleton, root[0], local[0], one.rate) for root, local in (start, made.motion, target)]
        return SheetRow(concatenate(*parts), label, ("the mean of the prior",) if seed is None else ())

    rows = [row("likeliest", None), *(row(f"sample {i}", i) for i in range(1, SHOWN + 1))]
    rows.append(SheetRow(Motion(one.skeleton, one.root[0, :frames], one.local[0, :frames], one.rate), "truth"))
    save(path, compose(draw_rows(rows), f"{method.name}: one gap of {frames} frames", ""))
