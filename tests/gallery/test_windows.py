"""Windows as numbers: equation 7, the mirror, angles that wrap around, and the order of what is found."""

import numpy as np
import pytest
from gallery.walks import angles, even, motion_along, moved, tracks_of, wander
from hypothesis import given
from hypothesis import strategies as st

from interpose.gallery.tracks import from_motions
from interpose.gallery.windows import (
    LONGEST_WINDOW,
    NO_WINDOWS,
    SHORTEST_WINDOW,
    TURN,
    FoundWindows,
    apart,
    errors,
    features,
    first_of,
    merged,
    select,
    to_units,
)
from interpose.motion import mirror

CRITERIA = ("both", "start", "turn")
UNIT = 2.0 * np.pi / TURN


def some_windows(frames, seed=0, count=400):
    rng = np.random.default_rng(seed)
    steps = rng.integers(SHORTEST_WINDOW, min(LONGEST_WINDOW, frames - 1) + 1, count)
    return (rng.random(count) * (frames - steps)).astype(np.int64), steps


def angle_between(a, b):
    """The angle between complex numbers, 0 to pi."""
    return np.abs(np.angle(a * np.conj(b)))


def equation_7(track, start, steps, facing, criterion):
    """By complex numbers, each facing seen along the way from end to end; radians."""
    a, b = track[start], track[start + steps]
    way = (b[:, 1] - a[:, 1]) + 1j * (b[:, 0] - a[:, 0])
    at_start, at_end = np.exp(1j * a[:, 2]) / way, np.exp(1j * b[:, 2]) / way
    ours = np.exp(1j * facing[0]), np.exp(1j * facing[1])
    if criterion == "turn":
        return angle_between(at_end / at_start, ours[1] / ours[0])
    return angle_between(at_start, ours[0]) + (angle_between(at_end, ours[1]) if criterion == "both" else 0.0)


@given(st.integers(0, 50), angles, angles, st.sampled_from(CRITERIA))
def test_errors_are_those_of_equation_7(seed, first, last, criterion):
    root = wander(300, seed).astype(np.float32)
    start, steps = some_windows(300, seed)
    distance, at_start, at_end = features(root, start, steps)
    track = root.astype(float)
    np.testing.assert_allclose(
        distance, np.linalg.norm(track[start + steps, :2] - track[start, :2], axis=-1), rtol=1e-6, atol=1e-7
    )
    clear = distance > 1e-3
    found = errors(at_start, at_end, (to_units(first), to_units(last)), criterion)
    told = equation_7(track, start, steps, (first, last), criterion)
    assert np.abs(found * UNIT - told)[clear].max() <= 2.001 * UNIT


@given(st.integers(0, 50), angles, angles, st.sampled_from(CRITERIA))
def test_a_mirrored_window_is_a_window_of_the_mirrored_motion(seed, first, last, criterion):
    motion = motion_along(wander(60, seed))
    there, seen = (from_motions([m], ["walk"]).root for m in (motion, mirror(motion)))
    start, steps = some_windows(60, seed, 100)
    against_mirrored = to_units(-first), to_units(-last)
    a = errors(*features(there, start, steps)[1:], against_mirrored, criterion)
    b = errors(*features(seen, start, steps)[1:], (to_units(first), to_units(last)), criterion)
    clear = features(there, start, steps)[0] > 0.01
    np.testing.assert_allclose(a[clear], b[clear], atol=2)


@given(st.integers(0, 50), angles, st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_features_are_the_same_wherever_the_clip_lies(seed, angle, x, z):
    track = wander(300, seed)
    start, steps = some_windows(300, seed)
    here = features(track.astype(np.float32), start, steps)
    there = features(moved(track, angle, x, z).astype(np.float32), start, steps)
    np.testing.assert_allclose(there[0], here[0], atol=2e-5)
    clear = here[0] > 0.5
    for a, b in zip(here[1:], there[1:], strict=True):
        assert (apart(a - b, 0)[clear] <= 2).all()


def test_a_window_without_a_way_has_a_length_of_0_and_its_yaws():
    track = even(40, pace=0.0, facing=0.5)
    track[:, 2] += 0.1 * np.arange(40)
    distance, at_start, at_end = features(track.astype(np.float32), np.array([2]), 20)
    assert (distance[0], at_start[0], at_end[0]) == (0.0, to_units(0.7), to_units(2.7))


def test_one_number_of_steps_serves_all_windows():
    root = tracks_of([wander(80, 4)]).root
    start = np.arange(50)
    for one, each in zip(features(root, start, 20), features(root, start, np.full(50, 20)), strict=True):
        np.testing.assert_array_equal(one, each)


@pytest.mark.parametrize(
    ("angle", "units"),
    [
        (0.0, 0),
        (np.pi, TURN // 2),
        (-np.pi, TURN // 2),
        (-1e-9, 0),
        (2.0 * np.pi - 1e-9, 0),
        (-UNIT, TURN - 1),
        (7.0 * np.pi, TURN // 2),
        (np.pi / 2.0 - 4.0 * np.pi, TURN // 4),
    ],
)
def test_angles_are_counted_in_units_of_a_turn_without_whole_turns(angle, units):
    assert to_units(angle) == units


@pytest.mark.parametrize(
    ("a", "b", "between"),
    [(0, 0, 0), (0, TURN - 1, 1), (TURN - 1, 0, 1), (0, TURN // 2, TURN // 2), (TURN // 2 + 1, 0, TURN // 2 - 1),
     (3, TURN // 2 + 3, TURN // 2), (3, TURN // 2 + 4, TURN // 2 - 1), (60000, 5000, TURN - 55000)],
)  # fmt: skip
def test_the_smaller_angle_between_two_directions_wraps_around(a, b, between):
    assert apart(np.array([a], np.uint16), b).tolist() == [between]
    assert apart(np.array([b], np.uint16), a).tolist() == [between]


def test_the_largest_error_of_both_facings_is_a_whole_turn():
    half = np.array([TURN // 2], np.uint16)
    assert errors(half, half, (0, 0), "both").tolist() == [TURN]
    assert errors(half, half, (0, 0), "start").tolist() == [TURN // 2]
    assert errors(half, half, (0, 0), "turn").tolist() == [0]
    assert errors(half, half, (5, 2), "turn").tolist() == [3]


found = st.integers(0, 60).flatmap(
    lambda n: st.tuples(*(st.lists(st.integers(0, most), min_size=n, max_size=n) for most in (9, 9, 1, 3)))
)


@given(found, st.integers(1, 80))
def test_the_best_come_by_error_then_side_then_start_then_steps(columns, count):
    start, steps, mirrored, error = (np.array(column, dtype=np.int64) for column in columns)
    rows = sorted(zip(error.tolist(), mirrored.tolist(), start.tolist(), steps.tolist(), strict=True))[:count]
    best = first_of(FoundWindows(start, steps, mirrored, error), count)
    assert list(zip(best.error, best.mirrored, best.start, best.steps, strict=True)) == rows


def test_findings_are_joined_and_chosen_from():
    one = FoundWindows(*(np.array([4, 5]) for _ in range(4)))
    both = merged([one, NO_WINDOWS, one])
    assert both.start.tolist() == both.error.tolist() == [4, 5, 4, 5]
    assert select(both, both.steps == 5).mirrored.tolist() == [5, 5]
    assert len(merged([])) == len(NO_WINDOWS) == 0
