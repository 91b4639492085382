"""Two chains that become one motion, and gaps of several lengths."""

import numpy as np

from interpose.features.stitch import schedule, shares
from interpose.runtime.backends import chains


def two(steps, buffer, value):
    """Chains whose frames say ``value(side, frame)`` everywhere."""
    made = ([], [])
    for move in schedule(steps, buffer):
        side = int(move.backward)
        said = np.full((1, 3), value(side, move.made))
        turned = said[0, 0] * np.ones((1, 22, 6))
        made[side].append({"hips": said, "rotations": turned, "contacts": said[:, [0, 0, 0, 0]]})
    return made


def test_short_gaps_are_blended_by_their_shares_and_not_smoothed():
    hips, turned, contacts = chains.joined(two(9, 2, lambda side, frame: 10.0 * side + frame), 9, 2)
    wanted = np.arange(1, 9) + 10.0 * shares(9, 2)[1:-1]
    for made in (hips, turned, contacts):
        np.testing.assert_allclose(made.reshape(8, -1), np.repeat(wanted[:, None], made[0, 0].size, axis=1))


def test_a_jolt_in_the_middle_of_a_longer_gap_is_smoothed():
    hips = chains.joined(two(40, 0, lambda side, frame: float(abs(frame - 20))), 40, 0)[0][0, :, 0]
    plain = np.abs(np.arange(1, 40) - 20.0)
    assert np.diff(hips, n=2).max() < 0.8 * np.diff(plain, n=2).max()
    np.testing.assert_allclose(hips[:12], plain[:12], atol=1e-9)


def test_gaps_go_by_their_length_and_end_in_their_targets():
    asked = []

    def make(rows, length):
        asked.append((rows, length))
        shape = len(rows), length
        return np.full((*shape, 3), length), np.full((*shape, 22, 4), length), np.ones((*shape, 4))

    root, local = np.full((4, 3), -1.0), np.full((4, 22, 4), -2.0)
    hips, turned, contacts = chains.by_length([3, 5, 0, 3], root, local, make)
    assert asked == [([0, 3], 3), ([1], 5)]
    np.testing.assert_array_equal(hips[:, :, 0], [[3, 3, 3, -1, -1], [5] * 5, [-1] * 5, [3, 3, 3, -1, -1]])
    np.testing.assert_array_equal(turned[2], np.full((5, 22, 4), -2.0))
    np.testing.assert_array_equal(contacts[:, :, 0].sum(axis=1), [3, 5, 0, 3])
