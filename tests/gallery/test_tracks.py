"""Tracks and postures of motions, and the clips they come in."""

from itertools import pairwise

import numpy as np
import pytest
from gallery.walks import RATE, even, motion_along, moved, tracks_of, wander
from hypothesis import given
from hypothesis import strategies as st
from strategies import humanoid_motions

from interpose import rotation
from interpose.data import database
from interpose.data.database import ClipArrays, ClipInfo
from interpose.errors import InputError
from interpose.gallery.tracks import (
    POSTURE_POINTS,
    POSTURE_SIZE,
    from_database,
    from_motions,
    mirror_posture,
    posture_distance,
    posture_of,
    track_of,
    without_jumps,
)
from interpose.motion import Motion, mirror
from interpose.skeleton import HUMANOID


def whole_turns(angles):
    """Angles without their whole turns, in [-pi, pi)."""
    return np.remainder(angles + np.pi, 2.0 * np.pi) - np.pi


def elsewhere(motion, angle, x, z):
    """The motion turned about the origin and moved along the ground."""
    q = rotation.from_rotation_vector(np.array([0.0, angle, 0.0]))
    turned = motion.local_rotations.copy()
    turned[:, 0] = rotation.multiply(np.broadcast_to(q, turned[:, 0].shape), turned[:, 0])
    return Motion(HUMANOID, rotation.rotate(q, motion.root_positions) + np.array([x, 0.0, z]), turned, RATE)


def test_the_track_of_a_motion_is_where_its_hips_stand_and_face():
    track = wander(200, 1)
    track[:, 2] += np.linspace(0.0, 15.0, 200)
    found = track_of(motion_along(track))
    np.testing.assert_allclose(found[:, :2], track[:, :2], atol=1e-12)
    np.testing.assert_allclose(np.diff(found[:, 2]), np.diff(track[:, 2]), atol=1e-9)
    np.testing.assert_allclose(whole_turns(found[:, 2] - track[:, 2]), 0.0, atol=1e-9)


@given(humanoid_motions())
def test_a_mirrored_motion_has_the_mirrored_track_and_posture(motion):
    there, seen = track_of(motion), track_of(mirror(motion))
    np.testing.assert_array_equal(seen[:, :2], there[:, :2] * [-1.0, 1.0])
    np.testing.assert_allclose(np.exp(1j * seen[:, 2]), np.exp(-1j * there[:, 2]), atol=1e-6)
    np.testing.assert_allclose(posture_of(mirror(motion)), mirror_posture(posture_of(motion)), atol=1e-4)


def test_mirroring_a_posture_twice_changes_nothing_and_once_exchanges_the_hands():
    posture = np.random.default_rng(0).normal(size=(3, POSTURE_SIZE))
    seen = mirror_posture(posture)
    np.testing.assert_array_equal(mirror_posture(seen), posture)
    left = 1 + 3 * POSTURE_POINTS.index("LeftHand")
    right = 1 + 3 * POSTURE_POINTS.index("RightHand")
    np.testing.assert_array_equal(seen[:, left : left + 3], posture[:, right : right + 3] * [-1.0, 1.0, 1.0])
    np.testing.assert_array_equal(seen[:, 0], posture[:, 0])


def test_a_posture_is_the_same_wherever_and_however_the_figure_stands():
    motion = motion_along(wander(60, 2))
    for angle, x, z in ((0.7, 3.0, -2.0), (np.pi, 0.0, 50.0)):
        np.testing.assert_allclose(posture_of(elsewhere(motion, angle, x, z)), posture_of(motion), atol=1e-9)


def test_the_posture_of_the_rest_pose_is_read_off_the_skeleton():
    rest = Motion(HUMANOID, np.array([[2.0, 0.9, 1.0]]), np.tile(rotation.IDENTITY, (1, len(HUMANOID), 1)), RATE)
    places = rest.global_positions()[0]
    posture = posture_of(rest)[0]
    assert posture[0] == 0.9
    for i, name in enumerate(POSTURE_POINTS):
        np.testing.assert_allclose(
            posture[1 + 3 * i : 4 + 3 * i], places[HUMANOID.index(name)] - [2.0, 0.0, 1.0], atol=1e-12
        )
    assert (
        posture[1 + 3 * POSTURE_POINTS.index("LeftHand")]
        > 0.3
        > -0.3
        > posture[1 + 3 * POSTURE_POINTS.index("RightHand")]
    )


@given(st.floats(0.0, 3.0), st.integers(0, 5))
def test_postures_whose_points_are_all_equally_far_apart_are_that_far_apart(metres, seed):
    rng = np.random.default_rng(seed)
    posture = rng.normal(size=POSTURE_SIZE)
    way = rng.normal(size=(len(POSTURE_POINTS), 3))
    way *= metres / np.linalg.norm(way, axis=-1, keepdims=True)
    other = posture + np.concatenate([[metres], way.reshape(-1)])
    np.testing.assert_allclose(posture_distance(posture, other), metres, atol=1e-12)
    np.testing.assert_array_equal(posture_distance(posture, other), posture_distance(other, posture))
    assert posture_distance(posture, posture) == 0.0


def test_a_window_is_cut_with_both_its_ends_as_it_lies_or_in_the_mirror():
    tracks = tracks_of([wander(50, 0), wander(60, 1)])
    there, seen = tracks.cut(55, 20, False), tracks.cut(55, 20, True)
    np.testing.assert_array_equal(there, tracks.root[55:76].astype(float))
    np.testing.assert_array_equal(seen, there * [-1.0, 1.0, -1.0])
    assert len(tracks) == 110


def test_clips_of_motions_follow_one_another_each_from_the_origin():
    ways = [moved(wander(40, 0), 0.3, 500.0, -800.0), moved(wander(25, 1), 2.0, 3.0, 1.0), even(30)]
    motions = [motion_along(way, seed) for seed, way in enumerate(ways)]
    tracks = from_motions(motions, ["Young", "Old", "Young"])
    assert tracks.styles == ("Old", "Young")
    assert tracks.clip_styles.tolist() == [1, 0, 1]
    assert tracks.ranges.tolist() == [[0, 40], [40, 65], [65, 95]]
    for motion, (start, stop) in zip(motions, tracks.ranges, strict=True):
        track = track_of(motion)
        np.testing.assert_allclose(tracks.root[start:stop], track - [*track[0, :2], 0.0], atol=1e-6)
        np.testing.assert_allclose(tracks.posture[start:stop], posture_of(motion), atol=2e-3)


@pytest.fixture
def data(tmp_path):
    """Three clips of 50, 30 and 40 frames in two styles."""
    motions = [motion_along(moved(wander(n, n), 0.0, 9.0, 9.0), n) for n in (50, 30, 40)]
    infos = [ClipInfo(f"{i}", "", style, "", "", RATE, 1, (0, 1), 0.0) for i, style in enumerate("yox")]
    arrays = [
        ClipArrays(
            motion.root_positions.astype(np.float32),
            motion.local_rotations.astype(np.float32),
            np.zeros((len(motion), 4), np.float32),
            np.zeros((len(motion), 4), np.uint8),
        )
        for motion in motions
    ]
    announced = [(info, len(motion)) for info, motion in zip(infos, motions, strict=True)]
    return database.write(tmp_path / "db", announced, arrays, dataset="walks", licence="CC0")


def test_a_database_gives_the_tracks_of_its_clips(data):
    tracks = from_database(data)
    told = from_motions([data.clip(i) for i in range(3)], ["y", "o", "x"])
    for name in ("root", "posture", "ranges", "clip_styles"):
        np.testing.assert_array_equal(getattr(tracks, name), getattr(told, name))
    assert tracks.styles == told.styles == ("o", "x", "y")


def test_ranges_of_a_database_keep_the_styles_of_their_clips(data):
    tracks = from_database(data, [(0, 20), (20, 50), (85, 119)])
    told = from_motions([data.clip(0)[:20], data.clip(0)[20:], data.clip(2)[5:39]], ["y", "y", "x"])
    assert tracks.styles == told.styles == ("x", "y")
    for name in ("root", "posture", "ranges", "clip_styles"):
        np.testing.assert_array_equal(getattr(tracks, name), getattr(told, name))


@pytest.mark.parametrize("change", ["place", "yaw", "outlier"])
def test_a_track_is_cut_where_it_jumps(change):
    track = wander(200, 3)
    assert without_jumps(track) == [(0, 200)]
    if change == "place":
        track[80:, :2] += 0.5
    elif change == "yaw":
        track[80:, 2] += 2.0
    else:
        track[80, 0] += 0.3
    ranges = without_jumps(track)
    assert all(b <= c for (_, b), (c, _) in pairwise(ranges))
    assert (ranges[0][0], ranges[-1][1]) == (0, 200)
    assert 75 < ranges[0][1] <= 80 <= ranges[-1][0] < 85
    for start, stop in ranges:
        assert without_jumps(track[start:stop]) == [(0, stop - start)]


def test_a_motion_that_jumps_becomes_clips_of_its_own():
    track = wander(100, 3)
    track[60:, :2] += 3.0
    tracks = from_motions([motion_along(even(30)), motion_along(track)], ["Young", "Old"])
    assert len(tracks.ranges) == len(tracks.clip_styles) == 3
    assert tracks.clip_styles.tolist() == [1, 0, 0]
    np.testing.assert_array_equal(tracks.root[tracks.ranges[:, 0], :2], 0.0)
    np.testing.assert_array_equal(tracks.ranges[1:, 0], tracks.ranges[:-1, 1])
    assert tracks.ranges[-1, 1] == len(tracks) == len(tracks.posture)
    assert np.abs(np.diff(tracks.cut(30, 50, False)[:, :2], axis=0)).max() < 0.2


def test_motions_of_one_frame_each_make_no_tracks():
    with pytest.raises(InputError, match="no clip"):
        from_motions([motion_along(even(1))], ["walk"])
