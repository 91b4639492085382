"""Arbitrary trajectory matching (Chu and Yang 2024, section 4.2, Algorithm 1, equations 7 and 8).

Windows come from a :data:`Search`, so that Algorithm 1 does not depend on how they are found.
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
"""At most so many of the wanted windows, best first, such as `index.best` of a gallery."""

IN_PLACE = 0.1
"""Metres between start and target below which v_p has no direction; then the turn is matched instead."""
SHORTEST_PART = 0.03
"""Metres: the least length of a part of a composition."""
LONGEST_QUERY = 100.0
"""Metres from start to target at most; six of the longest windows do not reach farther."""


@dataclass(frozen=True)
class Query:
    """q = (o_s, o_e, v_p) in the world: start and target as (x, z, yaw), metres and radians."""

    start: tuple[float, float, float]
    target: tuple[float, float, float]

    @property
    def distance(self) -> float:
        """The length of v_p, metres."""
        return float(np.hypot(self.target[0] - self.start[0], self.target[1] - self.start[1]))

    @property
    def heading(self) -> float:
        """The yaw of v_p; the start's facing where the query is in place."""
        if self.distance < IN_PLACE:
            return self.start[2]
        return float(np.arctan2(self.target[0] - self.start[0], self.target[1] - self.start[1]))

    @property
    def facing(self) -> tuple[float, float]:
        """Both facings relative to v_p, radians."""
        return self.start[2] - self.heading, self.target[2] - self.heading

    @property
    def in_place(self) -> bool:
        """Whether v_p has no direction, so that only the turn is matched."""
        return self.distance < IN_PLACE


@dataclass(frozen=True)
class MatchSettings:
    """How closely a match must fit, and how long the search for it may take.

    tolerance, least_tolerance: of the length of v_p, relative and in metres; the rest is scaled away. threshold: error
    budget alpha, radians. branches: k of Algorithm 1. rounds: how often a query is split at most. searches: the most
    searches of one composition.
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
    """A window of the gallery, as recorded or mirrored."""

    start: int
    steps: int
    mirrored: bool


@dataclass(frozen=True)
class Trace:
    """A match: atomic trajectories in order, and their error (equation 7, with the mismatch of facings at joins)."""

    parts: tuple[Window, ...]
    error: float

    @property
    def steps(self) -> int:
        """Frames from start to end."""
        return sum(part.steps for part in self.parts)


def window_query(
    query: Query, steps: tuple[int, int], styles: tuple[int, ...] | None, settings: MatchSettings = MATCH_DEFAULTS
) -> WindowQuery:
    """The windows that are direct candidates for a query."""
    if query.in_place:
        return WindowQuery((0.0, 1.5 * IN_PLACE), query.facing, "turn", steps, styles, settings.threshold)
    return WindowQuery(band(query.distance, settings), query.facing, "both", steps, styles, settings.threshold)


def band(distance: float, settings: MatchSettings = MATCH_DEFAULTS) -> tuple[float, float]:
    """The lengths of v_p, metres, that are accepted for ``distance``."""
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
    """The ``count`` best direct candidates (Algorithm 1, lines 9 to 15), best first."""
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
    """Several windows in a row for a query (Algorithm 1, lines 28 to 38); None where none are found.

    A window shorter than the query comes first, judged by its start alone; the rest becomes a query of its own with the
    rest of the error budget. All parts lie along the query's v_p, so that a rest is a length, two facings and steps.
    ``distances``: the gallery's distribution of lengths, ascending, from which partial lengths are drawn. Equal
    generators give equal results with any ``search``.
    """
    if query.in_place or query.distance > LONGEST_QUERY:
        return None
    task = _Task(search, tracks, distances, generator, styles, settings)
    return task.solve(query.distance, query.facing, steps, settings.threshold, settings.rounds)


@dataclass(eq=False)
class _Task:
    """One composition in progress, which counts its searches."""

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
        """TCS(M, q, alpha, k) of Algorithm 1 for the rest of a query; ``budget``: its alpha, radians."""
        lengths = max(steps[0], SHORTEST_WINDOW), min(steps[1], LONGEST_WINDOW)
        wanted = WindowQuery(band(distance, self.settings), facing, "both", lengths, self.styles, budget)
        if self.searches >= self.settings.searches:
            return None
        if rounds < self.settings.rounds:  # the whole query has no direct candidates, or this would not run
            found = self._find(wanted, 8 * self.settings.branches)
            if len(found):
                return traces(found)[int(self.generator.integers(len(found)))]
        if rounds == 0 or steps[1] < 2 * SHORTEST_WINDOW or self.searches >= self.settings.searches:
            return None
        share = self._share(distance, steps, rounds)
        if share is None:
            return None
        # The first part takes about the same share of the steps as of the length, so that the pace stays even.
        paced = (
            max(SHORTEST_WINDOW, int(0.7 * share * steps[0])),
            min(LONGEST_WINDOW, int(np.ceil(1.3 * share * steps[1])), steps[1] - SHORTEST_WINDOW),
        )
        first = replace(wanted, distance=band(share * distance, self.settings), criterion="start", steps=paced)
        found = self._find(first, 16 * self.settings.branches)
        order = self.generator.permutation(len(found))[: self.settings.branches]
        branches = traces(select(found, order))
        for branch in branches:
            part = branch.parts[0]
            length, _, end = features(self.tracks.root, np.array([part.start]), part.steps)
            turned = float(to_radians(int(end[0]))) * (-1.0 if part.mirrored else 1.0)
            left = max(0, steps[0] - part.steps), steps[1] - part.steps
            rest = distance - float(length[0])
            if rest < SHORTEST_PART:
                continue
            trace = self.solve(rest, (turned, facing[1]), left, budget - branch.error, rounds - 1)
            if trace is not None:
                return Trace((part, *trace.parts), branch.error + trace.error)
            if self.searches >= self.settings.searches:
                return None
        return None

    def _find(self, wanted: WindowQuery, count: int) -> FoundWindows:
        self.searches += 1
        return self.search(wanted, count)

    def _share(self, distance: float, steps: tuple[int, int], rounds: int) -> float | None:
        """The first part's share of the length, drawn from the gallery's lengths; None where no draw can succeed."""
        least = max(SHORTEST_PART, distance - rounds * self.distances[-1]) / distance
        least = max(least, 1.0 - rounds * LONGEST_WINDOW / max(steps[0], 1)) if steps[0] > LONGEST_WINDOW else least
        most = min(1.0 - SHORTEST_PART / distance, self.distances[-1] / distance)
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
