"""Paths that a user drew, from a JSON file (docs/paths.md) or from Python values, checked to the last number.

{"points": [[x, z], ...], "times": [s, ...], "facing": "path" | [[x, z], ...] | [degrees, ...]}
{"gaps": [{"start": frame, "target": frame, "points": ..., ...}, ...]}
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.io.files import read_whole

LARGEST_FILE = 16 * 1024 * 1024
"""Bytes of a file, at most."""
MOST_FILE_POINTS = 10_000
LARGEST_NUMBER = 1e4
"""The largest number that a coordinate (metres), time (seconds) or angle (degrees) may have."""
SAME_POINT = 1e-6
"""Metres: points closer than this count as one."""
_FIELDS = ("points", "times", "facing")


@dataclass(frozen=True, eq=False)
class DrawnPath:
    """A path on the ground. points: x, z in metres. times: seconds from the start key at each point, ascending, or
    None. facing: yaw at each point in radians, unwrapped, or None to face along the path."""

    points: Float[ndarray, "point 2"]
    times: Float[ndarray, "point"] | None = None
    facing: Float[ndarray, "point"] | None = None

    def scaled(self, scale: float) -> DrawnPath:
        """The path for a rig that is ``scale`` times as large; times and facings stay."""
        return DrawnPath(self.points * scale, self.times, self.facing)


@dataclass(frozen=True, eq=False)
class PathFile:
    """The paths of a file: one for any gap (``whole``), or one for each gap by its start key (``gaps``).

    targets: the target keys that the file gives, by start key. name: the file's, for messages.
    """

    whole: DrawnPath | None
    gaps: dict[int, DrawnPath]
    targets: dict[int, int] = field(default_factory=dict)
    name: str = "the drawn path"

    def of(self, start: int, target: int) -> DrawnPath | None:
        """The path of the gap between two keys, or None. Raises InputError where the file gives another target."""
        if self.whole is not None:
            return self.whole
        given = self.targets.get(start, target)
        if given != target:
            raise InputError(
                f"{self.name}: the gap that starts at key {start} has target {given}, but the next key is {target}; "
                f"correct the target or leave it out"
            )
        return self.gaps.get(start)

    def check(self, gaps: list[tuple[int, int]]) -> None:
        """Raises InputError where the file does not fit the gaps (start, target) of a clip: no such gap, another
        target, or one path for several gaps."""
        starts = [start for start, _ in gaps]
        if self.whole is not None and len(gaps) > 1:
            raise InputError(
                f"{self.name} has one path, but there are {len(gaps)} gaps; give "
                f'{{"gaps": [{{"start": {starts[0]}, "points": ...}}, ...]}}'
            )
        for start in self.gaps:
            if start not in starts:
                known = ", ".join(map(str, starts[:20])) + (", …" if len(starts) > 20 else "")
                raise InputError(f"{self.name}: no gap starts at frame {start}; gaps start at {known}")
        for start, target in gaps:
            self.of(start, target)


def read(path: Path) -> PathFile:
    """Reads the path or paths of a JSON file.

    Raises InputError, with the file and the field, for anything but the schema above with 1 to 10,000 points a path and
    finite numbers of at most 10,000.
    """
    held = _parsed(path)
    if not isinstance(held, dict):
        raise InputError(f'{path} is {_shown(held)}; give an object, {{"points": [[x, z], ...]}}')
    if "gaps" not in held:
        return PathFile(_path(held, f"{path}: ", _FIELDS), {}, name=str(path))
    _known(held, f"{path}: ", ("gaps",))
    entries = held["gaps"]
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{path}: gaps is {_shown(entries)}; give a list of at least one gap")
    gaps: dict[int, DrawnPath] = {}
    targets: dict[int, int] = {}
    for i, entry in enumerate(entries):
        place = f"{path}: gaps[{i}]"
        if not isinstance(entry, dict):
            raise InputError(f'{place} is {_shown(entry)}; give an object, {{"start": 0, "points": [[x, z], ...]}}')
        if "start" not in entry:
            raise InputError(f"{place} has no start; give the key frame that the gap starts at")
        path_of_gap = _path(entry, f"{place}.", ("start", "target", *_FIELDS))
        start = _frame(entry["start"], f"{place}.start")
        if start in gaps:
            raise InputError(f"{place}: the gap that starts at key {start} is given twice; remove one")
        if entry.get("target") is not None:
            targets[start] = _frame(entry["target"], f"{place}.target")
            if targets[start] <= start:
                raise InputError(f"{place}: target {targets[start]} does not come after start {start}; correct one")
        gaps[start] = path_of_gap
    return PathFile(None, gaps, targets, str(path))


def of_points(points: Any, times: Sequence[float] | None = None, facing: Sequence[float] | None = None) -> PathFile:
    """The path that any gap follows, from Python values: points (x, z) in metres, as an array (point, 2) or rows of
    numbers; seconds from the start key; yaw in radians. Raises InputError as :func:`read`."""
    held: dict[str, Any] = {"points": [np.asarray(point, dtype=object).tolist() for point in points]}
    if times is not None:
        held["times"] = list(times)
    path = _path(held, "the path's ", _FIELDS)
    if facing is not None:
        listed = _one_a_point(list(facing), "the path's facing", len(path.points), "radians")
        yaw = np.array([_number(value, f"the path's facing[{i}]") for i, value in enumerate(listed)])
        path = DrawnPath(path.points, path.times, yaw)
    return PathFile(path, {}, name="the path")


def _parsed(path: Path) -> Any:
    data = read_whole(path, LARGEST_FILE)

    def refused(constant: str) -> NoReturn:
        raise InputError(f"{path} contains {constant}; give finite numbers")

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        made = dict(pairs)
        if len(made) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(f"{path} has the field {_shown(twice)} twice in one object; remove one")
        return made

    try:
        return json.loads(data.decode("utf-8-sig"), parse_constant=refused, object_pairs_hook=unique)
    except InputError:
        raise
    except RecursionError:
        raise InputError(f'{path} is nested too deeply; give {{"points": [[x, z], ...]}}') from None
    except ValueError as error:
        raise InputError(f'{path} is not JSON ({error}); give {{"points": [[x, z], ...]}}') from None


def _path(held: dict[str, Any], place: str, fields: tuple[str, ...]) -> DrawnPath:
    """One path from an object. ``place``: the prefix of its fields in messages."""
    _known(held, place, fields)
    points = held.get("points")
    if not isinstance(points, list) or not points:
        problem = "there are no points" if points is None else f"points is {_shown(points)}"
        raise InputError(f"{place}{problem}; give a list of at least one, [[x, z], ...] in metres")
    if len(points) > MOST_FILE_POINTS:
        raise InputError(f"{place}points has {len(points)} points; give {MOST_FILE_POINTS} at most")
    ground = np.array([_pair(point, f"{place}points[{i}]") for i, point in enumerate(points)])
    apart = np.linalg.norm(np.diff(ground, axis=0), axis=-1)
    if len(apart) and apart.min() < SAME_POINT:
        at = int(np.argmin(apart))
        raise InputError(f"{place}points[{at + 1}] repeats the point before it, {points[at + 1]}; remove one")
    times = None if held.get("times") is None else _times(held["times"], f"{place}times", len(ground))
    facing = None if held.get("facing") is None else _facing(held["facing"], f"{place}facing", len(ground))
    return DrawnPath(ground, times, facing)


def _times(held: Any, place: str, count: int) -> Float[ndarray, "point"]:
    listed = _one_a_point(held, place, count, "seconds from the start key")
    times = np.array([_number(value, f"{place}[{i}]") for i, value in enumerate(listed)])
    if times[0] < 0.0:
        raise InputError(f"{place}[0] is {times[0]:g}, before the start key; give seconds from it, 0 or more")
    wrong = np.nonzero(np.diff(times) <= 0.0)[0]
    if len(wrong):
        at = int(wrong[0]) + 1
        raise InputError(f"{place}[{at}] is {times[at]:g}, not after {times[at - 1]:g} before it; give ascending times")
    return times


def _facing(held: Any, place: str, count: int) -> Float[ndarray, "point"] | None:
    if held == "path":
        return None
    if isinstance(held, str):
        raise InputError(f'{place} is {_shown(held)}; give "path", or one direction [x, z] or angle a point')
    listed = _one_a_point(held, place, count, "a direction [x, z] or degrees")
    if not isinstance(listed[0], list):
        degrees = np.array([_number(value, f"{place}[{i}]") for i, value in enumerate(listed)])
        return np.unwrap(np.radians(degrees))
    directions = np.array([_pair(value, f"{place}[{i}]") for i, value in enumerate(listed)])
    none = np.nonzero(np.linalg.norm(directions, axis=-1) < SAME_POINT)[0]
    if len(none):
        raise InputError(f"{place}[{none[0]}] is {listed[none[0]]}, which has no direction; give one that is not zero")
    return np.unwrap(np.arctan2(directions[:, 0], directions[:, 1]))


def _known(held: dict[str, Any], place: str, fields: tuple[str, ...]) -> None:
    unknown = [name for name in held if name not in fields]
    if unknown:
        raise InputError(f"{place}unknown field {_shown(unknown[0])}; the fields are {', '.join(fields)}")


def _one_a_point(held: Any, place: str, count: int, what: str) -> list[Any]:
    if not isinstance(held, list):
        raise InputError(f"{place} is {_shown(held)}; give a list, {what}, one a point")
    if len(held) != count:
        raise InputError(f"{place} has {len(held)} entries for {count} points; give one a point")
    return held


def _pair(held: Any, place: str) -> tuple[float, float]:
    if not isinstance(held, list) or len(held) != 2:
        raise InputError(f"{place} is {_shown(held)}; give two numbers, [x, z]")
    return _number(held[0], f"{place}[0]"), _number(held[1], f"{place}[1]")


def _number(held: Any, place: str) -> float:
    if isinstance(held, bool) or not isinstance(held, int | float):
        raise InputError(f"{place} is {_shown(held)}; give a number")
    if isinstance(held, float) and not math.isfinite(held):
        raise InputError(f"{place} is not finite; give a finite number")
    if abs(held) > LARGEST_NUMBER:
        raise InputError(
            f"{place} is {_shown(held)}; give a number of {LARGEST_NUMBER:.0f} at most (metres, seconds, degrees)"
        )
    return float(held)


def _frame(held: Any, place: str) -> int:
    if isinstance(held, bool) or not isinstance(held, int) or held < 0:
        raise InputError(f"{place} is {_shown(held)}; give the number of a key frame, 0 or more")
    return held


def _shown(held: Any) -> str:
    """A value, short enough for a message."""
    if isinstance(held, dict):
        return "an object"
    if isinstance(held, list) and (len(held) > 5 or any(isinstance(one, list | dict) for one in held)):
        return f"a list of {len(held)}"
    text = json.dumps(held)
    return text if len(text) <= 40 else f"{text[:39]}…"
