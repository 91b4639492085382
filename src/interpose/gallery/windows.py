"""Atomic trajectories (Chu and Yang 2024, section 4.1) as numbers, and their error against a query (equation 7).

A *window* is a start frame and 15 to 150 steps (0.5 to 5 s) within one clip: T = (id, o_s, o_e, v_p, c). Angles are
kept in 65,536ths of a turn, so that errors are integers and any two searches agree on every tie.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32, Int, Int32, UInt16
from numpy import ndarray

SHORTEST_WINDOW, LONGEST_WINDOW = 15, 150
"""Steps of a window, at 30 Hz."""
WINDOW_LENGTHS = LONGEST_WINDOW - SHORTEST_WINDOW + 1
TURN = 65536
"""Units of angle in a full turn."""

Units = int | UInt16[ndarray, "window"]
"""Angles in units: one, or one for each window."""
Criterion = Literal["both", "start", "turn"]
"""What the error measures: both facings (equation 7), the start's alone (Algorithm 1, line 18), or how much the facing
turns from start to end, where both are at one place and v_p has no direction."""


@dataclass(frozen=True)
class WindowQuery:
    """What a window must meet.

    distance: smallest and largest length of v_p, metres. facing: at start and end, radians relative to v_p, signed as
    yaw is. steps: fewest and most. styles: indices, or None for all. threshold: the largest error, radians.
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
        """Both facings in units of angle; with ``mirrored`` those that an unmirrored window is compared with."""
        sign = -1.0 if mirrored else 1.0
        return to_units(sign * self.facing[0]), to_units(sign * self.facing[1])


@dataclass(frozen=True, eq=False)
class FoundWindows:
    """Windows with their errors in units of angle.

    Where ordered, best first: by error, then unmirrored before mirrored, then by start frame, then by steps.
    """

    start: Int[ndarray, "window"]
    steps: Int[ndarray, "window"]
    mirrored: Int[ndarray, "window"]
    error: Int[ndarray, "window"]

    def __len__(self) -> int:
        return len(self.start)


NO_WINDOWS = FoundWindows(*(np.zeros(0, dtype=np.int64) for _ in range(4)))


def to_units(angle: float) -> int:
    """An angle in radians as 65,536ths of a turn, without whole turns."""
    return int(np.round(angle / (2.0 * np.pi) * TURN)) % TURN


def to_radians(units: Int[ndarray, "*batch"] | int) -> Float[ndarray, "*batch"]:
    """65,536ths of a turn in radians."""
    return np.asarray(np.asarray(units) * (2.0 * np.pi / TURN))


def features(
    root: Float32[ndarray, "frame 3"], start: Int[ndarray, "window"], steps: Int[ndarray, "window"] | int
) -> tuple[Float32[ndarray, "window"], UInt16[ndarray, "window"], UInt16[ndarray, "window"]]:
    """The length of v_p in metres, and both facings relative to it in units of angle; v_p has heading 0 where it has no
    length."""
    a, b = root[start].astype(float), root[start + steps].astype(float)
    v_p = b[:, :2] - a[:, :2]
    distance = np.sqrt(v_p[:, 0] ** 2 + v_p[:, 1] ** 2).astype(np.float32)
    heading = np.arctan2(v_p[:, 0], v_p[:, 1])
    turned = [np.round((end[:, 2] - heading) * (TURN / (2.0 * np.pi))).astype(np.int64) for end in (a, b)]
    return distance, turned[0].astype(np.uint16), turned[1].astype(np.uint16)


def errors(
    facing_start: UInt16[ndarray, "window"],
    facing_end: UInt16[ndarray, "window"],
    wanted: tuple[Units, Units],
    criterion: Criterion,
) -> Int32[ndarray, "window"]:
    """Equation 7 in units of angle. ``wanted``: the query's facings in the same units, one for all windows or each."""
    if criterion == "turn":
        return apart(facing_end - facing_start, wanted[1] - wanted[0])
    error = apart(facing_start, wanted[0])
    return error if criterion == "start" else error + apart(facing_end, wanted[1])


def apart(angle: UInt16[ndarray, "*batch"], wanted: Units) -> Int32[ndarray, "*batch"]:
    """The smaller angle between two directions, 0 to half a turn."""
    return np.abs((angle - np.asarray(wanted).astype(np.uint16)).view(np.int16).astype(np.int32))


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


def merged(parts: list[FoundWindows]) -> FoundWindows:
    """The windows of several results, unordered."""
    if not parts:
        return NO_WINDOWS
    names = ("start", "steps", "mirrored", "error")
    return FoundWindows(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
