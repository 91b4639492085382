"""The velocities at a transition's ends."""

import numpy as np
import pytest

from interpose import rotation
from interpose.runtime.inertia import NeighbourPose, arrive, leave

STEP = 1.0 / 30.0


def still(frames, batch=2, joints=3):
    return np.zeros((batch, frames, 3)), np.tile(rotation.IDENTITY, (batch, frames, joints, 1))


def spun(angles):
    """Joints turned by ``angles`` about their own axes."""
    axes = np.eye(3)
    return rotation.from_rotation_vector(np.asarray(angles)[..., None, None] * axes)


@pytest.mark.parametrize("before_step", [STEP, STEP / 4.0])
def test_a_transition_leaves_its_start_with_the_velocity_it_came_with(before_step):
    root, local = still(60)
    speed, spin = np.array([1.0, 0.0, -0.5]), 2.0
    before = -speed * before_step * np.ones((2, 1)), spun(-spin * before_step * np.ones(2))
    moved, turned = leave(root, local, NeighbourPose(*before, before_step), STEP)
    fine = np.diff(moved, axis=1) / STEP
    steps = rotation.angle(rotation.multiply(rotation.inverse(turned[:, :-1]), turned[:, 1:])) / STEP
    for i in range(4):
        share = (1.0 - (i + 1) * STEP / 0.5) ** 2 * (i + 1) - (1.0 - i * STEP / 0.5) ** 2 * i
        np.testing.assert_allclose(fine[:, i], share * speed * np.ones((2, 1)), atol=1e-9)
        np.testing.assert_allclose(steps[:, i], abs(share) * spin, atol=1e-9)
    np.testing.assert_array_equal(moved[:, 15:], 0.0)
    np.testing.assert_allclose(rotation.angle(turned[:, 15:]), 0.0, atol=1e-9)


@pytest.mark.parametrize("frames", [2, 3, 10, 60])
def test_both_keys_stay(frames):
    rng = np.random.default_rng(0)
    root = rng.normal(size=(2, frames, 3))
    local = rotation.from_rotation_vector(rng.normal(size=(2, frames, 3, 3)))
    other = rng.normal(size=(2, 3)), rotation.from_rotation_vector(rng.normal(size=(2, 3, 3)))
    for change in (leave, arrive):
        moved, turned = change(root, local, NeighbourPose(*other, STEP), STEP)
        np.testing.assert_allclose(moved[:, [0, -1]], root[:, [0, -1]], atol=1e-12)
        apart = rotation.multiply(rotation.inverse(turned[:, [0, -1]]), local[:, [0, -1]])
        np.testing.assert_allclose(rotation.angle(apart), 0.0, atol=1e-7)


def test_a_motion_that_goes_on_as_it_came_is_left_alone():
    t = np.arange(-1, 40)[None] * STEP
    root = t[..., None] * np.array([1.0, 2.0, 3.0])
    local = spun(1.3 * t)
    moved, turned = leave(root[:, 1:], local[:, 1:], NeighbourPose(root[:, 0], local[:, 0], STEP), STEP)
    np.testing.assert_allclose(moved, root[:, 1:], atol=1e-12)
    apart = rotation.multiply(rotation.inverse(turned), local[:, 1:])
    np.testing.assert_allclose(rotation.angle(apart), 0.0, atol=1e-7)


def test_arriving_is_leaving_backwards():
    rng = np.random.default_rng(1)
    root = np.cumsum(rng.normal(size=(2, 20, 3)), axis=1)
    local = spun(np.cumsum(0.1 * rng.normal(size=(2, 20)), axis=1))
    after = root[:, -1] + 0.1, spun(rng.normal(size=2))
    moved, turned = arrive(root, local, NeighbourPose(*after, STEP), STEP)
    back, unturned = leave(root[:, ::-1], local[:, ::-1], NeighbourPose(*after, STEP), STEP)
    np.testing.assert_array_equal(moved, back[:, ::-1])
    np.testing.assert_array_equal(turned, unturned[:, ::-1])
    before = np.linalg.norm((after[0] - root[:, -1]) - (root[:, -1] - root[:, -2]), axis=-1)
    now = np.linalg.norm((after[0] - root[:, -1]) - (moved[:, -1] - moved[:, -2]), axis=-1)
    assert (now < 0.25 * before).all()
