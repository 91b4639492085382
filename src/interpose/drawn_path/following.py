"""The root's path along a line that a user drew: which way it goes, how fast, and which way the character faces.

`drawfile` reads the line, `curve` makes it smooth, `pacing` says when each place is passed. What is decided here is how
the line meets the keys, and where the character looks. Facings that are not given follow the curve, turned by an
offset: somebody who walks backward or sideways out of the start goes on so where the target asks for the same; where
the keys differ, the path is walked in the manner of the key that is nearer to facing ahead, and the other one is turned
from or to on the spot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import PchipInterpolator

from interpose.drawn_path import curve as curves
from interpose.drawn_path import pacing
from interpose.drawn_path.curve import SHORT, TURNED, Curve, gaussian
from interpose.drawn_path.pacing import PathProgress
from interpose.drawn_path.path_file import DrawnPath
from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import paths
from interpose.gallery.matching import Query
from interpose.gallery.paths import ease
from interpose.gallery.proposals import LONGEST_GAP, PathRequest
from interpose.gallery.store import Gallery
from interpose.gallery.weighing import EndStates
from interpose.rotation import wrapped

JOIN = 0.3
"""Metres within which a first or last point stands for the key itself."""
FASTEST = 12.0
"""Metres a second at most; nobody has run faster than 12.4."""
LONGEST_LINE = FASTEST * LONGEST_GAP / RATE
ALIKE = float(np.radians(30.0))
"""Offsets of the two keys that differ by less go over into one another along the whole path."""
AHEAD = float(np.radians(60.0))
"""An offset up to which somebody walks forward."""
OPPOSITE = float(np.radians(120.0))
"""Where both keys look elsewhere than ahead and differ by more, the path between is walked forward."""
TURN_RATE = 2.0
"""Radians a second at which a key's offset is given up, about; half a second at least."""
SMOOTH = 3.0
"""Frames: the standard deviation of the last smoothing over time, for where the line turns on the spot."""


@dataclass(frozen=True, eq=False)
class _Line:
    """A line from start to target. passed, times, facing: of the points drawn, arc lengths, seconds, radians."""

    curve: Curve
    passed: Float[ndarray, "point"]
    times: Float[ndarray, "point"] | None
    facing: Float[ndarray, "point"] | None
    from_start: bool
    to_target: bool


def follow(
    gallery: Gallery | None, drawn: DrawnPath, query: Query, asked: PathRequest, ends: EndStates, seed: int = 0
) -> Float[ndarray, "time 3"]:
    """The path (time, 3) of x, z, yaw at 30 Hz along a drawn line, both ends exactly the query's.

    It takes ``asked.steps``; else what the line's own times say; else what the gallery says for ``asked.style`` and
    ``asked.speed``. Where steps are given, times or the gallery say only where it is faster and where slower. Equal
    seeds give the same.

    Raises InputError where no time is given and none can be had, where the line's times do not fit the keys, for a path
    of more than 600 steps or faster than 12 m/s anywhere, and for a style that the gallery lacks or an unknown speed.
    """
    if not np.isfinite([*query.start, *query.target]).all():
        raise InputError("start or target is not a finite position on the ground; give poses without NaN")
    if asked.steps is not None and not 1 <= asked.steps <= LONGEST_GAP:
        raise InputError(f"a path takes 1 to {LONGEST_GAP} frames at 30 Hz, got {asked.steps}")
    line = _line(drawn, query)
    offset = _Offset.of(line.curve, query)
    given = None if line.facing is None else _given(line, line.facing, query)
    if line.times is not None:
        progress = _timed(line, line.times)
    else:
        facing = offset.before(line.curve) if given is None else given
        progress = _paced(gallery, line.curve, facing, query, asked, ends, seed)
    steps = _steps(asked, progress)
    arc = progress.sampled(steps)
    heading = line.curve.heading_at(arc) if given is None else _looking(line.curve, given, arc)
    track = gaussian(np.concatenate([line.curve.at(arc), heading[:, None]], axis=-1), min(SMOOTH, steps / 8.0))
    if given is None:
        track[:, 2] += offset.over(steps)
    path = paths.fit(paths.meet(track, ends.velocities), query)
    _check_speed(path)
    return path


def _line(drawn: DrawnPath, query: Query) -> _Line:
    """The drawn points tied to start and target, as a curve."""
    start, target = np.array(query.start[:2]), np.array(query.target[:2])
    points, times = drawn.points, drawn.times
    first, last = float(np.linalg.norm(points[0] - start)), float(np.linalg.norm(points[-1] - target))
    from_start, to_target = first <= JOIN, last <= JOIN
    if len(points) == 1 and from_start and to_target:
        from_start, to_target = first < last, first >= last
    if times is not None and times[0] == 0.0 and not from_start:
        raise InputError(
            f"the drawn path is to be {first:.2f} m away from the start key at 0 s; begin it within {JOIN} m of the "
            f"start, or give its first point a later time"
        )
    tied = curves.attached(points, start, last=False) if from_start else np.concatenate([start[None], points])
    tied = curves.attached(tied, target, last=True) if to_target else np.concatenate([tied, target[None]])
    length = float(np.linalg.norm(np.diff(tied, axis=0), axis=-1).sum())
    if length <= 4.0 * LONGEST_LINE:  # a trembling hand draws longer lines than there are ways
        curve = curves.through(tied, query.start[2])
        length = curve.length
        if length <= LONGEST_LINE:
            passed = curve.passed[0 if from_start else 1 :][: len(points)]
            return _Line(curve, passed, times, drawn.facing, from_start, to_target)
    raise InputError(
        f"the drawn path is {length:.0f} m long, which takes more than {LONGEST_GAP} frames at 30 Hz even at "
        f"{FASTEST:.0f} m/s; draw a shorter one, or set keys in between"
    )


def _timed(line: _Line, times: Float[ndarray, "point"]) -> PathProgress:
    """Progress by the line's own times; where the last point is not at the target, on to that at the mean pace."""
    passed, length = line.passed, line.curve.length
    if not line.to_target:
        moving = times[-1] - (times[0] if line.from_start else 0.0)
        if moving <= 0.0 or passed[-1] < SHORT:
            raise InputError(
                f"the drawn path's times do not say how fast it goes to the target; give a last point within {JOIN} m "
                f"of the target with its time, or leave out the times"
            )
        times = np.append(times, times[-1] + (length - passed[-1]) / passed[-1] * moving)
        passed = np.append(passed, length)
    if times[0] > 0.0:
        times, passed = np.append(0.0, times), np.append(0.0, passed)
    passed = np.maximum.accumulate(passed)
    return pacing.by_times(line.curve, passed, times)


def _paced(
    gallery: Gallery | None,
    curve: Curve,
    facing: Float[ndarray, "sample"],
    query: Query,
    asked: PathRequest,
    ends: EndStates,
    seed: int,
) -> PathProgress:
    """Progress as the gallery has it; where it has nothing and the steps are given, at an even pace."""
    schedule = None if gallery is None else pacing.by_gallery(gallery, curve, facing, ends, asked, seed)
    if asked.steps is not None:
        seconds = asked.steps / RATE
        schedule = pacing.evenly(curve, seconds) if schedule is None else schedule * (seconds / schedule[-1])
    if schedule is None:
        why = "without a gallery" if gallery is None else "as the gallery has nothing like it"
        raise InputError(
            f"how long the drawn path takes is not known {why}; give a number of frames, or times in the file"
        )
    headings = curve.heading[0], curve.heading[-1]
    speeds = [
        None if velocity is None else max(0.0, float(velocity @ np.array([np.sin(heading), np.cos(heading)])))
        for velocity, heading in zip(ends.velocities, headings, strict=True)
    ]
    return pacing.progress(curve, schedule, (speeds[0], speeds[1]))


def _steps(asked: PathRequest, progress: PathProgress) -> int:
    if asked.steps is not None:
        return asked.steps
    steps = max(1, round(progress.duration * RATE))
    if steps > LONGEST_GAP:
        raise InputError(
            f"the drawn path takes {progress.duration:.1f} s, which is {steps} frames at 30 Hz; a gap has at most "
            f"{LONGEST_GAP}: give fewer frames, or set keys in between"
        )
    return steps


@dataclass(frozen=True)
class _Offset:
    """By how much the facing is turned from the curve's direction, radians: at the start, on the way, at the target.

    ``way`` is None where it goes over from one end to the other along the whole path.
    """

    start: float
    way: float | None
    target: float

    @staticmethod
    def of(curve: Curve, query: Query) -> _Offset:
        """What the keys ask for, the shorter way round."""
        a = float(wrapped(query.start[2] - curve.heading[0]))
        b = float(wrapped(query.target[2] - curve.heading[-1]))
        between = float(wrapped(b - a))
        way = min(a, b, key=abs)
        if abs(between) <= ALIKE or curve.length < SHORT or (abs(way) > AHEAD and abs(between) <= OPPOSITE):
            return _Offset(a, None, a + between)
        if abs(way) > AHEAD:
            way = 0.0
        # Each end is reached the shorter way from the way's own.
        return _Offset(way + float(wrapped(a - way)), way, way + float(wrapped(b - way)))

    def before(self, curve: Curve) -> Float[ndarray, "sample"]:
        """The facing at the samples of a curve, before it is known how fast it is walked."""
        if self.way is None:
            share = ease(curve.arc / max(curve.length, 1e-12))
            facing = curve.heading + self.start + share * (self.target - self.start)
        else:
            facing = curve.heading + self.way
        facing[[0, -1]] = curve.heading[0] + self.start, curve.heading[-1] + self.target
        return facing

    def over(self, steps: int) -> Float[ndarray, "time"]:
        """The offset at every frame of a path of so many steps of 1/30 s."""
        seconds = np.arange(steps + 1) / RATE
        if self.way is None:
            return self.start + ease(seconds / seconds[-1]) * (self.target - self.start)
        given_up, taken_up = self.start - self.way, self.target - self.way
        whole = float(seconds[-1])
        both = whole if given_up == 0.0 or taken_up == 0.0 else whole / 2.0
        first, last = (min(max(abs(turn) / TURN_RATE, 0.5), both) for turn in (given_up, taken_up))
        late = ease((seconds - (whole - last)) / last)
        return self.way + (1.0 - ease(seconds / first)) * given_up + late * taken_up


def _given(line: _Line, facing: Float[ndarray, "point"], query: Query) -> Float[ndarray, "sample"]:
    """Facings that were drawn, at the samples of the curve; at both ends the keys' own."""
    passed = line.passed
    if not line.from_start:
        passed, facing = np.append(0.0, passed), np.append(query.start[2], facing)
    if not line.to_target:
        passed, facing = np.append(passed, line.curve.length), np.append(facing, query.target[2])
    facing = facing.copy()
    facing[[0, -1]] = query.start[2], query.target[2]
    facing = np.unwrap(facing)
    knots, rows = np.unique(np.maximum.accumulate(passed), return_index=True)
    values = facing[rows]
    values[-1] = facing[-1]
    if len(knots) < 2 or line.curve.length < SHORT:
        return np.linspace(facing[0], facing[-1], len(line.curve.arc))
    even = np.linspace(0.0, line.curve.length, len(line.curve.arc))
    smooth = gaussian(PchipInterpolator(knots, values)(even), TURNED / float(even[1]))
    return np.interp(line.curve.arc, even, smooth)


def _looking(curve: Curve, given: Float[ndarray, "sample"], arc: Float[ndarray, "time"]) -> Float[ndarray, "time"]:
    if curve.length < SHORT:
        return given[0] + ease(np.linspace(0.0, 1.0, len(arc))) * (given[-1] - given[0])
    return np.interp(arc, curve.arc, given)


def _check_speed(path: Float[ndarray, "time 3"]) -> None:
    speeds = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1) * RATE
    at = int(np.argmax(speeds))
    if speeds[at] > FASTEST:
        x, z = path[at, :2].tolist()
        raise InputError(
            f"the drawn path goes {speeds[at]:.1f} m/s at x {x:.2f}, z {z:.2f}, {at / RATE:.1f} s from its start; "
            f"{FASTEST:.0f} m/s is the most: give more time, or draw a shorter one"
        )
