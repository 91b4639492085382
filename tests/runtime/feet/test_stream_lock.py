"""Feet held one frame at a time: planted while they stand, let go smoothly, back in place at the target."""

import numpy as np
import pytest

from interpose import skeleton as kinematics
from interpose.rotation import IDENTITY
from interpose.runtime.feet.stream_lock import LONGEST_HOLD, FootLock
from interpose.skeleton import HUMANOID

LEFT, RIGHT = HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")


def walked(contacts, frames=40, pace=0.008, left=1000):
    """The toes of a standing figure that is pushed forward, as it was and with held feet: (frame, joint, 3)."""
    lock, local = FootLock(1), np.tile(IDENTITY, (1, 22, 1))
    loose, held = [], []
    for frame in range(frames):
        hips = np.array([[0.0, 0.9, pace * frame]])
        made = lock.step(hips, local, np.array([contacts(frame)], dtype=float), np.array([left - frame]))
        for out, turned in ((loose, local), (held, made)):
            world = kinematics.global_rotations(turned, HUMANOID.parents)
            out.append(kinematics.global_positions(hips, world, HUMANOID.parents, HUMANOID.offsets)[0])
    return np.stack(loose), np.stack(held)


def test_a_foot_that_stands_is_held_and_the_other_is_not():
    _, held = walked(lambda _: (1, 1, 0, 0), frames=14)
    way = np.linalg.norm(np.diff(held, axis=0), axis=-1)
    assert way[6:, LEFT].max() < 0.002
    np.testing.assert_allclose(way[:, RIGHT], 0.008, atol=1e-9)


def test_it_is_let_go_without_a_jump():
    loose, held = walked(lambda frame: (1, 1, 0, 0) if frame < 12 else (0, 0, 0, 0))
    bends = np.linalg.norm(np.diff(held[:, LEFT], n=2, axis=0), axis=-1)
    assert bends.max() < 0.012  # 11 m/s2, a fraction of what a swinging foot has
    np.testing.assert_allclose(held[24:], loose[24:], atol=1e-9)


def test_too_much_is_not_asked():
    loose, held = walked(lambda _: (1, 1, 0, 0), frames=60)
    assert np.linalg.norm(held - loose, axis=-1).max() < LONGEST_HOLD + 0.02
    np.testing.assert_allclose(held[-1], loose[-1], atol=1e-9)


@pytest.mark.parametrize("contacts", [(1, 1, 1, 1), (1, 0, 0, 0)])
def test_at_the_target_nothing_is_left(contacts):
    loose, held = walked(lambda _: contacts, frames=20, left=20)
    assert np.abs(held - loose).max() > 0.01
    np.testing.assert_allclose(held[-1], loose[-1], atol=1e-9)


def test_without_contact_poses_stay_as_they_are():
    loose, held = walked(lambda _: (0.5, 0.3, 0, 0))
    np.testing.assert_array_equal(loose, held)
