"""How well each matching window fits a query, from more than the positions and facings of its two keys.

Beyond equation 7 of the paper, postures and known velocities at both ends, stretched time, detours and turns cost too.
A window's weight among the others is exp(-cost). docs/paths.md has how well this performs.
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
    merged,
    select,
    to_radians,
)
from interpose.rotation import wrapped

SAMPLED_WINDOWS = 2048
"""Windows weighed for one gap."""
BEST_WINDOWS = 64
"""The best by equation 7, which are always among them."""
SKETCH = np.linspace(0.0, 1.0, 13)
"""Shares of the duration at which paths are compared before they are built."""
DURATION_PRIOR = 0.5
"""Exponent of the prior 1 / steps^DURATION_PRIOR over durations: 1 is best on the data that a gallery was built from, 0
on other data."""


@dataclass(frozen=True)
class Costs:
    """Scales of the deviations: a cost is half the sum of (deviation / scale)^2.

    posture: metres, at each end. facing: radians of equation 7. velocity: m/s, at an end where it is known. stretch:
    logarithm of the change of speed. detour: logarithm of the path's length over (half a metre + the distance from end
    to end), against loops of metres for a turn on the spot. turning: radians that the facing turns beyond
    what the keys need.
    """

    posture: float = 0.12
    facing: float = float(np.radians(20.0))
    velocity: float = 0.5
    stretch: float = 0.1
    detour: float = 0.7
    turning: float = float(np.radians(60.0))


COSTS = Costs()


@dataclass(frozen=True, eq=False)
class EndStates:
    """What is known at start and target beyond their positions: postures, metres, and velocities (x, z), m/s."""

    postures: tuple[Float[ndarray, "16"], Float[ndarray, "16"]] | None = None
    velocities: tuple[Float[ndarray, "2"] | None, Float[ndarray, "2"] | None] = (None, None)


NOTHING_KNOWN = EndStates()


@dataclass(frozen=True, eq=False)
class Pool:
    """Single windows that match a query, with sketches of their placed paths: x, z in metres from the start.

    misfit: half the sum of the squared deviations. cost: the misfit plus the negative logarithm of the duration's
    prior.
    """

    found: FoundWindows
    misfit: Float[ndarray, "window"]
    cost: Float[ndarray, "window"]
    sketch: Float[ndarray, "window time 2"]

    def __len__(self) -> int:
        return len(self.found)

    @property
    def weights(self) -> Float[ndarray, "window"]:
        """exp(-cost), scaled so that the cheapest has 1."""
        return np.exp(self.cost.min() - self.cost)

    def take(self, rows: ndarray) -> Pool:
        """Some of the windows, by index or mask."""
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
) -> Pool:
    """A random sample of the windows that match a query, the best by equation 7 among them, each with its cost.

    ``steps``: fewest and most. ``styles``: indices, or None for all. ``target_steps``: a given duration, from which
    windows are stretched at a cost.
    """
    found = NO_WINDOWS
    if steps[1] >= SHORTEST_WINDOW and steps[0] <= LONGEST_WINDOW:
        wanted = matching.window_query(query, steps, styles, settings)
        drawn = indexing.sample(gallery.index, wanted, SAMPLED_WINDOWS, draw)
        found = _unique(merged([indexing.best(gallery.index, wanted, BEST_WINDOWS), drawn]))
    tracks, side = gallery.tracks, found.mirrored.astype(bool)
    at = found.start[:, None] + np.round(found.steps[:, None] * SKETCH).astype(np.int64)
    sketch = tracks.root[at].astype(float) * np.where(side[:, None, None], [-1.0, 1.0, -1.0], 1.0)
    angle, scale = _placing(query, sketch)
    placed = turned(sketch[..., :2] - sketch[:, :1, :2], angle[:, None]) * scale[:, None, None]
    ours = np.array(query.target[:2]) - np.array(query.start[:2])
    # Spread the remaining error at the target over the path, as `paths.fit` does, but linearly: it is small.
    placed += SKETCH[:, None] * (ours - placed[:, -1])[:, None]
    total = detour_cost(query, placed, sketch[..., 2]) + np.square(to_radians(found.error) / COSTS.facing)
    if target_steps is not None:
        total += np.square(np.log(found.steps / target_steps) / COSTS.stretch)
    if ends.postures is not None:
        for frame, wanted in zip((found.start, found.start + found.steps), ends.postures, strict=True):
            total += posture_cost(tracks, found, frame, wanted)
    # A velocity is that of the step after the start and of the step before the target.
    for frame, wanted in zip((found.start, found.start + found.steps - 1), ends.velocities, strict=True):
        if wanted is not None:
            step = (tracks.root[frame + 1, :2] - tracks.root[frame, :2]).astype(float) * RATE
            step[side, 0] *= -1.0
            total += np.sum(np.square((turned(step, angle) - wanted) / COSTS.velocity), axis=-1)
    prior = DURATION_PRIOR * np.log(found.steps) if target_steps is None else 0.0
    return Pool(found, 0.5 * total, 0.5 * total + prior, placed)


def posture_cost(
    tracks: Tracks, found: FoundWindows, frame: Int[ndarray, "window"], wanted: Float[ndarray, "16"]
) -> Float[ndarray, "window"]:
    """Twice the cost of the difference between each window's posture at its ``frame`` and a key's."""
    theirs = tracks.posture[frame].astype(float)
    theirs = np.where(found.mirrored.astype(bool)[:, None], mirror_posture(theirs), theirs)
    return np.square(posture_distance(theirs, wanted) / COSTS.posture)


def detour_cost(
    query: Query, placed: Float[ndarray, "window time 2"], yaw: Float[ndarray, "window time"]
) -> Float[ndarray, "window"]:
    """Twice the cost of paths (x, z) that are longer, or turn more, than their query needs."""
    walked = np.linalg.norm(np.diff(placed, axis=1), axis=-1).sum(axis=1)
    detour = np.maximum(np.log((walked + 1e-9) / (query.distance + 0.5)), 0.0)
    needed = abs(float(wrapped(query.target[2] - query.start[2])))
    turning = np.maximum(np.abs(np.diff(yaw, axis=1)).sum(axis=1) - needed, 0.0)
    return np.square(detour / COSTS.detour) + np.square(turning / COSTS.turning)


def _placing(query: Query, sketch: Float[ndarray, "window time 3"]) -> tuple[ndarray, ndarray]:
    """The angle and the scale that place each window onto the query."""
    if query.in_place:
        return query.start[2] - sketch[:, 0, 2], np.ones(len(sketch))
    v_p = sketch[:, -1, :2] - sketch[:, 0, :2]
    length = np.maximum(np.linalg.norm(v_p, axis=-1), 1e-9)
    return query.heading - np.arctan2(v_p[:, 0], v_p[:, 1]), query.distance / length


def _unique(found: FoundWindows) -> FoundWindows:
    key = (found.start * 1024 + found.steps) * 2 + found.mirrored
    _, rows = np.unique(key, return_index=True)
    return select(found, rows)
