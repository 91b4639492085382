"""How long a way takes: a suggestion, and three groups of durations named fast, medium and slow.

Chu and Yang 2024, section 4.2: the candidates' numbers of frames are put into three groups of least variance by
k-means. Each candidate counts by its weight. The suggestion is the weighted median of all; a group's own is that of the
group, and its share of the weight says how well it fits.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.cluster.vq import ClusterError, kmeans2

from interpose.errors import InputError

SPEEDS = ("fast", "medium", "slow")
_NAMES = {1: ("medium",), 2: ("fast", "slow"), 3: SPEEDS}
_POINTS = 512
"""Durations, drawn evenly by weight, that are put into groups."""


@dataclass(frozen=True)
class SpeedGroup:
    """Durations of one speed: their weighted median, the fewest and the most, in steps of 1/30 s; fit: the share of the
    weight that they have."""

    speed: str
    steps: int
    fewest: int
    most: int
    fit: float


@dataclass(frozen=True)
class Suggestion:
    """How many steps of 1/30 s to take, and the alternatives, the fastest first. Fewer than three where there are fewer
    different durations."""

    steps: int
    groups: tuple[SpeedGroup, ...]


def suggest(steps: Int[ndarray, "candidate"], weights: Float[ndarray, "candidate"]) -> Suggestion:
    """The suggestion that weighted candidates make; at least one candidate must have a weight."""
    order = np.argsort(steps, kind="stable")
    steps, share = steps[order].astype(int), np.cumsum(weights[order]) / weights.sum()
    at = (np.arange(_POINTS) + 0.5) / _POINTS
    points = steps[np.minimum(np.searchsorted(share, at), len(steps) - 1)]
    label = _labels(points)
    groups = []
    used = np.unique(label)
    for name, each in zip(_NAMES[len(used)], used, strict=True):
        mine = points[label == each]
        groups.append(
            SpeedGroup(name, int(mine[(len(mine) - 1) // 2]), int(mine[0]), int(mine[-1]), len(mine) / _POINTS)
        )
    return Suggestion(int(points[(_POINTS - 1) // 2]), tuple(groups))


def _labels(points: Int[ndarray, "point"]) -> Int[ndarray, "point"]:
    """k-means, begun from spread-out durations so that the answer does not depend on a draw."""
    different = np.unique(points)
    for count in range(min(len(SPEEDS), len(different)), 1, -1):
        begin = different[((np.arange(count) + 0.5) / count * len(different)).astype(int)]
        with suppress(ClusterError):  # a group that has lost all its points: fewer groups are enough
            return kmeans2(
                points[:, None].astype(float), begin[:, None].astype(float), 100, minit="matrix", missing="raise"
            )[1]
    return np.zeros(len(points), dtype=np.int64)


def check_speed(speed: str) -> None:
    """Raises InputError for what is none of the three words."""
    if speed not in SPEEDS:
        raise InputError(f"unknown speed '{speed}'; there are {', '.join(SPEEDS)}")


def group_of(suggestion: Suggestion, speed: str) -> SpeedGroup:
    """The group of a speed; where there are fewer groups, the fastest or the slowest there is.

    Raises InputError for another word.
    """
    check_speed(speed)
    by_name = {group.speed: group for group in suggestion.groups}
    if speed in by_name:
        return by_name[speed]
    return suggestion.groups[{"fast": 0, "slow": -1}.get(speed, len(suggestion.groups) // 2)]
