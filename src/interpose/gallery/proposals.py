"""Which of the many trajectories that fit a gap to take: the likeliest first, then others that truly differ from it.

Beyond the paper, which draws one at random: key poses say more than where they stand. A window's two ends are compared
with the two keys in posture, and where the motion before or after the gap is known, in velocity. From these and the
error of equation 7 each window of a random sample of all that fit gets a *cost*, and exp(-cost) as its weight. The
first proposal is the window nearest to the weighted mean path, a real trajectory of the most usual kind; the others are
the ones least like any chosen before. docs/method.md, D21, has what this is worth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery import index as indexing
from interpose.gallery import matching, paths
from interpose.gallery.matching import Query, Settings, Trace
from interpose.gallery.speeds import Suggestion, group_of, suggest
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import mirror_posture, posture_distance
from interpose.gallery.windows import LONGEST, SHORTEST, TURN, Found, first_of, join

SAMPLE = 2048
"""Windows that are weighed for one gap."""
EXACT = 64
"""The best by equation 7 that are always among them."""
NEAR = 256
"""Of these, the cheapest are what variants are chosen from."""
STRETCH = 0.1
"""How much faster or slower than it was walked a trajectory may be taken to fit a given time."""
MOST_STRETCH = 0.5
"""The same where nothing else fits."""
FAVOUR = 0.25
"""How much a variant's cost counts beside the logarithm of how much it differs."""
SKETCH = np.linspace(0.0, 1.0, 13)
"""Shares of the time at which paths are compared before they are made."""
COMPOSED = 4
"""Compositions tried for each proposal still missing, at most."""
RATE = 30.0
LONGEST_GAP = 600
"""Steps of a path at most."""


@dataclass(frozen=True)
class Costs:
    """What counts as one unit of deviation: a cost is half the sum of the squares.

    posture: metres, for each end. facing: radians of equation 7. velocity: m/s at an end where it is known. stretch:
    the logarithm of how much faster or slower.
    """

    posture: float = 0.12
    facing: float = float(np.radians(20.0))
    velocity: float = 0.5
    stretch: float = 0.1


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
    """Single windows that fit a query, with their costs and sketches of their placed paths (window, 13, 2)."""

    found: Found
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
        return Pool(found, self.cost[rows], self.sketch[rows])


def propose(
    gallery: Gallery, query: Query, asked: Asked, ends: Ends = Ends(), *, count: int = 1, seed: int = 0
) -> list[Proposal]:
    """``count`` different paths at most for a query, the likeliest first; with equal seeds the same.

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
        made = _from_pool(gallery, query, pool, count, [asked.steps] * count)
        if len(made) < count:
            made += _composed(gallery, query, asked.steps, styles, count - len(made), draw)
        return made or _stretched(gallery, query, ends, asked.steps, styles, count, draw)
    pool = gather(gallery, query, ends, (SHORTEST, LONGEST), styles, draw)
    if not len(pool):
        made = _composed(gallery, query, None, styles, count, draw)
        return made or _unreachable(gallery, query, None)
    told = suggest(pool.found.steps, pool.weights)
    inside = np.ones(len(pool), dtype=bool)
    frames = told.steps
    if asked.speed is not None:
        chosen = group_of(told, asked.speed)
        inside = (pool.found.steps >= chosen.fewest) & (pool.found.steps <= chosen.most)
        frames = chosen.steps
    near = np.abs(np.log(pool.found.steps / frames)) <= STRETCH
    first = _from_pool(gallery, query, pool.take(near & inside if (near & inside).any() else inside), 1, [frames])
    return first + _from_pool(gallery, query, pool.take(inside), count - 1, [None] * (count - 1), first)


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
    made = _composed(gallery, query, None, styles, 3, draw) or _unreachable(gallery, query, None)
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
    total = np.square(found.error * (2.0 * np.pi / TURN) / costs.facing)
    if target_steps is not None:
        total += np.square(np.log(found.steps / target_steps) / costs.stretch)
    else:  # by 1 / steps: a length of time counts by its ratio to others, not by how many frames it differs
        total += 2.0 * np.log(found.steps)
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
    return Pool(found, 0.5 * total, placed)


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
    pool: Pool,
    count: int,
    steps: list[int | None],
    chosen_before: list[Proposal] | None = None,
) -> list[Proposal]:
    """The likeliest of a pool, or after those chosen before it, and then the most different ones."""
    if not len(pool) or count < 1:
        return []
    before = chosen_before or []
    cheap = pool.take(np.argsort(pool.cost, kind="stable")[:NEAR])
    made = list(before)
    taken = [_sketch_of(query, proposal) for proposal in before]
    while len(made) - len(before) < count:
        if not made:
            mean = np.tensordot(pool.weights / pool.weights.sum(), pool.sketch, axes=1)
            row = int(np.argmin(np.linalg.norm(cheap.sketch - mean, axis=-1).mean(axis=-1)))
        else:
            apart = np.min([_difference(query, cheap, *other) for other in taken], axis=0)
            apart[apart < _near_copy(query)] = 0.0
            if not apart.any():
                break
            with np.errstate(divide="ignore"):
                row = int(np.argmax(np.log(apart) - FAVOUR * cheap.cost))
        found = cheap.found
        part = matching.Part(int(found.start[row]), int(found.steps[row]), bool(found.mirrored[row]))
        trace = Trace((part,), float(found.error[row]) * 2.0 * np.pi / TURN)
        wanted = steps[len(made) - len(before)]
        made.append(_proposal(gallery, query, trace, wanted, float(cheap.cost[row] - _prior(part, wanted))))
        taken.append((cheap.sketch[row], made[-1].steps))
    return made[len(before) :]


def _prior(part: matching.Part, wanted: int | None) -> float:
    """What of a cost is not about fit: the weight of a length of time."""
    return float(np.log(part.steps)) if wanted is None else 0.0


def _sketch_of(query: Query, proposal: Proposal) -> tuple[ndarray, int]:
    at = np.round(SKETCH * proposal.steps).astype(int)
    return proposal.path[at, :2] - np.array(query.start[:2]), proposal.steps


def _difference(query: Query, pool: Pool, sketch: Float[ndarray, "time 2"], steps: int) -> Float[ndarray, "window"]:
    """How unlike each window is to one chosen before: mean distance of the paths, and the times' ratio as a length."""
    away = np.linalg.norm(pool.sketch - sketch, axis=-1).mean(axis=-1)
    return away + 0.25 * max(query.distance, 0.5) * np.abs(np.log(pool.found.steps / steps))


def _near_copy(query: Query) -> float:
    """Metres below which a path is no variant of another."""
    return 0.03 + 0.01 * query.distance


def _proposal(gallery: Gallery, query: Query, trace: Trace, steps: int | None, cost: float) -> Proposal:
    path = paths.place(gallery.tracks, trace, query)
    tracks = gallery.tracks
    clip = int(np.searchsorted(tracks.ranges[:, 0], trace.parts[0].start, side="right")) - 1
    style = tracks.styles[int(tracks.clip_styles[clip])]
    timed = path if steps is None else paths.retime(path, steps)
    return Proposal(timed, trace, style, 1.0 / (1.0 + max(cost, 0.0)))


def _composed(
    gallery: Gallery,
    query: Query,
    steps: int | None,
    styles: tuple[int, ...] | None,
    count: int,
    draw: np.random.Generator,
) -> list[Proposal]:
    """Paths of several windows that differ from one another; few or none where few or none are found."""
    allowed = (2 * SHORTEST, LONGEST_GAP) if steps is None else _around(steps, STRETCH)
    if allowed[1] < 2 * SHORTEST:
        return []
    made: list[Proposal] = []
    for _ in range(COMPOSED * count):
        trace = matching.compose(gallery.search, gallery.tracks, gallery.distances, query, draw, allowed, styles)
        if trace is None:
            break
        cost = 0.5 * (trace.error / Costs().facing) ** 2
        one = _proposal(gallery, query, trace, steps, cost)
        if all(paths.apart(one.path, other.path) >= _near_copy(query) for other in made):
            made.append(one)
        if len(made) == count:
            break
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
    made = _from_pool(gallery, query, pool, count, [steps] * count)
    return made or _unreachable(gallery, query, steps)


def _around(steps: int, share: float) -> tuple[int, int]:
    return int(np.floor(steps / (1.0 + share))), int(np.ceil(steps * (1.0 + share)))


def _unreachable(gallery: Gallery, query: Query, steps: int | None) -> list[Proposal]:
    """Raises :class:`Unreachable` with the nearest that can be served."""
    way = f"{query.distance:.2f} m"
    if steps is None:
        reach = gallery.distances[-1] * (matching.DEFAULT.rounds + 1)
        raise Unreachable(
            f"no trajectory of the gallery, nor {matching.DEFAULT.rounds + 1} in a row, leads {way} from start to "
            f"target; the farthest within reach is about {reach:.0f} m; set a key in between"
        )
    asked = replace(matching.wanted(query, (SHORTEST, LONGEST), None), threshold=2.0 * np.pi)
    lengths = indexing.sample(gallery.index, asked, SAMPLE, np.random.default_rng(0)).steps
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


__all__ = ["Asked", "Ends", "Proposal", "Unreachable", "first_of", "gather", "propose", "suggestion"]
