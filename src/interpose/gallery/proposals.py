"""Which of the many trajectories that fit a gap to take: the likeliest first, then others that truly differ from it.

Beyond the paper, which draws one at random: key poses say more than where they stand. A window's two ends are compared
with the two keys in posture, and where the motion before or after the gap is known, in velocity. From these and the
error of equation 7 each window of a random sample of all that fit gets a *cost*, and exp(-cost) as its weight. The
first proposal is the window nearest to the weighted mean path, a real trajectory of the most usual kind; the others are
the ones least like any chosen before. docs/method.md, D21, has what this is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery import index as indexing
from interpose.gallery import matching, paths
from interpose.gallery.matching import Query, Settings, Trace
from interpose.gallery.speeds import Suggestion, check_speed, group_of, suggest
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import mirror_posture, posture_distance
from interpose.gallery.windows import LONGEST, SHORTEST, TURN, Found, first_of, join

SAMPLE = 2048
"""Windows that are weighed for one gap."""
EXACT = 64
"""The best by equation 7 that are always among them."""
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
SKETCH = np.linspace(0.0, 1.0, 13)
"""Shares of the time at which paths are compared before they are made."""
COMPOSED = 4
"""Compositions tried beyond those still missing; the ones that wander least are taken."""
RATE = 30.0
LONGEST_GAP = 600
"""Steps of a path at most."""


@dataclass(frozen=True)
class Costs:
    """What counts as one unit of deviation: a cost is half the sum of the squares.

    posture: metres, for each end. facing: radians of equation 7. velocity: m/s at an end where it is known. stretch:
    the logarithm of how much faster or slower. detour: the logarithm of the path's length over half a metre more than
    the way from end to end; nobody asks for a loop of eight metres to turn on the spot. turning: radians that the
    facing turns beyond what the keys ask for; nobody goes the long way round.
    """

    posture: float = 0.12
    facing: float = float(np.radians(20.0))
    velocity: float = 0.5
    stretch: float = 0.1
    detour: float = 0.7
    turning: float = float(np.radians(60.0))


@dataclass(frozen=True, eq=False)
class Ends:
    """What is known at start and target beside the places: posture (16,) and velocity on the ground (x, z), m/s."""

    postures: tuple[Float[ndarray, "16"], Float[ndarray, "16"]] | None = None
    velocities: tuple[Float[ndarray, "2"] | None, Float[ndarray, "2"] | None] = (None, None)


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
class Asked:
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


@dataclass(frozen=True, eq=False)
class Pool:
    """Single windows that fit a query, with sketches of their placed paths (window, 13, 2).

    misfit: half the sum of the squared deviations. cost: the same, and how unlikely the length of time is beforehand.
    """

    found: Found
    misfit: Float[ndarray, "window"]
    cost: Float[ndarray, "window"]
    sketch: Float[ndarray, "window time 2"]

    def __len__(self) -> int:
        return len(self.found)

    @property
    def weights(self) -> Float[ndarray, "window"]:
        """How much each counts; the cheapest counts 1."""
        return np.exp(self.cost.min() - self.cost)

    def take(self, rows: ndarray) -> Pool:
        """Some of them, by index or mask."""
        found = Found(*(getattr(self.found, name)[rows] for name in ("start", "steps", "mirrored", "error")))
        return Pool(found, self.misfit[rows], self.cost[rows], self.sketch[rows])


def propose(
    gallery: Gallery,
    query: Query,
    asked: Asked,
    ends: Ends = Ends(),
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
        return made or _stretched(gallery, query, ends, asked.steps, styles, count, draw)
    pool = gather(gallery, query, ends, (SHORTEST, LONGEST), styles, draw)
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
    gallery: Gallery, query: Query, ends: Ends = Ends(), style: str | None = None, seed: int = 0
) -> Suggestion:
    """How many steps the way would take, and what fast, medium and slow would mean. Raises as :func:`propose`."""
    _check(query, Asked(style=style))
    draw = np.random.default_rng(seed)
    styles = gallery.style_indices(style)
    pool = gather(gallery, query, ends, (SHORTEST, LONGEST), styles, draw)
    if len(pool):
        return suggest(pool.found.steps, pool.weights)
    made = _composed(gallery, query, ends, None, styles, 3, draw) or _unreachable(gallery, query, None, styles)
    return suggest(np.array([m.steps for m in made]), np.ones(len(made)))


def gather(
    gallery: Gallery,
    query: Query,
    ends: Ends,
    steps: tuple[int, int],
    styles: tuple[int, ...] | None,
    draw: np.random.Generator,
    *,
    target_steps: int | None = None,
    settings: Settings = matching.DEFAULT,
    costs: Costs = Costs(),
) -> Pool:
    """A random sample of the windows that fit a query, the best by equation 7 among them, each with its cost."""
    if steps[1] < SHORTEST or steps[0] > LONGEST:
        return _weigh(gallery, query, ends, Found(*(np.zeros(0, np.int64) for _ in range(4))), target_steps, costs)
    asked = matching.wanted(query, steps, styles, settings)
    index = gallery.index
    drawn = indexing.sample(index, asked, SAMPLE, draw)
    found = _unique(join([indexing.best(index, asked, EXACT), drawn]))
    return _weigh(gallery, query, ends, found, target_steps, costs)


def _weigh(gallery: Gallery, query: Query, ends: Ends, found: Found, target_steps: int | None, costs: Costs) -> Pool:
    tracks, side = gallery.tracks, found.mirrored.astype(bool)
    at = found.start[:, None] + np.round(found.steps[:, None] * SKETCH).astype(np.int64)
    sketch = tracks.root[at].astype(float) * np.where(side[:, None, None], [-1.0, 1.0, -1.0], 1.0)
    angle, scale = _placing(query, sketch)
    placed = _rotated(sketch[..., :2] - sketch[:, :1, :2], angle) * scale[:, None, None]
    ours = np.array(query.target[:2]) - np.array(query.start[:2])
    placed += SKETCH[:, None] * (ours - placed[:, -1])[:, None]
    total = _wandering(query, placed, sketch[..., 2], costs) + np.square(
        found.error * (2.0 * np.pi / TURN) / costs.facing
    )
    if target_steps is not None:
        total += np.square(np.log(found.steps / target_steps) / costs.stretch)
    if ends.postures is not None:
        for frame, wanted in zip((found.start, found.start + found.steps), ends.postures, strict=True):
            theirs = tracks.posture[frame].astype(float)
            theirs = np.where(side[:, None], mirror_posture(theirs), theirs)
            total += np.square(posture_distance(theirs, wanted) / costs.posture)
    for frame, wanted in zip((found.start, found.start + found.steps - 1), ends.velocities, strict=True):
        if wanted is not None:
            step = (tracks.root[frame + 1, :2] - tracks.root[frame, :2]).astype(float) * RATE
            step[side, 0] *= -1.0
            theirs = _rotated(step[:, None], angle)[:, 0]
            total += np.sum(np.square((theirs - wanted) / costs.velocity), axis=-1)
    # By 1 / steps: a length of time counts by its ratio to others, not by how many frames it differs.
    prior = np.log(found.steps) if target_steps is None else 0.0
    return Pool(found, 0.5 * total, 0.5 * total + prior, placed)


def _wandering(
    query: Query, ways: Float[ndarray, "window time 2"], yaw: Float[ndarray, "window time"], costs: Costs
) -> Float[ndarray, "window"]:
    """Twice the cost of what goes a long way or turns a lot for what it reaches."""
    walked = np.linalg.norm(np.diff(ways, axis=1), axis=-1).sum(axis=1)
    detour = np.maximum(np.log((walked + 1e-9) / (query.distance + 0.5)), 0.0)
    needed = abs((query.target[2] - query.start[2] + np.pi) % (2.0 * np.pi) - np.pi)
    turned = np.maximum(np.abs(np.diff(yaw, axis=1)).sum(axis=1) - needed, 0.0)
    return np.square(detour / costs.detour) + np.square(turned / costs.turning)


def _placing(query: Query, sketch: Float[ndarray, "window time 3"]) -> tuple[ndarray, ndarray]:
    """By how much each window is turned and scaled onto the query."""
    if query.in_place:
        return query.start[2] - sketch[:, 0, 2], np.ones(len(sketch))
    way = sketch[:, -1, :2] - sketch[:, 0, :2]
    length = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
    return query.heading - np.arctan2(way[:, 0], way[:, 1]), query.distance / length


def _rotated(v: Float[ndarray, "window time 2"], angle: Float[ndarray, "window"]) -> Float[ndarray, "window time 2"]:
    sin, cos = np.sin(angle)[:, None], np.cos(angle)[:, None]
    return np.stack([v[..., 0] * cos + v[..., 1] * sin, v[..., 1] * cos - v[..., 0] * sin], axis=-1)


def _unique(found: Found) -> Found:
    key = (found.start * 1024 + found.steps) * 2 + found.mirrored
    _, rows = np.unique(key, return_index=True)
    return Found(found.start[rows], found.steps[rows], found.mirrored[rows], found.error[rows])


def _from_pool(
    gallery: Gallery,
    query: Query,
    ends: Ends,
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
        found = cheap.found
        part = matching.Part(int(found.start[row]), int(found.steps[row]), bool(found.mirrored[row]))
        trace = Trace((part,), float(found.error[row]) * 2.0 * np.pi / TURN)
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


def _overlap(found: Found, traces: list[Trace]) -> Bool[ndarray, "window"]:
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


def _proposal(gallery: Gallery, query: Query, ends: Ends, trace: Trace, steps: int | None, cost: float) -> Proposal:
    path = paths.place(gallery.tracks, trace, query)
    tracks = gallery.tracks
    clip = int(np.searchsorted(tracks.ranges[:, 0], trace.parts[0].start, side="right")) - 1
    style = tracks.styles[int(tracks.clip_styles[clip])]
    timed = path if steps is None else paths.retime(path, steps)
    return Proposal(paths.meet(timed, ends.velocities), trace, style, 1.0 / (1.0 + max(cost, 0.0)))


def _composed(
    gallery: Gallery,
    query: Query,
    ends: Ends,
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
    allowed = (2 * SHORTEST, LONGEST_GAP) if steps is None else _around(steps, STRETCH)
    if allowed[1] < 2 * SHORTEST:
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
        cost = 0.5 * ((trace.error / Costs().facing) ** 2 + float(_wandering(query, way[None], yaw[None], Costs())[0]))
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
    ends: Ends,
    steps: int,
    styles: tuple[int, ...] | None,
    count: int,
    draw: np.random.Generator,
) -> list[Proposal]:
    """Paths walked in other times and retimed, where none was walked in that time."""
    low, high = _around(steps, MOST_STRETCH)
    pool = gather(gallery, query, ends, (low, high), styles, draw, target_steps=steps)
    made = _from_pool(gallery, query, ends, pool, count, [steps] * count)
    return made or _unreachable(gallery, query, steps, styles)


def _around(steps: int, share: float) -> tuple[int, int]:
    return int(np.floor(steps / (1.0 + share))), int(np.ceil(steps * (1.0 + share)))


def _unreachable(gallery: Gallery, query: Query, steps: int | None, styles: tuple[int, ...] | None) -> list[Proposal]:
    """Raises :class:`Unreachable` with the nearest that can be served."""
    way = f"{query.distance:.2f} m"
    if steps is None:
        reach = min(gallery.distances[-1] * (matching.DEFAULT.rounds + 1), matching.FARTHEST)
        raise Unreachable(
            f"no trajectory of the gallery, nor {matching.DEFAULT.rounds + 1} in a row, leads {way} from start to "
            f"target; the farthest within reach is about {reach:.0f} m; set a key in between"
        )
    draw = np.random.default_rng(0)
    asked = matching.wanted(query, (SHORTEST, LONGEST), styles)
    lengths = indexing.sample(gallery.index, asked, SAMPLE, draw).steps
    if not len(lengths):
        lengths = np.array([one.steps for one in _composed(gallery, query, Ends(), None, styles, 3, draw)])
    took = f"{way} in {steps} frames ({steps / RATE:.1f} s at 30 Hz)"
    if not len(lengths):
        raise Unreachable(f"no trajectory of the gallery covers {took}, nor that way in any time; set a key in between")
    nearest = int(lengths[np.argmin(np.abs(np.log(lengths / steps)))])
    raise Unreachable(
        f"no trajectory of the gallery covers {took}; the nearest takes {nearest} frames ({nearest / RATE:.1f} s)"
    )


def _check(query: Query, asked: Asked) -> None:
    if not np.isfinite([*query.start, *query.target]).all():
        raise InputError("start or target is not a finite place on the ground; give poses without NaN")
    if asked.steps is not None and not 1 <= asked.steps <= LONGEST_GAP:
        raise InputError(f"a path takes 1 to {LONGEST_GAP} frames at 30 Hz, got {asked.steps}")
    if asked.speed is not None:
        check_speed(asked.speed)


__all__ = ["Asked", "Ends", "Proposal", "Unreachable", "first_of", "gather", "propose", "suggestion"]
