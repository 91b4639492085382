"""The frames of a database for training, and those held out: the end of every long clip."""

from __future__ import annotations

from interpose.data.database import Database

Ranges = list[tuple[int, int]]


def training_ranges(data: Database, held_out: float = 0.06, least: int = 130) -> tuple[Ranges, Ranges]:
    """Frame ranges [start, stop) for training, and those held out. A clip of one frame is in neither; where no clip is
    long enough, the first is in both.

    held_out: share of a clip to hold out, but at least ``least`` frames; only clips eight times as long are cut.
    """
    training, kept_back = [], []
    for start, stop in data.ranges.tolist():
        if stop - start < 2:
            continue
        tail = max(least, round(held_out * (stop - start)))
        cut = stop - tail if stop - start >= 8 * least else stop
        training.append((start, cut))
        if cut < stop:
            kept_back.append((cut, stop))
    return training, kept_back or training[:1]
