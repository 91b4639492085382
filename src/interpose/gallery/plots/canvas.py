"""What the gallery's pictures share: colours, type sizes, and how positions and facings look from above.

The only module of the gallery that uses matplotlib, which it imports when something is drawn.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.render import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # the types that tests check at run time, where matplotlib is not imported
    Axes = Figure = Any

DPI = 160
SHEET_WIDTH = 15.0
"""Inches."""
SHEET_MARGIN = 0.6
HEADING_SIZE, TITLE_SIZE, TEXT_SIZE, SMALL_SIZE = 20.0, 15.0, 12.0, 10.5
"""Type sizes, points."""


def _hex(colour: drawing.Colour) -> str:
    return "#" + "".join(f"{c:02x}" for c in colour)


PAPER, INK, START, TARGET = (_hex(c) for c in (drawing.PAPER, drawing.INK, drawing.START, drawing.TARGET))
FAINT = _hex(drawing.mix(drawing.FAINT, drawing.INK, 0.35))
"""For text: a little darker than `drawing.FAINT`, which is for larger type."""
GRID_COLOUR = _hex(drawing.mix(drawing.PAPER, drawing.FAINT, 0.2))


def need_matplotlib() -> None:
    """Raises InputError where matplotlib is not installed."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise InputError("the pictures need matplotlib: pip install 'interpose[train]'") from None


def sheet(height: float, heading: str, below: str) -> Figure:
    """An empty picture with a heading and a subheading at the upper left. ``height``: inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(SHEET_WIDTH, height), dpi=DPI, facecolor=PAPER)
    FigureCanvasAgg(figure)
    left = SHEET_MARGIN / SHEET_WIDTH
    figure.text(left, 1.0 - 0.62 / height, heading, size=HEADING_SIZE, color=INK, weight="bold", va="baseline",
                parse_math=False)  # fmt: skip
    figure.text(left, 1.0 - 1.0 / height, below, size=TEXT_SIZE, color=FAINT, va="baseline", parse_math=False)
    return figure


def panel(figure: Figure, left: float, top: float, width: float, height: float) -> Axes:
    """Axes without frame or ticks, placed in inches, ``top`` from the upper edge."""
    tall = figure.get_figheight()
    axes = figure.add_axes((left / SHEET_WIDTH, 1.0 - (top + height) / tall, width / SHEET_WIDTH, height / tall))
    axes.set_facecolor("none")
    axes.spines[:].set_visible(False)
    axes.set_axisbelow(True)
    axes.set(xticks=[], yticks=[])
    return axes


def colouring(
    figure: Figure,
    colours: Sequence[str],
    low: float,
    high: float,
    label: str,
    ticks: Sequence[float] | None = None,
    *,
    root: bool = False,
) -> Callable[[Any], ndarray]:
    """A colour scale from ``low`` to ``high``, linear or by square root, with a legend at the upper right.

    Returns the function from numbers to rows of red, green, blue, alpha. Without ``ticks`` it chooses round numbers.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, PowerNorm
    from matplotlib.ticker import MaxNLocator

    ramp = LinearSegmentedColormap.from_list("ramp", list(colours))
    coloured = ScalarMappable(PowerNorm(0.5 if root else 1.0, low, high), ramp)
    axes = panel(figure, SHEET_WIDTH - SHEET_MARGIN - 3.2, 0.52, 3.2, 0.13)
    places = list(ticks) if ticks is not None else MaxNLocator(5, steps=[1, 2, 5, 10])
    bar = figure.colorbar(coloured, cax=axes, orientation="horizontal", ticks=places, format="{x:,g}")
    bar.outline.set_visible(False)  # type: ignore[operator]  # its stub says Any or a method
    axes.tick_params(length=0.0, pad=5.0, labelsize=SMALL_SIZE, labelcolor=FAINT)
    axes.annotate(label, (1.0, 1.0), (0.0, 6.0), xycoords="axes fraction", textcoords="offset points", ha="right",
                  size=SMALL_SIZE, color=FAINT)  # fmt: skip
    return lambda values: coloured.to_rgba(np.asarray(values, dtype=float))


def hill(axes: Axes, at: Float[ndarray, "place"], top: Float[ndarray, "place"], base: float, colours: ndarray) -> None:
    """The area between ``base`` and ``top`` (up is less), with a colour for each place."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    half = (at[1] - at[0]) / 2.0
    ends = float(at[0] - half), float(at[-1] + half)
    outline = np.concatenate([[[ends[0], base]], [[ends[0], top[0]]], np.stack([at, top], axis=-1), [[ends[1], base]]])
    filled = axes.imshow(colours[None], extent=(*ends, base, float(top.min())), aspect="auto", zorder=2)
    filled.set_clip_path(PathPatch(Path(outline), transform=axes.transData))


def title(axes: Axes, label: str, note: str, mark: str = "") -> None:
    """A panel's title with a note after it and a ``mark`` before it, above the panel."""
    after: Any = "axes fraction"
    start = 0.0
    styles = ((mark, TITLE_SIZE, "bold", TARGET), (label, TITLE_SIZE, "bold", INK), (note, TEXT_SIZE, "normal", FAINT))
    for text, size, weight, colour in styles:
        if text:
            after = axes.annotate(text, (start, 1.0), (12.0 * start, 14.0), xycoords=(after, "axes fraction"),
                                  textcoords="offset points", va="baseline", size=size, weight=weight,
                                  color=colour)  # fmt: skip
            start = 1.0


def png(figure: Figure) -> bytes:
    """The finished picture as the bytes of a PNG."""
    held = io.BytesIO()
    figure.savefig(held, format="png")
    return held.getvalue()


def seen(track: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 2"]:
    """The page position of x, z, yaw: z to the right, x up, so that yaw turns counter-clockwise from the right."""
    return np.stack([track[..., 1], track[..., 0]], axis=-1)


def toward(angle: Float[ndarray, "*batch"] | float) -> Float[ndarray, "*batch 2"]:
    """The direction of a yaw on the page, a unit vector."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def arrows(
    axes: Axes, at: Float[ndarray, "arrow 2"], yaw: Float[ndarray, "arrow"], length: float, colour: Any, **more: Any
) -> None:
    """Thin arrows of ``length`` metres."""
    tips = length * toward(yaw)
    axes.quiver(
        *at.T, *tips.T, color=colour, angles="xy", scale_units="xy", scale=1.0, units="dots", headwidth=4.2,
        headlength=4.6, headaxislength=4.2, **{"width": 2.0, "zorder": 3.0, **more},
    )  # fmt: skip


def stand(axes: Axes, place: Sequence[float], length: float, colour: str) -> None:
    """A character at x, z that faces yaw: a dot and an arrow with a pale outline."""
    track = np.array([place], dtype=float)
    at = seen(track)
    arrows(axes, at, track[:, 2], length, colour, width=7.0, zorder=6.0, edgecolor=PAPER, linewidth=1.0, clip_on=False)
    axes.plot(*at.T, "o", color=colour, markersize=12.0, markeredgecolor=PAPER, markeredgewidth=1.5, zorder=6.5)


def beside(
    axes: Axes, at: ndarray, angle: float, label: str, colour: str, size: float = TEXT_SIZE, gap: float = 14.0
) -> None:
    """A label ``gap`` points away from a place, in a direction on the page."""
    direction = toward(angle)
    side = "left" if direction[0] > 0.35 else "right" if direction[0] < -0.35 else "center"
    height = "bottom" if direction[1] > 0.7 else "top" if direction[1] < -0.7 else "center"
    axes.annotate(
        label, tuple(at), tuple(gap * direction), textcoords="offset points", ha=side, va=height, color=colour,
        size=size, zorder=9.0, annotation_clip=False,
    )  # fmt: skip


def free(busy: Sequence[float]) -> float:
    """The direction in the middle of the widest gap between the ``busy`` ones."""
    turns = np.sort(np.remainder(np.asarray(busy, dtype=float), 2.0 * np.pi))
    gaps = np.diff(turns, append=turns[0] + 2.0 * np.pi)
    widest = int(np.argmax(gaps))
    return float(turns[widest] + gaps[widest] / 2.0)


def round_length(most: float) -> float:
    """The largest of ... 0.1, 0.2, 0.5, 1, 2, 5, 10 ... that is at most ``most``."""
    tens = 10.0 ** np.floor(np.log10(most))
    return float(max(step for step in (tens, 2.0 * tens, 5.0 * tens) if step <= most))
