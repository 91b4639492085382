"""The index against the full scan: the same windows in the same order, whatever is asked."""

from unittest import mock

import numpy as np
import pytest
from gallery import full_scan
from gallery.walks import angles, drawn, even, several_clips, tracks_of
from hypothesis import given, settings
from hypothesis import strategies as st

from interpose.errors import InputError
from interpose.gallery import index as indexing
from interpose.gallery.index import DISTANCE_BINS, SECTOR, SECTOR_PAIRS, SECTORS, build, distance_bin
from interpose.gallery.windows import (
    LONGEST_WINDOW,
    SHORTEST_WINDOW,
    TURN,
    FoundWindows,
    WindowQuery,
    errors,
    features,
    to_units,
)

EVERYTHING = WindowQuery((0.0, 1000.0), (0.0, 0.0))
lengths = st.one_of(st.sampled_from([0.0, 0.02, 0.6, 1.2, 200.0]), st.floats(0.0, 3.0))
thresholds = st.one_of(st.sampled_from([2.0 * np.pi, np.pi, 0.7, 1e-4, 0.0]), st.floats(-0.1, 7.0))
counts = st.sampled_from([1, 2, 3, 10, 100, 5000, 10**6])


def rows(found: FoundWindows) -> list[tuple[int, ...]]:
    return list(zip(*(getattr(found, name).tolist() for name in ("start", "steps", "mirrored", "error")), strict=True))


def assert_same(a: FoundWindows, b: FoundWindows):
    for name in ("start", "steps", "mirrored", "error"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


@st.composite
def wants(draw, tracks):
    """What is wanted: often a window of the gallery itself, in any way asked of."""
    low, high = sorted((draw(lengths), draw(lengths)))
    facing = draw(angles), draw(angles)
    if draw(st.booleans()):
        clip = tracks.ranges[np.argmax(np.diff(tracks.ranges, axis=1))]
        steps = draw(st.integers(SHORTEST_WINDOW, min(LONGEST_WINDOW, int(clip[1] - clip[0]) - 1)))
        start = draw(st.integers(int(clip[0]), int(clip[1]) - steps - 1))
        distance, at_start, at_end = features(tracks.root, np.array([start]), steps)
        slack = draw(st.sampled_from([0.3, 0.02, 0.0]))
        low, high = max(0.0, float(distance[0]) - slack), float(distance[0]) + slack
        sign = draw(st.sampled_from([-1.0, 1.0]))
        facing = tuple(sign * float(at[0]) / TURN * 2.0 * np.pi for at in (at_start, at_end))
    styles = draw(st.none() | st.sets(st.integers(0, len(tracks.styles) - 1), min_size=1).map(tuple))
    fewest, most = sorted((draw(st.integers(1, 40)), draw(st.integers(15, 200))))
    criterion = draw(st.sampled_from(["both", "start", "turn"]))
    return WindowQuery((low, high), facing, criterion, (fewest, most), styles, draw(thresholds))


@given(st.data(), several_clips, counts, st.sampled_from([1, 32, indexing.READ_BATCH]))
def test_the_index_finds_what_the_scan_finds(data, clips, count, batch):
    tracks = drawn(clips)
    wanted = data.draw(wants(tracks))
    with mock.patch.object(indexing, "READ_BATCH", batch):
        assert_same(indexing.best(build(tracks), wanted, count), full_scan.best(tracks, wanted, count))


@pytest.mark.parametrize("name", ["wandering", "marching"])
@settings(max_examples=30)
@given(data=st.data(), count=counts, batch=st.sampled_from([8, 512, indexing.READ_BATCH]))
def test_the_index_finds_what_the_scan_finds_among_many(name, request, data, count, batch):
    gallery = request.getfixturevalue(name)
    wanted = data.draw(wants(gallery.tracks))
    with mock.patch.object(indexing, "READ_BATCH", batch):
        assert_same(indexing.best(gallery.index, wanted, count), full_scan.best(gallery.tracks, wanted, count))


def test_of_thousands_of_equal_errors_the_first_are_taken(marching):
    wanted = WindowQuery((0.5, 4.0), (0.0, 0.0))
    for count in (1, 7, 3000):
        found = indexing.best(marching.index, wanted, count)
        assert_same(found, full_scan.best(marching.tracks, wanted, count))
        assert len(found) == count
        assert not found.error.any()
        assert not found.mirrored.any()
    assert rows(found) == sorted(rows(found))


@pytest.mark.parametrize("count", [1, 40, 3000])
def test_equal_errors_are_found_though_they_are_read_later(count):
    tracks = tracks_of([even(60, facing=facing) for facing in (3.0, 0.1, 1.5, -1.5)])
    wanted = WindowQuery((0.6, 1.2), (0.4, 0.4), "turn")
    with mock.patch.object(indexing, "READ_BATCH", 1):
        found = indexing.best(build(tracks), wanted, count)
    assert_same(found, full_scan.best(tracks, wanted, count))
    assert found.start[0] == found.error.max() == 0


def test_all_that_fit_are_given_where_more_are_asked_for(wandering):
    wanted = WindowQuery((1.0, 1.1), (0.3, -0.2), threshold=1.0)
    found = indexing.best(wandering.index, wanted, 10**6)
    assert rows(found) == rows(full_scan.best(wandering.tracks, wanted, 10**6))
    assert 100 < len(found) < 10**6
    assert (np.diff(found.error) >= 0).all()
    assert found.error.max() <= 1.0 / (2.0 * np.pi) * TURN


@pytest.mark.parametrize(
    "wanted",
    [
        WindowQuery((900.0, 1000.0), (0.0, 0.0)),
        WindowQuery((2.0, 1.0), (0.0, 0.0)),
        WindowQuery((0.0, 10.0), (0.0, 0.0), steps=(60, 59)),
        WindowQuery((0.0, 10.0), (0.0, 0.0), steps=(1, 14)),
        WindowQuery((0.0, 10.0), (0.0, 0.0), steps=(151, 300)),
        WindowQuery((0.0, 10.0), (0.0, 0.0), styles=()),
        WindowQuery((0.0, 10.0), (0.0, 0.0), threshold=-0.1),
        WindowQuery((0.0, 0.0), (np.pi, 0.0), threshold=0.0),
    ],
)
def test_where_nothing_fits_nothing_is_found(marching, wanted):
    assert len(indexing.best(marching.index, wanted, 5)) == 0
    assert len(full_scan.best(marching.tracks, wanted, 5)) == 0
    assert len(indexing.sample(marching.index, wanted, 5, np.random.default_rng(0))) == 0


def test_few_windows_are_read_for_the_best(wandering):
    read = []

    def counted(at_start, *others):
        read.append(len(at_start))
        return errors(at_start, *others)

    with mock.patch.object(indexing, "errors", counted):
        assert len(indexing.best(wandering.index, WindowQuery((0.0, 10.0), (0.2, -0.4)), 8)) == 8
    assert sum(read) < len(wandering.index) / 5


@given(st.lists(st.floats(0.0, 1e6, width=32), min_size=2, max_size=50))
def test_the_bins_of_distance_rise_with_it(distances):
    bins = distance_bin(np.sort(np.array(distances, np.float32)))
    assert (np.diff(bins) >= 0).all()
    assert 0 <= bins[0] <= bins[-1] < DISTANCE_BINS


@given(angles, angles, st.sampled_from(["both", "start", "turn"]), st.sampled_from([0, 1]))
def test_pairs_of_sectors_are_read_by_the_least_error_that_they_can_hold(first, last, criterion, mirrored):
    floors = indexing._floors(WindowQuery((0.0, 1.0), (first, last), criterion), mirrored).reshape(SECTORS, SECTORS)
    ours = [to_units(-angle if mirrored else angle) for angle in (first, last)]
    least = np.abs((np.arange(TURN) - np.array(ours)[:, None] + TURN // 2) % TURN - TURN // 2)
    least = least.reshape(2, SECTORS, SECTOR).min(axis=-1)
    if criterion == "turn":  # a difference of two sectors is two sectors wide, but for one unit
        ends = SECTOR * (np.arange(SECTORS) - np.arange(SECTORS)[:, None])[..., None] + np.arange(1 - SECTOR, SECTOR)
        told = np.abs((ends - (ours[1] - ours[0]) + TURN // 2) % TURN - TURN // 2).min(axis=-1)
    else:
        told = least[0][:, None] + (least[1] if criterion == "both" else np.zeros(SECTORS, int))
    np.testing.assert_array_equal(floors, told)


# How it is built.


@given(several_clips)
def test_every_window_of_every_clip_is_kept_once_and_none_across_clips(clips):
    tracks = drawn(clips)
    index = build(tracks)
    told = [
        (start, steps)
        for begin, end in tracks.ranges.tolist()
        for steps in range(SHORTEST_WINDOW, LONGEST_WINDOW + 1)
        for start in range(begin, end - steps)
    ]
    assert len(index) == len(told)
    assert sorted(zip(index.start.tolist(), index.steps.tolist(), strict=True)) == sorted(told)
    distance, at_start, at_end = features(tracks.root, index.start.astype(np.int64), index.steps.astype(np.int64))
    np.testing.assert_array_equal(index.distance, distance)
    np.testing.assert_array_equal(index.facing, np.stack([at_start, at_end], axis=-1))


def test_windows_lie_in_the_cells_of_their_style_distance_and_facings_by_steps(wandering):
    index, tracks = wandering.index, wandering.tracks
    clip = np.searchsorted(tracks.ranges[:, 0], index.start, side="right") - 1
    at_start, at_end = (index.facing // SECTOR).T.astype(np.int64)
    block = tracks.clip_styles[clip] * DISTANCE_BINS + distance_bin(index.distance)
    cell = (block * SECTORS + at_start) * SECTORS + at_end
    held = np.repeat(np.arange(len(index.cells) - 1), np.diff(index.cells.astype(np.int64)))
    np.testing.assert_array_equal(held, cell)
    assert len(index.cells) == len(tracks.styles) * DISTANCE_BINS * SECTOR_PAIRS + 1
    within = np.diff(cell) == 0
    assert (np.diff(index.steps.astype(int))[within] >= 0).all()


def test_a_gallery_built_in_many_parts_is_the_same(wandering):
    with mock.patch.object(indexing, "BUILD_BATCH", 1000):
        index = build(wandering.tracks)
    for name in ("start", "steps", "distance", "facing", "cells"):
        np.testing.assert_array_equal(getattr(index, name), getattr(wandering.index, name))


def test_clips_of_less_than_16_frames_have_no_window():
    long, short = even(16), even(15)
    index = build(tracks_of([short, long, short]))
    assert (index.start.tolist(), index.steps.tolist()) == ([15], [15])
    for clips in ([short], [short, even(1), even(2)]):
        with pytest.raises(InputError, match="no clip is longer than 15 frames"):
            build(tracks_of(clips))


def test_a_style_whose_clips_are_too_short_has_no_window():
    tracks = tracks_of([even(10), even(20)], ["Old", "Young"])
    index = build(tracks)
    assert len(indexing.best(index, WindowQuery((0.0, 9.0), (0.0, 0.0), styles=(0,)), 9)) == 0
    assert len(indexing.best(index, WindowQuery((0.0, 9.0), (0.0, 0.0), styles=(1,)), 99)) == 30


def test_a_window_takes_13_bytes_beside_the_table_of_cells(wandering):
    index = wandering.index
    assert index.nbytes == 13 * len(index) + 4 * len(index.cells)
    assert index.nbytes - index.cells.nbytes <= 24 * len(index)
    # The table is as large for any gallery: at 4 hours of one style it is well within 24 bytes a window.
    hours = 4 * 3600 * 30 * (LONGEST_WINDOW - SHORTEST_WINDOW)
    assert 13 + 4 * (DISTANCE_BINS * SECTOR_PAIRS + 1) / hours < 24


def test_progress_is_told_until_all_is_done(wandering):
    told = []
    with mock.patch.object(indexing, "BUILD_BATCH", 20000):
        build(wandering.tracks, lambda done, total: told.append((done, total)))
    assert told[-1] == (len(wandering.index), len(wandering.index))
    assert [done for done, _ in told] == sorted({done for done, _ in told})
    assert len(told) > 3


# Drawn at random.


def fitting(gallery, wanted):
    return set(rows(full_scan.best(gallery.tracks, wanted, 10**6)))


@given(st.data(), several_clips, st.sampled_from([1, 10, 500, 10**6]), st.integers(0, 9))
def test_what_is_drawn_fits_and_is_drawn_once_and_all_is_where_no_more_is_there(data, clips, count, seed):
    tracks = drawn(clips)
    wanted = data.draw(wants(tracks))
    told = set(rows(full_scan.best(tracks, wanted, 10**6)))
    found = rows(indexing.sample(build(tracks), wanted, count, np.random.default_rng(seed)))
    assert len(set(found)) == len(found) == min(count, len(told))
    assert set(found) <= told


@pytest.mark.parametrize("count", [3, 400, 1500, 10**6])
def test_as_many_as_asked_for_are_drawn_where_there_are_so_many(wandering, count):
    wanted = WindowQuery((1.0, 1.12), (0.3, -0.2), threshold=0.7)
    told = fitting(wandering, wanted)
    assert 400 < len(told) < 1500
    found = rows(indexing.sample(wandering.index, wanted, count, np.random.default_rng(1)))
    assert set(found) <= told
    assert len(set(found)) == len(found) == min(count, len(told))


def test_equal_generators_draw_the_same_and_others_not(wandering):
    wanted = WindowQuery((1.0, 1.5), (0.3, -0.2), threshold=1.0)
    a, b, c = (indexing.sample(wandering.index, wanted, 50, np.random.default_rng(seed)) for seed in (4, 4, 5))
    assert_same(a, b)
    assert set(rows(a)) != set(rows(c))


def test_every_window_that_fits_is_as_likely_to_be_drawn(wandering):
    wanted = WindowQuery((1.0, 1.12), (0.3, -0.2), threshold=0.7)
    told = sorted(fitting(wandering, wanted), key=lambda row: (row[2], row[3], row[0]))
    group = {row: i * 20 // len(told) for i, row in enumerate(told)}
    size = np.bincount(list(group.values()))
    generator = np.random.default_rng(7)
    draws = [rows(indexing.sample(wandering.index, wanted, 50, generator)) for _ in range(60)]
    assert all(len(set(draw)) == len(draw) == 50 for draw in draws)
    found = [row for draw in draws for row in draw]
    expected = len(found) * size / len(told)
    statistic = (np.square(np.bincount([group[row] for row in found]) - expected) / expected).sum()
    assert statistic < 40.0  # 19 degrees of freedom: passed by 997 of 1000 fair draws
    assert len(set(found)) > 0.8 * len(told)


def test_windows_are_drawn_as_they_lie_and_in_the_mirror(marching):
    found = indexing.sample(marching.index, EVERYTHING, 2000, np.random.default_rng(0))
    assert 0.4 < found.mirrored.mean() < 0.6
    assert len(indexing.sample(marching.index, EVERYTHING, 0, np.random.default_rng(0))) == 0
