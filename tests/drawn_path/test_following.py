"""Following a drawn line: exact ends, its timing from steps, times and gallery, its facings, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy import ndarray

from interpose.drawn_path import curve, pacing
from interpose.drawn_path.following import follow
from interpose.drawn_path.path_file import DrawnPath
from interpose.errors import InputError
from interpose.gallery import proposals, store, weighing
from interpose.gallery.matching import Query
from interpose.gallery.proposals import LONGEST_GAP, PathRequest
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import Tracks
from interpose.gallery.weighing import EndStates

RATE = 30.0
NOTHING = EndStates()
angles = st.one_of(st.sampled_from([0.0, np.pi, -np.pi, np.pi / 2.0, 7.0]), st.floats(-4.0, 4.0))
places = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
queries = st.builds(lambda a, b, c, d: Query((*a, b), (*c, d)), places, angles, places, angles)


def walk(frames: int, pace: float, turning: float = 0.0, facing: float = 0.0) -> ndarray:
    """A track at an even pace (m/s) that turns by ``turning`` rad/s, looking ``facing`` away from where it goes."""
    heading = turning / RATE * np.arange(frames)
    step = pace / RATE * np.stack([np.sin(heading), np.cos(heading)], axis=-1)
    return np.concatenate([np.cumsum(step, axis=0), (heading + facing)[:, None]], axis=-1)


def tracks_of(clips: list[tuple[str, ndarray]]) -> Tracks:
    """Tracks without postures."""
    styles = tuple(sorted({style for style, _ in clips}))
    stops = np.cumsum([len(track) for _, track in clips])
    return Tracks(
        np.concatenate([track for _, track in clips]).astype(np.float32),
        np.zeros((int(stops[-1]), 16), dtype=np.float16),
        np.stack([np.append(0, stops[:-1]), stops], axis=-1),
        np.array([styles.index(style) for style, _ in clips], dtype=np.int64),
        styles,
    )


@pytest.fixture(scope="module")
def gallery() -> Gallery:
    """Walks at 0.9, 1.2 and 1.8 m/s and runs at 3 to 4, straight and round, forward, sideways and back."""
    clips = [("walk", walk(160, pace, turning)) for pace in (0.9, 1.2, 1.8) for turning in (0.0, 0.8, 1.6)]
    clips += [("walk", walk(160, 0.8, turning, facing)) for facing in (np.pi, np.pi / 2.0) for turning in (0.0, 0.8)]
    clips += [("run", walk(120, pace, turning)) for pace in (3.0, 4.0) for turning in (0.0, 1.5)]
    rest = walk(150, 1.2)
    rest[:, 1] = np.cumsum(1.2 / RATE * np.clip(np.arange(150) / 30.0, 0.0, 1.0))
    return store.of_tracks(tracks_of([*clips, ("walk", rest)]))


@pytest.fixture(scope="module")
def turns() -> Gallery:
    """Turns on the spot."""
    spin = np.zeros((120, 3))
    spin[:, 2] = np.arange(120) / 30.0
    return store.of_tracks(tracks_of([("turn", spin)]))


def speeds(path: ndarray) -> ndarray:
    return np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1) * RATE


def heading(path: ndarray) -> ndarray:
    steps = np.diff(path[:, :2], axis=0)
    return np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))


def assert_meets(path: ndarray, query: Query) -> None:
    np.testing.assert_array_equal(path[0], query.start)
    np.testing.assert_array_equal(path[-1, :2], query.target[:2])
    turned = (path[-1, 2] - query.target[2]) / (2.0 * np.pi)
    assert abs(turned - round(turned)) < 1e-12
    assert np.isfinite(path).all()


def line_of(points: list[tuple[float, float]]) -> DrawnPath:
    """What `read` would give: neighbours that repeat are left out."""
    kept = [
        p for i, p in enumerate(points) if i == 0 or np.hypot(p[0] - points[i - 1][0], p[1] - points[i - 1][1]) > 1e-5
    ]
    return DrawnPath(np.array(kept))


# Ends, for any line


@given(queries, st.lists(places, min_size=1, max_size=6), st.integers(150, 400), st.data())
def test_both_ends_are_exact_and_the_steps_as_asked(query, points, steps, data) -> None:
    line = line_of(points)
    if data.draw(st.booleans()):
        line = DrawnPath(line.points, None, np.unwrap([data.draw(angles) for _ in line.points]))
    path = follow(None, line, query, PathRequest(steps), NOTHING)
    assert path.shape == (steps + 1, 3)
    assert_meets(path, query)
    assert np.abs(np.diff(path[:, 2])).max() < 0.5


@settings(max_examples=20)
@given(queries, st.lists(places, min_size=1, max_size=3))
def test_both_ends_are_exact_with_a_gallery(gallery: Gallery, query, points) -> None:
    path = follow(gallery, line_of(points), query, PathRequest(style="walk"), NOTHING)
    assert_meets(path, query)
    assert 1 <= len(path) - 1 <= LONGEST_GAP
    again = follow(gallery, line_of(points), query, PathRequest(style="walk"), NOTHING)
    np.testing.assert_array_equal(path, again)


@given(
    queries,
    st.lists(places, min_size=1, max_size=4),
    st.lists(st.floats(1.0, 3.0), min_size=4, max_size=4),
    st.integers(250, 500),
)
def test_both_ends_are_exact_with_times(query, points, pauses, steps) -> None:
    assume(np.hypot(points[0][0] - query.start[0], points[0][1] - query.start[1]) > 0.35)
    line = line_of(points)
    timed = DrawnPath(line.points, np.cumsum(pauses)[: len(line.points)])
    path = follow(None, timed, query, PathRequest(steps), NOTHING)
    assert_meets(path, query)
    assert len(path) == steps + 1


@given(queries, st.lists(places, min_size=2, max_size=6), st.floats(1.0, 12.0))
def test_arc_lengths_never_fall(query, points, seconds) -> None:
    line = curve.through(np.array(points), query.start[2])
    made = pacing.progress(line, pacing.evenly(line, seconds), (0.0, 1.4))
    for steps in (1, 7, 90):
        arc = made.sampled(steps)
        assert arc[0] == 0.0
        assert arc[-1] == pytest.approx(line.length)
        assert (np.diff(arc) >= 0.0).all()
    assert made.duration >= seconds - 1e-9
    assert pacing.pieces(line)[-1] == len(line.arc) - 1


@pytest.mark.parametrize("steps", [1, 2, 3, 5, 9])
def test_few_steps(steps: int) -> None:
    query = Query((0.0, 0.0, 0.0), (0.0, 0.2, 0.5))
    path = follow(
        None, DrawnPath(np.array([[0.05, 0.1]])), query, PathRequest(steps), EndStates(None, (np.ones(2), np.ones(2)))
    )
    assert len(path) == steps + 1
    assert_meets(path, query)


def test_first_and_last_points_near_the_keys_stand_for_them() -> None:
    query = Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    near = follow(None, DrawnPath(np.array([[0.2, 0.0], [0.0, 2.0], [-0.2, 4.0]])), query, PathRequest(90), NOTHING)
    assert np.abs(near[:, 0]).max() < 0.03
    far = follow(None, DrawnPath(np.array([[0.5, 0.0], [0.0, 2.0], [-0.5, 4.0]])), query, PathRequest(120), NOTHING)
    assert np.linalg.norm(far[:, :2] - [0.5, 0.0], axis=-1).min() < 0.1
    assert np.linalg.norm(far[:, :2] - [-0.5, 4.0], axis=-1).min() < 0.1


def test_points_are_passed() -> None:
    points = np.array([[1.0, 1.0], [0.0, 2.5], [1.5, 4.0], [0.0, 5.0]])
    path = follow(None, DrawnPath(points), Query((0.0, 0.0, 0.0), (0.0, 6.0, 0.0)), PathRequest(300), NOTHING)
    away = np.linalg.norm(points[:, None] - path[None, :, :2], axis=-1).min(axis=1)
    assert away.max() < 0.08


def test_a_hand_drawn_line_is_walked_without_a_tremble() -> None:
    at = np.linspace(0.0, 1.0, 500)
    points = np.stack([np.sin(5.0 * at), 6.0 * at], axis=-1)
    noisy = points + np.random.default_rng(1).normal(0.0, 0.004, points.shape)
    query = Query((0.0, 0.0, 0.7), (float(points[-1, 0]), 6.0, 0.2))
    even, path = (follow(None, DrawnPath(line), query, PathRequest(200), NOTHING) for line in (points, noisy))
    assert np.abs(even - path)[:, :2].max() < 0.03
    assert np.abs(np.diff(speeds(path))).max() < 0.05
    assert np.abs(np.diff(path[:, 2], n=2)).max() * RATE**2 < 12.0


# Timing


@pytest.mark.parametrize(
    ("style", "speed", "metres"),
    [(None, None, 3.0), ("run", None, 3.0), *(("walk", s, m) for s in (None, "fast", "slow") for m in (1.0, 2.0, 3.5))],
)
def test_a_straight_line_takes_what_the_gallery_says(gallery: Gallery, style, speed, metres) -> None:
    query, asked = Query((0.0, 0.0, 0.0), (0.0, metres, 0.0)), PathRequest(style=style, speed=speed)
    matched = proposals.propose(gallery, query, asked)[0].steps
    steps = len(follow(gallery, DrawnPath(np.array([[0.0, metres / 2.0]])), query, asked, NOTHING)) - 1
    assert steps == pytest.approx(matched, rel=0.15, abs=2)


def test_a_longer_way_takes_longer_and_a_run_less(gallery: Gallery) -> None:
    query = Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    short, bow = DrawnPath(np.array([[0.0, 2.0]])), DrawnPath(np.array([[1.5, 1.0], [2.0, 2.0], [1.5, 3.0]]))

    def steps(line: DrawnPath, **asked: str) -> int:
        return len(follow(gallery, line, query, PathRequest(**asked), NOTHING)) - 1

    assert steps(bow, style="walk") > 1.2 * steps(short, style="walk")
    assert steps(bow, style="run") < 0.6 * steps(bow, style="walk")
    assert steps(bow, style="walk", speed="fast") < steps(bow, style="walk") <= steps(bow, style="walk", speed="slow")


def test_the_speed_has_no_jumps(gallery: Gallery) -> None:
    square = DrawnPath(np.array([[0.0, 3.0], [3.0, 3.0], [3.0, 0.0]]))
    path = follow(gallery, square, Query((0.0, 0.0, 0.0), (0.0, 0.0, -np.pi / 2.0)), PathRequest(), NOTHING)
    assert np.abs(np.diff(speeds(path))).max() * RATE < 6.0
    assert np.linalg.norm(np.diff(path[:, :2], n=2, axis=0), axis=-1).max() * RATE**2 < 9.0


def test_corners_are_slowed_for() -> None:
    query = Query((0.0, 0.0, 0.0), (0.5, 0.0, np.pi))
    path = follow(None, DrawnPath(np.array([[0.0, 4.0], [0.5, 4.0]])), query, PathRequest(120), NOTHING)
    turning = np.argmax(np.abs(np.diff(path[:, 2])))
    assert speeds(path)[turning] < 0.6 * speeds(path).max()
    assert np.abs(np.diff(path[:, 2])).max() * RATE < 6.0


def test_given_steps_scale_the_gallery_s_timing(gallery: Gallery) -> None:
    query = Query((0.0, 0.0, 0.0), (2.0, 4.0, 1.0))
    line = DrawnPath(np.array([[0.0, 2.0], [1.0, 3.0]]))
    suggested = follow(gallery, line, query, PathRequest(), NOTHING)
    slower = follow(gallery, line, query, PathRequest(2 * (len(suggested) - 1)), NOTHING)
    np.testing.assert_allclose(slower[::2, :2], suggested[:, :2], atol=0.1)


def test_known_velocities_are_met(gallery: Gallery) -> None:
    velocities = np.array([0.6, 0.9]), np.array([0.0, 0.0])
    query = Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    for asked in (PathRequest(), PathRequest(100)):
        path = follow(gallery, DrawnPath(np.array([[0.0, 2.0]])), query, asked, EndStates(None, velocities))
        np.testing.assert_allclose((path[1] - path[0])[:2] * RATE, velocities[0], atol=0.05)
        np.testing.assert_allclose((path[-1] - path[-2])[:2] * RATE, velocities[1], atol=0.05)
        assert np.linalg.norm(np.diff(path[:, :2], n=2, axis=0), axis=-1).max() * RATE**2 < 9.0


def test_points_are_passed_at_their_times_and_these_scale_with_the_steps() -> None:
    points, times = np.array([[0.0, 0.1], [0.0, 2.0], [2.0, 3.0], [4.0, 3.1]]), np.array([0.0, 1.0, 3.0, 4.0])
    line, query = DrawnPath(points, times), Query((0.0, 0.0, 0.0), (4.0, 3.0, 1.0))
    path = follow(None, line, query, PathRequest(), NOTHING)
    assert len(path) == 121
    np.testing.assert_allclose(path[[30, 90], :2], points[1:3], atol=0.08)
    longer = follow(None, line, query, PathRequest(240), NOTHING)
    assert len(longer) == 241
    np.testing.assert_allclose(longer[[60, 180], :2], points[1:3], atol=0.08)


def test_a_first_time_is_a_wait_and_the_last_pace_leads_to_the_target() -> None:
    line = DrawnPath(np.array([[0.0, 0.0], [0.0, 2.0]]), np.array([1.0, 3.0]))
    path = follow(None, line, Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0)), PathRequest(), NOTHING)
    assert len(path) == pytest.approx(151, abs=1)
    assert np.abs(path[:24, 1]).max() < 0.05
    np.testing.assert_allclose(path[90, 1], 2.0, atol=0.1)


def test_times_come_before_speed_and_gallery(gallery: Gallery) -> None:
    line = DrawnPath(np.array([[0.0, 4.0]]), np.array([4.0]))
    query = Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    assert len(follow(gallery, line, query, PathRequest(speed="fast"), NOTHING)) == 121


def test_in_place(gallery: Gallery) -> None:
    query = Query((1.0, 1.0, 0.0), (1.0, 1.0, 2.5))
    for line in (DrawnPath(np.array([[1.0, 1.0]])), DrawnPath(np.array([[1.1, 1.0]]), None, np.array([1.0]))):
        path = follow(None, line, query, PathRequest(40), NOTHING)
        assert_meets(path, query)
        assert np.abs(path[:, :2] - 1.0).max() < 0.02
        assert (np.diff(path[:, 2]) >= 0.0).all()
    assert_meets(follow(gallery, DrawnPath(np.array([[1.2, 1.0], [1.0, 1.4]])), query, PathRequest(), NOTHING), query)


def test_turning_on_the_spot_takes_the_gallery_s_time(turns: Gallery) -> None:
    query = Query((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    path = follow(turns, DrawnPath(np.array([[0.0, 0.0]])), query, PathRequest(), NOTHING)
    assert len(path) - 1 == proposals.suggestion(turns, query).steps


# Facings


def bow(facing: float, end: float | None = None) -> tuple[DrawnPath, Query]:
    """A quarter of a circle to the right, begun and ended looking ``facing`` and ``end`` away from it."""
    angle = np.linspace(0.0, np.pi / 2.0, 8)
    points = 3.0 * np.stack([1.0 - np.cos(angle), np.sin(angle)], axis=-1)
    last = facing if end is None else end
    return DrawnPath(points), Query((0.0, 0.0, facing), (3.0, 3.0, np.pi / 2.0 + last))


@pytest.mark.parametrize("facing", [0.0, np.pi, -np.pi / 2.0, 1.0])
def test_somebody_who_walks_backward_or_sideways_keeps_doing_so(facing: float) -> None:
    path = follow(None, *bow(facing), PathRequest(120), NOTHING)
    away = path[:-1, 2] - heading(path) - facing
    assert np.abs((away + np.pi) % (2.0 * np.pi) - np.pi).max() < 0.25


def test_a_key_that_looks_elsewhere_is_turned_from_and_to(gallery: Gallery) -> None:
    for start, end in ((2.0, 0.0), (0.0, -2.5), (2.0, -1.6)):
        path = follow(None, *bow(start, end), PathRequest(150), NOTHING)
        away = path[:-1, 2] - heading(path)
        assert np.abs(away[60:90]).max() < 0.3
        assert away[0] == pytest.approx(start, abs=0.15)
        assert away[-1] == pytest.approx(end, abs=0.15)
        assert np.abs(np.diff(path[:, 2])).max() * RATE < 5.0


@given(angles, angles)
def test_nobody_spins(first: float, last: float) -> None:
    line, query = bow(first, last)
    path = follow(None, line, query, PathRequest(150), NOTHING)
    assert_meets(path, query)
    assert np.ptp(path[:, 2]) < np.pi / 2.0 + 2.0 * np.pi + 0.2
    assert abs(path[-1, 2] - path[0, 2]) < np.pi / 2.0 + 2.0 * np.pi + 0.2


def test_given_facings_are_taken_up_smoothly() -> None:
    points = np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]])
    facing = np.array([1.5, 0.0, -1.5])
    path = follow(
        None, DrawnPath(points, None, facing), Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0)), PathRequest(240), NOTHING
    )
    at = [int(np.argmin(np.abs(path[:, 1] - z))) for z in (1.0, 2.0, 3.0)]
    np.testing.assert_allclose(path[at, 2], facing, atol=0.12)
    assert np.abs(np.diff(path[:, 2])).max() * RATE < 3.0
    assert np.abs(np.diff(path[:, 2], n=2)).max() * RATE**2 < 8.0


def test_given_facings_take_the_shorter_way_to_the_target() -> None:
    line = DrawnPath(np.array([[0.0, 2.0]]), None, np.array([3.0]))
    path = follow(None, line, Query((0.0, 0.0, 2.8), (0.0, 4.0, -3.0)), PathRequest(120), NOTHING)
    assert path[-1, 2] == pytest.approx(2.0 * np.pi - 3.0)
    assert np.ptp(path[:, 2]) < 0.6


# What is refused


def test_no_time_that_could_be_had(turns: Gallery) -> None:
    line, query = DrawnPath(np.array([[0.0, 2.0]])), Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    for gallery in (None, turns):
        with pytest.raises(InputError, match=r"the drawn path.s duration is not known .*; give a number of frames"):
            follow(gallery, line, query, PathRequest(), NOTHING)
        path = follow(gallery, line, query, PathRequest(100), NOTHING)
        assert speeds(path).max() < 1.05 * speeds(path).min()


def test_styles_and_speeds_that_are_not_there(gallery: Gallery) -> None:
    line, query = bow(0.0)
    with pytest.raises(InputError, match="no trajectory in style 'crawl'; it has run, walk"):
        follow(gallery, line, query, PathRequest(style="crawl"), NOTHING)
    with pytest.raises(InputError, match="unknown speed 'brisk'"):
        follow(gallery, line, query, PathRequest(speed="brisk"), NOTHING)


def test_too_long_and_too_fast(gallery: Gallery) -> None:
    query = Query((0.0, 0.0, 0.0), (0.0, 60.0, 0.0))
    with pytest.raises(InputError, match=r"takes [3-7]\d\.\d s, which is \d+ frames at 30 Hz; a gap has at most 600"):
        follow(gallery, DrawnPath(np.array([[0.0, 30.0]])), query, PathRequest(style="walk"), NOTHING)
    with pytest.raises(InputError, match=r"goes 1[2-9]\.\d m/s at x 0\.00, z \d+\.\d+"):
        follow(None, DrawnPath(np.array([[0.0, 30.0]])), query, PathRequest(130), NOTHING)
    with pytest.raises(InputError, match=r"is 400 m long, which takes more than 600 frames"):
        follow(None, DrawnPath(np.array([[0.0, 230.0]])), query, PathRequest(600), NOTHING)
    with pytest.raises(InputError, match=r"is \d+ m long"):
        follow(
            None, DrawnPath(np.random.default_rng(0).uniform(-1e4, 1e4, (10_000, 2))), query, PathRequest(600), NOTHING
        )
    with pytest.raises(InputError, match="at most 600"):
        follow(None, DrawnPath(np.array([[0.0, 60.0]]), np.array([21.0])), query, PathRequest(), NOTHING)


def test_steps_and_places_that_are_none() -> None:
    line, query = bow(0.0)
    for steps in (0, -5, 601):
        with pytest.raises(InputError, match=f"1 to 600 frames at 30 Hz, got {steps}"):
            follow(None, line, query, PathRequest(steps), NOTHING)
    with pytest.raises(InputError, match="not a finite position"):
        follow(None, line, Query((0.0, np.nan, 0.0), (0.0, 4.0, 0.0)), PathRequest(60), NOTHING)


def test_times_that_do_not_fit_the_keys() -> None:
    query = Query((0.0, 0.0, 0.0), (0.0, 4.0, 0.0))
    with pytest.raises(InputError, match=r"1\.00 m from the start key at 0 s"):
        follow(None, DrawnPath(np.array([[0.0, 1.0]]), np.array([0.0])), query, PathRequest(), NOTHING)
    with pytest.raises(InputError, match="do not say how fast it goes to the target"):
        follow(None, DrawnPath(np.array([[0.0, 0.1]]), np.array([1.0])), query, PathRequest(), NOTHING)


def test_a_long_winding_line_asks_the_gallery_little(gallery: Gallery, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    gather = weighing.gather
    monkeypatch.setattr(weighing, "gather", lambda *a, **k: asked.append(a) or gather(*a, **k))
    at = np.linspace(0.0, 40.0, 400)
    line = DrawnPath(np.stack([2.0 * np.sin(at), at], axis=-1))
    path = follow(gallery, line, Query((0.0, 0.0, 1.0), (0.0, 40.0, 1.0)), PathRequest(600, style="walk"), NOTHING)
    assert len(path) == 601
    assert 10 <= len(asked) <= 40
