"""A smooth curve through points drawn on the ground, sampled by arc length, with its direction.

A centripetal Catmull-Rom spline (Yuksel, Schaefer and Keyser 2011, `Parameterization and applications of Catmull-Rom
curves`), smoothed by a discrete smoothing spline.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.interpolate import CubicSpline
from scipy.linalg import solveh_banded
from scipy.ndimage import gaussian_filter1d

from interpose.gallery.paths import ease

SAMPLE_SPACING = 0.01
"""Metres between samples, at most."""
SMOOTHING_LENGTH = 0.1
"""Metres: waves shorter than 2 pi times this are smoothed away, such as the tremor of a hand and corners too sharp to
walk. An arc of half a metre stays in place within a millimetre or two, near its ends within a centimetre."""
HEADING_SMOOTHING = 0.12
"""Metres: the standard deviation of the Gaussian that smooths the direction."""
ROUND_TURN, CORNER_TURN = float(np.radians(30.0)), float(np.radians(90.0))
"""A turn between two legs below the first is part of a bend, above the second a corner."""
CORNER_REACH = 1.0
"""Metres from a corner over which its legs are curved, about."""
LONE_DISTANCE = 0.3
"""Metres: a point this far from both neighbours was placed deliberately, not drawn in passing."""
SHORTEST_CURVE = 0.02
"""Metres: a shorter curve has no direction."""
THINNING = 1e-3
"""Metres of a path of which one point is kept."""
ATTACH_SPREAD = 4.0
"""A first or last point that is moved onto a key takes with it what lies within so many times that distance."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve sampled almost evenly by arc length. arc: metres from its start to each sample. points: x, z. heading:
    yaw of its direction in radians, unwrapped, smoothed. passed: the arc length at each of the drawn points."""

    arc: Float[ndarray, "sample"]
    points: Float[ndarray, "sample 2"]
    heading: Float[ndarray, "sample"]
    passed: Float[ndarray, "point"]

    @property
    def length(self) -> float:
        """Metres."""
        return float(self.arc[-1])

    def at(self, arc: Float[ndarray, "*batch"]) -> Float[ndarray, "*batch 2"]:
        """The positions (x, z) at some arc lengths."""
        if self.length < SHORTEST_CURVE:
            share = np.asarray(arc)[..., None] / max(self.length, 1e-12)
            return self.points[0] + np.clip(share, 0.0, 1.0) * (self.points[-1] - self.points[0])
        return CubicSpline(self.arc, self.points)(arc)


def attached(points: Float[ndarray, "point 2"], place: Float[ndarray, "2"], *, last: bool) -> Float[ndarray, "point 2"]:
    """The points with their first (or ``last``) moved onto ``place``, and its neighbours by less and less, so that a
    path of many points gets no corner there."""
    if last:
        return attached(points[::-1], place, last=False)[::-1]
    away = place - points[0]
    along = _lengths(points)
    reach = max(min(ATTACH_SPREAD * float(np.linalg.norm(away)), float(along[-1])), 1e-12)
    moved = points + (1.0 - ease(along / reach))[:, None] * away
    moved[0] = place
    return moved


def through(points: Float[ndarray, "point 2"], yaw: float = 0.0) -> Curve:
    """The smooth curve through two or more points, x, z in metres, exact at both ends.

    It passes points that stand alone within a few centimetres at sharp corners, closer elsewhere, and keeps to the
    trend of points drawn close together. ``yaw``: the heading of a curve too short to have one, radians.
    """
    made = _through(points, yaw)
    if len(points) < 3 or made.length < SHORTEST_CURVE:
        return made
    legs = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    missed = points[1:-1] - made.at(made.passed[1:-1])
    missed[np.minimum(legs[:-1], legs[1:]) < LONE_DISTANCE] = 0.0
    if np.abs(missed).max() < 0.005:
        return made
    # Smoothing cuts corners, so aim beyond each of them by as much as it was missed.
    aimed = points.copy()
    aimed[1:-1] += missed
    return _through(aimed, yaw)


def _through(points: Float[ndarray, "point 2"], yaw: float) -> Curve:
    along = _lengths(points)
    if along[-1] < SHORTEST_CURVE:
        return Curve(along[[0, -1]], points[[0, -1]], np.full(2, yaw), along)
    new = np.append(True, np.diff(np.floor(along / THINNING)) > 0.0)
    last = points[-1]
    points = points[new]
    points[-1] = last
    # Sample finely enough for every leg, then evenly by length.
    legs = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    each = np.maximum(np.ceil(2.0 / SAMPLE_SPACING * legs), 4).astype(int)
    samples = _spline(points, each)
    passed = np.concatenate([[0], np.cumsum(each)]).astype(float)  # as fractional indices into `samples`
    for _ in range(2):  # noise lengthens a path and the smoothing is by length: the second pass has the true length
        along = _lengths(samples)
        count = max(int(np.ceil(along[-1] / SAMPLE_SPACING)), 8)
        even = np.linspace(0.0, along[-1], count + 1)
        passed = np.interp(np.interp(passed, np.arange(len(samples)), along), even, np.arange(count + 1))
        samples = np.stack([np.interp(even, along, samples[:, c]) for c in (0, 1)], axis=-1)
        samples = smoothed(samples, SMOOTHING_LENGTH / float(even[1]))
    arc = _lengths(samples)
    passed = np.interp(passed, np.arange(len(samples)), arc)[np.cumsum(new) - 1]
    apart = np.append(True, np.diff(arc) > 1e-9)  # where a path turns back on itself, two samples may coincide
    return Curve(arc[apart], samples[apart], _headings(arc, samples, yaw)[apart], passed)


def smoothed(values: Float[ndarray, "sample *rest"], width: float) -> Float[ndarray, "sample *rest"]:
    """Evenly spaced values without their waves of up to 2 pi * ``width`` samples; the first and the last stay.

    Minimises the sum of squared changes plus width^4 times that of squared second differences.
    """
    count = len(values)
    if count < 4:
        return values.copy()
    weight = np.ones(count)
    weight[[0, -1]] = 1e8
    second = np.zeros((3, count))  # D^T D for second differences, upper bands
    for a, b, product in ((0, 0, 1), (1, 1, 4), (2, 2, 1), (0, 1, -2), (1, 2, -2), (0, 2, 1)):
        second[2 - (b - a), b : count - 2 + b] += product
    bands = width**4 * second
    bands[2] += weight
    made = solveh_banded(bands, (weight * values.T).T)
    made[0], made[-1] = values[0], values[-1]
    return made


def gaussian(values: Float[ndarray, "sample *rest"], deviation: float) -> Float[ndarray, "sample *rest"]:
    """Values smoothed by a Gaussian of so many samples, padded by odd reflection so that both ends stay."""
    if len(values) < 3:
        return values.copy()
    pad = int(np.ceil(4.0 * deviation)) + 1
    wide = np.pad(values, [(pad, pad)] + [(0, 0)] * (values.ndim - 1), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(wide, deviation, axis=0, mode="nearest")[pad:-pad]


def _spline(points: Float[ndarray, "point 2"], each: Int[ndarray, "leg"]) -> Float[ndarray, "sample 2"]:
    """The centripetal spline through the points, ``each`` leg sampled so often, and the last point.

    With even parameters it would swing out behind a short leg, with chord lengths at sharp corners. Legs are straight
    except near a sharp corner.
    """
    legs = np.diff(points, axis=0)
    wide = np.sqrt(np.maximum(np.linalg.norm(legs, axis=-1), 1e-9))[:, None]
    slope = legs / wide
    angle = np.abs(np.diff(np.unwrap(np.arctan2(legs[:, 0], legs[:, 1]))))
    sharp = ease((np.concatenate([[0.0], angle, [0.0]]) - ROUND_TURN) / (CORNER_TURN - ROUND_TURN))[:, None]
    # The slope of the parabola through each point and its two neighbours is Catmull-Rom's for uneven knots. At the ends
    # it is half-way between leg and parabola, so that the curve does not aim far past the neighbour.
    inner = (slope[:-1] * wide[1:] + slope[1:] * wide[:-1]) / (wide[:-1] + wide[1:])
    first, last = slope[:1], slope[-1:]
    if len(inner):
        first = first + 0.5 * (1.0 - sharp[1]) * (first - inner[:1])
        last = last + 0.5 * (1.0 - sharp[-2]) * (last - inner[-1:])
    slopes = np.concatenate([first, inner, last])
    tangents = []
    for at in (slopes[:-1] * wide, slopes[1:] * wide):
        reach = np.minimum(1.0, CORNER_REACH / np.maximum(np.linalg.norm(at, axis=-1, keepdims=True), 1e-12))
        tangents.append(at * (1.0 - (sharp[:-1] if not tangents else sharp[1:]) * (1.0 - reach)))
    leg = np.repeat(np.arange(len(legs)), each)
    u = (np.arange(len(leg)) - np.repeat(np.cumsum(each) - each, each))[:, None] / each[leg][:, None]
    made = (
        points[leg] * (1.0 + 2.0 * u) * (1.0 - u) ** 2
        + points[leg + 1] * (3.0 - 2.0 * u) * u**2
        + tangents[0][leg] * u * (1.0 - u) ** 2
        + tangents[1][leg] * (u - 1.0) * u**2
    )
    return np.concatenate([made, points[-1:]])


def _lengths(samples: Float[ndarray, "sample 2"]) -> Float[ndarray, "sample"]:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(samples, axis=0), axis=-1))])


def _headings(
    arc: Float[ndarray, "sample"], samples: Float[ndarray, "sample 2"], yaw: float
) -> Float[ndarray, "sample"]:
    legs = np.diff(samples, axis=0)
    moving = np.linalg.norm(legs, axis=-1) > 1e-9
    if not moving.any():
        return np.full(len(samples), yaw)
    middles = (arc[:-1] + arc[1:])[moving] / 2.0
    angle = np.unwrap(np.arctan2(legs[moving, 0], legs[moving, 1]))
    even = np.linspace(0.0, arc[-1], len(arc))
    smooth = gaussian(np.interp(even, middles, angle), HEADING_SMOOTHING / max(float(even[1]), 1e-9))
    return np.interp(arc, even, smooth)
