"""How fast a drawn path is walked: piece by piece as people in the gallery walk such pieces, slower round its corners.

A *schedule* is the time at each sample of a curve, seconds from 0, ascending.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from interpose.drawn_path.curve import SHORTEST_CURVE, Curve, gaussian
from interpose.features import RATE
from interpose.gallery import matching, paths, weighing
from interpose.gallery.matching import IN_PLACE
from interpose.gallery.proposals import PathRequest
from interpose.gallery.speeds import group_of, suggest
from interpose.gallery.store import Gallery
from interpose.gallery.weighing import SKETCH, EndStates, Pool
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW

SHORTEST_PIECE, LONGEST_PIECE = 1.0, 4.0
"""Metres of a piece."""
PIECE_TURN = 0.6
"""Radians: a piece that is long enough ends where its direction has turned so far."""
MOST_PIECES = 20
"""Pieces that are request for; with the second try of those that find nothing, 40 queries at most."""
LIKE_LENGTH = 0.15
"""The logarithm of a window's length over the piece's that counts as one unit of deviation (`Costs`)."""
ANY_FACING = replace(matching.MATCH_DEFAULTS, threshold=2.0 * np.pi, tolerance=0.1)
"""The second try, where nothing matches: any facing."""
SWAY_RATIO = 1.2
"""Ratio of lengths up to which a window is no detour, as hips sway."""
TRUSTED_RATIO = 0.5
"""The logarithm of the windows' length over the piece's at which its pace has little weight."""
SLOWEST_SHARE = 0.05
"""The least speed within a piece, as a share of its mean."""
MOST_TURN_SPEED = 4.5
"""Radians a second along the curve."""
PACE_SMOOTHING = 1.0
"""Metres: the standard deviation of the Gaussian that smooths the pieces' paces."""
MOST_SIDEWAYS, MOST_BRAKING = 4.0, 4.0
"""m/s^2: outward in a bend, and along the path into and out of a corner."""
TIME_STEP = 1.0 / 120.0
"""Seconds between the speeds that are smoothed."""
SPEED_SMOOTHING = 0.15
"""Seconds: the standard deviation of the Gaussian that smooths speeds."""
SPEED_FADE = 0.5
"""Seconds over which a known speed at a key blends into the path's own."""


@dataclass(frozen=True, eq=False)
class PathProgress:
    """Progress along a curve. arc: metres at evenly spaced times from 0 to ``duration`` seconds."""

    arc: Float[ndarray, "time"]
    duration: float

    def sampled(self, steps: int) -> Float[ndarray, "time"]:
        """Metres at ``steps`` + 1 frames, stretched to that duration."""
        return np.interp(np.linspace(0.0, 1.0, steps + 1), np.linspace(0.0, 1.0, len(self.arc)), self.arc)


@dataclass(frozen=True)
class _Walk:
    """How a piece is walked. seconds: as suggested. slow: seconds a metre. haste: how many times faster the requested
    speed is. profile: speeds at equal shares of the duration, relative to their mean. trust: weight of the pace."""

    seconds: float
    slow: float
    haste: float
    profile: Float[ndarray, "leg"]
    trust: float


def by_gallery(
    gallery: Gallery, curve: Curve, facing: Float[ndarray, "sample"], ends: EndStates, request: PathRequest, seed: int
) -> Float[ndarray, "sample"] | None:
    """The schedule of a curve walked with those facings, in ``request.style`` and at ``request.speed``.

    Each piece of one to four metres is a query of its own; windows as long as the piece count most, so that a bend is
    timed by bends. Their weighted durations give its pace, and the mean progress of those at the curve's ends how it
    sets out and arrives. None where the gallery matches no piece. Raises InputError for a style that it lacks or an
    unknown speed.
    """
    styles = gallery.style_indices(request.style)
    draw = np.random.default_rng(seed)
    cuts = pieces(curve)
    lengths = np.diff(curve.arc[cuts])
    last = len(lengths) - 1
    walks: dict[int, _Walk] = {}
    for piece in np.unique(np.round(np.linspace(0, last, min(len(lengths), MOST_PIECES))).astype(int)).tolist():
        outer = (piece == 0, piece == last)  # whether the piece's ends are the curve's
        places = [(*curve.points[cut].tolist(), float(facing[cut])) for cut in cuts[piece : piece + 2]]
        query = paths.query_of(np.array(places))
        before, after = (velocity if here else None for velocity, here in zip(ends.velocities, outer, strict=True))
        known = EndStates(ends.postures if all(outer) else None, (before, after))
        tries = (
            weighing.gather(gallery, query, known, (SHORTEST_WINDOW, LONGEST_WINDOW), styles, draw, settings=settings)
            for settings in (matching.MATCH_DEFAULTS, ANY_FACING)
        )
        pool = next((pool for pool in tries if len(pool)), None)
        if pool is not None:
            walks[piece] = _walk(gallery, pool, float(lengths[piece]), ends, outer, request.speed)
    if not walks:
        return None
    if curve.length < IN_PLACE:
        return evenly(curve, walks[0].seconds / walks[0].haste)
    timed = np.array(sorted(walks))
    middles = curve.arc[cuts][:-1] + lengths / 2.0
    trusted = lengths[timed] * [walks[piece].trust for piece in timed]
    near = (np.exp(-0.5 * np.square((middles[:, None] - middles[timed]) / PACE_SMOOTHING)) + 1e-12) * trusted
    slow = np.average(np.tile([walks[piece].slow for piece in timed], (last + 1, 1)), axis=1, weights=near)
    haste = np.exp(np.average(np.log([walks[piece].haste for piece in timed]), weights=trusted))
    at = (curve.arc[:-1] + curve.arc[1:]) / 2.0
    profiles = {piece: walks[piece].profile for piece in {0, last} & walks.keys()}
    seconds = np.diff(curve.arc) * np.interp(at, middles, slow) * _slowness(at, curve.arc[cuts], profiles)
    schedule = np.concatenate([[0.0], np.cumsum(seconds)])
    return schedule * (float(lengths @ slow) / float(haste) / schedule[-1])


def evenly(curve: Curve, seconds: float) -> Float[ndarray, "sample"]:
    """The schedule of a constant speed."""
    share = np.linspace(0.0, 1.0, len(curve.arc)) if curve.length < SHORTEST_CURVE else curve.arc / curve.length
    return share * seconds


def progress(
    curve: Curve, schedule: Float[ndarray, "sample"], speeds: tuple[float | None, float | None]
) -> PathProgress:
    """A schedule made walkable: slower in corners, without jumps in speed, and with the known ``speeds`` at both ends,
    m/s along the curve. Corners make it take longer."""
    if curve.length < SHORTEST_CURVE:
        return PathProgress(curve.arc, float(schedule[-1]))
    cells = np.diff(curve.arc)
    bend = np.maximum(np.abs(np.diff(curve.heading)) / cells, 1e-9)
    fastest = np.minimum(MOST_TURN_SPEED / bend, np.sqrt(MOST_SIDEWAYS / bend))  # that turning allows, m/s
    squares = np.square(np.minimum(cells / np.maximum(np.diff(schedule), 1e-9), fastest))
    # Squared speeds may change by at most 2 a per metre: a forward and a backward pass bound them.
    slope = 2.0 * MOST_BRAKING * (curve.arc[1:] - curve.arc[1])
    squares = np.minimum.accumulate(squares - slope) + slope
    slope = 2.0 * MOST_BRAKING * (curve.arc[-1] - curve.arc[1:])
    squares = (np.minimum.accumulate((squares - slope)[::-1]) + slope[::-1])[::-1]
    times = np.concatenate([[0.0], np.cumsum(cells / np.sqrt(squares))])
    count = max(int(np.ceil(times[-1] / TIME_STEP)), 8)
    even = np.linspace(0.0, times[-1], count + 1)
    step = float(even[1])
    pace = np.diff(np.interp(even, times, curve.arc)) / step
    pace = gaussian_filter1d(pace, SPEED_SMOOTHING / step, mode="reflect")
    middles = (even[:-1] + even[1:]) / 2.0
    fade = min(SPEED_FADE, float(times[-1]) / 2.0)
    for speed, since in zip(speeds, (middles, times[-1] - middles), strict=True):
        if speed is not None:
            at_key = pace[0 if since is middles else -1]
            pace = pace + (speed - at_key) * np.maximum(1.0 - since / fade, 0.0) ** 2
    arc = np.concatenate([[0.0], np.cumsum(np.maximum(pace, 0.0))])
    return PathProgress(arc * (curve.length / arc[-1]), float(times[-1]))


def by_times(curve: Curve, passed: Float[ndarray, "knot"], times: Float[ndarray, "knot"]) -> PathProgress:
    """Progress that is at the arc lengths ``passed`` (from 0 to the curve's length) at those ``times`` (ascending from
    0): monotone in between, its speed smoothed over a tenth of a second."""
    count = max(int(np.ceil(times[-1] / TIME_STEP)), 8)
    even = np.linspace(0.0, times[-1], count + 1)
    arc = np.maximum.accumulate(gaussian(PchipInterpolator(times, passed)(even), 0.1 / float(even[1])))
    return PathProgress(np.clip(arc, 0.0, curve.length), float(times[-1]))


def pieces(curve: Curve) -> list[int]:
    """The samples at which a curve is cut where it turns, with its first and its last."""
    cuts, last = [0], len(curve.arc) - 1
    while True:
        begin = cuts[-1]
        least, most = np.searchsorted(curve.arc, curve.arc[begin] + [SHORTEST_PIECE, LONGEST_PIECE]).tolist()
        heading = curve.heading[begin : most + 1]
        turned = np.maximum.accumulate(heading) - np.minimum.accumulate(heading)
        end = min(max(begin + int(np.searchsorted(turned, PIECE_TURN)), least), most)
        if curve.length - curve.arc[min(end, last)] < SHORTEST_PIECE / 2.0:
            return [*cuts, last]
        cuts.append(end)


def _walk(
    gallery: Gallery, pool: Pool, length: float, ends: EndStates, outer: tuple[bool, bool], speed: str | None
) -> _Walk:
    """How a piece is walked in the windows that match it.

    A window counts by its cost, its length against the piece's, and its posture at an outer end.
    """
    legs = np.linalg.norm(np.diff(pool.sketch, axis=1), axis=-1)
    own = legs.sum(axis=1) + 1e-3
    cost = pool.cost.copy()
    if length >= IN_PLACE:
        cost += 0.5 * np.square(np.log(own / length) / LIKE_LENGTH)
    if ends.postures is not None and not all(outer):
        found = pool.found
        for frame, wanted, here in zip((found.start, found.start + found.steps), ends.postures, outer, strict=True):
            if here:
                cost += 0.5 * weighing.posture_cost(gallery.tracks, found, frame, wanted)
    weights = np.exp(cost.min() - cost)
    suggested = suggest(pool.found.steps, weights)
    steps = suggested.steps if speed is None else group_of(suggested, speed).steps
    mean = float(np.exp(np.average(np.log(own), weights=weights)))
    walked = max(min(mean, length), mean / SWAY_RATIO)
    trust = float(np.exp(-0.5 * np.square(np.log(mean / max(length, 1e-3)) / TRUSTED_RATIO))) + 1e-3
    profile = np.average(legs / own[:, None], axis=0, weights=weights) * legs.shape[1]
    seconds = suggested.steps / RATE
    return _Walk(seconds, seconds / walked, suggested.steps / steps, np.maximum(profile, SLOWEST_SHARE), trust)


def _slowness(
    at: Float[ndarray, "cell"], cuts: Float[ndarray, "cut"], profiles: dict[int, ndarray]
) -> Float[ndarray, "cell"]:
    """Slowness relative to constant speed within the first and the last piece, as in their windows. It fades towards
    inner ends, where a window ends and the path goes on."""
    slowness = np.ones(len(at))
    share = (np.arange(len(SKETCH) - 1) + 0.5) / (len(SKETCH) - 1)
    last = len(cuts) - 2
    for piece, profile in profiles.items():
        kept = np.maximum(
            *(np.clip(2.0 * t, 0.0, 1.0) * here for t, here in ((1.0 - share, piece == 0), (share, piece == last)))
        )
        speed = 1.0 + kept * (profile - 1.0)
        speed /= speed.mean()
        done = np.cumsum(speed) / len(speed) - speed / len(speed) / 2.0
        inside = (at >= cuts[piece]) & (at <= cuts[piece + 1])
        slowness[inside] = np.interp((at[inside] - cuts[piece]) / (cuts[piece + 1] - cuts[piece]), done, 1.0 / speed)
    return slowness
