"""Proposals: the likeliest way first, then others that differ; what is asked is kept to, or the nearest is named."""

import re
from itertools import combinations

import numpy as np
import pytest
from gallery.walks import RATE, ahead, arc, ends_of, even, moved, tracks_of
from hypothesis import given, settings
from hypothesis import strategies as st

from interpose.errors import InputError
from interpose.gallery import paths, store
from interpose.gallery.matching import Query, window_query
from interpose.gallery.proposals import LONGEST_GAP, PathRequest, Unreachable, propose, suggestion
from interpose.gallery.tracks import POSTURE_SIZE, mirror_posture
from interpose.gallery.weighing import DURATION_PRIOR, Costs, EndStates, gather
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW, TURN

near_0 = st.floats(-0.4, 0.4)


def near_copy(query):
    """Paths nearer than this, in metres, are copies of one another."""
    return 0.8 * (0.04 + 0.015 * query.distance)


def clip_of(gallery, proposal):
    return int(np.searchsorted(gallery.tracks.ranges[:, 0], proposal.trace.parts[0].start, side="right")) - 1


def assert_ends(path, query):
    for frame, told in ((path[0], query.start), (path[-1], query.target)):
        np.testing.assert_allclose(frame[:2], told[:2], atol=1e-12)
        np.testing.assert_allclose(np.exp(1j * frame[2]), np.exp(1j * told[2]), atol=1e-9)


def assert_sound(gallery, query, made, count):
    """What holds of all proposals, whatever was asked."""
    assert 1 <= len(made) <= count
    for one in made:
        assert_ends(one.path, query)
        assert one.steps == len(one.path) - 1
        assert 0.0 < one.fit <= 1.0
        assert one.style == gallery.styles[gallery.tracks.clip_styles[clip_of(gallery, one)]]
        assert one.composed == (len(one.trace.parts) > 1)
        assert np.abs(np.diff(one.path[:, 2])).max() < 1.0
    assert len({one.trace.parts for one in made}) == len(made)


def assert_different(query, made):
    for a, b in combinations(made, 2):
        times = 0.25 * max(query.distance, 0.5) * abs(np.log(a.steps / b.steps))
        assert paths.apart(a.path, b.path) + times >= near_copy(query)
        if not a.composed and not b.composed:  # nor are they mostly the same moments
            (one,), (other,) = a.trace.parts, b.trace.parts
            common = min(one.start + one.steps, other.start + other.steps) - max(one.start, other.start)
            assert one.mirrored != other.mirrored or common <= 0.5 * min(one.steps, other.steps)


# What is asked is kept to.


@settings(max_examples=40)
@given(st.floats(0.3, 2.5), near_0, near_0, st.integers(25, 90), st.integers(1, 6))
def test_paths_of_the_steps_asked_for_that_differ(wandering, metres, first, last, steps, count):
    query = ahead(metres, (first, last))
    try:
        made = propose(wandering, query, PathRequest(steps=steps), count=count)
    except Unreachable:
        return
    assert_sound(wandering, query, made, count)
    assert_different(query, made)
    assert all(one.steps == steps for one in made)


@settings(max_examples=30)
@given(st.floats(0.0, 2.5), near_0, near_0, st.integers(1, 6))
def test_paths_of_times_of_their_own_that_differ(wandering, metres, first, last, count):
    query = ahead(metres, (first, last))
    made = propose(wandering, query, PathRequest(), count=count)
    assert_sound(wandering, query, made, count)
    assert_different(query, made)
    told = suggestion(wandering, query)
    assert made[0].steps == told.steps
    assert all(SHORTEST_WINDOW <= one.steps <= LONGEST_WINDOW for one in made)


def test_as_many_as_asked_for_are_proposed_where_there_are_so_many(wandering):
    query = ahead(1.2, (0.1, -0.1))
    for asked in (PathRequest(), PathRequest(steps=45), PathRequest(speed="slow")):
        counts = [len(propose(wandering, query, asked, count=count)) for count in (1, 2, 3, 4)]
        assert counts == [1, 2, 3, 4]
        few, many = (propose(wandering, query, asked, count=count) for count in (2, 4))
        np.testing.assert_array_equal(few[0].path, many[0].path)
        np.testing.assert_array_equal(few[1].path, many[1].path)


def test_fast_is_faster_than_medium_and_medium_than_slow(wandering):
    for metres in (0.5, 1.0, 2.0):
        told = suggestion(wandering, ahead(metres))
        assert [group.speed for group in told.groups] == ["fast", "medium", "slow"]
        steps = []
        for group in told.groups:
            made = propose(wandering, ahead(metres), PathRequest(speed=group.speed), count=3)
            assert made[0].steps == group.steps
            assert all(group.fewest <= one.steps <= group.most for one in made)
            steps.append(made[0].steps)
        assert steps == sorted(set(steps))


def test_far_ways_are_faster_and_slower_too():
    gallery = store.of_tracks(tracks_of([even(100, pace=pace) for pace in (0.8, 1.2, 2.0)]))
    query = ahead(9.0)
    steps = [propose(gallery, query, PathRequest(speed=speed), seed=3)[0].steps for speed in ("fast", "medium", "slow")]
    assert steps[0] < steps[1] < steps[2]


def test_a_style_restricts_the_proposals(wandering):
    for style in wandering.styles:
        for one in propose(wandering, ahead(0.8), PathRequest(style=style), count=4):
            assert one.style == style
            assert wandering.styles[wandering.tracks.clip_styles[clip_of(wandering, one)]] == style
    unrestricted = propose(wandering, ahead(0.8), PathRequest(), count=6)
    assert len({one.style for one in unrestricted}) > 1


def test_equal_seeds_propose_the_same(wandering, strolling):
    for gallery, query in ((wandering, ahead(1.0, (0.2, 0.1))), (strolling, ahead(7.0))):
        made = [propose(gallery, query, PathRequest(), count=3, seed=seed) for seed in (5, 5)]
        for a, b in zip(*made, strict=True):
            np.testing.assert_array_equal(a.path, b.path)
            assert (a.trace, a.fit, a.style) == (b.trace, b.fit, b.style)


def test_other_seeds_propose_other_compositions(strolling):
    traces = {propose(strolling, ahead(7.0), PathRequest(), seed=seed)[0].trace for seed in range(4)}
    assert len(traces) > 1


@settings(max_examples=15)
@given(st.floats(-3.0, 3.0), st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
def test_proposals_do_not_depend_on_where_the_query_lies(wandering, angle, x, z):
    here = np.array([[0.0, 0.0, 0.1], [0.0, 1.0, -0.2]])
    there = moved(here, angle, x, z)
    a, b = (propose(wandering, ends_of(ends), PathRequest(steps=40))[0] for ends in (here, there))
    if a.trace.parts == b.trace.parts:  # errors are rounded to units of angle: equals may change their order
        np.testing.assert_allclose(b.path, moved(a.path, angle, x, z), atol=1e-6)
    assert paths.apart(moved(a.path, angle, x, z), b.path) < 0.05


def test_a_turn_in_place_is_proposed(wandering):
    for turn in (0.0, 0.8, -2.0):
        query = Query((3.0, 4.0, 0.5), (3.03, 4.0, 0.5 + turn))
        made = propose(wandering, query, PathRequest(), count=3)
        assert_sound(wandering, query, made, 3)
        assert abs(made[0].path[-1, 2] - made[0].path[0, 2] - turn) < 1e-6


# The likeliest first.


@pytest.mark.parametrize("query", [ahead(1.0, (0.1, -0.2)), ahead(0.5, (1.0, 0.9)), ahead(2.0)])
def test_the_first_is_nearest_to_the_weighted_mean_path(wandering, query):
    draw = np.random.default_rng(0)
    pool = gather(wandering, query, EndStates(), (32, 50), None, draw, target_steps=40)
    mean = np.tensordot(pool.weights / pool.weights.sum(), pool.sketch, axes=1)
    made = propose(wandering, query, PathRequest(steps=40), count=4)
    assert len(made) >= 3
    shares = np.linspace(0.0, 1.0, len(mean))
    away = []
    for one in made:
        own = np.linspace(0.0, 1.0, one.steps + 1)
        way = np.stack([np.interp(shares, own, one.path[:, axis]) for axis in (0, 1)], axis=-1)
        away.append(np.linalg.norm(way - mean, axis=-1).mean())
    assert np.argmin(away) == 0


def test_a_perfect_match_has_a_fit_of_1_and_a_worse_one_less():
    gallery = store.of_tracks(tracks_of([even(120)]))
    for asked in (PathRequest(), PathRequest(steps=50)):
        (one,) = propose(gallery, ahead(2.0), asked)
        assert one.fit == pytest.approx(1.0, abs=0.02)
        (off,) = propose(gallery, ahead(2.0, (0.35, 0.35)), asked)
        assert off.fit == pytest.approx(1.0 / (1.0 + 0.5 * (0.7 / Costs().facing) ** 2), abs=0.02)


def test_the_first_keeps_near_to_a_hint(wandering):
    query = ahead(1.5)
    for bend in (0.4, -0.4):
        hint = paths.straight(query, 40)
        hint[:, 0] += bend * np.sin(np.linspace(0.0, np.pi, 41))
        plain, led = (propose(wandering, query, PathRequest(), hint=given)[0] for given in (None, hint))
        assert paths.apart(led.path, hint) < paths.apart(plain.path, hint)
        assert np.sign(led.path[len(led.path) // 2, 0]) == np.sign(bend)


def posture_with(height):
    return np.full(POSTURE_SIZE, 0.3) * np.where(np.arange(POSTURE_SIZE) == 0, height / 0.3, 1.0)


def test_the_posture_at_the_keys_decides_between_ways_that_fit_alike():
    upright, low = posture_with(0.95), posture_with(0.5)
    left, right = arc(120, turning=0.3), arc(120, turning=-0.3)
    # Arcs one way upright and the other way low, a hand raised: in the mirror it is the other hand.
    one_hand = np.where(np.arange(POSTURE_SIZE) == 5, 1.6, upright)
    other_hand = np.where(np.arange(POSTURE_SIZE) == 8, 1.6, low)
    gallery = store.of_tracks(tracks_of([left, right], ["Up", "Low"], [one_hand, other_hand]))
    for posture, style, side in (
        (one_hand, "Up", 1.0),
        (other_hand, "Low", -1.0),
        (mirror_posture(one_hand), "Up", -1.0),
        (mirror_posture(other_hand), "Low", 1.0),
    ):
        for asked in (PathRequest(), PathRequest(steps=55)):
            first, *_ = propose(gallery, ahead(2.2), asked, EndStates((posture, posture)), count=2)
            assert first.style == style
            middle = first.path[first.steps // 2, 0]
            assert np.sign(middle) == -side  # a walk that turns towards +X swings out towards -X


def test_the_posture_at_either_end_counts():
    upright, low = posture_with(0.95), posture_with(0.5)
    rising = np.linspace(low, upright, 51)
    gallery = store.of_tracks(
        tracks_of([even(51), even(51), even(51), even(51)], "abcd", [upright, low, rising, rising[::-1]])
    )
    ends = {"a": (upright, upright), "b": (low, low), "c": (low, upright), "d": (upright, low)}
    for style, postures in ends.items():
        (first,) = propose(gallery, ahead(2.0), PathRequest(), EndStates(postures))
        assert first.style == style
        assert first.fit > 0.9


def test_the_velocities_at_the_keys_decide():
    """Of two ways alike but for where they are fast, turned by a quarter against the query."""
    pace = np.linspace(0.2, 2.2, 50) / RATE
    late, early = even(51), even(51)
    late[1:, 1], early[1:, 1] = np.cumsum(pace), np.cumsum(pace[::-1])
    gallery = store.of_tracks(tracks_of([late, early], ["late", "early"]))
    for angle in (0.0, np.pi / 2.0, 2.5):
        query = ends_of(moved(late, angle, 1.0, 2.0))
        towards = np.array([np.sin(angle), np.cos(angle)])
        for velocities, style in (
            ((0.2 * towards, None), "late"),
            ((2.2 * towards, None), "early"),
            ((None, 0.2 * towards), "early"),
            ((None, 2.2 * towards), "late"),
            ((0.2 * towards, 2.2 * towards), "late"),
        ):
            (first,) = propose(gallery, query, PathRequest(steps=50), EndStates(None, velocities))
            assert first.style == style
    sideways = 1.5 * np.array([1.0, 0.0])
    (first,) = propose(gallery, ends_of(late), PathRequest(steps=50), EndStates(None, (sideways, sideways)))
    assert first.fit < 0.2


def test_mirrored_windows_have_mirrored_velocities():
    bent = arc(61, turning=1.0, heading=-1.0)
    gallery = store.of_tracks(tracks_of([bent]))
    seen = bent * [-1.0, 1.0, -1.0]
    for track, mirrored in ((bent, False), (seen, True)):
        velocity = (track[1, :2] - track[0, :2]) * RATE
        (first,) = propose(gallery, ends_of(track), PathRequest(steps=60), EndStates(None, (velocity, None)))
        assert first.trace.parts[0].mirrored == mirrored
        assert first.fit > 0.6
        assert paths.apart(first.path, track) < 0.02


def test_paths_meet_the_velocities_that_are_known(strolling):
    before, after = np.array([0.3, 0.9]), np.array([-0.2, 1.4])
    for metres, asked in ((2.0, PathRequest()), (2.0, PathRequest(steps=45)), (7.0, PathRequest())):
        for one in propose(strolling, ahead(metres), asked, EndStates(None, (before, after)), count=2):
            assert_ends(one.path, ahead(metres))
            velocities = RATE * np.diff(one.path[:, :2], axis=0)
            np.testing.assert_allclose(velocities[[0, -1]], [before, after], atol=1e-9)


def test_detours_and_turns_that_nobody_asked_for_cost():
    straight, spun, bowed = even(61, pace=1.0), even(61, pace=1.0), even(61, pace=1.0)
    spun[:, 2] = np.linspace(0.0, 2.0 * np.pi, 61)
    bowed[:, 0] = 1.5 * np.sin(np.linspace(0.0, np.pi, 61))
    gallery = store.of_tracks(tracks_of([straight, spun, bowed]))
    pool = gather(gallery, ahead(2.0), EndStates(), (60, 60), None, np.random.default_rng(0), target_steps=60)
    misfit = {int(start): float(cost) for start, cost in zip(pool.found.start, pool.misfit, strict=True)}
    assert misfit[0] == pytest.approx(0.0, abs=1e-6)
    assert misfit[61] == pytest.approx(0.5 * (2.0 * np.pi / Costs().turning) ** 2, rel=1e-3)
    walked = np.linalg.norm(np.diff(bowed[:, :2], axis=0), axis=-1).sum()
    assert misfit[122] == pytest.approx(0.5 * (np.log(walked / 2.5) / Costs().detour) ** 2, rel=0.03)


def test_of_variants_that_differ_alike_the_likelier_is_taken():
    upright, low = posture_with(0.95), posture_with(0.8)
    bent = arc(61, turning=0.4)
    gallery = store.of_tracks(tracks_of([even(61), bent, bent], ["Even", "High", "Low"], [upright, upright, low]))
    made = propose(gallery, ahead(2.2), PathRequest(steps=55), EndStates((upright, upright)), count=2)
    assert len(made) == 2
    assert "Low" not in {one.style for one in made}


# Copies.


def test_of_ways_that_are_the_same_at_a_given_time_one_is_proposed():
    gallery = store.of_tracks(tracks_of([even(145, pace=1.7), even(131, pace=1.9)]))
    made = propose(gallery, ahead(8.0), PathRequest(steps=140), count=4)
    assert_different(ahead(8.0), made)
    assert len(made) == 1


def test_compositions_are_no_copies_of_single_windows(strolling):
    for seed in range(4):
        made = propose(strolling, ahead(3.4), PathRequest(steps=85), count=5, seed=seed)
        assert_sound(strolling, ahead(3.4), made, 5)
        assert_different(ahead(3.4), made)


def test_only_windows_of_other_moments_are_variants():
    """A single walk has no variants of nearly the same frames."""
    gallery = store.of_tracks(tracks_of([arc(60, turning=0.4)]))
    made = propose(gallery, ends_of(arc(56, turning=0.4)), PathRequest(steps=55), count=5)
    spans = [(one.trace.parts[0].start, one.trace.steps, one.trace.parts[0].mirrored) for one in made]
    assert len(set(spans)) == len(spans) == len({mirrored for *_, mirrored in spans})


# Far ways, and other times.


def test_far_ways_are_composed(strolling):
    for asked in (PathRequest(), PathRequest(steps=200), PathRequest(style="Old")):
        query = ahead(7.0, (0.1, -0.1))
        made = propose(strolling, query, asked, count=3, seed=2)
        assert_sound(strolling, query, made, 3)
        assert_different(query, made)
        assert all(one.composed for one in made)
        assert asked.steps is None or all(one.steps == asked.steps for one in made)
    assert {one.style for one in propose(strolling, ahead(7.0), PathRequest(style="Old"), count=3)} == {"Old"}


def test_what_can_be_composed_is_nearly_always_proposed(strolling):
    for seed in range(6):
        assert propose(strolling, ahead(8.0), PathRequest(steps=210), seed=seed)
        assert propose(strolling, ahead(8.0), PathRequest(), seed=seed)


def test_a_way_walked_in_another_time_is_retimed():
    gallery = store.of_tracks(tracks_of([even(120)]))
    for steps in (36, 70):
        (one,) = propose(gallery, ahead(2.0), PathRequest(steps=steps))
        np.testing.assert_allclose(np.diff(one.path[:, 1]), 2.0 / steps, atol=1e-3)
        assert one.fit < 0.3
        assert one.steps == steps


def test_a_way_walked_in_another_time_is_one_of_the_style_asked_for():
    gallery = store.of_tracks(tracks_of([even(150, pace=2.4), even(150, pace=0.8)], ["Brisk", "Old"]))
    assert {one.style for one in propose(gallery, ahead(2.0), PathRequest(steps=55, style="Old"), count=3)} == {"Old"}
    with pytest.raises(Unreachable) as error:
        propose(gallery, ahead(2.0), PathRequest(steps=55, style="Brisk"))
    assert nearest(error) == pytest.approx(25, abs=2)


# What cannot be had.


def nearest(error):
    """The frames that the message names."""
    found = re.search(r"the nearest takes (\d+) frames \((\d+\.\d) s\)$", str(error.value))
    assert found
    assert float(found[2]) == pytest.approx(int(found[1]) / RATE, abs=0.06)
    return int(found[1])


def test_too_short_a_time_is_refused_with_the_nearest(marching, wandering):
    for gallery in (marching, wandering):
        with pytest.raises(Unreachable, match=r"covers 5\.00 m in 5 frames \(0\.2 s at 30 Hz\); the nearest") as error:
            propose(gallery, ahead(5.0), PathRequest(steps=5))
        assert propose(gallery, ahead(5.0), PathRequest(steps=nearest(error)))
    with pytest.raises(Unreachable) as error:
        propose(marching, ahead(5.0), PathRequest(steps=5))
    assert 120 <= nearest(error) <= 126


def test_too_long_a_time_is_refused_with_the_nearest(marching):
    with pytest.raises(Unreachable) as error:
        propose(marching, ahead(2.0), PathRequest(steps=400))
    assert nearest(error) == pytest.approx(75, abs=4)  # at the slowest pace
    assert propose(marching, ahead(2.0), PathRequest(steps=nearest(error)))


def test_the_nearest_is_one_of_the_style_asked_for():
    gallery = store.of_tracks(tracks_of([even(150, pace=2.4), even(150, pace=0.8)], ["Brisk", "Old"]))
    with pytest.raises(Unreachable) as error:
        propose(gallery, ahead(2.0), PathRequest(steps=16, style="Old"))
    assert nearest(error) == pytest.approx(75, abs=4)
    assert propose(gallery, ahead(2.0), PathRequest(steps=nearest(error), style="Old"))


def test_the_nearest_is_one_that_faces_as_the_keys_do():
    back = even(150, pace=0.6, facing=np.pi)
    gallery = store.of_tracks(tracks_of([even(150, pace=2.4), back]))
    with pytest.raises(Unreachable) as error:
        propose(gallery, ahead(2.0, (np.pi, np.pi)), PathRequest(steps=25))
    assert nearest(error) == pytest.approx(100, abs=5)
    assert propose(gallery, ahead(2.0, (np.pi, np.pi)), PathRequest(steps=nearest(error)))


def test_the_nearest_of_a_far_way_is_that_of_a_composition():
    gallery = store.of_tracks(tracks_of([even(150)]))
    with pytest.raises(Unreachable) as error:
        propose(gallery, ahead(10.0), PathRequest(steps=60))
    assert nearest(error) == pytest.approx(250, abs=15)
    assert propose(gallery, ahead(10.0), PathRequest(steps=nearest(error)))


def test_too_far_is_refused_with_the_farthest(strolling, wandering):
    for gallery in (strolling, wandering):
        with pytest.raises(Unreachable, match=r"1000\.00 m .* about (\d+) m; set a key in between") as error:
            propose(gallery, ahead(1000.0), PathRequest())
        reach = int(re.search(r"about (\d+) m", str(error.value))[1])
        assert reach == pytest.approx(6.0 * gallery.distances[-1], abs=0.6)
    with pytest.raises(Unreachable, match="set a key in between"):
        propose(strolling, ahead(1000.0), PathRequest(steps=100))
    with pytest.raises(Unreachable, match="set a key in between"):
        suggestion(strolling, ahead(1000.0))


def test_the_farthest_that_is_named_is_not_refused_for_itself():
    gallery = store.of_tracks(tracks_of([even(200, pace=6.0)]))  # six windows of 30 m, but 100 m is the most
    with pytest.raises(Unreachable, match="about 100 m"):
        propose(gallery, ahead(120.0), PathRequest())
    assert propose(gallery, ahead(95.0), PathRequest())


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("entry", range(6))
def test_places_that_are_not_finite_are_refused(marching, value, entry):
    numbers = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    numbers[entry] = value
    query = Query(tuple(numbers[:3]), tuple(numbers[3:]))
    for call in (lambda: propose(marching, query, PathRequest()), lambda: suggestion(marching, query)):
        with pytest.raises(InputError, match="not a finite position"):
            call()


def test_demands_that_contradict_one_another_are_refused(marching):
    with pytest.raises(InputError, match="speed 'fast' and a number of frames"):
        PathRequest(steps=30, speed="fast")
    for steps in (0, -3, LONGEST_GAP + 1):
        with pytest.raises(InputError, match=f"1 to {LONGEST_GAP} frames at 30 Hz, got {steps}"):
            propose(marching, ahead(1.0), PathRequest(steps=steps))


@pytest.mark.parametrize("metres", [0.0, 2.0, 9.0])
def test_unknown_styles_and_speeds_are_refused_with_the_known_ones(marching, metres):
    for call in (propose, suggestion):
        with pytest.raises(InputError, match="no trajectory in style 'Proud'; it has Old, Young"):
            call(
                marching, ahead(metres), *([PathRequest(style="Proud")] if call is propose else [EndStates(), "Proud"])
            )
    with pytest.raises(InputError, match="unknown speed 'quick'; use fast, medium, slow"):
        propose(marching, ahead(metres), PathRequest(speed="quick"))


def test_the_suggestion_holds_what_the_gallery_walks():
    gallery = store.of_tracks(tracks_of([even(150)]))
    assert suggestion(gallery, ahead(2.0)).steps == pytest.approx(50, abs=2)
    assert suggestion(gallery, ahead(9.0)).steps == pytest.approx(225, abs=10)
    with pytest.raises(Unreachable):
        suggestion(gallery, ahead(2.0, (1.6, 1.6)))


def test_windows_are_weighed_once_each_the_best_by_equation_7_among_them(wandering):
    query = ahead(1.0, (0.2, 0.1))
    pool = gather(wandering, query, EndStates(), (SHORTEST_WINDOW, LONGEST_WINDOW), None, np.random.default_rng(0))
    rows = set(zip(pool.found.start, pool.found.steps, pool.found.mirrored, strict=True))
    assert len(rows) == len(pool) > 100
    top = wandering.search(window_query(query, (SHORTEST_WINDOW, LONGEST_WINDOW), None), 64)
    assert set(zip(top.start, top.steps, top.mirrored, strict=True)) <= rows
    assert pool.weights.max() == 1.0
    np.testing.assert_allclose(pool.cost - pool.misfit, DURATION_PRIOR * np.log(pool.found.steps))
    assert (pool.misfit >= 0.5 * np.square(pool.found.error / TURN * 2.0 * np.pi / Costs().facing) - 1e-9).all()
    np.testing.assert_allclose(pool.sketch[:, -1], np.broadcast_to([0.0, 1.0], (len(pool), 2)), atol=1e-9)
