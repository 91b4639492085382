"""Where a foot stands: one place for the toe and one for the heel in each stance that `stances` found.

Frames whose place is too far away, out of the leg's reach, or too far from the next place or key are released.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose.runtime.feet.stances import FootSettings

FLOOR_RISE = 0.005
"""Metres a frame by which the floor rises from a key that is below it."""
_NEAR_KEY = 0.08
"""Metres from a key's place within which a stance next to the key takes that place."""


@dataclass(frozen=True, eq=False)
class Footing:
    """Where one foot stands. held, toe: whether the toe stands in each frame, and where, metres. flat, heel: the same
    for the ankle."""

    held: Bool[ndarray, "frame"]
    toe: Float[ndarray, "frame 3"]
    flat: Bool[ndarray, "frame"]
    heel: Float[ndarray, "frame 3"]


def footing(
    leg: Float[ndarray, "frame 4 3"],
    heel_down: Float[ndarray, "frame"],
    spans: list[slice],
    reach: float,
    settings: FootSettings,
) -> Footing:
    """The places of one foot in its stances.

    ``leg``: hip, knee, ankle and toe, metres. ``heel_down``: probability of the heel's contact. ``reach``: the longest
    distance from hip to toe. A stance that holds a key stands at the key's place; one that holds both keys moves from
    one to the other smoothly.
    """
    hip, ankle, toe = leg[:, 0], leg[:, 2], leg[:, 3]
    frames = len(toe)
    held, flat = np.zeros(frames, dtype=bool), np.zeros(frames, dtype=bool)
    places, heels = toe.copy(), ankle.copy()
    lowest = floor(toe[:, 1], settings.toe_heights[0])
    down = (heel_down > 0.5) & (ankle[:, 1] < settings.ankle_heights[1] + settings.above)
    for span in spans:
        place = _held_by_keys(toe, span)
        if place is None:
            place = _beside_key(toe, span, settings)[None]
            if place[0, 1] < settings.toe_heights[1] + settings.above:
                place[0, 1] = np.clip(place[0, 1], *settings.toe_heights)
        place = np.broadcast_to(place, toe[span].shape).copy()
        place[:, 1] = np.maximum(place[:, 1], lowest[span])
        near = np.linalg.norm(toe[span] - place, axis=-1) <= settings.stretch
        near &= np.linalg.norm(place - hip[span], axis=-1) <= reach
        kept = _kept(near, span, frames, settings.shortest)  # a stance with gaps would snap the leg back and forth
        held[span], places[span] = kept, np.where(kept[:, None], place, toe[span])
        # The heel comes down only where it stays long enough, and rises before the toe leaves.
        rises = 0 if span.stop == frames else settings.heel_first
        flats = np.flatnonzero((down[span] & kept)[: len(kept) - rises])
        if len(flats) >= settings.shortest:
            stays = slice(span.start + int(flats[0]), span.start + int(flats[-1]) + 1)
            direction = _held_by_keys(ankle - toe, stays)
            if direction is None:
                direction = (ankle - toe)[stays].mean(axis=0)[None]
            direction = direction / np.linalg.norm(direction, axis=-1, keepdims=True)
            length = np.linalg.norm(ankle[0] - toe[0])
            flat[stays] = held[stays]
            heels[stays] = places[stays] + direction * length
    return Footing(held, places, flat, heels)


def _held_by_keys(values: Float[ndarray, "frame 3"], span: slice) -> Float[ndarray, "_ 3"] | None:
    """The values of the keys that a span holds, one row or one a frame; None where it holds no key."""
    at_start, at_target = span.start == 0, span.stop == len(values)
    if at_start and at_target:
        share = np.linspace(0.0, 1.0, len(values))[:, None]
        return values[:1] + share**2 * (3.0 - 2.0 * share) * (values[-1:] - values[:1])
    if at_start:
        return values[:1]
    return values[-1:] if at_target else None


def _beside_key(toe: Float[ndarray, "frame 3"], span: slice, settings: FootSettings) -> Float[ndarray, "3"]:
    """The mean place of a stance that holds no key; the key's place where it begins or ends just beside that key."""
    mean = toe[span].mean(axis=0)
    for key, since in ((0, span.start), (-1, len(toe) - span.stop)):
        apart = np.linalg.norm((toe[key] - mean)[::2])
        if since <= settings.shortest_swing and toe[key, 1] < settings.key_low and apart < _NEAR_KEY:
            return np.array([toe[key, 0], mean[1], toe[key, 2]])
    return mean


def _kept(near: Bool[ndarray, "part"], span: slice, frames: int, shortest: int) -> Bool[ndarray, "part"]:
    """The unbroken run of frames next to each key that a stance holds; the longest run where it holds none."""
    if near.all():
        return near
    kept = np.zeros_like(near)
    if span.start == 0:
        kept[: int(np.argmin(near))] = True
    if span.stop == frames:
        kept[len(near) - int(np.argmin(near[::-1])) :] = True
    if span.start > 0 and span.stop < frames:
        longest = max(spans(near), key=lambda s: s.stop - s.start, default=slice(0, 0))
        kept[longest] = longest.stop - longest.start >= shortest
    return kept


def floor(heights: Float[ndarray, "*leg frame"], level: float) -> Float[ndarray, "*leg frame"]:
    """The lowest allowed height in each frame: ``level``, lowered around a key that is below it."""
    away = np.arange(heights.shape[-1]) * FLOOR_RISE
    return np.minimum(level, np.minimum(heights[..., :1] + away, heights[..., -1:] + away[::-1]))


def eased(
    wanted: Float[ndarray, "frame 3"], held: Bool[ndarray, "frame"], settings: FootSettings
) -> Bool[ndarray, "frame"]:
    """``held`` without the frames that leave too little time to change from one correction, or a key, to the next."""
    last = len(held) - 1
    kept = held.copy()
    kept[[0, last]] = True  # the keys are anchors: their correction is zero
    correction = np.where(held[:, None], wanted, 0.0)
    correction[[0, last]] = 0.0
    length = np.linalg.norm(correction, axis=-1)
    while True:
        count = np.count_nonzero(kept)
        for key, beside in ((0, 1), (last, last - 1)):
            kept[beside] &= held[key] or length[beside] <= settings.pace
        for breach in spans(~kept):
            left, right = breach.start - 1, breach.stop
            apart = np.linalg.norm(correction[right] - correction[left])
            if apart > settings.pace * (right - left):  # release the frame with the larger correction, never a key
                kept[left if right == last or (left > 0 and length[left] > length[right]) else right] = False
        if np.count_nonzero(kept) == count:
            return kept & held


def spans(mask: Bool[ndarray, "frame"]) -> list[slice]:
    """The runs of frames in which the mask is true, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
