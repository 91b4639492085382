"""Local phases: feet that step in time, feet that do not step, and time that runs backwards."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interpose.data.local_phases import PHASE_FREQUENCIES, local_phases

RATE = 30.0


def stepping(frames: int, period: int, down: int, late: int = 0):
    """Contacts of both feet: the left down for the first ``down`` frames of each period, the right ``late`` after."""
    left, right = ((np.arange(frames) - shift) % period < down for shift in (0, late))
    return np.stack([left, left, right, right], axis=-1).astype(float)


@st.composite
def contacts(draw):
    count = draw(st.integers(1, 90))
    rows = draw(st.lists(st.tuples(*[st.booleans()] * 4), min_size=count, max_size=count))
    return np.array(rows, dtype=float)


@pytest.mark.parametrize(("period", "down"), [(30, 15), (24, 12), (40, 25), (15, 7), (60, 21)])
def test_a_foot_that_steps_turns_once_a_cycle_with_its_contact_on_top(period, down):
    phases = local_phases(stepping(10 * period, period, down), RATE)
    angle = np.unwrap(np.arctan2(phases[:, 0], phases[:, 1]))
    cycle = slice(4 * period, 6 * period)
    np.testing.assert_allclose(angle[cycle] - angle[3 * period : 5 * period], 2.0 * np.pi, atol=0.02)
    assert np.all(np.diff(angle[cycle]) > 0.0)
    middles = 4 * period + (down - 1) / 2  # of a contact; the angle there is nil
    at = np.interp(middles, np.arange(len(angle)), angle)
    assert abs((at + np.pi) % (2.0 * np.pi) - np.pi) < 0.02
    swings = middles + period / 2
    at = np.interp(swings, np.arange(len(angle)), angle)
    assert abs(at % (2.0 * np.pi) - np.pi) < 0.02


def test_the_amplitude_is_that_of_the_sinusoid():
    hertz = PHASE_FREQUENCIES[13]
    wave = 0.5 + 0.3 * np.cos(2.0 * np.pi * hertz * np.arange(300) / RATE - 1.0)
    phases = local_phases(np.stack([wave, 0.0 * wave, 0.2 * wave, 0.0 * wave], axis=-1), RATE)[90:-90]
    time = np.arange(90, 210) / RATE
    wanted = 2.0 * np.pi * hertz * time - 1.0
    np.testing.assert_allclose(phases[:, 0], 0.3 * np.sin(wanted), atol=2e-3)
    np.testing.assert_allclose(phases[:, 1], 0.3 * np.cos(wanted), atol=2e-3)
    np.testing.assert_allclose(phases[:, 2:], 0.2 * phases[:, :2], atol=1e-12)
    square = local_phases(stepping(300, 30, 15), RATE)[90:-90]
    np.testing.assert_allclose(np.hypot(square[:, 0], square[:, 1]), 2.0 / np.pi, atol=0.02)


@pytest.mark.parametrize("held", [[0, 0, 0, 0], [1, 1, 1, 1], [1, 0, 0, 1]])
@pytest.mark.parametrize("frames", [1, 7, 200])
def test_feet_that_do_not_step_have_no_phase(held, frames):
    phases = local_phases(np.tile(np.array(held, dtype=float), (frames, 1)), RATE)
    np.testing.assert_allclose(phases, np.zeros((frames, 4)), atol=1e-12)


def test_each_foot_has_its_own_and_is_down_on_either_joint():
    both = stepping(240, 30, 14, late=15)
    phases = local_phases(both, RATE)
    inside = slice(90, -90)
    np.testing.assert_allclose(phases[inside, :2], -phases[inside, 2:], atol=0.05)
    ankle_then_toe = both.copy()
    ankle_then_toe[:, 0] = both[:, 0] * np.roll(both[:, 0], 5)
    ankle_then_toe[:, 1] = both[:, 0] * np.roll(both[:, 0], -5)
    np.testing.assert_allclose(local_phases(ankle_then_toe, RATE), phases, atol=1e-12)


def test_the_rate_does_not_matter():
    slow = local_phases(stepping(240, 30, 15), RATE)
    fast = local_phases(stepping(480, 60, 30), 2.0 * RATE)
    between = 0.5 * (fast[:-1:2] + fast[1::2])  # a frame of the slow one lasts from one of the fast ones to the next
    np.testing.assert_allclose(between[90:-90], slow[90:-90], atol=0.02)


@given(contacts())
def test_backwards_in_time_phases_turn_backwards(down):
    forward, backward = local_phases(down, RATE), local_phases(down[::-1].copy(), RATE)[::-1]
    np.testing.assert_allclose(backward, forward * [-1.0, 1.0, -1.0, 1.0], atol=1e-9)


@given(contacts(), st.floats(0.1, 1.0), st.floats(0.0, 0.5))
def test_how_deep_contacts_are_scales_phases_and_their_level_is_nothing(down, scale, level):
    phases = local_phases(down, RATE)
    np.testing.assert_allclose(local_phases(scale * down + level, RATE), scale * phases, atol=1e-9)
    np.testing.assert_allclose(local_phases(down[:, [2, 3, 0, 1]], RATE), phases[:, [2, 3, 0, 1]], atol=1e-12)
    assert np.abs(phases).max() < 1.0
