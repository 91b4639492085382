"""The index: the same answers as the full scan of `scan`, from a few thousand windows in place of all of them.

Windows are sorted by style, by the length of v_p in bins of some 3 %, by both facings in bins of a 32nd of a turn, and
within such a cell by steps. A query reads the bins that its distances touch. For each pair of facing bins the least
error that a window in it can have is known beforehand; pairs are read in that order until the worst of the best found
so far beats every pair not yet read, so nothing is missed. A mirrored window is an unmirrored one held against the
mirrored query.

A window takes 13 bytes (start 4, steps 1, distance 4, facings 2 + 2), and the table of cells one megabyte a style.
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
    join,
    select,
)

NEAR = 0.5
"""Metres: bins of distance are 3 % of this wide at 0, and 3 % of the distance and this together beyond."""
GROWTH = 1.03
BINS = 192
SECTORS = 32
SECTOR = TURN // SECTORS
PAIRS = SECTORS * SECTORS
BATCH = 4096
"""Windows that are read at once, about."""
SPAN = 4_000_000
"""Windows whose features are worked out at once when an index is built."""

Progress = Callable[[int, int], None]
"""Called with windows done and windows in all."""


@dataclass(frozen=True, eq=False)
class Index:
    """Windows in the order of the module's text. cells: where each (style, bin, sector, sector) begins, and the end."""

    tracks: Tracks
    start: UInt32[ndarray, "window"]
    steps: UInt8[ndarray, "window"]
    distance: Float32[ndarray, "window"]
    facing: UInt16[ndarray, "window 2"]
    cells: UInt32[ndarray, "cell"]

    def __len__(self) -> int:
        """The number of windows stored; each serves as it lies and in the mirror."""
        return len(self.start)

    @property
    def nbytes(self) -> int:
        """Bytes of the index without the tracks."""
        return sum(a.nbytes for a in (self.start, self.steps, self.distance, self.facing, self.cells))


def build(tracks: Tracks, progress: Progress = lambda done, total: None) -> Index:
    """Sorts every window of 15 to 150 steps of every clip. Raises InputError where there is none, or too many."""
    lengths = np.diff(tracks.ranges, axis=1)[:, 0]
    counts = np.array([int(np.maximum(n - np.arange(SHORTEST_WINDOW, LONGEST_WINDOW + 1), 0).sum()) for n in lengths])
    total = int(counts.sum())
    if total == 0:
        raise InputError(f"no clip is longer than {SHORTEST_WINDOW} frames at 30 Hz; a gallery needs longer ones")
    if total >= 2**32 or len(tracks) >= 2**32:
        raise InputError(f"{total} windows are more than a gallery holds (2^32); build several of fewer clips")
    made = Index(
        tracks,
        np.empty(total, np.uint32),
        np.empty(total, np.uint8),
        np.empty(total, np.float32),
        np.empty((total, 2), np.uint16),
        np.zeros(len(tracks.styles) * BINS * PAIRS + 1, np.uint32),
    )
    sizes = np.zeros(len(made.cells) - 1, dtype=np.int64)
    at = 0
    for style in range(len(tracks.styles)):
        clips = np.nonzero(tracks.clip_styles == style)[0]
        keys = np.concatenate([np.zeros(0, np.uint64), *(_keys(tracks, clip) for clip in clips.tolist())])
        keys.sort()
        base = style * BINS * PAIRS
        sizes[base : base + BINS * PAIRS] = np.bincount(
            (keys >> np.uint64(40)).astype(np.int64), minlength=BINS * PAIRS
        )
        for low in range(0, len(keys), SPAN):
            part = keys[low : low + SPAN]
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
    """For every window of a clip: cell, steps and start frame in one number, most significant first."""
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
    """Which bin a distance is in; never falls as the distance grows."""
    wide = np.log1p(distance.astype(float) / NEAR) / np.log(GROWTH)
    return np.minimum(wide.astype(np.int64), BINS - 1)


def best(index: Index, wanted: WindowQuery, count: int) -> FoundWindows:
    """The ``count`` windows of the least error (equation 8), best first; the same as those of `scan.best`."""
    limit = wanted.limit
    found: list[FoundWindows] = []
    for floor, rows in _in_order(index, wanted, count):
        if floor > limit:
            break
        found = [first_of(join([*found, *_read(index, wanted, rows, limit)]), count)]
        if len(found[0]) == count:
            limit = int(found[0].error[-1])
    return found[0] if found else NO_WINDOWS


def sample(index: Index, wanted: WindowQuery, count: int, generator: np.random.Generator) -> FoundWindows:
    """Windows drawn at random, each once, of all within the threshold: ``count``, or all where there are fewer, in no
    order."""
    limit = wanted.limit
    reads = [
        (rows, mirrored) for floor, both in _in_order(index, wanted, None) if floor <= limit for rows, mirrored in both
    ]
    total = sum(len(rows) for rows, _ in reads)
    # Not all that is read fits: more is read until enough does, or all has been.
    parts: list[FoundWindows] = []
    seen, draws = np.zeros(0, dtype=np.int64), count
    while len(seen) < total and sum(len(part) for part in parts) < count:
        chosen = np.arange(total) if total <= 4 * draws else generator.integers(0, total, size=draws)
        chosen = np.setdiff1d(chosen, seen)
        parts += _read_some(index, wanted, reads, chosen, limit)
        seen, draws = np.union1d(seen, chosen), 4 * draws
    found = join(parts)
    return found if len(found) <= count else select(found, generator.choice(len(found), count, replace=False))


def _read_some(
    index: Index, wanted: WindowQuery, reads: list[tuple[WindowRanges, int]], chosen: Int[ndarray, "chosen"], limit: int
) -> Iterator[FoundWindows]:
    """As :func:`_read`, but of all windows of the ranges those ``chosen`` only, ascending."""
    ends = np.cumsum([len(rows) for rows, _ in reads])
    low = 0
    for (rows, mirrored), end, high in zip(reads, ends, np.searchsorted(chosen, ends), strict=True):
        picked = rows.take(chosen[low:high] - (end - len(rows)))
        yield from _read(index, wanted, [(WindowRanges(picked, np.ones(len(picked), np.int64)), mirrored)], limit)
        low = high


@dataclass(frozen=True, eq=False)
class WindowRanges:
    """Some ranges of windows: where each begins and how many there are."""

    first: Int[ndarray, "range"]
    size: Int[ndarray, "range"]

    def __len__(self) -> int:
        return int(self.size.sum())

    def all(self) -> Int[ndarray, "window"]:
        """Every window of them."""
        ends = np.cumsum(self.size)
        total = int(ends[-1]) if len(ends) else 0
        return np.arange(total) + np.repeat(self.first - (ends - self.size), self.size)

    def take(self, which: Int[ndarray, "chosen"]) -> Int[ndarray, "chosen"]:
        """The windows at those places, counted over all ranges."""
        ends = np.cumsum(self.size)
        in_range = np.searchsorted(ends, which, side="right")
        return self.first[in_range] + which - (ends - self.size)[in_range]


def _in_order(
    index: Index, wanted: WindowQuery, count: int | None
) -> Iterator[tuple[int, list[tuple[WindowRanges, int]]]]:
    """Batches of ranges by the least error that they can hold: (that error, [(ranges, mirrored)]).

    ``count``: how many windows are wanted, so that the first batch is likely enough; None gives all in one batch of
    those within the threshold.
    """
    styles = np.arange(len(index.tracks.styles)) if wanted.styles is None else np.array(wanted.styles, dtype=np.int64)
    low, high = (int(b) for b in distance_bin(np.array(wanted.distance, dtype=np.float32)))
    if not len(styles) or wanted.distance[1] < wanted.distance[0]:
        return
    # (style, bin) blocks of PAIRS cells each, and the windows in every cell.
    blocks = ((styles[:, None] * BINS + np.arange(low, high + 1)) * PAIRS).reshape(-1)
    at = blocks[:, None] + np.arange(PAIRS + 1)
    begins = index.cells[at].astype(np.int64)
    sizes = np.diff(begins, axis=1)
    share = (min(wanted.steps[1], LONGEST_WINDOW) - max(wanted.steps[0], SHORTEST_WINDOW) + 1) / WINDOW_LENGTHS
    expected = sizes.sum(axis=0) * share
    floors = np.concatenate([_floors(wanted, mirrored) for mirrored in (0, 1)])
    order = np.argsort(floors, kind="stable")
    order = order[floors[order] <= wanted.limit]
    upto = np.cumsum(expected[order % PAIRS])
    done, batch = 0, len(order)
    while done < len(order):
        if count is not None:
            before = upto[done - 1] if done else 0.0
            batch = max(1, int(np.searchsorted(upto, before + max(2 * count, BATCH) * (1 + done / 64))) - done)
        some = order[done : done + batch]
        made = []
        for mirrored in (0, 1):
            pairs = np.sort(some[some // PAIRS == mirrored] % PAIRS)
            first, size = begins[:, pairs].reshape(-1), sizes[:, pairs].reshape(-1)
            some_there = size > 0
            rows = _with_steps(index, first[some_there], size[some_there], wanted.steps)
            made.append((rows, mirrored))
        yield int(floors[some[0]]), made
        done += len(some)


def _floors(wanted: WindowQuery, mirrored: int) -> Int[ndarray, "pair"]:
    """The least error that a window in each pair of sectors can have."""
    at_start, at_end = wanted.units(mirrored)
    edges = np.arange(SECTORS) * SECTOR

    def from_sector(begin: ndarray, width: int, angle: int) -> ndarray:
        past = (angle - begin) % TURN  # how far the angle lies beyond the sector's beginning
        return np.where(past < width, 0, np.minimum(past - width + 1, TURN - past))

    if wanted.criterion == "turn":
        turn = (edges[None, :] - edges[:, None] - SECTOR + 1) % TURN
        return from_sector(turn, 2 * SECTOR - 1, (at_end - at_start) % TURN).reshape(-1)
    first = from_sector(edges, SECTOR, at_start)
    last = from_sector(edges, SECTOR, at_end) if wanted.criterion == "both" else np.zeros_like(first)
    return (first[:, None] + last[None, :]).reshape(-1)


def _with_steps(index: Index, first: ndarray, size: ndarray, steps: tuple[int, int]) -> WindowRanges:
    """The parts of the ranges whose windows have those steps; within a range the steps never fall."""
    if steps[0] <= SHORTEST_WINDOW and steps[1] >= LONGEST_WINDOW:
        return WindowRanges(first, size)
    begin = _search(index.steps, first, size, steps[0])
    end = _search(index.steps, first, size, steps[1] + 1)
    some = end > begin
    return WindowRanges(begin[some], (end - begin)[some])


def _search(values: ndarray, first: ndarray, size: ndarray, limit: int) -> ndarray:
    """For each sorted range of ``values``, the first place whose value is at least ``limit``; all ranges at once."""
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
    index: Index, wanted: WindowQuery, reads: list[tuple[WindowRanges, int]], limit: int
) -> Iterator[FoundWindows]:
    """The windows of the ranges that are as wanted, with errors of at most ``limit``."""
    for ranges, mirrored in reads:
        rows = ranges.all()
        there = index.facing[rows]
        error = errors(there[:, 0], there[:, 1], wanted.units(mirrored), wanted.criterion)
        distance = index.distance[rows]
        fits = (error <= limit) & (distance >= wanted.distance[0]) & (distance <= wanted.distance[1])
        rows, error = rows[fits], error[fits]
        side = np.full(len(rows), mirrored, dtype=np.int64)
        yield FoundWindows(
            index.start[rows].astype(np.int64), index.steps[rows].astype(np.int64), side, error.astype(np.int64)
        )
