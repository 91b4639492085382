"""What windows of motion show of a style: the same from anywhere, in any direction, and in the mirror."""

import learning
import numpy as np
import pytest

from interpose import rotation
from interpose.data import style_windows
from interpose.motion import Motion, mirror
from interpose.skeleton import HUMANOID


@pytest.fixture(scope="module")
def motion() -> Motion:
    return learning.march(40, 1.1, 0.4)


def seen(motion: Motion) -> np.ndarray:
    return style_windows.style_channels(motion.root_positions, motion.local_rotations)


def test_place_and_direction_do_not_show(motion):
    turn = rotation.from_rotation_vector(np.array([0.0, 1.9, 0.0]))
    local = motion.local_rotations.copy()
    local[:, 0] = rotation.multiply(turn, local[:, 0])
    moved = rotation.rotate(turn, motion.root_positions) + np.array([5.0, 0.0, -3.0])
    np.testing.assert_allclose(style_windows.style_channels(moved, local), seen(motion), atol=1e-5)


def test_height_and_speed_show(motion):
    higher = style_windows.style_channels(motion.root_positions + np.array([0.0, 0.2, 0.0]), motion.local_rotations)
    np.testing.assert_allclose((higher - seen(motion))[:, 1:66:3], 0.2, atol=1e-5)
    hips = seen(motion)[:, 66:69]
    speed = np.linalg.norm(np.diff(motion.root_positions, axis=0), axis=-1) * 30.0
    np.testing.assert_allclose(np.linalg.norm(hips[1:], axis=-1), speed, atol=1e-4)
    assert (hips[:, 2] > 0.5).all()  # they walk ahead, which is +Z


def test_a_mirrored_motion_has_the_mirrored_channels(motion):
    signs = np.array(style_windows.MIRROR_SIGNS, dtype=np.float32)
    np.testing.assert_allclose(
        seen(mirror(motion)), seen(motion)[:, style_windows.MIRRORED_CHANNELS] * signs, atol=1e-5
    )
    assert style_windows.STYLE_CHANNELS == len(signs) == 6 * len(HUMANOID)


def test_a_database_is_seen_clip_by_clip(database):
    whole = style_windows.database_channels(database)
    start, stop = database.ranges[1].tolist()
    clip = database.clip(1)
    np.testing.assert_array_equal(whole[start:stop], seen(clip))
    assert np.linalg.norm(whole[start, 66:69]) < 5.0  # no jump from the clip before it


def test_windows_cover_every_frame_of_a_range_that_holds_one():
    assert style_windows.window_starts([(0, 100), (100, 120), (120, 180)], 60, 12).tolist() == [0, 12, 24, 36, 40, 120]
    assert style_windows.window_starts([(0, 59)], 60, 12).tolist() == []
