"""Atomic trajectories (Chu and Yang 2024, section 4.1) as numbers, and how far one is from a query (equation 7).

A *window* is a start frame and a number of steps, 15 to 150 (0.5 to 5 s), within one clip: T = (id, o_s, o_e, v_p, c).
What matters of it once it is turned onto a query is the length of v_p and both facings relative to the direction of
v_p. Angles are kept in 65,536ths of a turn, so that errors are whole numbers and two ways to search agree on every tie.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32, Int, Int32, UInt16
from numpy import ndarray

SHORTEST_WINDOW, LONGEST_WINDOW = 15, 150
"""Steps of a window."""
WINDOW_LENGTHS = LONGEST_WINDOW - SHORTEST_WINDOW + 1
TURN = 65536
"""Units of angle in a whole turn."""

Criterion = Literal["both", "start", "turn"]
"""What the error counts: both facings (equation 7), the start's alone (Algorithm 1, line 18), or by how much the facing
turns from start to end, for where start and end are one place and v_p has no direction."""


@dataclass(frozen=True)
class WindowQuery:
    """What a window must have. Facings are radians relative to v_p, counted as yaw is.

    distance: lowest and highest length of v_p, metres. steps: fewest and most. styles: indices, or None for all.
    threshold: the largest error, radians.
    """

    distance: tuple[float, float]
    facing: tuple[float, float]
    criterion: Criterion = "both"
    steps: tuple[int, int] = (SHORTEST_WINDOW, LONGEST_WINDOW)
    styles: tuple[int, ...] | None = None
    threshold: float = 2.0 * np.pi

    @property
    def limit(self) -> int:
        """The largest error in units of angle."""
        return int(np.floor(self.threshold / (2.0 * np.pi) * TURN))

    def units(self, mirrored: int = 0) -> tuple[int, int]:
        """Both facings in units of angle; ``mirrored``, as an unmirrored window is held against them."""
        sign = -1.0 if mirrored else 1.0
        return to_units(sign * self.facing[0]), to_units(sign * self.facing[1])


@dataclass(frozen=True, eq=False)
class FoundWindows:
    """Windows, best first: by error, then unmirrored before mirrored, then by start frame, then by steps."""

    start: Int[ndarray, "window"]
    steps: Int[ndarray, "window"]
    mirrored: Int[ndarray, "window"]
    error: Int[ndarray, "window"]

    def __len__(self) -> int:
        return len(self.start)


NO_WINDOWS = FoundWindows(*(np.zeros(0, dtype=np.int64) for _ in range(4)))


def to_units(angle: float) -> int:
    """An angle in radians as 65,536ths of a turn, whole turns taken off."""
    return int(np.round(angle / (2.0 * np.pi) * TURN)) % TURN


def to_radians(units: Int[ndarray, "*batch"] | int) -> Float[ndarray, "*batch"]:
    """65,536ths of a turn in radians."""
    return np.asarray(np.asarray(units) * (2.0 * np.pi / TURN))


def features(
    root: Float32[ndarray, "frame 3"], start: Int[ndarray, "window"], steps: Int[ndarray, "window"] | int
) -> tuple[Float32[ndarray, "window"], UInt16[ndarray, "window"], UInt16[ndarray, "window"]]:
    """Length of v_p in metres, and both facings relative to it in 65,536ths of a turn; 0 stands for no direction."""
    a, b = root[start].astype(float), root[start + steps].astype(float)
    way = b[:, :2] - a[:, :2]
    distance = np.sqrt(way[:, 0] ** 2 + way[:, 1] ** 2).astype(np.float32)
    heading = np.arctan2(way[:, 0], way[:, 1])
    turned = [np.round((end[:, 2] - heading) * (TURN / (2.0 * np.pi))).astype(np.int64) for end in (a, b)]
    return distance, turned[0].astype(np.uint16), turned[1].astype(np.uint16)


def errors(
    facing_start: UInt16[ndarray, "window"],
    facing_end: UInt16[ndarray, "window"],
    wanted: tuple[int, int],
    criterion: Criterion,
) -> Int32[ndarray, "window"]:
    """Equation 7 in units of angle; ``wanted`` are the query's facings in the same units."""
    if criterion == "turn":
        return apart(facing_end - facing_start, (wanted[1] - wanted[0]) % TURN)
    error = apart(facing_start, wanted[0])
    return error if criterion == "start" else error + apart(facing_end, wanted[1])


def apart(angle: UInt16[ndarray, "*batch"], wanted: int) -> Int32[ndarray, "*batch"]:
    """The smaller angle between two directions, 0 to half a turn."""
    return np.abs((angle - np.uint16(wanted)).view(np.int16).astype(np.int32))


def first_of(found: FoundWindows, count: int) -> FoundWindows:
    """The ``count`` best, in order."""
    if len(found) > count:
        worst = np.partition(found.error, count - 1)[count - 1]
        found = select(found, found.error <= worst)
    order = np.lexsort((found.steps, found.start, found.mirrored, found.error))[:count]
    return select(found, order)


def select(found: FoundWindows, rows: ndarray) -> FoundWindows:
    """Some of the windows, by index or mask."""
    return FoundWindows(found.start[rows], found.steps[rows], found.mirrored[rows], found.error[rows])


def join(parts: list[FoundWindows]) -> FoundWindows:
    """All windows of several findings, unordered."""
    if not parts:
        return NO_WINDOWS
    return FoundWindows(
        np.concatenate([part.start for part in parts]),
        np.concatenate([part.steps for part in parts]),
        np.concatenate([part.mirrored for part in parts]),
        np.concatenate([part.error for part in parts]),
    )
