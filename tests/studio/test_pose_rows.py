"""Poses as rows: there and back on any rig, and what is no pose is refused in words."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from strategies import motions
from studio_rigs import STAND, moved, walk

from interpose import rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.studio import pose_rows


@given(motions())
def test_any_motion_comes_back(motion: Motion) -> None:
    made = pose_rows.of_motion(motion)
    assert made.shape == (len(motion), pose_rows.width(motion))
    again = pose_rows.to_motion(made, motion, "it")
    assert again.skeleton == motion.skeleton
    assert again.rate == motion.rate
    np.testing.assert_allclose(again.root_positions, motion.root_positions, atol=1e-5)
    assert (
        rotation.angle(rotation.multiply(rotation.inverse(again.local_rotations), motion.local_rotations)) < 1e-6
    ).all()
    assert (again.translations is None) == (motion.translations is None)
    if motion.translations is not None:
        np.testing.assert_allclose(again.translations, motion.translations, atol=1e-5)


def test_a_row_is_the_root_then_the_turns_then_the_places_of_joints() -> None:
    motion = moved(walk())
    assert motion.translations is not None
    row = pose_rows.of_motion(motion)[2]
    assert row.dtype == np.float32
    np.testing.assert_array_equal(row[:3], motion.root_positions[2].astype(np.float32))
    np.testing.assert_array_equal(row[3:91], motion.local_rotations[2].astype(np.float32).ravel())
    np.testing.assert_array_equal(row[91:], motion.translations[2].astype(np.float32).ravel())


def test_the_place_of_the_root_is_told_once() -> None:
    motion = moved(walk())
    row = pose_rows.of_motion(motion)
    row[:, 91:94] += 5.0
    again = pose_rows.to_motion(row, motion, "it")
    assert again.translations is not None
    np.testing.assert_array_equal(again.translations[:, 0], again.root_positions)


def test_quaternions_are_made_unit_where_they_nearly_are() -> None:
    row = pose_rows.of_motion(STAND)
    row[0, 3:91] *= 1.009
    again = pose_rows.to_motion(row, STAND, "it")
    np.testing.assert_allclose(np.linalg.norm(again.local_rotations, axis=-1), 1.0, atol=1e-12)


@pytest.mark.parametrize("scale", [0.0, 0.98, 1.02, -1.02, 1e30])
def test_quaternions_that_are_not_unit_are_refused_with_their_place(scale: float) -> None:
    row = pose_rows.of_motion(walk())
    row[3, 3 + 4 * 5 : 7 + 4 * 5] *= scale
    with pytest.raises(InputError, match=r"^the pose: the rotation of RightUpLeg in frame 3 has the length"):
        pose_rows.to_motion(row, walk(), "the pose")


@pytest.mark.parametrize("shape", [(), (91,), (0, 91), (2, 90), (2, 92), (1, 2, 91), (0, 0), (91, 0)])
def test_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match=r"^start has the shape .*; it needs one row of 91 numbers"):
        pose_rows.to_motion(np.zeros(shape, np.float32), STAND, "start")


def test_what_is_too_far_away_is_refused() -> None:
    row = pose_rows.of_motion(moved(walk()))
    for column in (0, 2, 100):
        far = row.copy()
        far[1, column] = -2e5
        with pytest.raises(InputError, match="more than 100000 m from the origin"):
            pose_rows.to_motion(far, moved(walk()), "it")


def test_what_is_given_is_left_alone() -> None:
    row = pose_rows.of_motion(moved(walk()))
    row.setflags(write=False)
    again = pose_rows.to_motion(row, moved(walk()), "it")
    assert not np.shares_memory(again.root_positions, row)
