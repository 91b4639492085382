"""The user's frame rate to the model's and back."""

import numpy as np
import pytest

from interpose import rotation
from interpose.motion import Motion, sample
from interpose.runtime.resampling import model_steps, recent, to_user_rate
from interpose.skeleton import HUMANOID

RATES = [24.0, 25.0, 29.97, 30.0, 50.0, 60.0, 120.0]


def swing(times):
    """A smooth motion as a function of time in seconds: root and rotations."""
    root = np.stack([1.2 * times, 0.9 + 0.03 * np.cos(9.0 * times), 0.2 * np.sin(4.0 * times)], axis=-1)
    axes = np.random.default_rng(0).normal(size=(22, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    angles = 0.7 * np.sin(5.0 * times[:, None] + np.arange(22))
    return root, rotation.from_rotation_vector(angles[..., None] * axes)


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("frames", [1, 2, 3, 10, 59, 600])
def test_a_step_of_the_model_lasts_about_a_thirtieth_of_a_second(frames, rate):
    steps = model_steps(frames, rate)
    lasts = (frames + 1) / rate / steps
    assert steps >= 1
    assert steps == 1 or abs(lasts * 30.0 - 1.0) <= 0.5 / steps + 1e-12


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("frames", [5, 30, 59, 200])
@pytest.mark.parametrize("context", [0, 5])
def test_a_smooth_motion_comes_back_at_the_users_rate(frames, rate, context):
    steps = model_steps(frames, rate)
    lasts = (frames + 1) / rate
    known = np.concatenate([np.arange(-context, 0) / 30.0, np.arange(steps + 1) * lasts / steps])
    root, local = to_user_rate(*swing(known), context, frames, rate)
    true_root, true_local = swing(np.arange(frames + 2) / rate)
    turned = rotation.angle(rotation.multiply(rotation.inverse(local), true_local))
    assert np.abs(root - true_root).max() < 2e-3
    assert np.degrees(turned.max()) < 0.3
    np.testing.assert_allclose(np.linalg.norm(local, axis=-1), 1.0, atol=1e-12)


def test_where_the_grids_coincide_frames_are_taken_as_they_are():
    root, local = swing(np.arange(-3, 46) / 30.0)
    same_root, same_local = to_user_rate(root, local, 3, 44, 30.0)
    np.testing.assert_array_equal(same_root, root[3:])
    np.testing.assert_array_equal(same_local, local[3:])


@pytest.mark.parametrize("rate", RATES)
def test_the_ends_are_the_keys(rate):
    steps = model_steps(40, rate)
    root, local = swing(np.arange(-4, steps + 1) / 30.0)
    flipped = local * np.where(np.arange(len(local)) % 2, 1.0, -1.0)[:, None, None]
    out_root, out_local = to_user_rate(root, flipped, 4, 40, rate)
    np.testing.assert_array_equal(out_root[[0, -1]], root[[4, -1]])
    turned = rotation.angle(rotation.multiply(rotation.inverse(out_local[[0, -1]]), local[[4, -1]]))
    np.testing.assert_allclose(turned, 0.0, atol=1e-7)
    steps_turned = rotation.angle(rotation.multiply(rotation.inverse(out_local[:-1]), out_local[1:]))
    assert np.degrees(steps_turned.max()) < 0.7 * 5.0 / rate * 180.0 / np.pi * 1.2


def test_two_frames_make_a_straight_line():
    root, local = swing(np.array([0.0, 0.03]))
    out_root, _ = to_user_rate(root, local, 0, 2, 100.0)
    np.testing.assert_allclose(out_root[1], root[0] + (root[1] - root[0]) / 3.0, atol=1e-12)


@pytest.mark.parametrize("rate", RATES)
def test_the_context_is_the_latest_third_of_a_second(rate):
    root, local = swing(np.arange(100) / rate)
    clip = Motion(HUMANOID, root, local, rate)
    latest = recent(clip, 10)
    assert len(latest) == 10
    np.testing.assert_array_equal(latest.root_positions[-1], root[-1])
    np.testing.assert_array_equal(latest.local_rotations[-1], local[-1])
    expected = sample(clip, 99 - np.arange(10)[::-1] * rate / 30.0)
    np.testing.assert_allclose(latest.root_positions, expected.root_positions, atol=1e-9)


def test_a_short_context_is_what_there_is():
    root, local = swing(np.arange(5) / 60.0)
    assert len(recent(Motion(HUMANOID, root, local, 60.0), 10)) == 3
    assert len(recent(Motion(HUMANOID, root[:1], local[:1], 24.0), 10)) == 1
