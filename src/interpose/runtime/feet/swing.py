"""How a foot moves between the places where it stands: corrections that fade smoothly, toes that clear the floor."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.linalg import solveh_banded

from interpose.runtime.feet.footholds import floor
from interpose.runtime.feet.stances import FootSettings

_CLEARANCE = np.array([0.0, 0.6, 0.9, 1.0])
"""Share of the clearance that a toe has 0, 1, 2, ... frames after it leaves its place or before it reaches it."""
_KEY_CLEARANCE = np.array([0.0, 0.04, 0.15, 0.31, 0.5, 0.69, 0.85, 0.96, 1.0])
"""The same from or to a key in which the foot does not stand."""
_HEEL_LEAD = (0.1, 0.2, 0.4, 0.2, 0.1)
"""Weights of the toe's lift in this frame and the next four in the lift of the heel."""
_AFTER_KEY = np.array([0.0, 0.25, 0.75, 1.0])
_SOFT_FLOOR = 0.01
"""Metres over which the least height takes over from the toe's own."""


def smooth_field(
    values: Float[ndarray, "leg frame channel"], held: Bool[ndarray, "leg frame"], decay: float
) -> Float[ndarray, "leg frame channel"]:
    """For each leg, the correction c(frame) that is ``values`` where ``held`` and smooth and short-lived elsewhere.

    It minimises the sum of |second difference of c|^2 + 4 / decay^4 |c|^2: a beam on an elastic foundation, which
    forgets a place within some ``decay`` frames. It is zero at both keys and one frame beyond them, so that keys stay
    and nothing jumps there. One banded system solves all legs.
    """
    legs, frames, channels = values.shape
    fixed = np.ones((legs, frames + 2), dtype=bool)
    fixed[:, 2:-2] = held[:, 1:-1]
    known = np.zeros((legs, frames + 2, channels))
    known[:, 2:-2] = np.where(held[:, 1:-1, None], values[:, 1:-1], 0.0)
    moved = np.any(known, axis=(1, 2))
    if not moved.any():
        return known[:, 1:-1]
    curvature = np.diff(known[moved], n=2, axis=1)
    pull = np.zeros_like(known[moved])
    pull[:, :-2] += curvature
    pull[:, 1:-1] -= 2.0 * curvature
    pull[:, 2:] += curvature
    free = ~fixed[moved].reshape(-1)
    # The upper bands of D'D are 6, -4, 1. Each leg's first two and last two rows are fixed, so legs do not interact.
    bands = np.zeros((3, len(free)))
    bands[2] = np.where(free, 6.0 + 4.0 / decay**4, 1.0)
    bands[1, 1:] = np.where(free[1:] & free[:-1], -4.0, 0.0)
    bands[0, 2:] = np.where(free[2:] & free[:-2], 1.0, 0.0)
    right = np.where(free[:, None], -pull.reshape(-1, channels), known[moved].reshape(-1, channels))
    known[moved] = solveh_banded(bands, right).reshape(-1, frames + 2, channels)
    return known[:, 1:-1]


def lifted(
    toes: Float[ndarray, "leg frame 3"], held: Bool[ndarray, "leg frame"], settings: FootSettings
) -> Float[ndarray, "leg frame"]:
    """The toes' heights, metres, raised where they swing too low; unchanged where ``held`` and at the keys.

    A toe gains its clearance within three frames of leaving its place, and more slowly from a key in which it does not
    stand. A dragged toe rises in an arch above that, the higher the longer its step.
    """
    legs, frames = held.shape
    anchor = held.copy()
    anchor[:, [0, -1]] = True
    number = np.broadcast_to(np.arange(frames), (legs, frames))
    before = np.maximum.accumulate(np.where(anchor, number, 0), axis=1)
    after = np.minimum.accumulate(np.where(anchor, number, frames - 1)[:, ::-1], axis=1)[:, ::-1]
    row = np.arange(legs)[:, None]
    step = np.linalg.norm((toes[row, after] - toes[row, before])[..., ::2], axis=-1)
    share = (number - before) / np.maximum(after - before, 1)
    # The highest point of each swing says whether the network drags the toe (1) or lifts it by itself (0).
    highest = np.maximum.reduceat(toes[..., 1].reshape(-1), np.flatnonzero(anchor))[np.cumsum(anchor) - 1]
    drags = np.clip(2.0 - 2.0 * highest.reshape(legs, frames) / settings.clear, 0.0, 1.0)
    arch = drags * np.minimum(settings.arch * step, settings.arch_most) * np.sin(np.pi * share) ** 2
    clear = settings.clear + floor(toes[..., 1], 0.0)
    least = clear + arch
    rests = held.copy()
    rests[:, 0] &= held[:, 1]
    rests[:, -1] &= held[:, -2]
    for at, count in ((before, number - before), (after, after - number)):
        off = np.where(rests[row, at], _table(_CLEARANCE, count), _table(_KEY_CLEARANCE, count))
        least -= np.maximum(clear[row, at] - toes[row, at, 1], 0.0) * (1.0 - off)
    height = toes[..., 1]
    # A smooth maximum of the own and the least height.
    near = np.maximum(_SOFT_FLOOR - np.abs(height - least), 0.0)
    raised = np.maximum(height, least) + near**2 / (4.0 * _SOFT_FLOOR)
    return np.where(anchor, height, raised)


def heel_lift(lift: Float[ndarray, "leg frame"]) -> Float[ndarray, "leg frame"]:
    """The heel's lift for that of the toe, metres: earlier and smoother, as the heel leaves the ground and comes down
    first in a step. Zero at the keys."""
    frames = lift.shape[1]
    ahead = np.pad(lift, ((0, 0), (0, len(_HEEL_LEAD) - 1)))
    rise = np.sum([w * ahead[:, k : k + frames] for k, w in enumerate(_HEEL_LEAD)], axis=0)
    return rise * _table(_AFTER_KEY, np.arange(frames)) * (np.arange(frames) < frames - 1)


def _table(values: Float[ndarray, "step"], count: ndarray) -> ndarray:
    return values[np.minimum(count, len(values) - 1)]
