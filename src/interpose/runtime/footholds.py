"""When and where a foot joint stands: contact probabilities into runs of frames, and a place on the ground for each.

Places are chosen so that what is asked of the legs stays possible: frames that would need too long a way to a place are
let go, and so are those that would leave no time to come from one place to the next, or to a key.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.ndimage import median_filter


@dataclass(frozen=True)
class Settings:
    """Frames are of 30 Hz, lengths metres.

    on, off: the probabilities at which a contact begins and ends. shortest: frames that a contact lasts at least.
    decay: frames over which a correction fades. stretch: the longest correction; a place farther away is let go.
    pace: metres a frame by which a correction may change between two places; frames are let go to leave the time.
    step: how far apart both keys' places of one foot must be for it to have stepped between them.
    toe_heights, ankle_heights: from the lowest that a joint may be to the highest that one on the floor stands. A
    lower key lowers the floor around it. above: metres over those heights up to which a planted joint is brought
    down to the floor; one still higher stands on something and keeps its height.
    """

    on: float = 0.6
    off: float = 0.4
    shortest: int = 3
    decay: float = 8.0
    stretch: float = 0.25
    pace: float = 0.03
    step: float = 0.03
    toe_heights: tuple[float, float] = (0.0, 0.02)
    ankle_heights: tuple[float, float] = (0.06, 0.09)
    above: float = 0.06


DEFAULT = Settings()

_KEY_REACH = 0.1
"""Metres within which the neighbour of a key must stand to stand where the key does."""


def runs(
    probability: Float[ndarray, "frame"],
    positions: Float[ndarray, "frame 3"],
    heights: tuple[float, float],
    settings: Settings,
) -> list[slice]:
    """Frames of each contact: median of three, hysteresis, short breaks closed, short contacts dropped.

    A contact of a key's neighbour takes the key in where the joint stands there too: not far off, and not in the air.
    """
    inner = median_filter(probability[1:-1], size=3, mode="nearest")
    spans = [s for s in _spans(inner > settings.off) if inner[s].max() > settings.on]
    merged: list[slice] = []
    for span in spans:
        if merged and span.start - merged[-1].stop < settings.shortest:
            merged[-1] = slice(merged[-1].start, span.stop)
        else:
            merged.append(span)
    last = len(probability) - 1

    def stands(key: int, beside: int) -> bool:
        raised = positions[key, 1] - max(positions[beside, 1], heights[1])
        return bool(np.linalg.norm(positions[key] - positions[beside]) < _KEY_REACH and raised < settings.step)

    runs = []
    for span in merged:
        start, stop = span.start + 1, span.stop + 1
        start = 0 if start == 1 and stands(0, 1) else start
        stop = last + 1 if stop == last and stands(last, last - 1) else stop
        if stop - start >= settings.shortest:
            runs.append(slice(start, stop))
    return runs


def places(
    positions: Float[ndarray, "frame 3"], runs: list[slice], heights: tuple[float, float], settings: Settings
) -> list[tuple[slice, Float[ndarray, "3"]]]:
    """The place of each contact, and the frames left of it where the whole would need too long a way.

    A contact that holds a key stands where the key stands. One that holds both, in different places, is two with a step
    between them.
    """
    last = len(positions) - 1
    found: list[tuple[slice, Float[ndarray, "3"]]] = []
    for run in runs:
        at_start, at_target = run.start == 0, run.stop == last + 1
        if at_start and at_target and np.linalg.norm(positions[-1] - positions[0]) > settings.step:
            found.extend(_step(positions, settings))
        elif at_start or at_target:
            found.extend(_near(positions, run, positions[0] if at_start else positions[-1], settings))
        else:
            found.extend(_free(positions, run, heights, settings))
    return [(run, where) for run, where in found if run.stop - run.start >= settings.shortest]


def _near(
    positions: Float[ndarray, "frame 3"], run: slice, where: Float[ndarray, "3"], settings: Settings
) -> list[tuple[slice, Float[ndarray, "3"]]]:
    """The unbroken frames next to the key at ``where`` that it can hold."""
    within = np.linalg.norm(positions[run] - where, axis=-1) <= settings.stretch
    if run.start == 0:
        return [(slice(0, run.stop if within.all() else int(np.argmin(within))), where)]
    return [(slice(run.start if within.all() else run.stop - int(np.argmin(within[::-1])), run.stop), where)]


def _free(
    positions: Float[ndarray, "frame 3"], run: slice, heights: tuple[float, float], settings: Settings
) -> list[tuple[slice, Float[ndarray, "3"]]]:
    """The mean place, on the floor if it is near; a contact that wanders farther than may be is cut at its ends."""
    start, stop = run.start, run.stop
    while stop - start >= settings.shortest:
        where = positions[start:stop].mean(axis=0)
        if where[1] < heights[1] + settings.above:
            where[1] = np.clip(where[1], *heights)
        way = np.linalg.norm(positions[start:stop] - where, axis=-1)
        if way.max() <= settings.stretch:
            return [(slice(start, stop), where)]
        start, stop = (start + 1, stop) if way[0] >= way[-1] else (start, stop - 1)
    return []


def _step(positions: Float[ndarray, "frame 3"], settings: Settings) -> list[tuple[slice, Float[ndarray, "3"]]]:
    """Two contacts, at the start's place and at the target's, with time between them for a step."""
    frames = len(positions)
    apart = float(np.linalg.norm(positions[-1] - positions[0]))
    from_start, to_target = (np.linalg.norm(positions - key, axis=-1) for key in (positions[0], positions[-1]))
    turn = int(np.clip(np.count_nonzero(from_start < to_target), 1, frames - 1))
    pause = int(np.clip(round(40.0 * apart), 4, max(4, frames // 2)))
    first, second = slice(0, max(1, turn - pause // 2)), slice(min(frames - 1, turn + pause - pause // 2), frames)
    return [*_near(positions, first, positions[0], settings), *_near(positions, second, positions[-1], settings)]


def eased(
    wanted: Float[ndarray, "frame 3"], held: Bool[ndarray, "frame"], settings: Settings
) -> Bool[ndarray, "frame"]:
    """``held`` without those frames that leave too little time to come from one correction, or a key, to the next."""
    last = len(held) - 1
    kept = held.copy()
    kept[[0, last]] = True  # the keys are anchors: their correction is zero
    way = np.where(held[:, None], wanted, 0.0)
    way[[0, last]] = 0.0
    length = np.linalg.norm(way, axis=-1)
    while True:
        count = np.count_nonzero(kept)
        for key, beside in ((0, 1), (last, last - 1)):
            kept[beside] &= held[key] or length[beside] <= settings.pace
        for breach in _spans(~kept):
            left, right = breach.start - 1, breach.stop
            apart = np.linalg.norm(way[right] - way[left])
            if apart > settings.pace * (right - left):
                kept[left if right == last or (left > 0 and length[left] > length[right]) else right] = False
        if np.count_nonzero(kept) == count:
            return kept & held


def _spans(mask: Bool[ndarray, "frame"]) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def overlap(a: slice, b: slice) -> slice | None:
    """The frames that both have, or None."""
    start, stop = max(a.start, b.start), min(a.stop, b.stop)
    return slice(start, stop) if start < stop else None
