"""The figures 6 and 8 of Ren et al. 2024: errors along time, and samples of one gap."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.evaluate.lafan1 import Windows
from interpose.evaluate.methods import Drawn
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


def draw_samples(windows: Windows, method: Drawn, frames: int, path: Path) -> None:
    """Figure 8: the likeliest motion and :data:`SHOWN` samples of one gap, and the truth, a row each.

    The gap is the one whose root goes as far as that of nine tenths of the windows.
    """
    far = np.linalg.norm(windows.root[:, frames - 1] - windows.root[:, 0], axis=-1)
    one = int(np.argsort(far)[int(0.9 * (len(far) - 1))])
    w = windows
    last = frames - 1
    keys = w.root[[one], :1], w.local[[one], :1], w.root[[one], last], w.local[[one], last]
    made = method.draw(*keys, frames - 2, SHOWN)

    def whole(root: ndarray, local: ndarray) -> Motion:
        ends = [Motion(w.skeleton, w.root[one, [i]], w.local[one, [i]], w.rate) for i in (0, last)]
        return concatenate(ends[0], Motion(w.skeleton, root, local, w.rate), ends[1])

    rows = [SheetRow(whole(*(x[0] for x in made.motions[0])), "likeliest", ("the mean of the prior",))]
    for number, motion in enumerate(made.motions[1:], start=1):
        rows.append(SheetRow(whole(*(x[0] for x in motion)), f"sample {number}"))
    rows.append(SheetRow(Motion(w.skeleton, w.root[one, :frames], w.local[one, :frames], w.rate), "truth"))
    save(path, compose(draw_rows(rows), f"{method.name}: one gap of {frames} frames", ""))
