"""Joint limits: knees and elbows bend one way, nothing goes under the floor, keys and sound motion stay as they are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from strategies import quaternions

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.runtime import joint_limits
from interpose.skeleton import HUMANOID

KNEE, ANKLE, ELBOW, HAND = (HUMANOID.index(name) for name in ("LeftLeg", "LeftFoot", "RightForeArm", "RightHand"))
HIGHER = [joint for joint, name in enumerate(HUMANOID.names) if not name.endswith(("Foot", "Toe"))]
"""Feet are the foot lock's."""


def bent(joint: int, angles: ndarray, axis: int = 0) -> tuple[ndarray, ndarray]:
    """A T-pose whose ``joint`` turns by those angles about an axis, one a frame: roots and local rotations."""
    local = np.tile(rotation.IDENTITY, (1, len(angles), len(HUMANOID), 1))
    turns = np.zeros((len(angles), 3))
    turns[:, axis] = angles
    local[0, :, joint] = rotation.from_rotation_vector(turns)
    return np.tile([0.0, 1.0, 0.0], (1, len(angles), 1)), local


def places(root: ndarray, local: ndarray) -> tuple[ndarray, ndarray]:
    world = kinematics.global_rotations(local, HUMANOID.parents)
    return kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets), world


def behind(root: ndarray, local: ndarray) -> ndarray:
    """Metres of the left knee behind the straight from hip to ankle, where the leg's own back is -Z."""
    where, world = places(root, local)
    hip, knee, ankle = (where[..., HUMANOID.index(name), :] for name in ("LeftUpLeg", "LeftLeg", "LeftFoot"))
    along = (ankle - hip) / np.linalg.norm(ankle - hip, axis=-1, keepdims=True)
    off = knee - hip - np.sum((knee - hip) * along, axis=-1, keepdims=True) * along
    return -np.sum(off * rotation.rotate(world[..., HUMANOID.index("LeftUpLeg"), :], rotation.FORWARD), axis=-1)


@given(st.floats(0.1, 1.5), quaternions())
def test_a_backward_knee_bends_forward_and_the_foot_stays(angle: float, turn: ndarray) -> None:
    root, local = bent(KNEE, np.array([0.0, -angle, -angle, 0.0]))
    local[..., 0, :] = turn
    made = joint_limits.hinged(root, local)
    assert behind(root, local)[0, 1] > 0.02
    assert behind(root, made).max() <= 0.02
    (before, old), (after, new) = places(root, local), places(root, made)
    np.testing.assert_allclose(after[..., ANKLE, :], before[..., ANKLE, :], atol=1e-3)
    assert rotation.angle(rotation.multiply(rotation.inverse(old[..., ANKLE, :]), new[..., ANKLE, :])).max() < 1e-6


def test_a_knee_that_swings_through_the_limit_does_not_jump() -> None:
    angles = 0.3 * np.sin(np.linspace(0.0, 4.0 * np.pi, 400))
    root, local = bent(KNEE, angles)
    made = places(root, joint_limits.hinged(root, local))[0][0, 10:-10, KNEE]
    plain = -behind(root, local)[0, 10:-10]
    assert (
        np.abs(np.diff(-behind(root, joint_limits.hinged(root, local))[0, 10:-10])).max()
        < 2.5 * np.abs(np.diff(plain)).max()
    )
    assert np.linalg.norm(np.diff(made, axis=0), axis=-1).max() < 0.006


@given(st.floats(0.2, 1.2))
def test_a_backward_elbow_bends_forward_and_the_hand_stays(angle: float) -> None:
    root, local = bent(ELBOW, np.array([0.0, -angle, 0.0]), axis=1)
    made = joint_limits.hinged(root, local)
    (before, _), (after, _) = places(root, local), places(root, made)
    assert after[0, 1, ELBOW, 2] < before[0, 1, ELBOW, 2] - 0.01
    np.testing.assert_allclose(after[..., HAND, :], before[..., HAND, :], atol=0.02)


@given(st.floats(0.0, 2.0))
def test_a_sound_knee_stays_as_it_is(angle: float) -> None:
    root, local = bent(KNEE, np.array([0.0, angle, 0.5 * angle, 0.0]))
    assert joint_limits.hinged(root, local) is local


def test_a_key_that_bends_backwards_is_left_without_a_jump() -> None:
    angles = np.full(30, -0.2)
    root, local = bent(KNEE, angles)
    made = joint_limits.hinged(root, local)
    np.testing.assert_array_equal(made[:, [0, -1]], local[:, [0, -1]])
    assert behind(root, made)[0, 15] <= 0.01 < behind(root, made)[0, 0]


@pytest.mark.parametrize("depth", [0.05, 0.4])
def test_a_body_under_the_floor_is_raised_smoothly(depth: float) -> None:
    frames = 41
    root, local = bent(KNEE, np.zeros(frames))
    lowest = places(root, local)[0][..., HIGHER, 1].min()
    sunk = root.copy()
    sunk[..., 1] -= lowest + depth * np.exp(-0.5 * ((np.arange(frames) - 20) / 4.0) ** 2)
    made = joint_limits.above_floor(sunk, local)
    assert places(made, local)[0][..., HIGHER, 1].min() >= -0.01
    np.testing.assert_array_equal(made[:, [0, -1]], sunk[:, [0, -1]])
    shaken, before = (np.abs(np.diff(root[0, :, 1], n=2)).max() for root in (made, sunk))
    assert shaken <= before + 1e-6


def test_keys_under_the_floor_keep_their_depth() -> None:
    root, local = bent(KNEE, np.zeros(9))
    root[..., 1] -= places(root, local)[0][..., 1].min() + 0.3
    np.testing.assert_allclose(joint_limits.above_floor(root, local), root)


def test_a_body_above_the_floor_stays() -> None:
    root, local = bent(KNEE, np.zeros(9))
    root[..., 1] += 0.5
    assert joint_limits.above_floor(root, local) is root
