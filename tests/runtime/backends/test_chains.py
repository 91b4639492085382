"""Two chains that become one motion."""

import numpy as np

from interpose.features.stitch import schedule, shares, smoothed
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


def test_only_the_middle_is_smoothed():
    time = np.arange(41.0)
    kinked = np.stack([np.abs(time - 20.0), time])[None].swapaxes(1, 2)
    flat = smoothed(kinked, 40)
    bends = [np.abs(np.diff(x[0, :, 0], n=2)).max() for x in (kinked, flat)]
    assert bends[1] < 0.8 * bends[0]
    np.testing.assert_allclose(flat[..., 1], kinked[..., 1])  # what has no bend stays
    np.testing.assert_array_equal(flat[:, :14], kinked[:, :14])
    np.testing.assert_array_equal(flat[:, 28:], kinked[:, 28:])
    np.testing.assert_array_equal(smoothed(kinked[:, :16], 15), kinked[:, :16])
