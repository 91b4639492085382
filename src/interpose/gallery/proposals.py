"""Which of the many trajectories that fit a gap to take: the likeliest first, then others that truly differ from it.

The paper draws one at random. Here the windows of a random sample of all that fit are weighed (`weighing`). The first
proposal is the window nearest to a hint, or to the weighted mean path: a real trajectory of the most usual kind. The
others are the ones least like any chosen before, none a near copy. Where no single window fits, compositions are tried
and those that wander least are taken. docs/method.md, D22, has what this is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

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
from interpose.gallery.weighing import NOTHING_KNOWN, SAMPLE, SKETCH, Costs, EndStates, Pool, gather, wandering
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW, FoundWindows, select

NEAR = 512
"""Of these, the cheapest are what variants are chosen from."""
STRETCH = 0.1
"""How much faster or slower than it was walked a trajectory may be taken to fit a given time."""
MOST_STRETCH = 0.5
"""The same where nothing else fits."""
FAVOUR = 0.5
"""How much a variant's cost counts beside the logarithm of how much it differs."""
HINTED = 0.1
"""How much its cost counts beside the logarithm of how near to the hint the first is."""
COMPOSED = 4
"""Compositions tried beyond those still missing; the ones that wander least are taken."""
LONGEST_GAP = 600
"""Steps of a path at most."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A path for a gap: (time, 3) of x, z, yaw at 30 Hz with both ends.

    style: that it was walked in. fit: 1 for a perfect match, 1 / (1 + cost). composed: of several windows.
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
        return len(self.trace.parts) > 1


@dataclass(frozen=True)
class PathRequest:
    """What is asked of the paths. Raises InputError for demands that contradict one another.

    steps: frames from start to target at 30 Hz; None lets the gallery suggest. speed: fast, medium or slow, in place of
    steps. style: one of the gallery's, or None.
    """

    steps: int | None = None
    speed: str | None = None
    style: str | None = None

    def __post_init__(self) -> None:
        if self.speed is not None and self.steps is not None:
            raise InputError(f"speed '{self.speed}' and a number of frames were both asked for; give one of them")


class Unreachable(InputError):
    """No trajectory of the gallery, nor several together, serves the query; the message names the nearest that does."""


def propose(
    gallery: Gallery,
    query: Query,
    asked: PathRequest,
    ends: EndStates = NOTHING_KNOWN,
    *,
    count: int = 1,
    seed: int = 0,
    hint: Float[ndarray, "time 3"] | None = None,
) -> list[Proposal]:
    """``count`` different paths at most for a query, the likeliest first; with equal seeds the same.

    hint: a path that the first is to be near to; without it, the weighted mean path of all that fit.
    Without ``asked.steps`` the first takes the suggested time and the others times of their own within the range asked
    for. Raises :class:`Unreachable` where there is none, with the nearest that can be had; InputError for a style that
    the gallery lacks, an unknown speed, and places that are not finite.
    """
    styles = gallery.style_indices(asked.style)
    _check(query, asked)
    draw = np.random.default_rng(seed)
    if asked.steps is not None:
        low, high = _around(asked.steps, STRETCH)
        pool = gather(gallery, query, ends, (low, high), styles, draw, target_steps=asked.steps)
        made = _from_pool(gallery, query, ends, pool, count, [asked.steps] * count, hint=hint)
        if len(made) < count:
            made += _composed(gallery, query, ends, asked.steps, styles, count - len(made), draw, before=made)
        return made or _stretched(gallery, query, ends, asked.steps, styles, count, draw, hint)
    pool = gather(gallery, query, ends, (SHORTEST_WINDOW, LONGEST_WINDOW), styles, draw)
    if not len(pool):
        made = _composed(gallery, query, ends, None, styles, count, draw, speed=asked.speed)
        return made or _unreachable(gallery, query, None, styles)
    told = suggest(pool.found.steps, pool.weights)
    inside = np.abs(np.log2(pool.found.steps / told.steps)) <= 1.0
    frames = told.steps
    if asked.speed is not None:
        chosen = group_of(told, asked.speed)
        inside = (pool.found.steps >= chosen.fewest) & (pool.found.steps <= chosen.most)
        frames = chosen.steps
    near = np.abs(np.log(pool.found.steps / frames)) <= STRETCH
    first = _from_pool(
        gallery, query, ends, pool.take(near & inside if (near & inside).any() else inside), 1, [frames], hint=hint
    )
    return first + _from_pool(gallery, query, ends, pool.take(inside), count - 1, [None] * (count - 1), before=first)


def suggestion(
    gallery: Gallery, query: Query, ends: EndStates = NOTHING_KNOWN, style: str | None = None, seed: int = 0
) -> Suggestion:
    """How many steps the way would take, and what fast, medium and slow would mean. Raises as :func:`propose`."""
    _check(query, PathRequest(style=style))
    draw = np.random.default_rng(seed)
    styles = gallery.style_indices(style)
    pool = gather(gallery, query, ends, (SHORTEST_WINDOW, LONGEST_WINDOW), styles, draw)
    if len(pool):
        return suggest(pool.found.steps, pool.weights)
    made = _composed(gallery, query, ends, None, styles, 3, draw) or _unreachable(gallery, query, None, styles)
    return suggest(np.array([m.steps for m in made]), np.ones(len(made)))


def _from_pool(
    gallery: Gallery,
    query: Query,
    ends: EndStates,
    pool: Pool,
    count: int,
    steps: list[int | None],
    before: Sequence[Proposal] = (),
    hint: Float[ndarray, "time 3"] | None = None,
) -> list[Proposal]:
    """The likeliest of a pool, and then the most different ones; those chosen ``before`` count among them."""
    if not len(pool) or count < 1:
        return []
    cheap = pool.take(np.argsort(pool.cost, kind="stable")[:NEAR])
    made = list(before)
    taken = [_sketch_of(query, proposal) for proposal in before]
    while len(made) - len(before) < count:
        wanted = steps[len(made) - len(before)]
        if not made:
            row = _likeliest(query, pool, cheap, hint)
        else:
            times = cheap.found.steps if wanted is None else np.full(len(cheap), wanted)
            apart = np.min([_difference(query, cheap.sketch, times, *other) for other in taken], axis=0)
            apart[apart < _near_copy(query)] = 0.0
            apart[_overlap(cheap.found, [one.trace for one in made])] = 0.0
            if not apart.any():
                break
            with np.errstate(divide="ignore"):
                row = int(np.argmax(np.log(apart) - FAVOUR * cheap.cost))
        (trace,) = matching.traces(select(cheap.found, np.array([row])))
        made.append(_proposal(gallery, query, ends, trace, wanted, float(cheap.misfit[row])))
        taken.append((cheap.sketch[row], made[-1].steps))
    return made[len(before) :]


def _likeliest(query: Query, pool: Pool, cheap: Pool, hint: Float[ndarray, "time 3"] | None) -> int:
    """Which of the ``cheap`` windows is nearest to the hint, or to the weighted mean of all."""
    if hint is None:
        mean = np.tensordot(pool.weights / pool.weights.sum(), pool.sketch, axes=1)
        return int(np.argmin(np.linalg.norm(cheap.sketch - mean, axis=-1).mean(axis=-1)))
    wanted = paths.retime(hint, len(SKETCH) - 1)[:, :2] - np.array(query.start[:2])
    away = np.linalg.norm(cheap.sketch - wanted, axis=-1).mean(axis=-1)
    return int(np.argmin(np.log(away + 0.02) + HINTED * cheap.cost))


def _overlap(found: FoundWindows, traces: list[Trace]) -> Bool[ndarray, "window"]:
    """Which windows are mostly the same moments as one chosen before, as they lie or in the mirror."""
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
    """How unlike each path is to one chosen before: mean distance of the two, and the times' ratio as a length."""
    away = np.linalg.norm(sketches - sketch, axis=-1).mean(axis=-1)
    return away + 0.25 * max(query.distance, 0.5) * np.abs(np.log(times / steps))


def _near_copy(query: Query) -> float:
    """Metres below which a path is no variant of another."""
    return 0.04 + 0.015 * query.distance


def _proposal(
    gallery: Gallery, query: Query, ends: EndStates, trace: Trace, steps: int | None, cost: float
) -> Proposal:
    path = paths.place(gallery.tracks, trace, query)
    style = gallery.tracks.style_of(trace.parts[0].start)
    timed = path if steps is None else paths.retime(path, steps)
    return Proposal(paths.meet(timed, ends.velocities), trace, style, 1.0 / (1.0 + max(cost, 0.0)))


def _composed(
    gallery: Gallery,
    query: Query,
    ends: EndStates,
    steps: int | None,
    styles: tuple[int, ...] | None,
    count: int,
    draw: np.random.Generator,
    *,
    speed: str | None = None,
    before: Sequence[Proposal] = (),
) -> list[Proposal]:
    """Paths of several windows that differ from one another and from those chosen ``before``; few or none where few or
    none are found."""
    allowed = (2 * SHORTEST_WINDOW, LONGEST_GAP) if steps is None else _around(steps, STRETCH)
    if allowed[1] < 2 * SHORTEST_WINDOW:
        return []
    found: list[Proposal] = []
    failed = 0
    for _ in range(COMPOSED + count):
        trace = matching.compose(gallery.search, gallery.tracks, gallery.distances, query, draw, allowed, styles)
        if trace is None:
            failed += 1
            if found or before or failed == COMPOSED:
                break
            continue
        one = _proposal(gallery, query, ends, trace, steps, 0.0)
        way, _ = _sketch_of(query, one)
        yaw = one.path[np.round(SKETCH * one.steps).astype(int), 2]
        cost = 0.5 * ((trace.error / Costs().facing) ** 2 + float(wandering(query, way[None], yaw[None], Costs())[0]))
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


def _stretched(
    gallery: Gallery,
    query: Query,
    ends: EndStates,
    steps: int,
    styles: tuple[int, ...] | None,
    count: int,
    draw: np.random.Generator,
    hint: Float[ndarray, "time 3"] | None,
) -> list[Proposal]:
    """Paths walked in other times and retimed, where none was walked in that time."""
    low, high = _around(steps, MOST_STRETCH)
    pool = gather(gallery, query, ends, (low, high), styles, draw, target_steps=steps)
    made = _from_pool(gallery, query, ends, pool, count, [steps] * count, hint=hint)
    return made or _unreachable(gallery, query, steps, styles)


def _around(steps: int, share: float) -> tuple[int, int]:
    return int(np.floor(steps / (1.0 + share))), int(np.ceil(steps * (1.0 + share)))


def _unreachable(gallery: Gallery, query: Query, steps: int | None, styles: tuple[int, ...] | None) -> list[Proposal]:
    """Raises :class:`Unreachable` with the nearest that can be served."""
    way = f"{query.distance:.2f} m"
    if steps is None:
        most = matching.MATCH_DEFAULTS.rounds + 1
        reach = min(gallery.distances[-1] * most, matching.FARTHEST)
        if query.distance < reach:
            raise Unreachable(
                f"no trajectory of the gallery, nor {most} in a row, leads {way} from start to "
                f"target with these facings; turn one of the keys, or set a key in between"
            )
        raise Unreachable(
            f"no trajectory of the gallery, nor {most} in a row, leads {way} from start to "
            f"target; the farthest within reach is about {reach:.0f} m; set a key in between"
        )
    draw = np.random.default_rng(0)
    asked = matching.window_query(query, (SHORTEST_WINDOW, LONGEST_WINDOW), styles)
    lengths = indexing.sample(gallery.index, asked, SAMPLE, draw).steps
    if not len(lengths):
        lengths = np.array([one.steps for one in _composed(gallery, query, NOTHING_KNOWN, None, styles, 3, draw)])
    took = f"{way} in {steps} frames ({steps / RATE:.1f} s at 30 Hz)"
    if not len(lengths):
        raise Unreachable(f"no trajectory of the gallery covers {took}, nor that way in any time; set a key in between")
    nearest = int(lengths[np.argmin(np.abs(np.log(lengths / steps)))])
    raise Unreachable(
        f"no trajectory of the gallery covers {took}; the nearest takes {nearest} frames ({nearest / RATE:.1f} s)"
    )


def _check(query: Query, asked: PathRequest) -> None:
    if not np.isfinite([*query.start, *query.target]).all():
        raise InputError("start or target is not a finite place on the ground; give poses without NaN")
    if asked.steps is not None and not 1 <= asked.steps <= LONGEST_GAP:
        raise InputError(f"a path takes 1 to {LONGEST_GAP} frames at 30 Hz, got {asked.steps}")
    if asked.speed is not None:
        check_speed(asked.speed)
