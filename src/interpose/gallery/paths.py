"""From a trace of windows to one path on the ground: turned onto the query, joined without kinks, exact at both ends.

Figure 6 of Chu and Yang 2024 (appendix 9.1) is :func:`place`: the candidate is turned by the angle between both ways
from end to end, scaled by the little that their lengths differ, and what its facings are off at the ends is spread
smoothly over the whole. Parts meet in position by construction; at a join their facings meet half-way, and so do their
velocities, both corrections dying away within half a second.

A path is an array (time, 3) of x, z, yaw at 30 Hz, yaw unwrapped, both ends included.
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
"""Frames from a join, or from an end of a known velocity, over which corrections die away."""


@dataclass(frozen=True, eq=False)
class Steps:
    """The stages of figure 6: as windows lie in the gallery, turned and scaled onto the query, and finished.

    Before the last a frame in which two windows meet is there twice.
    """

    found: Float[ndarray, "cut 3"]
    turned: Float[ndarray, "cut 3"]
    placed: Float[ndarray, "time 3"]


def place(tracks: Tracks, trace: Trace, query: Query) -> Float[ndarray, "time 3"]:
    """The path of a trace from the query's start to its target, ``trace.steps`` + 1 frames; both ends are exact."""
    return stages(tracks, trace, query).placed


def stages(tracks: Tracks, trace: Trace, query: Query) -> Steps:
    """:func:`place` step by step, for a picture of it."""
    cuts = [tracks.cut(part.start, part.steps, part.mirrored) for part in trace.parts]
    lengths = [float(np.hypot(*(cut[-1] - cut[0])[:2])) for cut in cuts]
    scale = 1.0 if query.in_place else query.distance / sum(lengths)
    laid, at = [], np.array(query.start[:2])
    for cut in cuts:
        way = cut[-1] - cut[0]  # of a window that is shorter than what counts as a way, too
        heading = cut[0, 2] if query.in_place else np.arctan2(way[0], way[1])
        laid.append(turn(cut, float(query.heading - heading), scale, at))
        at = laid[-1][-1, :2]
    whole = laid[0]
    for part in laid[1:]:
        whole = join(whole, part)
    return Steps(np.concatenate(cuts), np.concatenate(laid), fit(whole, query))


def query_of(track: Float[ndarray, "time 3"]) -> Query:
    """The query that a path itself answers."""
    (a, b, c), (d, e, f) = track[0].tolist(), track[-1].tolist()
    return Query((a, b, c), (d, e, f))


def turn(
    track: Float[ndarray, "time 3"], angle: float, scale: float, origin: Float[ndarray, "2"]
) -> Float[ndarray, "time 3"]:
    """A path turned about its start by ``angle``, scaled, and moved to begin at ``origin``."""
    ground = origin + scale * turned(track[:, :2] - track[0, :2], angle)
    return np.concatenate([ground, track[:, 2:] + angle], axis=-1)


def join(a: Float[ndarray, "before 3"], b: Float[ndarray, "after 3"]) -> Float[ndarray, "time 3"]:
    """One path after another: ``a``'s last frame is ``b``'s first. Their other ends stay as they are, but that ``b`` is
    turned by whole turns."""
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
    """0 at the join, 1 one frame away from it, gone after ``fade`` frames, with its slope."""
    share = frames * np.maximum(1.0 - frames / fade, 0.0) ** 2
    return share / max((1.0 - 1.0 / fade) ** 2, 1e-9) if fade > 1 else np.zeros(len(frames))


def fit(track: Float[ndarray, "time 3"], query: Query) -> Float[ndarray, "time 3"]:
    """A path bent to begin and end exactly where the query does; what it is off is spread smoothly over all of it."""
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
    """A path bent at its ends into the velocities (x, z), m/s, that are known there; its ends stay where they are."""
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
    """The same path walked evenly faster or slower, in ``steps`` steps."""
    if steps == len(track) - 1:
        return track
    spline = CubicSpline(np.linspace(0.0, 1.0, len(track)), track)
    made = spline(np.linspace(0.0, 1.0, steps + 1))
    made[0], made[-1] = track[0], track[-1]
    return made


def straight(query: Query, steps: int) -> Float[ndarray, "time 3"]:
    """The straight line at an even pace, turning evenly the shorter way round."""
    start, target = np.array(query.start), np.array(query.target)
    target[2] = start[2] + wrapped(target[2] - start[2])
    return start + np.linspace(0.0, 1.0, steps + 1)[:, None] * (target - start)


def ease(t: Float[ndarray, "*batch"]) -> Float[ndarray, "*batch"]:
    """From 0 to 1 with no slope at either end."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def apart(a: Float[ndarray, "time 3"], b: Float[ndarray, "other 3"]) -> float:
    """The mean distance of two paths at equal shares of their time, metres."""
    count = max(len(a), len(b)) - 1
    return float(np.linalg.norm(retime(a, count)[:, :2] - retime(b, count)[:, :2], axis=-1).mean())
