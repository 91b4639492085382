"""Two-bone inverse kinematics: bones keep their lengths, targets within reach are met, the knee keeps its plane."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from strategies import quaternions, vectors

from interpose import rotation
from interpose.runtime.ik.two_bone import soft_reach, two_bone_ik

THIGH, SHIN = 0.435, 0.4237
LENGTH = THIGH + SHIN
FORWARD = np.array([0.0, 0.0, 1.0])


def leg(bend: float, turn: ndarray) -> tuple[ndarray, ndarray, ndarray, ndarray]:
    """Hip, knee and ankle of a leg bent by ``bend`` radians towards ``turn``'s +Z, and that direction."""
    thigh = np.array([0.0, -THIGH * np.cos(bend / 2), THIGH * np.sin(bend / 2)])
    shin = np.array([0.0, -SHIN * np.cos(bend / 2), -SHIN * np.sin(bend / 2)])
    hip = np.array([0.3, 0.9, -0.2])
    knee = hip + rotation.rotate(turn, thigh)
    return hip, knee, knee + rotation.rotate(turn, shin), rotation.rotate(turn, FORWARD)


def solve(hip: ndarray, knee: ndarray, ankle: ndarray, target: ndarray, forward: ndarray) -> tuple[ndarray, ndarray]:
    """Where knee and ankle come to."""
    thigh, shin = two_bone_ik(hip, knee, ankle, target, forward)
    new_knee = hip + rotation.rotate(thigh, knee - hip)
    return new_knee, new_knee + rotation.rotate(shin, ankle - knee)


bends = st.one_of(st.sampled_from([0.0, 1e-9, 1e-4, 0.02]), st.floats(0.0, 2.6))


@given(bends, quaternions(), vectors(), st.floats(0.05, 0.9999))
def test_a_target_within_reach_is_met(bend: float, turn: ndarray, way: ndarray, share: float) -> None:
    hip, knee, ankle, forward = leg(bend, turn)
    direction = way if np.linalg.norm(way) > 1e-3 else FORWARD
    target = hip + direction / np.linalg.norm(direction) * share * LENGTH
    _, new_ankle = solve(hip, knee, ankle, target, forward)
    np.testing.assert_allclose(new_ankle, target, atol=1e-6)


@given(bends, quaternions(), vectors())
def test_a_target_out_of_reach_is_pointed_at(bend: float, turn: ndarray, way: ndarray) -> None:
    hip, knee, ankle, forward = leg(bend, turn)
    direction = way if np.linalg.norm(way) > 1e-3 else FORWARD
    direction = direction / np.linalg.norm(direction)
    new_knee, new_ankle = solve(hip, knee, ankle, hip + 2.0 * direction, forward)
    np.testing.assert_allclose(new_ankle, hip + LENGTH * direction, atol=1e-6)
    np.testing.assert_allclose(new_knee, hip + THIGH * direction, atol=1e-6)


@given(bends, quaternions())
def test_an_ankle_that_is_there_already_changes_nothing(bend: float, turn: ndarray) -> None:
    hip, knee, ankle, forward = leg(bend, turn)
    thigh, shin = two_bone_ik(hip, knee, ankle, ankle, forward)
    assert rotation.angle(thigh) < 1e-6
    assert rotation.angle(shin) < 1e-6


@given(st.floats(0.1, 2.6), quaternions(), st.floats(0.2, 0.99))
def test_the_knee_keeps_its_plane_and_side(bend: float, turn: ndarray, share: float) -> None:
    hip, knee, ankle, forward = leg(bend, turn)
    along = (ankle - hip) / np.linalg.norm(ankle - hip)
    hinge = np.cross(along, forward)
    new_knee, _ = solve(hip, knee, ankle, hip + along * share * LENGTH, forward)
    assert abs((new_knee - hip) @ hinge) < 1e-9
    assert (new_knee - hip) @ forward >= 0.0
    thigh, shin = two_bone_ik(hip, knee, ankle, hip + along * share * LENGTH, forward)
    np.testing.assert_allclose(rotation.rotate(thigh, hinge), hinge, atol=1e-6)  # both bones turn about the hinge alone
    np.testing.assert_allclose(rotation.rotate(shin, hinge), hinge, atol=1e-6)


def test_a_knee_bent_backwards_bends_forwards_when_the_leg_shortens() -> None:
    hip, knee, ankle, _ = leg(0.05, rotation.from_rotation_vector(np.array([0.0, np.pi, 0.0])))
    new_knee, new_ankle = solve(hip, knee, ankle, hip + np.array([0.0, -0.8, 0.0]), FORWARD)
    assert (new_knee - hip) @ FORWARD > 0.1
    np.testing.assert_allclose(new_ankle, hip + np.array([0.0, -0.8, 0.0]), atol=1e-9)


def test_legs_are_solved_frame_by_frame() -> None:
    frames = [leg(bend, rotation.IDENTITY) for bend in (0.3, 0.9, 1.5)]
    hip, knee, ankle, forward = (np.stack(part) for part in zip(*frames, strict=True))
    target = hip + np.array([0.1, -0.6, 0.1])
    thigh, shin = two_bone_ik(hip, knee, ankle, target, forward)
    for i in range(3):
        one_thigh, one_shin = two_bone_ik(hip[i], knee[i], ankle[i], target[i], forward[i])
        np.testing.assert_allclose(thigh[i], one_thigh, atol=1e-12)
        np.testing.assert_allclose(shin[i], one_shin, atol=1e-12)


@given(st.floats(0.1, LENGTH), st.floats(0.0, 2.0))
def test_reach_is_never_the_whole_length_unless_it_was(present: float, wanted: float) -> None:
    reach = soft_reach(np.array(wanted), np.array(present), LENGTH)
    assert reach <= max(present, LENGTH * (1.0 - 1e-5))
    assert reach <= wanted
    if wanted <= max(present, 0.98 * LENGTH):
        assert reach == wanted


def test_reach_grows_smoothly_into_full_extension() -> None:
    wanted = np.linspace(0.8, 1.0, 2001)
    reach = soft_reach(wanted, np.full(2001, 0.8), LENGTH)
    slope = np.diff(reach) / np.diff(wanted)
    assert np.all(slope >= 0.0)
    assert np.all(np.abs(np.diff(slope)) < 0.01)
