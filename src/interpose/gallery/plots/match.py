"""Figure 6 of Chu and Yang 2024: a query, a candidate of its length, the angle between them, and the result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery import index, matching, paths
from interpose.gallery.matching import Query, Trace
from interpose.gallery.plots import canvas
from interpose.gallery.store import Gallery
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW, WindowQuery, features
from interpose.rotation import wrapped

TARGET_TURN = 20.0
"""Degrees between the facing of the query's target and that of the window it is made from."""
MOST_HEADING = np.radians(40.0)
"""Radians: the query's largest angle from the page's horizontal, as the page is wider than tall."""
MOST_CANDIDATES = 8192
"""One of so many of the best direct candidates is shown."""
LEAST_OFF = np.radians(8.0)
"""Radians: facings that are off by this or more are visible."""
ANGLE_RANGE = np.radians(35.0), np.radians(125.0)
LENGTH_RANGE = 1.08, 2.0
"""Angles, and lengths relative to the straight distance, that show the steps best."""
WINDOW_DRAWS = 512
"""Windows from which the query is made from one at random."""
DOT_STEPS = 5
ARROW_SHARE = 0.38
"""The length of a facing's arrow, as a share of half a panel's height."""


@dataclass(frozen=True, eq=False)
class Matched:
    """One query and one of its direct candidates.

    count: direct candidates considered. angle: by which the candidate is turned. off: the turned candidate's facing at
    start and end relative to the query's. Radians, counter-clockwise seen from above.
    """

    query: Query
    trace: Trace
    style: str
    count: int
    stages: paths.PlacementStages
    angle: float
    off: tuple[float, float]


def matched(gallery: Gallery, distance: float, style: str | None = None, seed: int = 0) -> Matched:
    """A query made from a window of about ``distance`` metres, and a candidate drawn from those that serve it.

    The window is turned and moved, and its target turned by 20 degrees more. Raises InputError where no window moves
    from one position to another.
    """
    draw = np.random.default_rng(seed)
    styles = gallery.style_indices(style)
    own = _window(gallery, distance, styles, draw)
    heading = float(draw.uniform(-1.0, 1.0)) * MOST_HEADING
    moved = paths.turn(own, heading - paths.query_of(own).heading, 1.0, draw.uniform(-5.0, 5.0, 2))
    moved[-1, 2] += np.radians(TARGET_TURN) * draw.choice([-1.0, 1.0])
    query = paths.query_of(moved)
    steps = max(SHORTEST_WINDOW, int((len(own) - 1) / 1.1)), min(LONGEST_WINDOW, int(np.ceil((len(own) - 1) * 1.1)))
    found = matching.direct(gallery.search, query, MOST_CANDIDATES, steps, styles)
    order = [found[i] for i in draw.permutation(len(found))[:256]]
    made = [_matched(gallery, query, trace, len(found)) for trace in order]
    return max(made, key=_worth)


def _window(
    gallery: Gallery, distance: float, styles: tuple[int, ...] | None, draw: np.random.Generator
) -> Float[ndarray, "time 3"]:
    """A window of about that length, of one to three seconds where there is one; else the nearest in length."""
    about, anywhere = matching.band(distance), (2.0 * matching.IN_PLACE, matching.LONGEST_QUERY)
    for lengths, steps in (
        (about, (30, 90)),
        (about, (SHORTEST_WINDOW, LONGEST_WINDOW)),
        (anywhere, (SHORTEST_WINDOW, LONGEST_WINDOW)),
    ):
        if lengths[1] < anywhere[0]:
            continue
        found = index.sample(gallery.index, WindowQuery(lengths, (0.0, 0.0), "both", steps, styles), WINDOW_DRAWS, draw)
        if len(found):
            length = features(gallery.tracks.root, found.start, found.steps)[0]
            row = int(np.argmin(np.abs(length - distance))) if lengths == anywhere else int(draw.integers(len(found)))
            return gallery.tracks.cut(int(found.start[row]), int(found.steps[row]), bool(found.mirrored[row]))
    raise InputError("no trajectory of the gallery leads from one place to another; there is no match to show")


def _matched(gallery: Gallery, query: Query, trace: Trace, count: int) -> Matched:
    tracks = gallery.tracks
    stages = paths.stages(tracks, trace, query)
    angle = float(wrapped(query.heading - paths.query_of(stages.found).heading))
    ends = zip(stages.turned[[0, -1], 2].tolist(), (query.start[2], query.target[2]), strict=True)
    at_start, at_end = (float(wrapped(theirs - ours)) for theirs, ours in ends)
    return Matched(query, trace, tracks.style_of(trace.parts[0].start), count, stages, angle, (at_start, at_end))


def _worth(one: Matched) -> int:
    """How well a candidate shows the steps."""
    long = float(np.linalg.norm(np.diff(one.stages.turned[:, :2], axis=0), axis=-1).sum()) / one.query.distance
    seen = min(abs(off) for off in one.off) >= LEAST_OFF, ANGLE_RANGE[0] <= abs(one.angle) <= ANGLE_RANGE[1]
    return 4 * bool(seen[0]) + 2 * bool(seen[1]) + (LENGTH_RANGE[0] <= long <= LENGTH_RANGE[1])


def draw(one: Matched) -> bytes:
    """The picture as a PNG: four panels at one scale."""
    query, stages = one.query, one.stages
    part = one.trace.parts[0]
    found, laid, placed = (canvas.seen(track) for track in (stages.found, stages.turned, stages.placed))
    start, target = canvas.seen(np.array([query.start, query.target]))
    own = paths.query_of(stages.found)
    both = np.array([[0.0, 0.0], query.distance * canvas.toward(query.heading), found[-1] - found[0]])
    shown = [np.stack([start, target]), found, both, np.concatenate([laid, placed, [start, target]])]
    wide, tall, first, between = 6.6, 4.7, 1.95, 1.15
    arrow = ARROW_SHARE * max(_reach(places, wide / tall) for places in shown)
    for number, ends in ((0, query), (1, own), (3, query)):
        tips = [canvas.seen(np.array(end)) + arrow * canvas.toward(end[2]) for end in (ends.start, ends.target)]
        shown[number] = np.concatenate([shown[number], tips])
    half = 1.22 * max(_reach(places, wide / tall) for places in shown)
    figure = canvas.sheet(first + 2.0 * tall + between + 0.45, "How a trajectory is matched", _about(one))
    labels = (
        ("a", "Query", "two positions and their facings"),
        ("b", "Candidate", f"{part.steps} frames of the gallery, as long from end to end"),
        ("c", "Angle", "between both straight directions"),
        ("d", "Turned", "onto the query (dark), then made exact (dashed)"),
    )
    panels = []
    for number, (label, places) in enumerate(zip(labels, shown, strict=True)):
        row, column = divmod(number, 2)
        left, top = canvas.SHEET_MARGIN + column * (wide + canvas.SHEET_MARGIN), first + row * (tall + between)
        axes = canvas.panel(figure, left, top, wide, tall)
        middle = (places.max(axis=0) + places.min(axis=0)) / 2.0
        sides = half * np.array([-1.0, 1.0])
        axes.set(xlim=middle[0] + sides * wide / tall, ylim=middle[1] + sides)
        canvas.title(axes, label[1], label[2], label[0])
        panels.append(axes)
    a, b, c, d = panels
    _straight(a, start, target, canvas.INK, f"{query.distance:.2f} m", shown[0][:2])
    _ends(a, query, arrow, (canvas.START, canvas.TARGET), "target", np.stack([start, target]))
    _straight(b, found[0], found[-1], canvas.FAINT, f"{own.distance:.2f} m", found)
    _path(b, found, canvas.INK)
    _ends(b, own, arrow, (canvas.INK, canvas.INK), "end", found)
    _angle(c, both, own.heading, one.angle)
    _path(d, laid, canvas.INK)
    some = slice(2 * DOT_STEPS, -2 * DOT_STEPS, 2 * DOT_STEPS)
    canvas.arrows(d, laid[some], stages.turned[some, 2], 0.5 * arrow, canvas.INK)
    canvas.arrows(d, placed[some], stages.placed[some, 2], 0.5 * arrow, canvas.TARGET)
    d.plot(*placed.T, color=canvas.TARGET, linewidth=2.2, linestyle=(0, (4, 2.5)), zorder=2.6)
    _wedge(d, query.start, one.off[0], arrow, canvas.START, laid)
    _wedge(d, query.target, one.off[1], arrow, canvas.TARGET, laid)
    _scale(a)
    return canvas.png(figure)


def _reach(places: Float[ndarray, "place 2"], shape: float) -> float:
    """Half the height of a panel that just holds the places, ``shape`` times as wide as tall."""
    return float(np.max(np.ptp(places, axis=0) / [shape, 1.0])) / 2.0


def _about(one: Matched) -> str:
    part = one.trace.parts[0]
    seen = ", seen in a mirror" if part.mirrored else ""
    return (
        f"Seen from above. The candidate is one of the {one.count:,} best: {one.style}, frames {part.start:,} to"
        f" {part.start + part.steps:,} of the gallery{seen}."
    )


def _straight(
    axes: canvas.Axes, a: Float[ndarray, "2"], b: Float[ndarray, "2"], colour: str, label: str, places: ndarray
) -> None:
    """The straight arrow from ``a`` to ``b``, with its length beside it, on the other side of most ``places``."""
    dashed = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "ls": (0, (5, 3)), "mutation_scale": 16.0}
    axes.annotate("", tuple(b), tuple(a), arrowprops={**dashed, "shrinkA": 9.0, "shrinkB": 9.0}, zorder=2.0)
    angle = float(np.arctan2(*(b - a)[::-1]))
    normal = canvas.toward(angle + np.pi / 2.0)
    side = -1.0 if float(np.mean((places - a) @ normal)) > 1e-9 else 1.0
    canvas.beside(axes, (a + b) / 2.0, angle + side * np.pi / 2.0, label, colour, gap=10.0)


def _path(axes: canvas.Axes, places: Float[ndarray, "time 2"], colour: str) -> None:
    axes.plot(*places.T, color=colour, linewidth=1.8, zorder=2.4)
    axes.plot(*places[DOT_STEPS:-1:DOT_STEPS].T, ".", color=colour, markersize=6.5, zorder=2.5)


def _ends(
    axes: canvas.Axes, query: Query, arrow: float, colours: tuple[str, str], last: str, around: Float[ndarray, "time 2"]
) -> None:
    """The characters at both ends, with labels where ``around`` and the straight path leave most room."""
    for place, colour, name, straight in (
        (query.start, colours[0], "start", query.heading),
        (query.target, colours[1], last, query.heading + np.pi),
    ):
        canvas.stand(axes, place, arrow, colour)
        at = canvas.seen(np.array(place))
        canvas.beside(axes, at, canvas.free([place[2], straight, *_near(at, around, arrow)]), name, colour)


def _near(at: Float[ndarray, "2"], around: Float[ndarray, "time 2"], reach: float) -> list[float]:
    """The directions in which a path passes within reach."""
    away = around - at
    far = np.linalg.norm(away, axis=-1)
    x, y = away[(far < reach) & (far > 0.05 * reach)].T
    return np.arctan2(y, x).tolist()


def _angle(axes: canvas.Axes, both: Float[ndarray, "3 2"], heading: float, angle: float) -> None:
    """Two vectors from one origin, with the arc from the candidate's to the query's."""
    origin, ours, theirs = both
    for tip, colour, label in ((ours, canvas.INK, "query"), (theirs, canvas.FAINT, "candidate")):
        shape = {"arrowstyle": "-|>", "lw": 2.2, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 18.0}
        axes.annotate("", tuple(tip), tuple(origin), arrowprops={"color": colour, **shape}, zorder=3.0)
        canvas.beside(axes, tip, float(np.arctan2(*tip[::-1])), label, colour, gap=8.0)
    axes.plot(*origin, "o", color=canvas.INK, markersize=7.0, zorder=4.0)
    radius = 0.42 * float(np.linalg.norm(ours))
    turns = heading + angle * np.linspace(0.0, 1.0, 64)
    arc = origin + radius * canvas.toward(turns)
    axes.fill(*np.concatenate([[origin], arc]).T, color=canvas.GRID_COLOUR, alpha=0.6, linewidth=0.0, zorder=1.0)
    axes.plot(*arc.T, color=canvas.TARGET, linewidth=2.0, zorder=2.0)
    middle = heading + angle / 2.0
    canvas.beside(axes, origin + radius * canvas.toward(middle), middle, f"{np.degrees(abs(angle)):.0f}°",
                  canvas.TARGET, canvas.TITLE_SIZE, 10.0)  # fmt: skip


def _wedge(
    axes: canvas.Axes, place: tuple[float, float, float], off: float, arrow: float, colour: str, around: ndarray
) -> None:
    """The facings of the query and of the candidate, with the angle in between."""
    at, facing = canvas.seen(np.array(place)), place[2]
    turns = facing + off * np.linspace(0.0, 1.0, 32)
    edge = at + 0.8 * arrow * canvas.toward(turns)
    axes.fill(*np.concatenate([[at], edge]).T, color=colour, alpha=0.22, linewidth=0.0, zorder=1.5)
    canvas.arrows(axes, at[None], np.array([facing + off]), arrow, canvas.INK, width=3.5, zorder=4.0)
    canvas.stand(axes, place, arrow, colour)
    between = facing + off / 2.0
    spot, direction, gap = at + arrow * canvas.toward(between), between, 8.0
    if np.linalg.norm(around - (at + 1.6 * arrow * canvas.toward(between)), axis=-1).min() < 0.8 * arrow:
        # The path passes there, so put the label beside the dot.
        spot, direction, gap = at, canvas.free([facing, facing + off, *_near(at, around, 1.5 * arrow)]), 16.0
    canvas.beside(axes, spot, direction, f"{np.degrees(abs(off)):.0f}° off", colour, canvas.TITLE_SIZE, gap)


def _scale(axes: canvas.Axes) -> None:
    """A scale bar of a round length, at the lower left."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    long = canvas.round_length(0.3 * (right - left))
    at = left + 0.02 * (right - left), low + 0.05 * (high - low)
    axes.plot((at[0], at[0] + long), (at[1], at[1]), color=canvas.FAINT, linewidth=2.0, solid_capstyle="butt")
    axes.annotate(f"{long:g} m", (at[0] + long / 2.0, at[1]), (0.0, 6.0), textcoords="offset points", ha="center",
                  color=canvas.FAINT, size=canvas.SMALL_SIZE)  # fmt: skip
