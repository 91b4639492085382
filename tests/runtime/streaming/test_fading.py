"""What a change took from the velocity fades, one frame at a time."""

import numpy as np
import pytest

from interpose.rotation import IDENTITY, from_rotation_vector
from interpose.runtime.streaming import fading


def course(fade: fading.Fade, left: int) -> np.ndarray:
    values = []
    for k in range(left, 0, -1):
        fade = fading.advanced(fade, np.full(len(fade.left), float(k)))
        values.append(fade.value.copy())
    return np.stack(values)


@pytest.mark.parametrize("left", [6, 15, 40])
def test_one_change_fades_as_an_inertialised_key(left):
    speed = np.random.default_rng(0).normal(size=(2, 23, 3))
    fade = fading.kicked(fading.none(2), np.array([True, True]), speed)
    t, whole = np.arange(1, left + 1), min(left, fading.FADE_FRAMES)
    share = t * np.maximum(1.0 - t / whole, 0.0) ** 2
    np.testing.assert_allclose(course(fade, left), share[:, None, None, None] * speed, atol=1e-9)


def test_changes_add_up_without_a_jump_and_leave_others_alone():
    rows = np.array([True, False])
    fade = fading.kicked(fading.none(2), rows, np.ones((1, 23, 3)))
    before = fading.advanced(fade, np.array([30.0, 30.0]))
    fade = fading.kicked(before, rows, -2.0 * np.ones((1, 23, 3)))
    np.testing.assert_array_equal(fade.value, before.value)
    after = fading.advanced(fade, np.array([29.0, 29.0]))
    assert np.all(np.abs(after.value[0] - before.value[0]) < 2.5)
    assert not after.value[1].any()
    assert not course(after, 3)[-1].any()


def test_velocities_and_shown_poses():
    hips, local = np.array([[0.0, 1.0, 0.0]]), np.tile(IDENTITY, (1, 22, 1))
    turned = from_rotation_vector(np.full((1, 22, 3), 0.1))
    velocity = fading.velocity((hips, local), (hips + 0.5, turned))
    np.testing.assert_allclose(velocity[0, 0], 0.5)
    np.testing.assert_allclose(velocity[0, 1:], 0.1, atol=1e-12)
    shown = fading.shown(fading.Fade(velocity, velocity, np.ones(1)), hips, local)
    np.testing.assert_allclose(shown[0], hips + 0.5)
    np.testing.assert_allclose(shown[1], turned, atol=1e-12)
