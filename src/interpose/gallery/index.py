"""An index of the windows: the results of a full scan after reading only a few thousand of them.

Windows are sorted by style, by bins of the length of v_p, by both facings in bins of a 32nd of a turn, and within such
a cell by steps. A mirrored window is an unmirrored one compared with the mirrored query.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int, UInt8, UInt16, UInt32
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery.tracks import Tracks
from interpose.gallery.windows import (
    LONGEST_WINDOW,
    NO_WINDOWS,
    SHORTEST_WINDOW,
    TURN,
    WINDOW_LENGTHS,
    FoundWindows,
    WindowQuery,
    errors,
    features,
    first_of,
    merged,
    select,
)

BIN_OFFSET, BIN_GROWTH = 0.5, 1.03
"""Bins of distance grow by 3 % of (the distance + 0.5 m)."""
DISTANCE_BINS = 192
SECTORS = 32
SECTOR = TURN // SECTORS
SECTOR_PAIRS = SECTORS * SECTORS
READ_BATCH = 4096
"""Windows read together, about."""
BUILD_BATCH = 4_000_000
"""Windows whose features are computed together when an index is built."""

Progress = Callable[[int, int], None]
"""Called with the windows done and their total."""


@dataclass(frozen=True, eq=False)
class Index:
    """Windows in sorted order: 13 bytes each, and a megabyte for the cells of each style.

    distance: metres. facing: at start and end, units of angle. cells: where each (style, bin, sector, sector) begins,
    and the end.
    """

    tracks: Tracks
    start: UInt32[ndarray, "window"]
    steps: UInt8[ndarray, "window"]
    distance: Float32[ndarray, "window"]
    facing: UInt16[ndarray, "window 2"]
    cells: UInt32[ndarray, "cell"]

    def __len__(self) -> int:
        """The number of windows stored, each of which is searched as recorded and mirrored."""
        return len(self.start)

    @property
    def nbytes(self) -> int:
        """Bytes of the index, without the tracks."""
        return sum(a.nbytes for a in (self.start, self.steps, self.distance, self.facing, self.cells))


def build(tracks: Tracks, progress: Progress = lambda done, total: None) -> Index:
    """The index of every window of 15 to 150 steps of every clip. Raises InputError where there is none, or too
    many."""
    lengths = np.diff(tracks.ranges, axis=1)[:, 0]
    counts = np.array([int(np.maximum(n - np.arange(SHORTEST_WINDOW, LONGEST_WINDOW + 1), 0).sum()) for n in lengths])
    total = int(counts.sum())
    if total == 0:
        raise InputError(f"no clip is longer than {SHORTEST_WINDOW} frames at 30 Hz; a gallery needs longer ones")
    if total >= 2**32 or len(tracks) >= 2**32:
        raise InputError(
            f"{total} windows are more than a gallery holds (2^32); split the clips over several galleries"
        )
    made = Index(
        tracks,
        np.empty(total, np.uint32),
        np.empty(total, np.uint8),
        np.empty(total, np.float32),
        np.empty((total, 2), np.uint16),
        np.zeros(len(tracks.styles) * DISTANCE_BINS * SECTOR_PAIRS + 1, np.uint32),
    )
    sizes = np.zeros((len(tracks.styles), DISTANCE_BINS * SECTOR_PAIRS), dtype=np.int64)
    at = 0
    for style in range(len(tracks.styles)):
        clips = np.nonzero(tracks.clip_styles == style)[0]
        keys = np.concatenate([np.zeros(0, np.uint64), *(_keys(tracks, clip) for clip in clips.tolist())])
        keys.sort()  # one integer sort orders the windows by cell, steps and start
        sizes[style] = np.bincount((keys >> np.uint64(40)).astype(np.int64), minlength=sizes.shape[1])
        for low in range(0, len(keys), BUILD_BATCH):
            part = keys[low : low + BUILD_BATCH]
            rows = slice(at, at + len(part))
            made.start[rows] = part & np.uint64(2**32 - 1)
            made.steps[rows] = (part >> np.uint64(32)) & np.uint64(255)
            start, steps = made.start[rows].astype(np.int64), made.steps[rows].astype(np.int64)
            made.distance[rows], made.facing[rows, 0], made.facing[rows, 1] = features(tracks.root, start, steps)
            at += len(part)
            progress(at, total)
    np.cumsum(sizes, out=made.cells[1:])
    return made


def _keys(tracks: Tracks, clip: int) -> ndarray:
    """For every window of a clip, its cell, steps and start frame as one number, most significant first."""
    begin, end = (int(x) for x in tracks.ranges[clip])
    steps = np.arange(SHORTEST_WINDOW, min(LONGEST_WINDOW, end - begin - 1) + 1)
    if not len(steps):
        return np.zeros(0, np.uint64)
    each = end - begin - steps
    length = np.repeat(steps, each)
    start = np.concatenate([np.arange(begin, begin + n) for n in each])
    distance, at_start, at_end = features(tracks.root, start, length)
    cell = (distance_bin(distance) * SECTORS + at_start // SECTOR) * SECTORS + at_end // SECTOR
    return (
        (cell.astype(np.uint64) << np.uint64(40))
        | (length.astype(np.uint64) << np.uint64(32))
        | start.astype(np.uint64)
    )


def distance_bin(distance: Float32[ndarray, "*batch"]) -> Int[ndarray, "*batch"]:
    """The bin of a distance in metres; monotonic."""
    wide = np.log1p(distance.astype(float) / BIN_OFFSET) / np.log(BIN_GROWTH)
    return np.minimum(wide.astype(np.int64), DISTANCE_BINS - 1)


def best(index: Index, wanted: WindowQuery, count: int) -> FoundWindows:
    """The ``count`` windows of the least error (equation 8), best first: the same as a full scan's.

    The least possible error of each pair of facing bins is known. Pairs are read in that order until the worst of the
    best so far beats every pair that is left, so nothing is missed.
    """
    limit, found = wanted.limit, NO_WINDOWS
    for floor, ranges in _in_order(index, wanted, count):
        if floor > limit:
            break
        found = first_of(merged([found, _read(index, wanted, *ranges.windows(), limit)]), count)
        if len(found) == count:
            limit = int(found.error[-1])
    return found


def sample(index: Index, wanted: WindowQuery, count: int, generator: np.random.Generator) -> FoundWindows:
    """``count`` windows drawn at random without replacement from all within the threshold, or all where there are
    fewer; in no order."""
    parts: list[FoundWindows] = []
    for _, ranges in _in_order(index, wanted, None):
        # Not every window that is read matches, so more are drawn until enough do or none is left.
        total, seen, draws = len(ranges), np.zeros(0, dtype=np.int64), count
        while len(seen) < total and sum(len(part) for part in parts) < count:
            chosen = np.arange(total) if total <= 4 * draws else generator.integers(0, total, size=draws)
            chosen = np.setdiff1d(chosen, seen)
            parts.append(_read(index, wanted, *ranges.windows(chosen), wanted.limit))
            seen, draws = np.union1d(seen, chosen), 4 * draws
    found = merged(parts)
    return found if len(found) <= count else select(found, generator.choice(len(found), count, replace=False))


@dataclass(frozen=True, eq=False)
class WindowRanges:
    """Ranges of windows: the first of each, how many it has, and whether they are mirrored (0 or 1)."""

    first: Int[ndarray, "range"]
    size: Int[ndarray, "range"]
    mirrored: Int[ndarray, "range"]

    def __len__(self) -> int:
        return int(self.size.sum())

    def windows(
        self, which: Int[ndarray, "chosen"] | None = None
    ) -> tuple[Int[ndarray, "chosen"], Int[ndarray, "chosen"]]:
        """The windows with those numbers, counted over all ranges, or all; and whether each is mirrored."""
        ends = np.cumsum(self.size)
        if which is None:
            at = np.repeat(np.arange(len(ends)), self.size)
            which = np.arange(len(at))
        else:
            at = np.searchsorted(ends, which, side="right")
        return (self.first - (ends - self.size))[at] + which, self.mirrored[at]


def _in_order(index: Index, wanted: WindowQuery, count: int | None) -> Iterator[tuple[int, WindowRanges]]:
    """Batches of ranges in the order of their least possible error, with that error.

    ``count``: windows wanted, from which the size of a batch follows; with None all within the threshold are one batch.
    """
    styles = np.arange(len(index.tracks.styles)) if wanted.styles is None else np.array(wanted.styles, dtype=np.int64)
    low, high = (int(b) for b in distance_bin(np.array(wanted.distance, dtype=np.float32)))
    if not len(styles) or wanted.distance[1] < wanted.distance[0]:
        return
    # Blocks (style, bin) of SECTOR_PAIRS cells each, and the number of windows in every cell.
    blocks = ((styles[:, None] * DISTANCE_BINS + np.arange(low, high + 1)) * SECTOR_PAIRS).reshape(-1)
    at = blocks[:, None] + np.arange(SECTOR_PAIRS + 1)
    begins = index.cells[at].astype(np.int64)
    sizes = np.diff(begins, axis=1)
    share = (min(wanted.steps[1], LONGEST_WINDOW) - max(wanted.steps[0], SHORTEST_WINDOW) + 1) / WINDOW_LENGTHS
    expected = sizes.sum(axis=0) * share
    # Cells are equal in error over styles and bins, so only the pairs of facing bins are ordered.
    floors = np.concatenate([_floors(wanted, mirrored) for mirrored in (0, 1)])
    order = np.argsort(floors, kind="stable")
    order = order[floors[order] <= wanted.limit]
    upto = np.cumsum(expected[order % SECTOR_PAIRS])
    done, batch = 0, len(order)
    while done < len(order):
        if count is not None:
            before = upto[done - 1] if done else 0.0
            batch = max(1, int(np.searchsorted(upto, before + max(2 * count, READ_BATCH) * (1 + done / 64))) - done)
        some = order[done : done + batch]
        mirrored, pairs = np.divmod(np.sort(some), SECTOR_PAIRS)
        first, size = begins[:, pairs].reshape(-1), sizes[:, pairs].reshape(-1)
        side = np.tile(mirrored, len(blocks))
        filled = np.argsort(side, kind="stable")  # recorded windows first
        filled = filled[size[filled] > 0]
        ranges = WindowRanges(first[filled], size[filled], side[filled])
        yield int(floors[some[0]]), _with_steps(index, ranges, wanted.steps)
        done += len(some)


def _floors(wanted: WindowQuery, mirrored: int) -> Int[ndarray, "pair"]:
    """The least possible error of a window in each pair of sectors, in units of angle."""
    at_start, at_end = wanted.units(mirrored)
    edges = np.arange(SECTORS) * SECTOR

    def from_sector(begin: ndarray, width: int, angle: int) -> ndarray:
        past = (angle - begin) % TURN  # the angle, counted from the sector's beginning
        return np.where(past < width, 0, np.minimum(past - width + 1, TURN - past))

    if wanted.criterion == "turn":
        turn = (edges[None, :] - edges[:, None] - SECTOR + 1) % TURN
        return from_sector(turn, 2 * SECTOR - 1, (at_end - at_start) % TURN).reshape(-1)
    first = from_sector(edges, SECTOR, at_start)
    last = from_sector(edges, SECTOR, at_end) if wanted.criterion == "both" else np.zeros_like(first)
    return (first[:, None] + last[None, :]).reshape(-1)


def _with_steps(index: Index, ranges: WindowRanges, steps: tuple[int, int]) -> WindowRanges:
    """The parts of the ranges whose windows have those steps, which ascend within each range."""
    if steps[0] <= SHORTEST_WINDOW and steps[1] >= LONGEST_WINDOW:
        return ranges
    begin, end = (_search(index.steps, ranges.first, ranges.size, limit) for limit in (steps[0], steps[1] + 1))
    some = end > begin
    return WindowRanges(begin[some], (end - begin)[some], ranges.mirrored[some])


def _search(values: ndarray, first: ndarray, size: ndarray, limit: int) -> ndarray:
    """For each sorted range of ``values``, the first index with a value of at least ``limit``: a binary search of all
    ranges at once."""
    low, high = first.copy(), first + size
    while True:
        open_ = low < high
        if not open_.any():
            return low
        middle = (low + high) // 2
        less = open_ & (values[np.minimum(middle, len(values) - 1)] < limit)
        low = np.where(less, middle + 1, low)
        high = np.where(open_ & ~less, middle, high)


def _read(
    index: Index, wanted: WindowQuery, rows: Int[ndarray, "window"], mirrored: Int[ndarray, "window"], limit: int
) -> FoundWindows:
    """Those of the windows that are wanted, with errors of at most ``limit``."""
    at_start, at_end = np.array([wanted.units(0), wanted.units(1)], dtype=np.uint16)[mirrored].T
    facing, distance = index.facing[rows], index.distance[rows]
    error = errors(facing[:, 0], facing[:, 1], (at_start, at_end), wanted.criterion)
    fits = (error <= limit) & (distance >= wanted.distance[0]) & (distance <= wanted.distance[1])
    rows = rows[fits]
    columns = index.start[rows], index.steps[rows], mirrored[fits], error[fits]
    return FoundWindows(*(column.astype(np.int64) for column in columns))
