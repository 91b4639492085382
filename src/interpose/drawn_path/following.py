"""The root's path along a drawn path: how it meets the keys, its speed, and where the character faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import PchipInterpolator

from interpose.drawn_path import curve as curves
from interpose.drawn_path import pacing
from interpose.drawn_path.curve import HEADING_SMOOTHING, SHORTEST_CURVE, Curve, gaussian
from interpose.drawn_path.pacing import PathProgress
from interpose.drawn_path.path_file import DrawnPath
from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import paths
from interpose.gallery.matching import Query
from interpose.gallery.paths import ease
from interpose.gallery.proposals import LONGEST_GAP, PathRequest, check
from interpose.gallery.store import Gallery
from interpose.gallery.weighing import EndStates
from interpose.rotation import wrapped

ATTACH_DISTANCE = 0.3
"""Metres within which a first or last point stands for the key itself."""
TOP_SPEED = 12.0
"""Metres a second at most; the fastest runners reach 12.4."""
LONGEST_DRAWN = TOP_SPEED * LONGEST_GAP / RATE
"""Metres of a drawn path, at most."""
SAME_OFFSET = float(np.radians(30.0))
"""Radians: offsets of the two keys that differ by less blend along the whole path."""
FORWARD_OFFSET = float(np.radians(60.0))
"""Radians: the largest offset that counts as walking forward."""
OPPOSITE_OFFSET = float(np.radians(120.0))
"""Radians: where neither key faces forward and they differ by more, the path between is walked forward."""
TURN_RATE = 2.0
"""Radians a second at which a key's offset fades, about; half a second at least."""
TIME_SMOOTHING = 3.0
"""Frames: the standard deviation of the final smoothing over time, for turns on the spot."""


@dataclass(frozen=True, eq=False)
class _TiedPath:
    """A drawn path from start to target. times, facing: of the drawn points, seconds, radians. from_start, to_target:
    whether its first and last point stand for the keys; otherwise the curve begins and ends with points of its own."""

    curve: Curve
    times: Float[ndarray, "point"] | None
    facing: Float[ndarray, "point"] | None
    from_start: bool
    to_target: bool


def follow(
    gallery: Gallery | None, drawn: DrawnPath, query: Query, request: PathRequest, ends: EndStates, seed: int = 0
) -> Float[ndarray, "time 3"]:
    """The root's path (x, z in metres, yaw in radians, at 30 Hz) along a drawn path, both ends exactly the query's.

    Its duration is ``request.steps``, else the last of the path's own times, else what the gallery suggests for
    ``request.style`` and ``request.speed``. With given steps, the times or the gallery only say where the path is
    faster and where slower. Facings that are not drawn follow the path with the keys' offsets from it. Equal seeds give
    equal paths.

    Raises InputError where no duration is given or known, where the path's times do not fit the keys, for a path
    of more than 600 steps or faster than 12 m/s anywhere, and for a style that the gallery lacks or an unknown speed.
    """
    check(query, request)
    tied = _tied(drawn, query)
    offset = _Offset.of(tied.curve, query)
    given = None if tied.facing is None else _given(tied, tied.facing, query)
    if tied.times is not None:
        progress = _timed(tied, tied.times)
    else:
        facing = offset.before(tied.curve) if given is None else given
        progress = _paced(gallery, tied.curve, facing, query, request, ends, seed)
    steps = _steps(request, progress)
    arc = progress.sampled(steps)
    heading = np.interp(arc, tied.curve.arc, tied.curve.heading) if given is None else _looking(tied.curve, given, arc)
    track = gaussian(np.concatenate([tied.curve.at(arc), heading[:, None]], axis=-1), min(TIME_SMOOTHING, steps / 8.0))
    if given is None:
        track[:, 2] += offset.over(steps)
    path = paths.fit(paths.meet(track, ends.velocities), query)
    _check_speed(path)
    return path


def _tied(drawn: DrawnPath, query: Query) -> _TiedPath:
    """The drawn points as a curve that begins at the start and ends at the target."""
    start, target = np.array(query.start[:2]), np.array(query.target[:2])
    points, times = drawn.points, drawn.times
    first, last = float(np.linalg.norm(points[0] - start)), float(np.linalg.norm(points[-1] - target))
    from_start, to_target = first <= ATTACH_DISTANCE, last <= ATTACH_DISTANCE
    if len(points) == 1 and from_start and to_target:
        from_start, to_target = first < last, first >= last
    if times is not None and times[0] == 0.0 and not from_start:
        raise InputError(
            f"the drawn path is {first:.2f} m from the start key at 0 s; begin it within {ATTACH_DISTANCE} m of the "
            f"start, or give its first point a later time"
        )
    whole = curves.attached(points, start, last=False) if from_start else np.concatenate([start[None], points])
    whole = curves.attached(whole, target, last=True) if to_target else np.concatenate([whole, target[None]])
    length = float(np.linalg.norm(np.diff(whole, axis=0), axis=-1).sum())
    if length <= 4.0 * LONGEST_DRAWN:  # smoothing shortens what a trembling hand drew
        curve = curves.through(whole, query.start[2])
        length = curve.length
        if length <= LONGEST_DRAWN:
            return _TiedPath(curve, times, drawn.facing, from_start, to_target)
    raise InputError(
        f"the drawn path is {length:.0f} m long, which takes more than {LONGEST_GAP} frames at 30 Hz even at "
        f"{TOP_SPEED:.0f} m/s; draw a shorter path, or set keys in between"
    )


def _timed(tied: _TiedPath, times: Float[ndarray, "point"]) -> PathProgress:
    """Progress by the path's own times; from a last point before the target on at the mean speed."""
    passed = tied.curve.passed
    if not tied.to_target:
        moving, gone = times[-1] - (times[0] if tied.from_start else 0.0), passed[-2]
        if moving <= 0.0 or gone < SHORTEST_CURVE:
            raise InputError(
                f"the drawn path's times do not say how fast it goes to the target; give a last point within "
                f"{ATTACH_DISTANCE} m of the target with its time, or leave out the times"
            )
        times = np.append(times, times[-1] + (tied.curve.length - gone) / gone * moving)
    if times[0] > 0.0:
        times = np.append(0.0, times)
        passed = np.append(0.0, passed) if tied.from_start else passed
    return pacing.by_times(tied.curve, np.maximum.accumulate(passed), times)


def _paced(
    gallery: Gallery | None,
    curve: Curve,
    facing: Float[ndarray, "sample"],
    query: Query,
    request: PathRequest,
    ends: EndStates,
    seed: int,
) -> PathProgress:
    """Progress as in the gallery; at constant speed where it knows none and the steps are given."""
    schedule = None if gallery is None else pacing.by_gallery(gallery, curve, facing, ends, request, seed)
    if request.steps is not None:
        seconds = request.steps / RATE
        schedule = pacing.evenly(curve, seconds) if schedule is None else schedule * (seconds / schedule[-1])
    if schedule is None:
        why = "without a gallery" if gallery is None else "because the gallery has nothing like it"
        raise InputError(f"the drawn path's duration is not known {why}; give a number of frames, or times in the file")
    headings = curve.heading[0], curve.heading[-1]
    speeds = [
        None if velocity is None else max(0.0, float(velocity @ np.array([np.sin(heading), np.cos(heading)])))
        for velocity, heading in zip(ends.velocities, headings, strict=True)
    ]
    return pacing.progress(curve, schedule, (speeds[0], speeds[1]))


def _steps(request: PathRequest, progress: PathProgress) -> int:
    if request.steps is not None:
        return request.steps
    steps = max(1, round(progress.duration * RATE))
    if steps > LONGEST_GAP:
        raise InputError(
            f"the drawn path takes {progress.duration:.1f} s, which is {steps} frames at 30 Hz; a gap has at most "
            f"{LONGEST_GAP}: give fewer frames, or set keys in between"
        )
    return steps


@dataclass(frozen=True)
class _Offset:
    """The facing relative to the curve's direction, radians: at the start, along the path, at the target.

    ``along`` is None where the offset blends from one end to the other over the whole path.
    """

    start: float
    along: float | None
    target: float

    @staticmethod
    def of(curve: Curve, query: Query) -> _Offset:
        """The offsets of both keys, by the smaller angle.

        Who walks backward or sideways out of the start goes on so where the target has the same offset. Where the keys
        differ, the path takes the offset of the key that faces more nearly forward, and turns from or to the other's.
        """
        a = float(wrapped(query.start[2] - curve.heading[0]))
        b = float(wrapped(query.target[2] - curve.heading[-1]))
        between = float(wrapped(b - a))
        along = min(a, b, key=abs)
        aside = abs(along) > FORWARD_OFFSET and abs(between) <= OPPOSITE_OFFSET  # both keys to one side, or backward
        if abs(between) <= SAME_OFFSET or curve.length < SHORTEST_CURVE or aside:
            return _Offset(a, None, a + between)
        if abs(along) > FORWARD_OFFSET:
            along = 0.0
        # Each end differs from the path's own offset by the smaller angle.
        return _Offset(along + float(wrapped(a - along)), along, along + float(wrapped(b - along)))

    def before(self, curve: Curve) -> Float[ndarray, "sample"]:
        """The facing at the samples of a curve, before its speed is known."""
        if self.along is None:
            share = ease(curve.arc / max(curve.length, 1e-12))
            facing = curve.heading + self.start + share * (self.target - self.start)
        else:
            facing = curve.heading + self.along
        facing[[0, -1]] = curve.heading[0] + self.start, curve.heading[-1] + self.target
        return facing

    def over(self, steps: int) -> Float[ndarray, "time"]:
        """The offset at every frame of a path of so many steps at 30 Hz."""
        seconds = np.arange(steps + 1) / RATE
        if self.along is None:
            return self.start + ease(seconds / seconds[-1]) * (self.target - self.start)
        given_up, taken_up = self.start - self.along, self.target - self.along
        whole = float(seconds[-1])
        both = whole if given_up == 0.0 or taken_up == 0.0 else whole / 2.0
        first, last = (min(max(abs(turn) / TURN_RATE, 0.5), both) for turn in (given_up, taken_up))
        late = ease((seconds - (whole - last)) / last)
        return self.along + (1.0 - ease(seconds / first)) * given_up + late * taken_up


def _given(tied: _TiedPath, facing: Float[ndarray, "point"], query: Query) -> Float[ndarray, "sample"]:
    """Drawn facings at the samples of the curve; at both ends the keys' own."""
    inner = facing[tied.from_start : len(facing) - tied.to_target]
    facing = np.unwrap(np.concatenate([query.start[2:], inner, query.target[2:]]))
    knots, rows = np.unique(np.maximum.accumulate(tied.curve.passed), return_index=True)
    values = facing[rows]
    values[-1] = facing[-1]
    if len(knots) < 2 or tied.curve.length < SHORTEST_CURVE:
        return np.linspace(facing[0], facing[-1], len(tied.curve.arc))
    even = np.linspace(0.0, tied.curve.length, len(tied.curve.arc))
    smooth = gaussian(PchipInterpolator(knots, values)(even), HEADING_SMOOTHING / float(even[1]))
    return np.interp(tied.curve.arc, even, smooth)


def _looking(curve: Curve, given: Float[ndarray, "sample"], arc: Float[ndarray, "time"]) -> Float[ndarray, "time"]:
    if curve.length < SHORTEST_CURVE:
        return given[0] + ease(np.linspace(0.0, 1.0, len(arc))) * (given[-1] - given[0])
    return np.interp(arc, curve.arc, given)


def _check_speed(path: Float[ndarray, "time 3"]) -> None:
    speeds = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1) * RATE
    at = int(np.argmax(speeds))
    if speeds[at] > TOP_SPEED:
        x, z = path[at, :2].tolist()
        raise InputError(
            f"the drawn path goes {speeds[at]:.1f} m/s at x {x:.2f}, z {z:.2f}, {at / RATE:.1f} s from its start; "
            f"{TOP_SPEED:.0f} m/s is the most: give more time, or draw a shorter path"
        )
