"""Algorithm 1: what was planted is found again, and ways too long for one window are composed of several."""

from functools import partial

import numpy as np
import pytest
from gallery import full_scan
from gallery.walks import ahead, angles, ends_of, even, moved, tracks_of, wander
from hypothesis import given, settings
from hypothesis import strategies as st

from interpose.gallery import store
from interpose.gallery.matching import (
    IN_PLACE,
    LONGEST_QUERY,
    MATCH_DEFAULTS,
    SHORTEST_PART,
    MatchSettings,
    Query,
    Window,
    band,
    compose,
    direct,
    window_query,
)
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW, TURN, features

UNIT = 2.0 * np.pi / TURN
places = st.floats(-50.0, 50.0)


class Counted:
    """A search that counts how often it is asked, and keeps what was."""

    def __init__(self, search):
        self.search, self.asked = search, []

    def __call__(self, wanted, count):
        self.asked.append(wanted)
        return self.search(wanted, count)


def composed(gallery, query, seed=0, search=None, **more):
    draw = np.random.default_rng(seed)
    return compose(search or gallery.search, gallery.tracks, gallery.distances, query, draw, **more)


def lengths_of(gallery, trace):
    """How long the way of each part is from end to end."""
    parts = [(np.array([part.start]), part.steps) for part in trace.parts]
    return np.array([float(features(gallery.tracks.root, *part)[0][0]) for part in parts])


# Queries.


@given(angles, angles, places, places, angles, st.floats(0.2, 20.0))
def test_a_query_is_the_same_wherever_it_lies(first, last, x, z, angle, metres):
    track = np.array([[0.0, 0.0, first], [0.3, 1.0, 0.0], [0.0, metres, last]])
    here, there = ends_of(track), ends_of(moved(track, angle, x, z))
    assert there.distance == pytest.approx(here.distance, abs=1e-9)
    np.testing.assert_allclose(np.exp(1j * np.array(there.facing)), np.exp(1j * np.array(here.facing)), atol=1e-9)
    assert here.facing == (first, last)
    assert not here.in_place


def test_a_query_in_place_is_seen_along_its_start():
    query = Query((1.0, 2.0, 0.7), (1.0, 2.0 + 0.9 * IN_PLACE, 1.9))
    assert query.in_place
    assert query.heading == 0.7
    np.testing.assert_allclose(query.facing, (0.0, 1.2))
    asked = window_query(query, (20, 30), (1,))
    assert asked.criterion == "turn"
    assert asked.distance[0] == 0.0
    assert not ahead(1.01 * IN_PLACE).in_place


@given(st.floats(0.0, 100.0))
def test_the_lengths_that_pass_hold_the_length_itself_and_little_more(distance):
    low, high = band(distance)
    slack = max(0.03 * distance, 0.02)
    assert low == pytest.approx(max(0.0, distance - slack))
    assert high == pytest.approx(distance + slack)


# Direct candidates.


@given(st.data(), angles, places, places, st.booleans())
def test_a_planted_trajectory_is_found_wherever_it_is_asked_for(wandering, data, angle, x, z, mirrored):
    tracks = wandering.tracks
    begin, end = tracks.ranges[data.draw(st.sampled_from([0, 1, 3, 4]))].tolist()
    steps = data.draw(st.integers(SHORTEST_WINDOW, LONGEST_WINDOW))
    start = data.draw(st.integers(begin, end - steps - 1))
    query = ends_of(moved(tracks.cut(start, steps, mirrored), angle, x, z))
    exact = MatchSettings(tolerance=0.0, least_tolerance=1e-4, threshold=3.0 * UNIT)
    found = direct(wandering.search, query, 10**6, settings=exact)
    planted = [trace for trace in found if trace.parts == (Window(start, steps, mirrored),)]
    if query.in_place:  # only the turn counts there; windows by the thousand turn that much
        assert found[0].error <= 3.0 * UNIT
    else:
        assert len(planted) == 1
        assert planted[0].error <= 2.001 * UNIT
        assert planted[0].steps == steps
    assert [trace.error for trace in found] == sorted(trace.error for trace in found)


@given(angles, angles, st.floats(0.0, 8.0), st.integers(1, 20))
def test_direct_candidates_are_as_asked_for(wandering, first, last, metres, count):
    query = ahead(metres, (first, last))
    found = direct(wandering.search, query, count, (20, 40), (2,))
    assert len(found) <= count
    low, high = band(metres)
    for trace in found:
        (part,) = trace.parts
        assert 20 <= part.steps <= 40
        assert trace.error <= MATCH_DEFAULTS.threshold
        clip = np.searchsorted(wandering.tracks.ranges[:, 0], part.start, side="right") - 1
        assert wandering.tracks.clip_styles[clip] == 2
        (length,) = lengths_of(wandering, trace)
        assert length <= 1.5 * IN_PLACE + 1e-6 if query.in_place else low - 1e-6 <= length <= high + 1e-6


def test_a_turn_in_place_is_found_by_how_far_it_turns():
    spin = even(100, pace=0.0)
    spin[:, 2] = 0.02 * np.arange(100)
    gallery = store.of_tracks(tracks_of([spin, even(100)]))
    query = Query((5.0, 5.0, 3.0), (5.02, 5.0, 3.8))
    best = direct(gallery.search, query, 500)
    assert {trace.parts[0].steps for trace in best if trace.error < 0.5 * 0.02} == {40}
    assert best[0].parts[0] == Window(0, 40, False)
    other = direct(gallery.search, Query(query.start, (5.02, 5.0, 2.2)), 1)
    assert other[0].parts[0] == Window(0, 40, True)


def test_where_there_is_no_candidate_there_is_none(marching):
    assert direct(marching.search, ahead(30.0), 5) == []
    assert direct(marching.search, ahead(2.0, (1.5, 1.5)), 5) == []
    assert direct(marching.search, ahead(2.0), 5, styles=()) == []


# Compositions.


def assert_holds(gallery, query, trace, steps, settings=MATCH_DEFAULTS):
    """What every composition must keep to."""
    low, high = band(query.distance, settings)
    lengths = lengths_of(gallery, trace)
    assert low - 1e-5 <= lengths.sum() <= high + 1e-5
    assert lengths.min() >= 0.0
    assert steps[0] <= trace.steps <= steps[1]
    assert 0.0 <= trace.error <= settings.threshold + 1e-9
    assert 2 <= len(trace.parts) <= settings.rounds + 1
    assert all(SHORTEST_WINDOW <= part.steps <= LONGEST_WINDOW for part in trace.parts)


def error_of(gallery, query, trace):
    """Equation 7 with the facings' mismatch at joins, in floating point, each part seen along its own way."""
    facings = [query.facing[0]]
    for part in trace.parts:
        cut = gallery.tracks.cut(part.start, part.steps, part.mirrored)
        way = cut[-1] - cut[0]
        facings += (cut[[0, -1], 2] - np.arctan2(way[0], way[1])).tolist()
    pairs = np.reshape([*facings, query.facing[1]], (-1, 2))
    return np.abs(np.angle(np.exp(1j * (pairs[:, 0] - pairs[:, 1])))).sum()


FAR = st.floats(4.5, 12.0)
near_0 = st.floats(-0.4, 0.4)


@settings(max_examples=30)
@given(FAR, near_0, near_0, st.integers(0, 1000))
def test_a_way_beyond_the_longest_window_is_composed(strolling, metres, first, last, seed):
    query = ahead(metres, (first, last))
    assert direct(strolling.search, query, 1) == []
    search = Counted(strolling.search)
    trace = composed(strolling, query, seed, search)
    assert len(search.asked) <= MATCH_DEFAULTS.searches
    if trace is not None:
        assert_holds(strolling, query, trace, (SHORTEST_WINDOW, 6 * LONGEST_WINDOW))
        assert trace.error == pytest.approx(error_of(strolling, query, trace), abs=6 * 2.001 * UNIT)


def test_ways_straight_ahead_are_nearly_always_composed(strolling):
    made = [composed(strolling, ahead(metres), seed) for seed in range(10) for metres in (5.0, 9.0)]
    assert sum(trace is not None for trace in made) > 17


@settings(max_examples=25)
@given(st.floats(4.5, 9.0), st.integers(100, 400), st.integers(0, 1000))
def test_a_composition_takes_the_steps_asked_for(strolling, metres, steps, seed):
    asked = (int(steps / 1.1), int(np.ceil(1.1 * steps)))
    trace = composed(strolling, ahead(metres), seed, steps=asked)
    if trace is not None:
        assert_holds(strolling, ahead(metres), trace, asked)


def test_a_composition_at_the_usual_pace_is_found_in_its_steps(strolling):
    asked = (180, 220)  # 8 m at 1.2 m/s
    made = [composed(strolling, ahead(8.0), seed, steps=asked) for seed in range(10)]
    assert sum(trace is not None for trace in made) > 5


def test_a_composition_keeps_to_a_style(strolling):
    for style, clips in ((0, [0]), (1, [1, 2])):
        for seed in range(5):
            trace = composed(strolling, ahead(6.0), seed, styles=(style,))
            if trace is not None:
                starts = [part.start for part in trace.parts]
                assert set(np.searchsorted(strolling.tracks.ranges[:, 0], starts, side="right") - 1) <= set(clips)


@settings(max_examples=4)
@given(FAR, near_0, st.integers(0, 1000))
def test_index_and_scan_compose_the_same(strolling, metres, last, seed):
    query = ahead(metres, (0.0, last))
    by_scan = partial(full_scan.best, strolling.tracks)
    assert composed(strolling, query, seed, by_scan) == composed(strolling, query, seed)


def test_equal_seeds_compose_the_same_and_others_differ(strolling):
    made = [composed(strolling, ahead(6.0), seed) for seed in (1, 1, 2, 3)]
    assert made[0] == made[1]
    assert len({trace.parts for trace in made[1:] if trace is not None}) > 1


def test_what_cannot_be_composed_is_given_up_soon(strolling):
    for query in (ahead(0.05), Query((1.0, 1.0, 0.0), (1.0, 1.0, 3.0)), ahead(1.01 * LONGEST_QUERY), ahead(1e9)):
        search = Counted(strolling.search)
        assert composed(strolling, query, search=search) is None
        assert search.asked == []
    search = Counted(strolling.search)
    fast = np.full_like(strolling.distances, 30.0)
    draw = np.random.default_rng(0)
    assert compose(search, strolling.tracks, fast, ahead(1.01 * LONGEST_QUERY), draw) is None
    assert search.asked == []
    for query, more in (
        (ahead(90.0), {}),
        (ahead(8.0, (1.6, -1.6)), {}),
        (ahead(8.0), {"steps": (15, 29)}),
        (ahead(8.0), {"steps": (30, 40)}),
        (ahead(8.0), {"steps": (2000, 2200)}),
        (ahead(8.0), {"styles": ()}),
        (ahead(0.11), {"steps": (300, 301)}),
        (ahead(2.5 * SHORTEST_PART + IN_PLACE), {"settings": MatchSettings(threshold=0.0)}),
        (ahead(8.0), {"settings": MatchSettings(rounds=0)}),
    ):
        search = Counted(strolling.search)
        assert composed(strolling, query, search=search, **more) is None
        assert len(search.asked) <= MATCH_DEFAULTS.searches


@pytest.mark.parametrize("searches", [1, 2, 3, 4, 7])
def test_no_more_is_searched_than_allowed(strolling, searches):
    for seed in range(10):
        search = Counted(strolling.search)
        composed(strolling, ahead(9.0, (0.0, 0.65)), seed, search, settings=MatchSettings(searches=searches))
        assert len(search.asked) <= searches


def test_later_parts_are_asked_for_with_what_is_left(strolling):
    search = Counted(strolling.search)
    query = ahead(6.0, (0.2, 0.1))
    trace = composed(strolling, query, 4, search, steps=(100, 300))
    assert trace is not None
    first, *others = search.asked
    assert first.criterion == "start"
    assert first.distance[1] < 6.0
    assert all(a.threshold <= MATCH_DEFAULTS.threshold for a in others)
    assert all(a.distance[1] < 6.0 for a in others)
    assert others[-1].facing[1] == pytest.approx(query.facing[1])


def test_without_noise_the_whole_budget_is_not_needed():
    gallery = store.of_tracks(tracks_of([even(100)]))
    trace = composed(gallery, ahead(7.0), 0)
    assert trace is not None
    assert trace.error == 0.0


def test_wandering_ways_are_composed_too(wandering):
    far = 1.5 * float(wandering.distances[-1])
    made = [composed(wandering, ahead(far), seed) for seed in range(5)]
    assert any(trace is not None for trace in made)
    for trace in made:
        if trace is not None:
            assert_holds(wandering, ahead(far), trace, (SHORTEST_WINDOW, 6 * LONGEST_WINDOW))


def test_longer_clips_reach_as_far_as_their_windows_in_a_row():
    gallery = store.of_tracks(tracks_of([even(200, pace=1.5), wander(200, 1)]))
    reach = 6 * LONGEST_WINDOW * 1.5 / 30.0
    made = [composed(gallery, ahead(0.9 * reach), seed) for seed in range(20)]
    assert any(trace is not None for trace in made)
    assert all(composed(gallery, ahead(1.1 * reach), seed) is None for seed in range(5))
