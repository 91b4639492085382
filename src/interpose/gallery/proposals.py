"""Which of the trajectories that match a gap to take: the likeliest first, then others that truly differ from it.

The paper draws one at random; here the windows of a random sample are weighed. docs/paths.md has how well that
performs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import index as indexing
from interpose.gallery import matching, paths
from interpose.gallery.matching import Query, Trace
from interpose.gallery.speeds import Suggestion, check_speed, group_of, suggest
from interpose.gallery.store import Gallery
from interpose.gallery.weighing import (
    COSTS,
    NOTHING_KNOWN,
    SAMPLED_WINDOWS,
    SKETCH,
    EndStates,
    Pool,
    detour_cost,
    gather,
)
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW, FoundWindows, select

VARIANT_POOL = 512
"""Variants are chosen from so many of the cheapest windows."""
STRETCH = 0.1
"""Share by which a trajectory may be faster or slower than recorded to take a given duration."""
MOST_STRETCH = 0.5
"""The same where nothing else matches."""
VARIANT_COST_WEIGHT = 0.5
"""Weight of a variant's cost against the logarithm of its difference from the others."""
HINT_COST_WEIGHT = 0.1
"""Weight of the first one's cost against the logarithm of its distance from the hint."""
SPARE_COMPOSITIONS = 4
"""Compositions tried beyond the number still missing; the least winding ones are taken."""
LONGEST_GAP = 600
"""Most steps of a path, at 30 Hz."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A path for a gap: x, z (metres) and yaw (radians) at 30 Hz, both ends included.

    style: that of the recording. fit: 1 / (1 + cost), 1 for a perfect match.
    """

    path: Float[ndarray, "time 3"]
    trace: Trace
    style: str
    fit: float

    @property
    def steps(self) -> int:
        """Frames from start to target."""
        return len(self.path) - 1

    @property
    def composed(self) -> bool:
        """Whether it consists of several windows."""
        return len(self.trace.parts) > 1


@dataclass(frozen=True)
class PathRequest:
    """What is requested of the paths of a gap.

    steps: from start to target at 30 Hz; None lets the gallery suggest them. speed: fast, medium or slow, instead of
    steps. style: one of the gallery's, or None for any. Raises InputError for both steps and a speed.
    """

    steps: int | None = None
    speed: str | None = None
    style: str | None = None

    def __post_init__(self) -> None:
        if self.speed is not None and self.steps is not None:
            raise InputError(f"speed '{self.speed}' and a number of frames are both given; give one of them")


class Unreachable(InputError):
    """No trajectory of the gallery, nor several in a row, matches the query; the message names the nearest that
    does."""


def check(query: Query, request: PathRequest) -> None:
    """Raises InputError for positions that are not finite, and for steps that no gap has."""
    if not np.isfinite([*query.start, *query.target]).all():
        raise InputError("start or target is not a finite position on the ground; give poses without NaN")
    if request.steps is not None and not 1 <= request.steps <= LONGEST_GAP:
        raise InputError(f"a path takes 1 to {LONGEST_GAP} frames at 30 Hz, got {request.steps}")


def propose(
    gallery: Gallery,
    query: Query,
    request: PathRequest,
    ends: EndStates = NOTHING_KNOWN,
    *,
    count: int = 1,
    seed: int = 0,
    hint: Float[ndarray, "time 3"] | None = None,
) -> list[Proposal]:
    """At most ``count`` different paths for a query, the likeliest first. Equal seeds give equal paths.

    The first is the window nearest to ``hint`` (a path, x, z, yaw), or to the weighted mean of all that match: a real
    trajectory of the most usual kind. The others are the least like any chosen before, none a near copy. Where no
    single window matches, compositions are tried. Without ``request.steps`` the first takes the suggested duration, the
    others their own within the requested range.

    Raises :class:`Unreachable` where nothing matches, naming the nearest that does; InputError for a style that the
    gallery lacks, an unknown speed, and positions that are not finite.
    """
    gap = _gap(gallery, query, request, ends, seed)
    if request.steps is not None:
        made = _retimed(gap, request.steps, STRETCH, count, hint)
        if len(made) < count:
            made += _composed(gap, request.steps, count - len(made), before=made)
        return made or _retimed(gap, request.steps, MOST_STRETCH, count, hint) or _unreachable(gap, request.steps)
    pool = gap.pool((SHORTEST_WINDOW, LONGEST_WINDOW))
    if not len(pool):
        return _composed(gap, None, count, speed=request.speed) or _unreachable(gap, None)
    suggested = suggest(pool.found.steps, pool.weights)
    inside = np.abs(np.log2(pool.found.steps / suggested.steps)) <= 1.0
    frames = suggested.steps
    if request.speed is not None:
        chosen = group_of(suggested, request.speed)
        inside = (pool.found.steps >= chosen.fewest) & (pool.found.steps <= chosen.most)
        frames = chosen.steps
    near = inside & (np.abs(np.log(pool.found.steps / frames)) <= STRETCH)
    first = _from_pool(gap, pool.take(near if near.any() else inside), 1, frames, hint=hint)
    return first + _from_pool(gap, pool.take(inside), count - 1, None, before=first)


def suggestion(
    gallery: Gallery, query: Query, ends: EndStates = NOTHING_KNOWN, style: str | None = None, seed: int = 0
) -> Suggestion:
    """How many steps a path would take, and what fast, medium and slow mean for it. Raises as :func:`propose`."""
    gap = _gap(gallery, query, PathRequest(style=style), ends, seed)
    pool = gap.pool((SHORTEST_WINDOW, LONGEST_WINDOW))
    if len(pool):
        return suggest(pool.found.steps, pool.weights)
    made = _composed(gap, None, 3) or _unreachable(gap, None)
    return suggest(np.array([m.steps for m in made]), np.ones(len(made)))


@dataclass(frozen=True, eq=False)
class _GapQuery:
    """A query with all that the search for its paths needs. styles: indices, None for all."""

    gallery: Gallery
    query: Query
    ends: EndStates
    styles: tuple[int, ...] | None
    draw: np.random.Generator

    def pool(self, lengths: tuple[int, int], target_steps: int | None = None) -> Pool:
        """The single windows that match, of so many steps; see :func:`~interpose.gallery.weighing.gather`."""
        return gather(self.gallery, self.query, self.ends, lengths, self.styles, self.draw, target_steps=target_steps)


def _gap(gallery: Gallery, query: Query, request: PathRequest, ends: EndStates, seed: int) -> _GapQuery:
    """The search for a request, checked."""
    styles = gallery.style_indices(request.style)
    check(query, request)
    if request.speed is not None:
        check_speed(request.speed)
    return _GapQuery(gallery, query, ends, styles, np.random.default_rng(seed))


def _retimed(
    gap: _GapQuery, steps: int, stretch: float, count: int, hint: Float[ndarray, "time 3"] | None
) -> list[Proposal]:
    """Single windows whose duration differs by a factor of 1 + ``stretch`` at most, retimed."""
    return _from_pool(gap, gap.pool(_around(steps, stretch), steps), count, steps, hint=hint)


def _from_pool(
    gap: _GapQuery,
    pool: Pool,
    count: int,
    steps: int | None,
    before: Sequence[Proposal] = (),
    hint: Float[ndarray, "time 3"] | None = None,
) -> list[Proposal]:
    """The likeliest path of a pool, then the most different ones; those chosen ``before`` count as chosen.

    ``steps``: of every path; with None each keeps its own.
    """
    if not len(pool) or count < 1:
        return []
    cheap = pool.take(np.argsort(pool.cost, kind="stable")[:VARIANT_POOL])
    made = list(before)
    taken = [_sketch_of(gap.query, proposal) for proposal in before]
    times = cheap.found.steps if steps is None else np.full(len(cheap), steps)
    while len(made) - len(before) < count:
        if not made:
            row = _likeliest(gap.query, pool, cheap, hint)
        else:
            apart = np.min([_difference(gap.query, cheap.sketch, times, *other) for other in taken], axis=0)
            apart[apart < _near_copy(gap.query)] = 0.0
            apart[_overlap(cheap.found, [one.trace for one in made])] = 0.0
            if not apart.any():
                break
            with np.errstate(divide="ignore"):
                row = int(np.argmax(np.log(apart) - VARIANT_COST_WEIGHT * cheap.cost))
        (trace,) = matching.traces(select(cheap.found, np.array([row])))
        made.append(_proposal(gap, trace, steps, float(cheap.misfit[row])))
        taken.append((cheap.sketch[row], made[-1].steps))
    return made[len(before) :]


def _likeliest(query: Query, pool: Pool, cheap: Pool, hint: Float[ndarray, "time 3"] | None) -> int:
    """The row of the ``cheap`` window nearest to the hint, or to the weighted mean of the pool."""
    if hint is None:
        mean = np.tensordot(pool.weights / pool.weights.sum(), pool.sketch, axes=1)
        return int(np.argmin(np.linalg.norm(cheap.sketch - mean, axis=-1).mean(axis=-1)))
    wanted = paths.retime(hint, len(SKETCH) - 1)[:, :2] - np.array(query.start[:2])
    away = np.linalg.norm(cheap.sketch - wanted, axis=-1).mean(axis=-1)
    return int(np.argmin(np.log(away + 0.02) + HINT_COST_WEIGHT * cheap.cost))


def _overlap(found: FoundWindows, traces: list[Trace]) -> Bool[ndarray, "window"]:
    """Which windows share more than half of their frames, and the side, with one chosen before."""
    same = np.zeros(len(found), dtype=bool)
    for part in (part for trace in traces for part in trace.parts):
        common = np.minimum(found.start + found.steps, part.start + part.steps) - np.maximum(found.start, part.start)
        same |= (common > 0.5 * np.minimum(found.steps, part.steps)) & (found.mirrored == int(part.mirrored))
    return same


def _sketch_of(query: Query, proposal: Proposal) -> tuple[ndarray, int]:
    at = np.round(SKETCH * proposal.steps).astype(int)
    return proposal.path[at, :2] - np.array(query.start[:2]), proposal.steps


def _difference(
    query: Query,
    sketches: Float[ndarray, "window time 2"],
    times: Int[ndarray, "window"],
    sketch: Float[ndarray, "time 2"],
    steps: int,
) -> Float[ndarray, "window"]:
    """How much each path differs from one chosen before, metres: their mean distance, plus the logarithm of their
    durations' ratio times a quarter of the query's distance."""
    away = np.linalg.norm(sketches - sketch, axis=-1).mean(axis=-1)
    return away + 0.25 * max(query.distance, 0.5) * np.abs(np.log(times / steps))


def _near_copy(query: Query) -> float:
    """The difference in metres below which two paths are the same variant."""
    return 0.04 + 0.015 * query.distance


def _proposal(gap: _GapQuery, trace: Trace, steps: int | None, cost: float) -> Proposal:
    path = paths.place(gap.gallery.tracks, trace, gap.query)
    style = gap.gallery.tracks.style_of(trace.parts[0].start)
    timed = path if steps is None else paths.retime(path, steps)
    return Proposal(paths.meet(timed, gap.ends.velocities), trace, style, 1.0 / (1.0 + max(cost, 0.0)))


def _composed(
    gap: _GapQuery, steps: int | None, count: int, *, speed: str | None = None, before: Sequence[Proposal] = ()
) -> list[Proposal]:
    """At most ``count`` composed paths that differ from one another and from those chosen ``before``."""
    allowed = (2 * SHORTEST_WINDOW, LONGEST_GAP) if steps is None else _around(steps, STRETCH)
    if allowed[1] < 2 * SHORTEST_WINDOW:
        return []
    gallery, query = gap.gallery, gap.query
    found: list[Proposal] = []
    failed = 0
    for _ in range(SPARE_COMPOSITIONS + count):
        trace = matching.compose(
            gallery.search, gallery.tracks, gallery.distances, query, gap.draw, allowed, gap.styles
        )
        if trace is None:
            failed += 1
            if found or before or failed == SPARE_COMPOSITIONS:
                break
            continue
        one = _proposal(gap, trace, steps, 0.0)
        sketch, _ = _sketch_of(query, one)
        yaw = one.path[np.round(SKETCH * one.steps).astype(int), 2]
        turns = (trace.error / COSTS.facing) ** 2
        cost = 0.5 * (turns + float(detour_cost(query, sketch[None], yaw[None])[0]))
        found.append(replace(one, fit=1.0 / (1.0 + cost)))
    if speed is not None and found:
        chosen = group_of(suggest(np.array([one.steps for one in found]), np.ones(len(found))), speed)
        found = [one for one in found if chosen.fewest <= one.steps <= chosen.most]
    made: list[Proposal] = []
    for one in sorted(found, key=lambda one: -one.fit):
        others = [*before, *made]
        if len(made) < count and all(paths.apart(one.path, other.path) >= _near_copy(query) for other in others):
            made.append(one)
    return made


def _around(steps: int, share: float) -> tuple[int, int]:
    return int(np.floor(steps / (1.0 + share))), int(np.ceil(steps * (1.0 + share)))


def _unreachable(gap: _GapQuery, steps: int | None) -> NoReturn:
    """Raises :class:`Unreachable`, naming the nearest query that can be served."""
    gallery, query = gap.gallery, gap.query
    length = f"{query.distance:.2f} m"
    if steps is None:
        most = matching.MATCH_DEFAULTS.rounds + 1
        reach = min(gallery.distances[-1] * most, matching.LONGEST_QUERY)
        near = " with these facings; turn one of the keys, or set a key in between"
        far = f"; the farthest within reach is about {reach:.0f} m; set a key in between"
        raise Unreachable(
            f"no trajectory of the gallery, nor {most} in a row, covers {length} from start to target"
            + (near if query.distance < reach else far)
        )
    gap = replace(gap, ends=NOTHING_KNOWN, draw=np.random.default_rng(0))
    wanted = matching.window_query(query, (SHORTEST_WINDOW, LONGEST_WINDOW), gap.styles)
    lengths = indexing.sample(gallery.index, wanted, SAMPLED_WINDOWS, gap.draw).steps
    if not len(lengths):
        lengths = np.array([one.steps for one in _composed(gap, None, 3)])
    covered = f"{length} in {steps} frames ({steps / RATE:.1f} s at 30 Hz)"
    if not len(lengths):
        raise Unreachable(
            f"no trajectory of the gallery covers {covered}, or that distance at all; set a key in between"
        )
    nearest = int(lengths[np.argmin(np.abs(np.log(lengths / steps)))])
    raise Unreachable(
        f"no trajectory of the gallery covers {covered}; the nearest takes {nearest} frames ({nearest / RATE:.1f} s)"
    )
