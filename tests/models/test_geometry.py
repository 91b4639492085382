"""The geometry of the training graph against NumPy's, which has tests of its own."""

import math

import numpy as np
import pytest
import torch

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.data import root
from interpose.models import geometry
from interpose.skeleton import HUMANOID


@pytest.fixture
def world():
    """(pose, joint, 4) global rotations of all kinds, hips lying and upside down among them."""
    q = np.random.default_rng(0).normal(size=(40, len(HUMANOID), 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def test_kinematics_agree_with_the_skeletons(world):
    hips = np.random.default_rng(1).normal(size=(40, 3))
    wanted = kinematics.global_positions(hips, world, HUMANOID.parents, HUMANOID.offsets)
    got = geometry.joint_positions(torch.tensor(hips), torch.tensor(rotation.to_matrix(world)))
    np.testing.assert_allclose(got, wanted, atol=2e-5)


def test_facing_is_the_twist_of_the_hips(world):
    got = geometry.facing(torch.tensor(rotation.to_matrix(world)))
    yaw = root.pose_yaw(world)
    np.testing.assert_allclose(got, np.stack([np.sin(yaw), np.cos(yaw)], axis=-1), atol=2e-5)
    ahead = rotation.rotate(rotation.twist(world, np.array([0.0, 1.0, 0.0])), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(got, ahead[..., ::2], atol=2e-5)


def test_hips_upside_down_face_where_the_run_time_says():
    upside_down = rotation.from_rotation_vector(np.array([math.pi, 0.0, 0.0]))
    got = geometry.facing(torch.tensor(rotation.to_matrix(upside_down), dtype=torch.float32))
    yaw = float(root.pose_yaw(upside_down))
    np.testing.assert_allclose(got, [math.sin(yaw), math.cos(yaw)], atol=1e-6)


def test_the_root_frame_turns_the_facing_to_z_and_keeps_lengths_and_up():
    angle = torch.linspace(-3.0, 3.0, 25, dtype=torch.float64)
    direction = torch.stack([angle.sin(), angle.cos()], dim=-1)
    frame = geometry.root_frame(direction)
    ahead = torch.stack([direction[:, 0], torch.zeros_like(angle), direction[:, 1]], dim=-1)
    unit = torch.eye(3, dtype=torch.float64)
    turned = (ahead[:, None] @ frame)[:, 0]
    torch.testing.assert_close(turned, unit[2].expand(25, 3))
    torch.testing.assert_close(unit[1] @ frame, unit[1].expand(25, 3))
    torch.testing.assert_close(frame @ frame.transpose(1, 2), unit.expand(25, 3, 3))
    assert torch.all(torch.linalg.det(frame) > 0.0)


def test_six_numbers_are_the_first_two_columns(world):
    matrices = torch.tensor(rotation.to_matrix(world))
    six = geometry.to_six(matrices)
    np.testing.assert_allclose(six, rotation.to_6d(world), atol=1e-12)
    torch.testing.assert_close(geometry.to_matrix(six), matrices)


def test_any_six_numbers_give_the_rotation_that_numpy_finds():
    six = np.random.default_rng(2).normal(size=(5, 7, 6))
    got = geometry.to_matrix(torch.tensor(six))
    np.testing.assert_allclose(got, rotation.to_matrix(rotation.from_6d(six)), atol=1e-9)
