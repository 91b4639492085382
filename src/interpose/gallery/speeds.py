"""How long a path takes: a suggested duration, and three groups of durations named fast, medium and slow.

Chu and Yang 2024, section 4.2: k-means puts the candidates' numbers of frames into three groups of least variance.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose.errors import InputError

SPEEDS = ("fast", "medium", "slow")
_SPEED_NAMES = {1: ("medium",), 2: ("fast", "slow"), 3: SPEEDS}
_DURATION_POINTS = 512
"""Durations, taken at equal steps of the cumulative weight, that are clustered."""


@dataclass(frozen=True)
class SpeedGroup:
    """Durations of one speed. steps, fewest, most: their weighted median and range, in steps of 1/30 s. fit: their
    share of the weight."""

    speed: str
    steps: int
    fewest: int
    most: int
    fit: float


@dataclass(frozen=True)
class Suggestion:
    """A duration in steps of 1/30 s, the weighted median, and up to three alternatives, fastest first."""

    steps: int
    groups: tuple[SpeedGroup, ...]


def suggest(steps: Int[ndarray, "candidate"], weights: Float[ndarray, "candidate"]) -> Suggestion:
    """The suggestion from the candidates' durations; at least one must have a weight above 0."""
    order = np.argsort(steps, kind="stable")
    steps, share = steps[order].astype(int), np.cumsum(weights[order]) / weights.sum()
    at = (np.arange(_DURATION_POINTS) + 0.5) / _DURATION_POINTS
    points = steps[np.minimum(np.searchsorted(share, at), len(steps) - 1)]
    label = exact_groups(points)
    groups = []
    used = np.unique(label)
    for name, each in zip(_SPEED_NAMES[len(used)], used, strict=True):
        mine = points[label == each]
        groups.append(
            SpeedGroup(name, int(mine[(len(mine) - 1) // 2]), int(mine[0]), int(mine[-1]), len(mine) / _DURATION_POINTS)
        )
    return Suggestion(int(points[(_DURATION_POINTS - 1) // 2]), tuple(groups))


def exact_groups(points: Int[ndarray, "point"]) -> Int[ndarray, "point"]:
    """k-means, exactly: in one dimension the groups of least variance are intervals, so all cuts are compared."""
    values, count = np.unique(points, return_counts=True)
    groups = min(len(SPEEDS), len(values))
    sums = [np.insert(np.cumsum(count * values.astype(float) ** power), 0, 0.0) for power in range(3)]
    each_cut = list(combinations(range(1, len(values)), groups - 1))
    cuts = np.array(each_cut, dtype=int).reshape(len(each_cut), groups - 1)
    bounds = np.pad(cuts, ((0, 0), (1, 1)), constant_values=((0, 0), (0, len(values))))
    weight, total, squares = (each[bounds[:, 1:]] - each[bounds[:, :-1]] for each in sums)
    best = cuts[np.argmin((squares - total**2 / weight).sum(axis=1))]
    return np.searchsorted(values[best], points, side="right")


def check_speed(speed: str) -> None:
    """Raises InputError for anything but fast, medium or slow."""
    if speed not in SPEEDS:
        raise InputError(f"unknown speed '{speed}'; use {', '.join(SPEEDS)}")


def group_of(suggestion: Suggestion, speed: str) -> SpeedGroup:
    """The group of a speed; where there are fewer groups, the fastest or the slowest of them. Raises InputError as
    :func:`check_speed`."""
    check_speed(speed)
    by_name = {group.speed: group for group in suggestion.groups}
    if speed in by_name:
        return by_name[speed]
    return suggestion.groups[{"fast": 0, "slow": -1}.get(speed, len(suggestion.groups) // 2)]
