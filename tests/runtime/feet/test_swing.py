"""Corrections are the smoothest that hold what is held; toes clear the floor between their places and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from numpy import ndarray

from interpose.runtime.feet.stances import FOOT_DEFAULTS
from interpose.runtime.feet.swing import heel_lift, lifted, smooth_field

FRAMES = 40


def smoothest(values: ndarray, held: ndarray, decay: float) -> ndarray:
    """The field of one leg by dense least squares."""
    frames = len(values)
    bend = np.diff(np.eye(frames + 2), n=2, axis=0)
    fixed = np.concatenate([[True, True], held[1:-1], [True, True]])
    known = np.zeros((frames + 2, values.shape[1]))
    known[2:-2][held[1:-1]] = values[1:-1][held[1:-1]]
    rows = np.concatenate([bend, 2.0 / decay**2 * np.eye(frames + 2)])
    free = np.linalg.lstsq(rows[:, ~fixed], -rows[:, fixed] @ known[fixed], rcond=None)[0]
    known[~fixed] = free
    return known[1:-1]


def test_the_field_is_the_smoothest_of_each_leg() -> None:
    draw = np.random.default_rng(0)
    values = draw.normal(size=(4, FRAMES, 3))
    held = np.zeros((4, FRAMES), dtype=bool)
    held[0, 10:20] = held[1, 1:4] = held[1, 30:39] = held[3] = True
    field = smooth_field(values, held, 6.0)
    for leg in range(4):
        np.testing.assert_allclose(field[leg], smoothest(values[leg], held[leg], 6.0), atol=1e-9)
    np.testing.assert_array_equal(field[:, [0, -1]], 0.0)
    np.testing.assert_array_equal(field[2], 0.0)


def dragging(way: float, height: float = 0.005) -> tuple[ndarray, ndarray]:
    """A toe that is dragged along the floor between two stances of ten frames, and where it stands."""
    toe = np.zeros((1, FRAMES, 3))
    share = np.clip((np.arange(FRAMES) - 9) / 21.0, 0.0, 1.0)
    toe[0, :, 0], toe[0, :, 1] = way * share**2 * (3.0 - 2.0 * share), height
    held = np.zeros((1, FRAMES), dtype=bool)
    held[0, :10] = held[0, 30:] = True
    return toe, held


def test_a_toe_that_drags_is_lifted_over_the_floor_and_higher_on_a_long_step() -> None:
    toe, held = dragging(0.1)
    heights = lifted(toe, held, FOOT_DEFAULTS)[0]
    np.testing.assert_array_equal(heights[held[0]], 0.005)
    assert np.all(heights[12:28] >= FOOT_DEFAULTS.clear)
    far, _ = dragging(1.0)
    assert lifted(far, held, FOOT_DEFAULTS)[0].max() > heights.max() + 0.02
    assert np.abs(np.diff(lifted(far, held, FOOT_DEFAULTS)[0])).max() < 0.02


def test_a_toe_that_is_clear_of_the_floor_keeps_its_height() -> None:
    toe, held = dragging(0.8)
    toe[0, :, 1] += 0.1 * np.sin(np.pi * np.clip((np.arange(FRAMES) - 9) / 21.0, 0.0, 1.0))
    heights = lifted(toe, held, FOOT_DEFAULTS)[0]
    np.testing.assert_array_equal(heights[13:27], toe[0, 13:27, 1])


def test_a_foot_on_a_box_is_not_lifted() -> None:
    toe, held = dragging(0.3, height=0.4)
    np.testing.assert_array_equal(lifted(toe, held, FOOT_DEFAULTS), toe[..., 1])


@pytest.mark.parametrize("depth", [0.0, -0.02, -0.1])
def test_beside_a_key_that_swings_a_toe_rises_slowly(depth: float) -> None:
    toe, held = dragging(0.5, height=depth)
    held[:, :10] = False
    heights = lifted(toe, held, FOOT_DEFAULTS)[0]
    assert heights[0] == depth
    assert heights[1] - heights[0] < 0.008
    assert np.abs(np.diff(heights, n=2))[:8].max() < 0.01
    assert heights[12:26].min() > min(depth + FOOT_DEFAULTS.clear, FOOT_DEFAULTS.clear) - 1e-9


def test_the_heel_goes_before_the_toe_and_keeps_to_the_keys() -> None:
    toe, held = dragging(0.5)
    lift = lifted(toe, held, FOOT_DEFAULTS) - toe[..., 1]
    rise = heel_lift(lift)
    moves = np.flatnonzero(lift[0] > 1e-6)
    rises = np.flatnonzero(rise[0] > 1e-6)
    assert rises[0] < moves[0]
    assert rises[-1] == moves[-1]
    early, late = (
        rise[0, moves[:3]].sum() / lift[0, moves[:3]].sum(),
        rise[0, moves[-3:]].sum() / lift[0, moves[-3:]].sum(),
    )
    assert early > 1.0 > late
    at_once = heel_lift(np.full((1, FRAMES), 0.03))
    np.testing.assert_array_equal(at_once[:, [0, -1]], 0.0)
    assert np.abs(np.diff(at_once[0], n=2)).max() < 0.02
