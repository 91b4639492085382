"""Figure 3 of Chu and Yang 2024: different paths between the same two positions, by how far the facing turns."""

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

QUERY_TURNS = (0, 45, 90, 135)
"""Degrees from the facing of the start, which faces the target, to that of the target."""
MOST_VARIANTS = 7
DOT_STEPS, ARROW_STEPS = 5, 10
"""Steps between two dots, and between two arrows."""
SPEED_COLOURS = ("#440154", "#443983", "#31688e", "#21918c", "#35b779", "#8fc93a")
"""Darker is faster."""
PANEL_WIDTH = 6.6
"""Inches."""
BOTH_SIDES = np.array([-1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Variants:
    """The results of a query. degrees: by how much the facing turns. proposals: none where the gallery has no path."""

    degrees: int
    query: Query
    proposals: list[Proposal]


def variants(gallery: Gallery, distance: float, style: str | None = None, seed: int = 0) -> list[Variants]:
    """At most seven proposals for each of the four queries over ``distance`` metres.

    Raises :class:`~interpose.gallery.proposals.Unreachable` where all four have none.
    """
    made: list[Variants] = []
    missing: Unreachable | None = None
    for degrees in QUERY_TURNS:
        query = Query((0.0, 0.0, 0.0), (0.0, distance, float(np.radians(degrees))))
        try:
            found = propose(gallery, query, PathRequest(style=style), count=MOST_VARIANTS, seed=seed)
        except Unreachable as error:
            found, missing = [], error
        made.append(Variants(degrees, query, found))
    if missing is not None and not any(each.proposals for each in made):
        raise missing
    return made


def draw(shown: list[Variants], distance: float, style: str | None = None) -> bytes:
    """The picture as a PNG: a panel for each query at its own scale, with the straight distance below it."""
    bounds = [_bounds(each, distance) for each in shown]
    # The panels of a row share the height that the taller one needs at full width.
    wants = [PANEL_WIDTH * float(np.divide(*np.ptp(b, axis=0)[::-1])) for b in bounds]
    rows = [float(np.clip(max(wants[i : i + 2]), 2.4, 5.4)) for i in range(0, len(shown), 2)]
    first, between = 1.95, 1.25
    grid = canvas.round_length(max(1.2 * distance / 2.0, max(float(np.ptp(b, axis=0).max()) for b in bounds) / 7.5))
    name = "" if style is None else f" in style {style}"
    figure = canvas.sheet(
        first + sum(rows) + between * (len(rows) - 1) + 0.75,
        f"Paths over {distance:g} m{name}",
        f"Seen from above, by how far the facing turns. A dot every {DOT_STEPS} frames, the facing every {ARROW_STEPS}."
        f" Grid: {grid:g} m.",
    )
    seconds = [p.steps / RATE for each in shown for p in each.proposals]
    quickest = min(seconds)
    colours = canvas.colouring(figure, SPEED_COLOURS, quickest, max(*seconds, quickest + 0.5), "seconds")
    for number, (each, (low, high)) in enumerate(zip(shown, bounds, strict=True)):
        row = number // 2
        top = first + sum(rows[:row]) + between * row
        axes = canvas.panel(
            figure, canvas.SHEET_MARGIN + number % 2 * (PANEL_WIDTH + canvas.SHEET_MARGIN), top, PANEL_WIDTH, rows[row]
        )
        metre = min(PANEL_WIDTH / (high - low)[0], rows[row] / (high - low)[1])
        middle, half = (low + high) / 2.0, np.array([PANEL_WIDTH, rows[row]]) / metre / 2.0
        axes.set(xlim=middle[0] + half[0] * BOTH_SIDES, ylim=middle[1] + half[1] * BOTH_SIDES)
        _grid(axes, distance, grid)
        for proposal in sorted(each.proposals, key=lambda p: -p.steps):
            colour = colours(proposal.steps / RATE)
            at = canvas.seen(proposal.path)
            axes.plot(*at.T, color=colour, linewidth=1.6, solid_capstyle="round", zorder=2.0)
            axes.plot(*at[DOT_STEPS:-1:DOT_STEPS].T, "o", color=colour, markersize=3.2, markeredgewidth=0.0, zorder=2.5)
            some = slice(ARROW_STEPS, -DOT_STEPS, ARROW_STEPS)
            canvas.arrows(axes, at[some], proposal.path[some, 2], 0.2 / metre, colour)
        for place, colour in ((each.query.start, canvas.START), (each.query.target, canvas.TARGET)):
            canvas.stand(axes, place, 0.55 / metre, colour)
        times = sorted(p.steps / RATE for p in each.proposals)
        note = f"{len(times)} paths, {times[0]:.1f} to {times[-1]:.1f} s" if times else "no path in the gallery"
        canvas.title(axes, f"Turning {each.degrees}°", note)
    return canvas.png(figure)


def _bounds(each: Variants, distance: float) -> Float[ndarray, "2 2"]:
    """The lower left and the upper right of what a panel shows, with room for arrows."""
    straight = np.array([[0.0, 0.0], [distance, 0.0]])
    places = np.concatenate([canvas.seen(p.path) for p in each.proposals] + [straight])
    low, high = places.min(axis=0), places.max(axis=0)
    room = 0.125 * float(np.max(high - low))
    return np.stack([low - room, high + room])


def _grid(axes: canvas.Axes, distance: float, grid: float) -> None:
    """Grid lines ``grid`` metres apart, and below them the straight distance."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    across, up = (np.arange(np.ceil(a / grid), b / grid) * grid for a, b in ((left, right), (low, high)))
    axes.vlines(across, low, high, color=canvas.GRID_COLOUR, linewidth=0.8, zorder=0.5)
    axes.hlines(up, left, right, color=canvas.GRID_COLOUR, linewidth=0.8, zorder=0.5)
    shared = {"xycoords": axes.get_xaxis_transform(), "annotation_clip": False}
    axes.annotate("", (0.0, 0.0), (distance, 0.0), arrowprops={"arrowstyle": "|-|,widthA=0.25,widthB=0.25",
                  "color": canvas.FAINT, "lw": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}, **shared)  # fmt: skip
    axes.annotate(f"{distance:g} m", (distance / 2.0, 0.0), (0.0, -8.0), textcoords="offset points", ha="center",
                  va="top", color=canvas.FAINT, size=canvas.SMALL_SIZE, **shared)  # fmt: skip
