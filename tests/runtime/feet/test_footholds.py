"""Places are on the floor, at the keys where a stance holds one, and never farther than a leg can go."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from interpose.runtime.feet.footholds import eased, floor, footing
from interpose.runtime.feet.stances import FOOT_DEFAULTS

FRAMES, REACH = 30, 1.0


def leg(toe: ndarray) -> ndarray:
    """A leg over its toe: hip, knee, ankle and toe."""
    offsets = np.array([[0.0, 0.85, -0.1], [0.0, 0.45, 0.0], [0.0, 0.06, -0.14], [0.0, 0.0, 0.0]])
    return np.asarray(toe[:, None] + offsets)


def gliding(height: float = 0.01, pace: float = 0.004) -> ndarray:
    toe = np.zeros((FRAMES, 3))
    toe[:, 1], toe[:, 2] = height, pace * np.arange(FRAMES)
    return toe


def test_a_stance_within_the_gap_stands_in_the_middle_of_its_way_on_the_floor() -> None:
    toe = gliding(height=0.05)
    found = footing(leg(toe), np.ones(FRAMES), [slice(10, 20)], REACH, FOOT_DEFAULTS)
    np.testing.assert_array_equal(np.flatnonzero(found.held), np.arange(10, 20))
    expected = [0.0, FOOT_DEFAULTS.toe_heights[1], toe[10:20, 2].mean()]
    np.testing.assert_allclose(found.toe[10:20], np.tile(expected, (10, 1)))
    flat = np.flatnonzero(found.flat)
    np.testing.assert_array_equal(flat, np.arange(10, 20 - FOOT_DEFAULTS.heel_first))  # the heel leaves first
    apart = np.linalg.norm(found.heel[flat] - found.toe[flat], axis=-1)
    np.testing.assert_allclose(apart, np.hypot(0.06, 0.14))


def test_a_stance_that_holds_a_key_stands_where_the_key_does() -> None:
    toe = gliding()
    found = footing(leg(toe), np.zeros(FRAMES), [slice(0, 8), slice(20, FRAMES)], REACH, FOOT_DEFAULTS)
    np.testing.assert_allclose(found.toe[:8], np.tile(toe[0], (8, 1)))
    np.testing.assert_allclose(found.toe[20:], np.tile(toe[-1], (10, 1)))
    assert not found.flat.any()


def test_a_stance_that_holds_both_keys_goes_from_the_one_to_the_other() -> None:
    toe = gliding(pace=0.0008)
    toe[10:20, 0] += 0.1
    found = footing(leg(toe), np.ones(FRAMES), [slice(0, FRAMES)], REACH, FOOT_DEFAULTS)
    assert found.held.all()
    np.testing.assert_allclose(found.toe[[0, -1]], toe[[0, -1]])
    assert np.linalg.norm(np.diff(found.toe, axis=0), axis=-1).max() < 0.0015


def test_a_stance_beside_a_key_in_which_the_foot_just_lands_is_at_the_keys_place() -> None:
    toe = gliding()
    found = footing(leg(toe), np.zeros(FRAMES), [slice(3, 15)], REACH, FOOT_DEFAULTS)
    np.testing.assert_allclose(found.toe[3:15, [0, 2]], np.tile(toe[0, [0, 2]], (12, 1)))
    later = footing(leg(toe), np.zeros(FRAMES), [slice(8, 20)], REACH, FOOT_DEFAULTS)
    assert later.toe[8, 2] > toe[8, 2]


def test_frames_too_far_from_their_place_or_out_of_reach_are_let_go() -> None:
    toe = gliding(pace=0.03)
    found = footing(leg(toe), np.zeros(FRAMES), [slice(0, FRAMES - 3)], REACH, FOOT_DEFAULTS)
    assert 0 < found.held.sum() <= FOOT_DEFAULTS.stretch / 0.03 + 1
    away = leg(gliding())
    away[12:16, 0, 1] += 0.2
    kept = np.flatnonzero(footing(away, np.zeros(FRAMES), [slice(4, 28)], REACH, FOOT_DEFAULTS).held)
    np.testing.assert_array_equal(kept, np.arange(16, 28))


def test_a_key_under_the_floor_lowers_it_beside_itself() -> None:
    heights = np.full(FRAMES, 0.02)
    heights[0] = -0.02
    level = floor(heights, 0.0)
    assert level[0] == -0.02
    assert level.max() == 0.0
    assert np.diff(level).max() <= 0.005 + 1e-12


def test_there_is_time_between_places_and_before_keys() -> None:
    wanted = np.zeros((20, 3))
    wanted[2:9, 0], wanted[11:19, 0] = 0.12, -0.06
    held = np.zeros(20, dtype=bool)
    held[2:9] = held[11:19] = True
    kept = eased(wanted, held, FOOT_DEFAULTS)
    assert not np.any(kept & ~held)
    way = np.concatenate([[0.0], wanted[kept, 0], [0.0]])
    at = np.concatenate([[0], np.flatnonzero(kept), [19]])
    assert np.all(np.abs(np.diff(way)) <= FOOT_DEFAULTS.pace * np.diff(at) + 1e-12)
    assert kept.sum() >= 7
