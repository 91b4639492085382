"""Paths: windows turned onto a query, joined without kinks, exact at both ends, walked in another time."""

import numpy as np
import pytest
from gallery.walks import ahead, angles, arc, ends_of, even, moved, tracks_of, wander
from hypothesis import given, settings
from hypothesis import strategies as st

from interpose.gallery import paths
from interpose.gallery.matching import IN_PLACE, MatchSettings, Query, Trace, Window, compose, direct
from interpose.gallery.paths import (
    FADE_STEPS,
    apart,
    ease,
    fit,
    join,
    meet,
    place,
    query_of,
    retime,
    stages,
    straight,
    turn,
)
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW

places = st.floats(-50.0, 50.0)
TURN = 2.0 * np.pi


def whole_turns(angle):
    return np.round(angle / TURN) * TURN


def assert_same_but_whole_turns(a, b, atol):
    """Equal places, and yaws that differ by the same whole turns all along."""
    np.testing.assert_allclose(a[:, :2], b[:, :2], atol=atol)
    np.testing.assert_allclose(a[:, 2] - whole_turns(a[0, 2] - b[0, 2]), b[:, 2], atol=atol)


def assert_ends(path, query):
    """The path begins and ends exactly where the query does, and its yaw at whole turns from it."""
    for frame, told in ((path[0], query.start), (path[-1], query.target)):
        assert frame[:2].tolist() == list(told[:2])
        np.testing.assert_allclose(np.exp(1j * frame[2]), np.exp(1j * told[2]), atol=1e-9)


def windows(gallery):
    """Any window of a gallery, as it lies or in the mirror."""
    ranges = [clip for clip in gallery.tracks.ranges.tolist() if clip[1] - clip[0] > SHORTEST_WINDOW]

    def within(clip):
        steps = st.integers(SHORTEST_WINDOW, min(LONGEST_WINDOW, clip[1] - clip[0] - 1))
        return steps.flatmap(
            lambda n: st.builds(Window, st.integers(clip[0], clip[1] - n - 1), st.just(n), st.booleans())
        )

    return st.sampled_from(ranges).flatmap(within)


# Placing.


@given(st.data(), angles, places, places)
def test_a_window_placed_on_its_own_query_is_itself(wandering, data, angle, x, z):
    part = data.draw(windows(wandering))
    cut = wandering.tracks.cut(part.start, part.steps, part.mirrored)
    told = moved(cut, angle, x, z)
    assert_same_but_whole_turns(place(wandering.tracks, Trace((part,), 0.0), ends_of(told)), told, 1e-6)


@given(st.data(), angles, angles, places, places, angles, st.floats(0.0, 6.0))
def test_a_placed_path_has_the_ends_of_the_query(wandering, data, first, last, x, z, heading, metres):
    query = Query((x, z, first), (x + metres * np.sin(heading), z + metres * np.cos(heading), last))
    part = data.draw(windows(wandering))
    path = place(wandering.tracks, Trace((part,), 0.0), query)
    assert len(path) == part.steps + 1
    assert_ends(path, query)


@given(angles, places, places, st.floats(0.0, 3.0), st.floats(-0.3, 0.3))
def test_a_candidate_turned_and_scaled_reaches_the_target(wandering, heading, x, z, metres, facing):
    target = x + metres * np.sin(heading), z + metres * np.cos(heading)
    query = Query((x, z, heading), (*target, heading + facing))
    for trace in direct(wandering.search, query, 5):
        made = stages(wandering.tracks, trace, query)
        (part,) = trace.parts
        np.testing.assert_array_equal(made.found, wandering.tracks.cut(part.start, part.steps, part.mirrored))
        np.testing.assert_array_equal(made.turned[0, :2], query.start[:2])
        assert np.linalg.norm(made.turned[-1, :2] - target) <= (2.5 * IN_PLACE if query.in_place else 1e-6)
        if query.in_place:
            continue
        facings = np.angle(np.exp(1j * (made.turned[[0, -1], 2] - np.array([query.start[2], query.target[2]]))))
        assert np.abs(facings).sum() == pytest.approx(trace.error, abs=3e-4)


def test_short_ways_are_turned_onto_the_query_too():
    track = even(40, pace=0.12, facing=1.0)  # 6 cm in 15 frames, 10 cm in 25
    gallery_tracks = tracks_of([track])
    for steps in (15, 20, 24, 26):
        query = moved(track[: steps + 1], 2.0)
        asked = Query(tuple(query[0]), tuple(query[0] + (query[-1] - query[0]) * (0.11 / (0.004 * steps))))
        assert not asked.in_place
        made = stages(gallery_tracks, Trace((Window(0, steps, False),), 0.0), asked).turned
        np.testing.assert_allclose(made[-1, :2], asked.target[:2], atol=1e-6)
        np.testing.assert_allclose(made[:, 2], asked.start[2], atol=1e-6)


@settings(max_examples=30)
@given(st.floats(4.5, 9.0), angles, st.integers(0, 1000))
def test_a_composed_path_has_the_ends_of_the_query_and_no_kink(strolling, metres, heading, seed):
    query = ends_of(moved(np.array([[0.0, 0.0, 0.1], [0.0, metres, -0.2]]), heading, 3.0, -4.0))
    draw = np.random.default_rng(seed)
    trace = compose(
        strolling.search, strolling.tracks, strolling.distances, query, draw, settings=MatchSettings(threshold=0.7)
    )
    if trace is None:
        return
    made = stages(strolling.tracks, trace, query)
    path = made.placed
    assert len(path) == trace.steps + 1
    assert_ends(path, query)
    np.testing.assert_allclose(made.turned[-1, :2], query.target[:2], atol=1e-6)
    assert len(made.found) == len(made.turned) == trace.steps + len(trace.parts)
    # Windows here take even steps of 4 cm or so, and turn by little; so must the path, across its joins too.
    assert np.abs(np.diff(path[:, 2])).max() < 0.4
    assert np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1).max() < 0.2
    bends = np.linalg.norm(np.diff(path, n=2, axis=0), axis=-1)
    assert bends.max() < 0.05


def test_yaw_does_not_jump_where_the_parts_are_whole_turns_apart():
    spun = even(100)
    spun[:, 2] += 3 * TURN
    gallery_tracks = tracks_of([even(100), spun, even(100, facing=np.pi), even(100, heading=TURN - 0.01)])
    for first, second in ((0, 1), (1, 0), (1, 3), (2, 2), (0, 3)):
        trace = Trace((Window(100 * first, 50, False), Window(100 * second, 50, False)), 0.0)
        for yaw in (0.0, 5 * TURN, -np.pi):
            query = Query((0.0, 0.0, yaw), (0.0, 4.0, yaw - TURN))
            path = place(gallery_tracks, trace, query)
            assert_ends(path, query)
            assert np.abs(np.diff(path[:, 2])).max() < 0.15


# Joining.


@given(st.integers(FADE_STEPS + 1, 60), st.integers(FADE_STEPS + 1, 60), angles, st.integers(0, 99))
def test_places_yaws_and_steps_are_continuous_at_a_join(before, after, angle, seed):
    a = wander(before, seed)
    b = moved(wander(after, seed + 100), angle)
    b[:, :2] += a[-1, :2] - b[0, :2]
    path = join(a, b)
    assert len(path) == before + after - 1
    np.testing.assert_allclose(path[before - 1] - path[before - 2], path[before] - path[before - 1], atol=1e-9)
    np.testing.assert_array_equal(path[0], a[0])
    np.testing.assert_allclose(path[-1, :2], b[-1, :2], atol=1e-12)
    np.testing.assert_allclose(np.exp(1j * path[-1, 2]), np.exp(1j * b[-1, 2]), atol=1e-9)
    np.testing.assert_array_equal(path[: before - FADE_STEPS], a[: before - FADE_STEPS])
    np.testing.assert_allclose(path[before - 1 + FADE_STEPS :, :2], b[FADE_STEPS:, :2], atol=1e-12)
    assert abs(path[before - 1, 2] - a[-1, 2]) <= np.pi / 2.0 + 1e-9


def test_what_goes_on_as_it_came_is_joined_unchanged():
    whole = even(60)
    whole[:, 2] += 0.03 * np.arange(60)
    shifted = whole[29:] + np.array([0.0, 0.0, 3 * TURN])
    np.testing.assert_allclose(join(whole[:30], shifted), whole, atol=1e-12)


def test_at_a_join_facings_and_velocities_meet_half_way():
    a, b = even(40, pace=1.0), even(40, pace=2.0, facing=0.6)
    b[:, :2] += a[-1, :2]
    path = join(a, b)
    np.testing.assert_allclose(path[39], [*a[-1, :2], 0.3], atol=1e-12)
    np.testing.assert_allclose(path[40, 1] - path[39, 1], 1.5 / 30.0, atol=1e-12)


@pytest.mark.parametrize("before", [2, 3, 5, 30])
@pytest.mark.parametrize("after", [2, 3, 5, 30])
def test_parts_shorter_than_the_fade_keep_their_other_ends(before, after):
    a, b = even(before), even(after, facing=0.5)
    b[:, :2] += a[-1, :2]
    path = join(a, b)
    np.testing.assert_allclose(path[0], a[0], atol=1e-12)
    np.testing.assert_allclose(path[-1], b[-1], atol=1e-12)
    np.testing.assert_allclose(path[before - 1], [*a[-1, :2], 0.25], atol=1e-12)
    if before > 2 < after:
        np.testing.assert_allclose(path[before - 1] - path[before - 2], path[before] - path[before - 1], atol=1e-9)


# Known velocities.


@given(st.integers(8, 80), st.integers(0, 50), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_a_path_meets_the_velocities_known_at_its_ends(frames, seed, u, v):
    track = wander(frames, seed)
    first, last = np.array([u, v]), np.array([v, -u])
    own = 30.0 * np.diff(track[:, :2], axis=0)[[0, -1]]
    for velocities in ((first, None), (None, last), (first, last)):
        path = meet(track, velocities)
        np.testing.assert_array_equal(path[[0, -1]], track[[0, -1]])
        np.testing.assert_array_equal(path[:, 2], track[:, 2])
        told = [was if known is None else known for known, was in zip(velocities, own, strict=True)]
        np.testing.assert_allclose(30.0 * np.diff(path[:, :2], axis=0)[[0, -1]], told, atol=1e-9)
        np.testing.assert_array_equal(path[FADE_STEPS:-FADE_STEPS], track[FADE_STEPS:-FADE_STEPS])


def test_where_no_velocity_is_known_or_no_time_is_left_nothing_is_bent():
    np.testing.assert_array_equal(meet(wander(50, 0), (None, None)), wander(50, 0))
    for frames in (1, 2, 6):
        np.testing.assert_array_equal(meet(even(frames), (np.ones(2), np.ones(2))), even(frames))


# Turning, fitting, timing.


@given(st.integers(0, 50), angles, st.floats(0.5, 2.0), places, places)
def test_turning_keeps_shapes(seed, angle, scale, x, z):
    track = wander(50, seed)
    turned = turn(track, angle, scale, np.array([x, z]))
    assert turned[0, :2].tolist() == [x, z]
    np.testing.assert_allclose(turned[:, 2], track[:, 2] + angle)
    there, here = np.diff(turned[:, :2], axis=0), np.diff(track[:, :2], axis=0)
    np.testing.assert_allclose(np.linalg.norm(there, axis=-1), scale * np.linalg.norm(here, axis=-1), atol=1e-9)
    # A way is turned as a yaw is: about +Y, from +Z towards +X.
    np.testing.assert_allclose(
        there[:, 1] + 1j * there[:, 0], scale * np.exp(1j * angle) * (here[:, 1] + 1j * here[:, 0]), atol=1e-9
    )


def test_the_query_of_a_path_is_its_ends():
    assert query_of(even(31, pace=1.0, facing=0.5)) == Query((0.0, 0.0, 0.5), (0.0, 1.0, 0.5))


@given(st.integers(0, 50), angles, angles, st.integers(SHORTEST_WINDOW, 60))
def test_fitting_moves_the_ends_only_as_far_as_needed(seed, first, last, steps):
    track = wander(steps + 1, seed)
    (x, z, _), (u, v, _) = track[[0, -1]].tolist()
    query = Query((x + 0.1, z, track[0, 2] + first), (u, v - 0.1, track[-1, 2] + last))
    path = fit(track, query)
    assert_ends(path, query)
    assert_same_but_whole_turns(fit(path, query), path, 1e-12)
    moved_by = path - track
    np.testing.assert_allclose(np.abs(moved_by[:, 0]).max(), 0.1, atol=1e-9)
    assert np.abs(moved_by[:, 2] - whole_turns(moved_by[0, 2])).max() <= np.pi + 1e-9 + abs(
        np.angle(np.exp(1j * first))
    )


def test_fitting_what_fits_changes_nothing_and_no_end_gets_a_kink():
    track = wander(60, 2)
    np.testing.assert_allclose(fit(track, ends_of(track)), track, atol=1e-12)
    query = ends_of(track)
    off = Query(query.start, (query.target[0] + 0.2, query.target[1], query.target[2] + 0.3))
    bent = fit(track, off) - track
    assert np.abs(bent[1]).max() < 0.002
    assert np.abs(bent[-2] - bent[-1]).max() < 0.002


@given(st.integers(0, 50), st.integers(SHORTEST_WINDOW, LONGEST_WINDOW), st.integers(1, 300))
def test_a_retimed_path_has_its_ends_and_as_many_steps_as_asked_for(seed, steps, asked):
    track = wander(steps + 1, seed)
    path = retime(track, asked)
    assert path.shape == (asked + 1, 3)
    np.testing.assert_array_equal(path[[0, -1]], track[[0, -1]])
    if asked % steps == 0:
        np.testing.assert_allclose(path[:: asked // steps], track, atol=1e-9)


@given(st.integers(1, LONGEST_WINDOW), st.integers(1, 300))
def test_an_even_path_stays_even_in_another_time(steps, asked):
    path = retime(even(steps + 1, facing=0.4), asked)
    np.testing.assert_allclose(np.diff(path[:, 1]), 0.04 * steps / asked, atol=1e-9)
    np.testing.assert_allclose(path[:, [0, 2]], [[0.0, 0.4]] * (asked + 1), atol=1e-9)


@given(angles, angles, st.integers(1, 200))
def test_the_straight_path_is_even_and_turns_the_shorter_way_round(first, last, steps):
    query = ahead(3.0, (first, last))
    path = straight(query, steps)
    assert path.shape == (steps + 1, 3)
    assert_ends(path, query)
    np.testing.assert_allclose(np.diff(path[:, 1]), 3.0 / steps, atol=1e-9)
    np.testing.assert_allclose(np.diff(path[:, 2]), (path[-1, 2] - path[0, 2]) / steps, atol=1e-9)
    assert abs(path[-1, 2] - path[0, 2]) <= np.pi + 1e-9


def test_easing_rises_from_0_to_1_without_slope_at_its_ends():
    t = np.linspace(-0.5, 1.5, 201)
    eased = ease(t)
    assert (np.diff(eased) >= 0.0).all()
    assert (eased[:51] == 0.0).all()
    assert (eased[150:] == 1.0).all()
    assert ease(np.array([0.5])) == 0.5
    assert eased[51] - eased[50] < 1e-3 > eased[150] - eased[149]


def test_paths_are_apart_by_their_mean_distance_at_equal_shares_of_time():
    a, b = even(61), even(61) + np.array([0.3, 0.4, 2.0])
    assert apart(a, a) == 0.0
    assert apart(a, b) == pytest.approx(0.5)
    assert apart(a, retime(b, 90)) == pytest.approx(0.5)
    bent = arc(61, turning=0.4)
    assert apart(a, retime(bent, 90)) == pytest.approx(apart(retime(bent, 90), a), rel=1e-12)
    assert 0.1 < apart(a, bent) < 1.0


def test_the_stages_of_a_placing_end_in_the_path(wandering):
    (trace,) = direct(wandering.search, ahead(1.0, (0.2, 0.1)), 1)
    made = paths.stages(wandering.tracks, trace, ahead(1.0, (0.2, 0.1)))
    np.testing.assert_array_equal(made.placed, place(wandering.tracks, trace, ahead(1.0, (0.2, 0.1))))
    assert apart(made.turned, made.placed) < 0.01
