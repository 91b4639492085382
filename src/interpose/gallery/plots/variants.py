"""Figure 3: how different the ways are between the same two places, the more so the more the facing has to turn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import RATE
from interpose.gallery.matching import Query
from interpose.gallery.plots import canvas
from interpose.gallery.proposals import PathRequest, Proposal, Unreachable, propose
from interpose.gallery.store import Gallery

DEGREES = (0, 45, 90, 135)
"""By how much the target faces another way than the start, which faces along the way."""
COUNT = 7
DOT, ARROW = 5, 10
"""Frames from one dot to the next, and from one arrow to the next."""
COLOURS = ("#440154", "#443983", "#31688e", "#21918c", "#35b779", "#8fc93a")
"""Darker is faster."""
PANEL = 6.6
"""Inches of a panel's width."""
SIDES = np.array([-1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Variants:
    """What a query finds. degrees: by how much the facing turns. proposals: none where the gallery has no way."""

    degrees: int
    query: Query
    proposals: list[Proposal]


def variants(gallery: Gallery, distance: float, style: str | None = None, seed: int = 0) -> list[Variants]:
    """Seven proposals at most for each of the four queries over ``distance`` metres.

    Raises :class:`~interpose.gallery.proposals.Unreachable` where there is none for any of them.
    """
    made: list[Variants] = []
    missing: Unreachable | None = None
    for degrees in DEGREES:
        query = Query((0.0, 0.0, 0.0), (0.0, distance, float(np.radians(degrees))))
        try:
            found = propose(gallery, query, PathRequest(style=style), count=COUNT, seed=seed)
        except Unreachable as error:
            found, missing = [], error
        made.append(Variants(degrees, query, found))
    if missing is not None and not any(each.proposals for each in made):
        raise missing
    return made


def draw(shown: list[Variants], distance: float, style: str | None = None) -> bytes:
    """The picture: a panel a query, each at its own scale, which the length of the straight way below it tells."""
    bounds = [_bounds(each, distance) for each in shown]
    # Panels of one row are as tall as the taller needs where it fills the width.
    wants = [PANEL * float(np.divide(*np.ptp(b, axis=0)[::-1])) for b in bounds]
    rows = [float(np.clip(max(wants[i : i + 2]), 2.4, 5.4)) for i in range(0, len(shown), 2)]
    first, between = 1.95, 1.25
    grid = canvas.round_length(max(1.2 * distance / 2.0, max(float(np.ptp(b, axis=0).max()) for b in bounds) / 7.5))
    name = "" if style is None else f" in style {style}"
    figure = canvas.sheet(
        first + sum(rows) + between * (len(rows) - 1) + 0.75,
        f"Ways over {distance:g} m{name}",
        f"Seen from above, by how far the facing turns. A dot every {DOT} frames, the facing every {ARROW}. Grid:"
        f" {grid:g} m.",
    )
    seconds = [p.steps / RATE for each in shown for p in each.proposals]
    quickest = min(seconds)
    colours = canvas.colouring(figure, COLOURS, quickest, max(*seconds, quickest + 0.5), "seconds")
    for number, (each, (low, high)) in enumerate(zip(shown, bounds, strict=True)):
        row = number // 2
        top = first + sum(rows[:row]) + between * row
        axes = canvas.panel(figure, canvas.MARGIN + number % 2 * (PANEL + canvas.MARGIN), top, PANEL, rows[row])
        metre = min(PANEL / (high - low)[0], rows[row] / (high - low)[1])
        middle, half = (low + high) / 2.0, np.array([PANEL, rows[row]]) / metre / 2.0
        axes.set(xlim=middle[0] + half[0] * SIDES, ylim=middle[1] + half[1] * SIDES)
        _grid(axes, distance, grid)
        for proposal in sorted(each.proposals, key=lambda p: -p.steps):
            colour = colours(proposal.steps / RATE)
            at = canvas.seen(proposal.path)
            axes.plot(*at.T, color=colour, linewidth=1.6, solid_capstyle="round", zorder=2.0)
            axes.plot(*at[DOT:-1:DOT].T, "o", color=colour, markersize=3.2, markeredgewidth=0.0, zorder=2.5)
            some = slice(ARROW, -DOT, ARROW)
            canvas.arrows(axes, at[some], proposal.path[some, 2], 0.2 / metre, colour)
        for place, colour in ((each.query.start, canvas.START), (each.query.target, canvas.TARGET)):
            canvas.stand(axes, place, 0.55 / metre, colour)
        times = sorted(p.steps / RATE for p in each.proposals)
        note = f"{len(times)} ways, {times[0]:.1f} to {times[-1]:.1f} s" if times else "no way in the gallery"
        canvas.title(axes, f"Turning {each.degrees}°", note)
    return canvas.png(figure)


def _bounds(each: Variants, distance: float) -> Float[ndarray, "2 2"]:
    """The lowest and the highest place on the page that a panel has to show, with room for arrows."""
    straight = np.array([[0.0, 0.0], [distance, 0.0]])
    places = np.concatenate([canvas.seen(p.path) for p in each.proposals] + [straight])
    low, high = places.min(axis=0), places.max(axis=0)
    room = 0.125 * float(np.max(high - low))
    return np.stack([low - room, high + room])


def _grid(axes: canvas.Axes, distance: float, grid: float) -> None:
    """Lines ``grid`` metres apart, and below them how long the straight way is."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    across, up = (np.arange(np.ceil(a / grid), b / grid) * grid for a, b in ((left, right), (low, high)))
    axes.vlines(across, low, high, color=canvas.LINE, linewidth=0.8, zorder=0.5)
    axes.hlines(up, left, right, color=canvas.LINE, linewidth=0.8, zorder=0.5)
    shared = {"xycoords": axes.get_xaxis_transform(), "annotation_clip": False}
    axes.annotate("", (0.0, 0.0), (distance, 0.0), arrowprops={"arrowstyle": "|-|,widthA=0.25,widthB=0.25",
                  "color": canvas.FAINT, "lw": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}, **shared)  # fmt: skip
    axes.annotate(f"{distance:g} m", (distance / 2.0, 0.0), (0.0, -8.0), textcoords="offset points", ha="center",
                  va="top", color=canvas.FAINT, size=canvas.SMALL, **shared)  # fmt: skip
