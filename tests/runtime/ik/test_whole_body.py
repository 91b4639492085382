"""Inverse kinematics of a whole figure."""

from dataclasses import replace

import numpy as np
import pytest
from learning import march

from interpose import rotation
from interpose.runtime import target_parts
from interpose.runtime.ik.whole_body import Ease, JointTargets, solve
from interpose.skeleton import HUMANOID

EASE = Ease(np.ones(22), 0.05)
CLIP = march(40, 1.0, 0.3)


def wanted(pose, *names):
    joints = [HUMANOID.index(name) for name in names]
    at, turned = pose.global_positions()[0], pose.global_rotations()[0]
    return JointTargets({j: at[j] for j in joints}, {j: turned[j] for j in joints})


@pytest.mark.parametrize(
    "names",
    [("Hips",), ("LeftHand",), ("Spine1", "RightToe"), ("LeftLeg", "Head", "RightHand"), HUMANOID.names],
)
def test_what_is_wanted_of_a_possible_pose_is_met(names):
    goal = wanted(CLIP[30], *names)
    made, miss = solve(CLIP[10], goal, EASE)
    assert miss < 1e-7
    at, turned = made.global_positions()[0], made.global_rotations()[0]
    for joint in goal.positions:
        np.testing.assert_allclose(at[joint], goal.positions[joint], atol=1e-7)
        assert rotation.angle(rotation.multiply(rotation.inverse(turned[joint]), goal.rotations[joint])) < 1e-7


def test_no_more_moves_than_has_to():
    still, miss = solve(CLIP[10], wanted(CLIP[10], "Head", "LeftFoot"), EASE)
    assert miss < 1e-12
    np.testing.assert_allclose(still.local_rotations, CLIP[10].local_rotations, atol=1e-12)
    hand = HUMANOID.index("LeftHand")
    at = CLIP[10].global_positions()[0]
    aside = np.cross(at[hand] - at[hand - 2], [0.0, 1.0, 0.0])  # across the arm
    near = JointTargets({hand: at[hand] + 0.02 * aside / np.linalg.norm(aside)}, {})
    made, _ = solve(CLIP[10], near, target_parts.EASE)
    apart = np.linalg.norm(made.global_positions()[0] - at, axis=-1)
    assert apart[hand] == pytest.approx(0.02, abs=1e-6)
    assert apart[HUMANOID.index("RightFoot")] < 0.01


def test_an_axis_may_be_left_free():
    goal = JointTargets({0: np.array([1.0, np.nan, -2.0])}, {})
    made, miss = solve(CLIP[10], goal, EASE)
    assert miss < 1e-7
    np.testing.assert_allclose(made.root_positions[0], [1.0, CLIP[10].root_positions[0, 1], -2.0], atol=1e-7)


def test_joints_that_are_fixed_stay_and_what_cannot_be_reached_is_come_near_to():
    hand, arm = HUMANOID.index("LeftHand"), HUMANOID.index("LeftArm")
    only_arm = Ease(np.isin(np.arange(22), [arm, HUMANOID.index("LeftForeArm")]).astype(float), 0.0)
    away = CLIP[10].global_positions()[0, arm] + np.array([0.0, 0.0, 1.0])
    made, miss = solve(CLIP[10], JointTargets({hand: away}, {}), only_arm)
    assert miss == pytest.approx(1.0 - 0.582, abs=5e-3)
    np.testing.assert_array_equal(made.root_positions, CLIP[10].root_positions)
    others = [j for j in range(22) if j not in (arm, arm + 1)]
    np.testing.assert_allclose(made.local_rotations[:, others], CLIP[10].local_rotations[:, others], atol=1e-12)


def test_the_places_of_joints_that_a_file_animates_are_kept():
    moved = np.repeat(HUMANOID.offsets[None] * 1.1, 1, axis=0)
    moved[:, 0] = CLIP[10].root_positions
    pose = replace(CLIP[10], translations=moved)
    hand = HUMANOID.index("LeftHand")
    goal = pose.global_positions()[0, hand] + [0.1, 0.1, 0.0]
    made, miss = solve(pose, JointTargets({hand: goal}, {}), EASE)
    assert miss < 1e-7
    np.testing.assert_allclose(made.global_positions()[0, hand], goal, atol=1e-7)
    np.testing.assert_array_equal(made.translations[:, 1:], moved[:, 1:])
