"""Figure 4 of Chu and Yang 2024: the distance covered in one and a half seconds, by style."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery.plots import canvas
from interpose.gallery.tracks import Tracks

SEGMENT_STEPS = 45
"""Steps of a segment, at 30 Hz."""
DENSITY_BINS = 480
DENSITY_SMOOTHING = 0.05
"""Metres: the standard deviation of the Gaussian that smooths the distributions."""
MANY_STYLES = 25
"""With more styles than these, the scale is shown above the picture too."""
DENSITY_COLOURS = ("#dfe6e4", "#9dbfca", "#4d8aa5", "#1f5c7a", "#0e2f44")


def covered(tracks: Tracks, frames: int = SEGMENT_STEPS) -> dict[str, Float[ndarray, "segment"]]:
    """For each style the lengths along the track of all segments of so many frames, metres, by ascending median.

    Styles without a long enough clip are left out. Raises InputError where no style has one.
    """
    parts: dict[str, list[ndarray]] = {}
    for (start, stop), style in zip(tracks.ranges.tolist(), tracks.clip_styles.tolist(), strict=True):
        if stop - start > frames:
            steps = np.linalg.norm(np.diff(tracks.root[start:stop, :2].astype(float), axis=0), axis=-1)
            upto = np.concatenate([[0.0], np.cumsum(steps)])
            parts.setdefault(tracks.styles[style], []).append(upto[frames:] - upto[:-frames])
    if not parts:
        raise InputError(f"no clip of the gallery is longer than {frames} frames; there is no distance to show")
    lengths = {style: np.concatenate(some) for style, some in parts.items()}
    return dict(sorted(lengths.items(), key=lambda item: (float(np.median(item[1])), item[0])))


def draw(lengths: dict[str, Float[ndarray, "segment"]], chosen: str | None = None) -> bytes:
    """The picture as a PNG: a row for each style, its distribution as a hill, darker where there are more segments."""
    far = 1.04 * max(max(float(np.quantile(some, 0.999)) for some in lengths.values()), 4.0 * DENSITY_SMOOTHING)
    at, hills = density(lengths, far)
    pitch = float(np.clip(9.0 / len(lengths), 0.34, 0.62))
    first, numbers = 1.95, 2.5
    side = canvas.SHEET_MARGIN + 0.3 + 0.108 * max(12, *(len(style) for style in lengths))
    wide, tall = canvas.SHEET_WIDTH - side - numbers, pitch * len(lengths)
    figure = canvas.sheet(
        first + tall + 1.1,
        f"Distance covered in {SEGMENT_STEPS} frames",
        f"The path of the hips over the ground in {SEGMENT_STEPS / RATE:g} s, by style. Darker: more segments. The"
        " pale stroke is the median.",
    )
    axes = canvas.panel(figure, side, first, wide, tall)
    axes.set(xlim=(0.0, far), ylim=(len(lengths), 0.0))
    most = max(float(hill.max()) for hill in hills.values())
    ticks = [0.0, canvas.round_length(most / 4.0), canvas.round_length(most)]
    colours = canvas.colouring(figure, DENSITY_COLOURS, 0.0, most, "segments for each 10 cm", ticks, root=True)
    metres = np.arange(0.0, far, 1.0 if far > 2.5 else 0.2)
    axes.vlines(metres, 0.0, len(lengths), color=canvas.GRID_COLOUR, linewidth=0.8, zorder=0.5)
    for row, (style, hill) in enumerate(hills.items()):
        base, ink = row + 0.86, canvas.TARGET if style == chosen else canvas.INK
        ridge = base - 0.78 * hill / hill.max()
        canvas.hill(axes, at, ridge, base, colours(hill))
        axes.plot((0.0, far), (base, base), color=canvas.GRID_COLOUR, linewidth=0.8, zorder=1.5)
        middle = float(np.median(lengths[style]))
        top = float(np.interp(middle, at, ridge))
        axes.plot((middle, middle), (base, top), color=canvas.PAPER, linewidth=1.6, zorder=3)
        weight = "bold" if style == chosen else "normal"
        letters = {"color": ink, "size": canvas.TEXT_SIZE, "va": "baseline", "weight": weight, "parse_math": False}
        axes.annotate(style, (0.0, base), (-14.0, 1.0), textcoords="offset points", ha="right", **letters)
        for text, right in ((f"{middle * RATE / SEGMENT_STEPS:.2f}", 62.0), (f"{len(lengths[style]):,}", 137.0)):
            axes.annotate(text, (far, base), (right, 1.0), textcoords="offset points", ha="right", **letters)
    for text, right in (("median m/s", 62.0), ("segments", 137.0)):
        axes.annotate(text, (1.0, 1.0), (right, 12.0), xycoords="axes fraction", textcoords="offset points",
                      ha="right", color=canvas.FAINT, size=canvas.SMALL_SIZE)  # fmt: skip
    axes.set_xticks(metres)
    axes.tick_params(
        length=0.0, pad=7.0, labeltop=len(lengths) > MANY_STYLES, labelsize=canvas.SMALL_SIZE, labelcolor=canvas.FAINT
    )
    axes.set_xlabel(f"metres in {SEGMENT_STEPS / RATE:g} s", color=canvas.FAINT, size=canvas.TEXT_SIZE, labelpad=8.0)
    return canvas.png(figure)


def density(
    lengths: dict[str, Float[ndarray, "segment"]], far: float
) -> tuple[Float[ndarray, "place"], dict[str, Float[ndarray, "place"]]]:
    """Places from 0 to ``far`` metres, and the number of segments of each style there for each 10 cm."""
    from scipy.ndimage import gaussian_filter1d

    width = far / DENSITY_BINS
    hills = {}
    for style, some in lengths.items():
        counts = np.histogram(some, DENSITY_BINS, (0.0, far))[0] * (0.1 / width)
        hills[style] = gaussian_filter1d(counts, DENSITY_SMOOTHING / width, mode="reflect")
    return (np.arange(DENSITY_BINS) + 0.5) * width, hills
