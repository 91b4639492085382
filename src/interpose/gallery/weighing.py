"""How well each of the windows that fit a query fits it: costs, from more than where the two keys stand.

Beyond the paper's equation 7, a window's two ends are compared with the two keys in posture, and where the motion
before or after the gap is known, in velocity; time that must be stretched, detours and turns that nobody asked for
cost, too. exp(-cost) is a window's weight among the others. docs/method.md, D22, has what this is worth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose.data.root import turned
from interpose.features import RATE
from interpose.gallery import index as indexing
from interpose.gallery import matching
from interpose.gallery.matching import MatchSettings, Query
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import Tracks, mirror_posture, posture_distance
from interpose.gallery.windows import (
    LONGEST_WINDOW,
    NO_WINDOWS,
    SHORTEST_WINDOW,
    FoundWindows,
    join,
    select,
    to_radians,
)
from interpose.rotation import wrapped

SAMPLE = 2048
"""Windows that are weighed for one gap."""
EXACT = 64
"""The best by equation 7 that are always among them."""
SKETCH = np.linspace(0.0, 1.0, 13)
"""Shares of the time at which paths are compared before they are made."""
RATIOS = 0.5
"""1 has a length of time count by its ratio to others, 0 by how many frames it differs. 1 is best on the data that a
gallery is made of, 0 on other data (docs/method.md, D23)."""


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
class EndStates:
    """What is known at start and target beside the places: posture (16,) and velocity on the ground (x, z), m/s."""

    postures: tuple[Float[ndarray, "16"], Float[ndarray, "16"]] | None = None
    velocities: tuple[Float[ndarray, "2"] | None, Float[ndarray, "2"] | None] = (None, None)


NOTHING_KNOWN = EndStates()


@dataclass(frozen=True, eq=False)
class Pool:
    """Single windows that fit a query, with sketches of their placed paths (window, 13, 2).

    misfit: half the sum of the squared deviations. cost: the same, and how unlikely the length of time is beforehand.
    """

    found: FoundWindows
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
        return Pool(select(self.found, rows), self.misfit[rows], self.cost[rows], self.sketch[rows])


def gather(
    gallery: Gallery,
    query: Query,
    ends: EndStates,
    steps: tuple[int, int],
    styles: tuple[int, ...] | None,
    draw: np.random.Generator,
    *,
    target_steps: int | None = None,
    settings: MatchSettings = matching.MATCH_DEFAULTS,
    costs: Costs = Costs(),
) -> Pool:
    """A random sample of the windows that fit a query, the best by equation 7 among them, each with its cost."""
    if steps[1] < SHORTEST_WINDOW or steps[0] > LONGEST_WINDOW:
        return weigh(gallery, query, ends, NO_WINDOWS, target_steps, costs)
    asked = matching.window_query(query, steps, styles, settings)
    index = gallery.index
    drawn = indexing.sample(index, asked, SAMPLE, draw)
    found = _unique(join([indexing.best(index, asked, EXACT), drawn]))
    return weigh(gallery, query, ends, found, target_steps, costs)


def weigh(
    gallery: Gallery, query: Query, ends: EndStates, found: FoundWindows, target_steps: int | None, costs: Costs
) -> Pool:
    tracks, side = gallery.tracks, found.mirrored.astype(bool)
    at = found.start[:, None] + np.round(found.steps[:, None] * SKETCH).astype(np.int64)
    sketch = tracks.root[at].astype(float) * np.where(side[:, None, None], [-1.0, 1.0, -1.0], 1.0)
    angle, scale = _placing(query, sketch)
    placed = turned(sketch[..., :2] - sketch[:, :1, :2], angle[:, None]) * scale[:, None, None]
    ours = np.array(query.target[:2]) - np.array(query.start[:2])
    placed += SKETCH[:, None] * (ours - placed[:, -1])[:, None]
    total = wandering(query, placed, sketch[..., 2], costs) + np.square(to_radians(found.error) / costs.facing)
    if target_steps is not None:
        total += np.square(np.log(found.steps / target_steps) / costs.stretch)
    if ends.postures is not None:
        for frame, wanted in zip((found.start, found.start + found.steps), ends.postures, strict=True):
            total += unlike(tracks, found, frame, wanted, costs)
    for frame, wanted in zip((found.start, found.start + found.steps - 1), ends.velocities, strict=True):
        if wanted is not None:
            step = (tracks.root[frame + 1, :2] - tracks.root[frame, :2]).astype(float) * RATE
            step[side, 0] *= -1.0
            total += np.sum(np.square((turned(step, angle) - wanted) / costs.velocity), axis=-1)
    prior = RATIOS * np.log(found.steps) if target_steps is None else 0.0
    return Pool(found, 0.5 * total, 0.5 * total + prior, placed)


def unlike(
    tracks: Tracks, found: FoundWindows, frame: Int[ndarray, "window"], wanted: Float[ndarray, "16"], costs: Costs
) -> Float[ndarray, "window"]:
    """Twice the cost of how each window's posture at its ``frame`` differs from that of a key."""
    theirs = tracks.posture[frame].astype(float)
    theirs = np.where(found.mirrored.astype(bool)[:, None], mirror_posture(theirs), theirs)
    return np.square(posture_distance(theirs, wanted) / costs.posture)


def wandering(
    query: Query, ways: Float[ndarray, "window time 2"], yaw: Float[ndarray, "window time"], costs: Costs
) -> Float[ndarray, "window"]:
    """Twice the cost of what goes a long way or turns a lot for what it reaches."""
    walked = np.linalg.norm(np.diff(ways, axis=1), axis=-1).sum(axis=1)
    detour = np.maximum(np.log((walked + 1e-9) / (query.distance + 0.5)), 0.0)
    needed = abs(float(wrapped(query.target[2] - query.start[2])))
    turning = np.maximum(np.abs(np.diff(yaw, axis=1)).sum(axis=1) - needed, 0.0)
    return np.square(detour / costs.detour) + np.square(turning / costs.turning)


def _placing(query: Query, sketch: Float[ndarray, "window time 3"]) -> tuple[ndarray, ndarray]:
    """By how much each window is turned and scaled onto the query."""
    if query.in_place:
        return query.start[2] - sketch[:, 0, 2], np.ones(len(sketch))
    way = sketch[:, -1, :2] - sketch[:, 0, :2]
    length = np.maximum(np.linalg.norm(way, axis=-1), 1e-9)
    return query.heading - np.arctan2(way[:, 0], way[:, 1]), query.distance / length


def _unique(found: FoundWindows) -> FoundWindows:
    key = (found.start * 1024 + found.steps) * 2 + found.mirrored
    _, rows = np.unique(key, return_index=True)
    return select(found, rows)
