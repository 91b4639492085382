"""How a foot goes from place to place: corrections that fade smoothly, and toes that clear the floor.

The corrections of a joint are the field c(frame) that moves it onto its places and is otherwise as smooth and as
short-lived as possible, the least sum of |second difference of c|^2 + (4 / decay^4) |c|^2: a beam on an elastic
foundation, which forgets a place within some `decay` frames. It is zero at both keys and one frame beyond them, so that
keys stay as they are and nothing jumps there.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.linalg import solveh_banded

from interpose.runtime.feet.footholds import floor
from interpose.runtime.feet.stances import FootSettings

_OFF = np.array([0.0, 0.6, 0.9, 1.0])
"""How much of the clearance a toe has so many frames from where it stands."""
_OFF_KEY = np.array([0.0, 0.04, 0.15, 0.31, 0.5, 0.69, 0.85, 0.96, 1.0])
"""The same from a key in which the foot does not rest."""
_LEAD = (0.1, 0.2, 0.4, 0.2, 0.1)
"""Shares of the toe's lift in this frame and the next ones in that of the heel."""
_AFTER_KEY = np.array([0.0, 0.25, 0.75, 1.0])
_SOFT = 0.01
"""Metres over which a toe's own height gives way to the least one."""


def smooth_field(
    values: Float[ndarray, "leg frame channel"], held: Bool[ndarray, "leg frame"], decay: float
) -> Float[ndarray, "leg frame channel"]:
    """For each leg the field that is ``values`` where ``held``, zero at the keys and beyond, else the smoothest that
    fades: the least sum of |second difference|^2 + 4 / decay^4 |field|^2, of all legs by one banded system."""
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
    # Rows of the upper bands of D'D: 6, -4, 1. A leg's two first and two last rows are fixed, so that legs do not meet.
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
    """The toes' heights, raised where they swing too low; unchanged where ``held`` and at the keys.

    A toe has the clearance within two frames of leaving its place, and on a long step that drags an arch above that.
    From a key in which it does not rest it rises more slowly.
    """
    legs, frames = held.shape
    anchor = held.copy()
    anchor[:, [0, -1]] = True
    number = np.broadcast_to(np.arange(frames), (legs, frames))
    before = np.maximum.accumulate(np.where(anchor, number, 0), axis=1)
    after = np.minimum.accumulate(np.where(anchor, number, frames - 1)[:, ::-1], axis=1)[:, ::-1]
    row = np.arange(legs)[:, None]
    way = np.linalg.norm((toes[row, after] - toes[row, before])[..., ::2], axis=-1)
    share = (number - before) / np.maximum(after - before, 1)
    highest = np.maximum.reduceat(toes[..., 1].reshape(-1), np.flatnonzero(anchor))[np.cumsum(anchor) - 1]
    drags = np.clip(2.0 - 2.0 * highest.reshape(legs, frames) / settings.clear, 0.0, 1.0)
    arch = drags * np.minimum(settings.arch * way, settings.arch_most) * np.sin(np.pi * share) ** 2
    clear = settings.clear + floor(toes[..., 1], 0.0)
    least = clear + arch
    rests = held.copy()
    rests[:, 0] &= held[:, 1]
    rests[:, -1] &= held[:, -2]
    for at, count in ((before, number - before), (after, after - number)):
        off = np.where(rests[row, at], _table(_OFF, count), _table(_OFF_KEY, count))
        least -= np.maximum(clear[row, at] - toes[row, at, 1], 0.0) * (1.0 - off)
    height = toes[..., 1]
    near = np.maximum(_SOFT - np.abs(height - least), 0.0)
    raised = np.maximum(height, least) + near**2 / (4.0 * _SOFT)
    return np.where(anchor, height, raised)


def led(lift: Float[ndarray, "leg frame"]) -> Float[ndarray, "leg frame"]:
    """What a heel rises for such a lift of the toe: earlier and more smoothly, so that it leaves the ground first and
    comes down first, as in a step. Zero at the keys."""
    frames = lift.shape[1]
    ahead = np.pad(lift, ((0, 0), (0, len(_LEAD) - 1)))
    rise = np.sum([w * ahead[:, k : k + frames] for k, w in enumerate(_LEAD)], axis=0)
    return rise * _table(_AFTER_KEY, np.arange(frames)) * (np.arange(frames) < frames - 1)


def _table(values: Float[ndarray, "step"], count: ndarray) -> ndarray:
    return values[np.minimum(count, len(values) - 1)]
