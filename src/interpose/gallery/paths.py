"""From matched windows to one continuous path that is exact at both ends (Chu and Yang 2024, appendix 9.1, figure 6).

A path is an array (time, 3) of x, z in metres and unwrapped yaw in radians at 30 Hz, both ends included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray
from scipy.interpolate import CubicSpline

from interpose.data.root import turned
from interpose.features import RATE
from interpose.gallery.matching import Query, Trace
from interpose.gallery.tracks import Tracks
from interpose.rotation import wrapped

FADE_STEPS = 15
"""Steps from a join, or from an end with a known velocity, over which corrections fade."""


@dataclass(frozen=True, eq=False)
class PlacementStages:
    """The stages of figure 6: windows as recorded, turned and scaled onto the query, and joined and fitted.

    In the first two, the frame at which two windows meet appears twice.
    """

    found: Float[ndarray, "cut 3"]
    turned: Float[ndarray, "cut 3"]
    placed: Float[ndarray, "time 3"]


def place(tracks: Tracks, trace: Trace, query: Query) -> Float[ndarray, "time 3"]:
    """The path of a trace from the query's start to its target: ``trace.steps`` + 1 frames, exact at both ends.

    Each window is turned by the angle between its v_p and the query's, and scaled by the little that the lengths
    differ.
    """
    return stages(tracks, trace, query).placed


def stages(tracks: Tracks, trace: Trace, query: Query) -> PlacementStages:
    """The stages of :func:`place`, for a picture of them."""
    cuts = [tracks.cut(part.start, part.steps, part.mirrored) for part in trace.parts]
    lengths = [float(np.hypot(*(cut[-1] - cut[0])[:2])) for cut in cuts]
    scale = 1.0 if query.in_place else query.distance / sum(lengths)
    laid, at = [], np.array(query.start[:2])
    for cut in cuts:
        v_p = cut[-1] - cut[0]  # also of a window too short to count as moving
        heading = cut[0, 2] if query.in_place else np.arctan2(v_p[0], v_p[1])
        laid.append(turn(cut, float(query.heading - heading), scale, at))
        at = laid[-1][-1, :2]
    whole = laid[0]
    for part in laid[1:]:
        whole = join(whole, part)
    return PlacementStages(np.concatenate(cuts), np.concatenate(laid), fit(whole, query))


def query_of(track: Float[ndarray, "time 3"]) -> Query:
    """The query from a path's start to its end."""
    (a, b, c), (d, e, f) = track[0].tolist(), track[-1].tolist()
    return Query((a, b, c), (d, e, f))


def turn(
    track: Float[ndarray, "time 3"], angle: float, scale: float, origin: Float[ndarray, "2"]
) -> Float[ndarray, "time 3"]:
    """A path turned about its start by ``angle`` radians, scaled, and moved to begin at ``origin``."""
    ground = origin + scale * turned(track[:, :2] - track[0, :2], angle)
    return np.concatenate([ground, track[:, 2:] + angle], axis=-1)


def join(a: Float[ndarray, "before 3"], b: Float[ndarray, "after 3"]) -> Float[ndarray, "time 3"]:
    """One path after another: the last frame of ``a`` is the first of ``b``.

    At the join, facings and velocities meet half-way; both corrections fade within :data:`FADE_STEPS`. The other ends
    stay, except that the yaw of ``b`` is shifted by whole turns.
    """
    b = b + np.array([0.0, 0.0, -2.0 * np.pi * np.round((b[0, 2] - a[-1, 2]) / (2.0 * np.pi))])
    fade_a, fade_b = min(FADE_STEPS, len(a) - 1), min(FADE_STEPS, len(b) - 1)
    before, after = np.arange(len(a))[::-1], np.arange(len(b))
    apart = (b[0] - a[-1]) / 2.0
    a = a + ease(1.0 - before / fade_a)[:, None] * apart
    b = b - ease(1.0 - after / fade_b)[:, None] * apart
    bend = ((b[1] - b[0]) - (a[-1] - a[-2])) / 2.0
    a = a - _kick(before, fade_a)[:, None] * bend
    b = b - _kick(after, fade_b)[:, None] * bend
    return np.concatenate([a, b[1:]])


def _kick(frames: Int[ndarray, "time"], fade: int) -> Float[ndarray, "time"]:
    """A velocity correction: 0 at the join, 1 one frame away, 0 with zero slope after ``fade`` frames."""
    share = frames * np.maximum(1.0 - frames / fade, 0.0) ** 2
    return share / max((1.0 - 1.0 / fade) ** 2, 1e-9) if fade > 1 else np.zeros(len(frames))


def fit(track: Float[ndarray, "time 3"], query: Query) -> Float[ndarray, "time 3"]:
    """A path that begins and ends exactly where the query does; its errors are spread smoothly over its length."""
    start, target = np.array(query.start), np.array(query.target)
    track = track + np.array([0.0, 0.0, 2.0 * np.pi * np.round((start[2] - track[0, 2]) / (2.0 * np.pi))])
    target[2] += 2.0 * np.pi * np.round((track[-1, 2] - target[2]) / (2.0 * np.pi))
    late = ease(np.linspace(0.0, 1.0, len(track)))[:, None]
    made = track + (1.0 - late) * (start - track[0]) + late * (target - track[-1])
    made[0], made[-1] = start, target
    return made


def meet(
    track: Float[ndarray, "time 3"], velocities: tuple[Float[ndarray, "2"] | None, Float[ndarray, "2"] | None]
) -> Float[ndarray, "time 3"]:
    """A path bent near its ends towards the known velocities (x, z), m/s, there; both ends stay in place."""
    fade = min(FADE_STEPS, (len(track) - 1) // 2)
    if fade < 3:
        return track
    kick, made = _kick(np.arange(len(track)), fade), track.copy()
    if velocities[0] is not None:
        made[:, :2] += kick[:, None] * (velocities[0] / RATE - (track[1] - track[0])[:2])
    if velocities[1] is not None:
        made[:, :2] -= kick[::-1, None] * (velocities[1] / RATE - (track[-1] - track[-2])[:2])
    return made


def retime(track: Float[ndarray, "time 3"], steps: int) -> Float[ndarray, "other 3"]:
    """The same path, evenly faster or slower, in ``steps`` steps."""
    if steps == len(track) - 1:
        return track
    spline = CubicSpline(np.linspace(0.0, 1.0, len(track)), track)
    made = spline(np.linspace(0.0, 1.0, steps + 1))
    made[0], made[-1] = track[0], track[-1]
    return made


def straight(query: Query, steps: int) -> Float[ndarray, "time 3"]:
    """The straight path at constant speed; the yaw turns evenly by the smaller angle."""
    start, target = np.array(query.start), np.array(query.target)
    target[2] = start[2] + wrapped(target[2] - start[2])
    return start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (target - start)


def ease(t: Float[ndarray, "*batch"]) -> Float[ndarray, "*batch"]:
    """Smoothstep: from 0 to 1 with zero slope at both ends; ``t`` is clamped to [0, 1]."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def apart(a: Float[ndarray, "time 3"], b: Float[ndarray, "other 3"]) -> float:
    """The mean distance of two paths at equal shares of their durations, metres."""
    count = max(len(a), len(b)) - 1
    return float(np.linalg.norm(retime(a, count)[:, :2] - retime(b, count)[:, :2], axis=-1).mean())
