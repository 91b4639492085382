"""Arbitrary trajectory matching (Chu and Yang 2024, section 4.2, Algorithm 1, equations 7 and 8).

A query asks for a way from one place and facing on the ground to another. Windows as long as the query's own way are
*direct* candidates once they are turned onto it. Where there are none within the error budget, the way is split: a
window shorter than it is put first, judged by its start alone, and what is left is asked for again with what is left of
the budget, five rounds deep at most. All parts lie on the query's straight line, so what is left of a query is a
length, two facings, and the steps that remain.

Which windows there are is asked through a :data:`Search`, so that the index and the plain scan can serve alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.gallery.tracks import Tracks
from interpose.gallery.windows import (
    LONGEST_WINDOW,
    SHORTEST_WINDOW,
    FoundWindows,
    WindowQuery,
    features,
    select,
    to_radians,
)

Search = Callable[[WindowQuery, int], FoundWindows]
"""The windows wanted, so many at most, best first: `index.best` or `scan.best` of a gallery."""

IN_PLACE = 0.1
"""Metres: where start and target are nearer than this the way has no direction, and the turn is matched instead."""
LEAST = 0.03
"""Metres: a part of a composition is at least this long."""
FARTHEST = 100.0
"""Metres of a query at most; six of the longest windows do not reach farther."""


@dataclass(frozen=True)
class Query:
    """q = (o_s, o_e, v_p) with its place: start and target as (x, z, yaw), metres and radians."""

    start: tuple[float, float, float]
    target: tuple[float, float, float]

    @property
    def distance(self) -> float:
        """The length of v_p, metres."""
        return float(np.hypot(self.target[0] - self.start[0], self.target[1] - self.start[1]))

    @property
    def heading(self) -> float:
        """The yaw of v_p; of the start's facing where the query is in place."""
        if self.distance < IN_PLACE:
            return self.start[2]
        return float(np.arctan2(self.target[0] - self.start[0], self.target[1] - self.start[1]))

    @property
    def facing(self) -> tuple[float, float]:
        """Both facings relative to v_p."""
        return self.start[2] - self.heading, self.target[2] - self.heading

    @property
    def in_place(self) -> bool:
        """Whether only the turn is matched."""
        return self.distance < IN_PLACE


@dataclass(frozen=True)
class MatchSettings:
    """How far a match may be off, and how long it is searched for.

    tolerance: of the way's length, relative and in metres; what is left is scaled away. threshold: error budget alpha,
    radians. branches: k of Algorithm 1. rounds: how often a way is split at most. searches: queries of one composition
    at most, so that none takes for ever.
    """

    tolerance: float = 0.03
    least_tolerance: float = 0.02
    threshold: float = float(np.radians(60.0))
    branches: int = 4
    rounds: int = 5
    searches: int = 24


MATCH_DEFAULTS = MatchSettings()


@dataclass(frozen=True)
class Window:
    """A window of the gallery, as it lies or in the mirror."""

    start: int
    steps: int
    mirrored: bool


@dataclass(frozen=True)
class Trace:
    """One answer: atomic trajectories in order, and their error: equation 7, with the facings' mismatch at joins."""

    parts: tuple[Window, ...]
    error: float

    @property
    def steps(self) -> int:
        """Frames from start to end."""
        return sum(part.steps for part in self.parts)


def window_query(
    query: Query, steps: tuple[int, int], styles: tuple[int, ...] | None, settings: MatchSettings = MATCH_DEFAULTS
) -> WindowQuery:
    """What a direct candidate for a query must have."""
    if query.in_place:
        return WindowQuery((0.0, 1.5 * IN_PLACE), query.facing, "turn", steps, styles, settings.threshold)
    return WindowQuery(band(query.distance, settings), query.facing, "both", steps, styles, settings.threshold)


def band(distance: float, settings: MatchSettings = MATCH_DEFAULTS) -> tuple[float, float]:
    """The lengths that pass for ``distance``."""
    slack = max(settings.least_tolerance, settings.tolerance * distance)
    return max(0.0, distance - slack), distance + slack


def direct(
    search: Search,
    query: Query,
    count: int,
    steps: tuple[int, int] = (SHORTEST_WINDOW, LONGEST_WINDOW),
    styles: tuple[int, ...] | None = None,
    settings: MatchSettings = MATCH_DEFAULTS,
) -> list[Trace]:
    """The ``count`` best direct candidates (Algorithm 1, lines 9 to 15), best first; empty where there is none."""
    return traces(search(window_query(query, steps, styles, settings), count))


def compose(
    search: Search,
    tracks: Tracks,
    distances: Float[ndarray, "quantile"],
    query: Query,
    generator: np.random.Generator,
    steps: tuple[int, int] = (SHORTEST_WINDOW, LONGEST_WINDOW * 6),
    styles: tuple[int, ...] | None = None,
    settings: MatchSettings = MATCH_DEFAULTS,
) -> Trace | None:
    """Several windows, one after the other, for a query (Algorithm 1, lines 28 to 38); None where there are none.

    ``distances``: the gallery's distribution of lengths, ascending, from which sub-distances are drawn. Equal
    generators give equal answers, however ``search`` finds them.
    """
    if query.in_place or query.distance > FARTHEST:
        return None
    task = _Task(search, tracks, distances, generator, styles, settings)
    return task.solve(query.distance, query.facing, steps, settings.threshold, settings.rounds)


@dataclass(eq=False)
class _Task:
    """One composition under way; counts its searches."""

    search: Search
    tracks: Tracks
    distances: Float[ndarray, "quantile"]
    generator: np.random.Generator
    styles: tuple[int, ...] | None
    settings: MatchSettings
    searches: int = 0

    def solve(
        self, distance: float, facing: tuple[float, float], steps: tuple[int, int], budget: float, rounds: int
    ) -> Trace | None:
        """TCS(M, q, alpha, k) for what is left of the query."""
        lengths = max(steps[0], SHORTEST_WINDOW), min(steps[1], LONGEST_WINDOW)
        asked = WindowQuery(band(distance, self.settings), facing, "both", lengths, self.styles, budget)
        if self.searches >= self.settings.searches:
            return None
        if rounds < self.settings.rounds:  # the whole query has been asked directly before
            found = self._ask(asked, 8 * self.settings.branches)
            if len(found):
                return traces(found)[int(self.generator.integers(len(found)))]
        if rounds == 0 or steps[1] < 2 * SHORTEST_WINDOW or self.searches >= self.settings.searches:
            return None
        share = self._share(distance, steps, rounds)
        if share is None:
            return None
        # A first part of about that share of the steps that may be left, so that the pace stays even.
        paced = (
            max(SHORTEST_WINDOW, int(0.7 * share * steps[0])),
            min(LONGEST_WINDOW, int(np.ceil(1.3 * share * steps[1])), steps[1] - SHORTEST_WINDOW),
        )
        first = replace(asked, distance=band(share * distance, self.settings), criterion="start", steps=paced)
        found = self._ask(first, 16 * self.settings.branches)
        order = self.generator.permutation(len(found))[: self.settings.branches]
        branches = traces(select(found, order))
        for branch in branches:
            part = branch.parts[0]
            length, _, end = features(self.tracks.root, np.array([part.start]), part.steps)
            turned = float(to_radians(int(end[0]))) * (-1.0 if part.mirrored else 1.0)
            left = max(0, steps[0] - part.steps), steps[1] - part.steps
            rest = distance - float(length[0])
            if rest < LEAST:
                continue
            trace = self.solve(rest, (turned, facing[1]), left, budget - branch.error, rounds - 1)
            if trace is not None:
                return Trace((part, *trace.parts), branch.error + trace.error)
            if self.searches >= self.settings.searches:
                return None
        return None

    def _ask(self, asked: WindowQuery, count: int) -> FoundWindows:
        self.searches += 1
        return self.search(asked, count)

    def _share(self, distance: float, steps: tuple[int, int], rounds: int) -> float | None:
        """The first part's share of the way, drawn from the gallery's lengths; None where no draw can lead there."""
        least = max(LEAST, distance - rounds * self.distances[-1]) / distance
        least = max(least, 1.0 - rounds * LONGEST_WINDOW / max(steps[0], 1)) if steps[0] > LONGEST_WINDOW else least
        most = min(1.0 - LEAST / distance, self.distances[-1] / distance)
        if least > most:
            return None
        low, high = np.searchsorted(self.distances, [least * distance, most * distance])
        if high <= low:
            return float(self.generator.uniform(least, most))
        return float(np.clip(self.distances[self.generator.integers(low, high)] / distance, least, most))


def traces(found: FoundWindows) -> list[Trace]:
    """Each window as a trace of its own."""
    rows = zip(found.start.tolist(), found.steps.tolist(), found.mirrored.tolist(), found.error.tolist(), strict=True)
    return [Trace((Window(start, steps, bool(side)),), float(to_radians(error))) for start, steps, side, error in rows]
