"""Smooth curves through drawn points: their ends, what they pass, what they smooth away, and their direction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy import ndarray

from interpose.drawn_path.curve import SAMPLE_SPACING, attached, gaussian, smoothed, through

ANY = st.integers(2, 12).flatmap(
    lambda count: arrays(float, (count, 2), elements=st.one_of(st.sampled_from([0.0, 1.0, 1.0005]), st.floats(-5, 5)))
)
"""Points anywhere, some of them twice."""
SET = st.integers(3, 9).flatmap(
    lambda count: st.lists(
        st.tuples(st.floats(0.6, 4.0), st.floats(-np.pi, np.pi)), min_size=count - 1, max_size=count - 1
    )
)
"""Legs of points that were set one by one: length and direction."""


def apart(points: ndarray, line: ndarray) -> ndarray:
    """How far each point is from the nearest sample of a line."""
    return np.linalg.norm(points[:, None] - line[None], axis=-1).min(axis=1)


@given(ANY)
def test_ends_are_exact_and_arc_lengths_rise(points: ndarray) -> None:
    curve = through(points, 0.5)
    np.testing.assert_array_equal(curve.points[0], points[0])
    np.testing.assert_array_equal(curve.points[-1], points[-1])
    assert curve.arc[0] == 0.0
    assert (np.diff(curve.arc) > 0.0).all() or curve.length < 0.02
    assert len(curve.passed) == len(points)
    assert (np.diff(curve.passed) >= 0.0).all()
    assert curve.passed[0] == 0.0
    assert curve.passed[-1] == pytest.approx(curve.length)
    for values in (curve.points, curve.heading, curve.at(np.linspace(0.0, curve.length, 50))):
        assert np.isfinite(values).all()
    np.testing.assert_allclose(curve.at(np.array([0.0, curve.length])), points[[0, -1]], atol=1e-9)


@given(SET)
def test_points_that_were_set_are_passed_near_and_it_stays_near_their_polyline(legs: list[tuple[float, float]]) -> None:
    steps = np.array([(length * np.sin(angle), length * np.cos(angle)) for length, angle in legs])
    points = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)])
    curve = through(points)
    assert np.linalg.norm(curve.at(curve.passed) - points, axis=-1).max() < 0.08
    straight = np.concatenate([a + np.linspace(0, 1, 200)[:, None] * (b - a) for a, b in pairwise(points)])
    assert apart(curve.points, straight).max() < 0.45
    assert curve.length < 1.25 * sum(length for length, _ in legs) + 0.1


def test_a_straight_line_stays_straight() -> None:
    curve = through(np.array([[1.0, 1.0], [1.0, 2.0], [1.0, 5.0]]))
    np.testing.assert_allclose(curve.points[:, 0], 1.0, atol=1e-9)
    assert curve.length == pytest.approx(4.0)
    np.testing.assert_allclose(curve.passed, [0.0, 1.0, 4.0], atol=0.01)
    np.testing.assert_allclose(curve.heading, 0.0, atol=1e-9)
    assert np.diff(curve.arc).max() <= 1.01 * SAMPLE_SPACING


def test_a_trembling_hand_is_smoothed_away() -> None:
    angle = np.linspace(0.0, np.pi, 600)
    points = 2.0 * np.stack([np.sin(angle), -np.cos(angle)], axis=-1)
    curve = through(points + np.random.default_rng(0).normal(0.0, 0.004, points.shape))
    assert np.abs(np.linalg.norm(curve.points, axis=-1) - 2.0).max() < 0.012
    assert curve.length == pytest.approx(2.0 * np.pi, rel=0.01)
    bend = np.diff(curve.heading) / np.diff(curve.arc)
    assert np.abs(bend[40:-40] + 0.5).max() < 0.15


def test_a_scribble_of_many_points_is_as_long_as_what_was_meant() -> None:
    points = np.stack([np.linspace(0.0, 3.0, 3000), np.zeros(3000)], axis=-1)
    curve = through(points + np.random.default_rng(0).normal(0.0, 0.003, points.shape))
    assert curve.length == pytest.approx(3.0, rel=0.02)
    assert np.abs(curve.points[:, 1]).max() < 0.01


def test_points_less_than_a_millimetre_apart() -> None:
    points = np.stack([np.linspace(0.0, 2.0, 9000), np.linspace(0.0, 1.0, 9000)], axis=-1)
    curve = through(points)
    assert curve.length == pytest.approx(np.sqrt(5.0))
    assert np.abs(curve.at(curve.passed) - points).max() < 0.01


def test_an_arc_stays_where_it_is() -> None:
    angle = np.linspace(0.0, 1.5 * np.pi, 40)
    curve = through(0.5 * np.stack([np.sin(angle), -np.cos(angle)], axis=-1))
    away = np.abs(np.linalg.norm(curve.points, axis=-1) - 0.5)
    assert away.max() < 0.015
    assert away[40:-40].max() < 0.003


def test_legs_are_straight_away_from_sharp_corners() -> None:
    curve = through(np.array([[0.0, 0.0], [0.0, 6.0], [6.0, 6.0]]))
    assert apart(np.array([[0.0, 6.0]]), curve.points)[0] < 0.03
    assert np.abs(curve.points[(curve.points[:, 1] < 5.0), 0]).max() < 0.13
    assert curve.length < 12.3


def test_the_direction_turns_by_itself_alone() -> None:
    out_and_back = through(np.array([[0.0, 0.0], [0.0, 3.0], [0.0, 0.0]]))
    assert abs(abs(out_and_back.heading[-1] - out_and_back.heading[0]) - np.pi) < 1e-6
    for curve in (out_and_back, through(np.array([[0.0, 0.0], [1.0, 0.2], [0.0, 0.4], [1.0, 0.6]]))):
        assert np.abs(np.diff(curve.heading)).max() < 0.4
        assert np.ptp(curve.heading) < 1.05 * np.pi


def test_a_curve_of_no_length_looks_as_it_is_told() -> None:
    for points in ([[1.0, 2.0], [1.0, 2.0]], [[1.0, 2.0], [1.005, 2.0]]):
        curve = through(np.array(points), 0.7)
        np.testing.assert_array_equal(curve.heading, 0.7)
        np.testing.assert_allclose(curve.at(np.array([0.0, curve.length])), points)


def test_an_end_is_attached_without_a_corner() -> None:
    points = np.stack([np.zeros(100), np.linspace(0.0, 5.0, 100)], axis=-1)
    moved = attached(points, np.array([0.2, 0.0]), last=False)
    np.testing.assert_array_equal(moved[0], [0.2, 0.0])
    np.testing.assert_array_equal(moved[50:], points[50:])
    assert np.abs(np.diff(moved[:, 0], n=2)).max() < 0.006
    moved = attached(points, np.array([0.2, 5.0]), last=True)
    np.testing.assert_array_equal(moved[-1], [0.2, 5.0])
    np.testing.assert_array_equal(moved[:50], points[:50])
    short = attached(np.array([[0.0, 0.0], [0.0, 0.1]]), np.array([0.3, 0.0]), last=False)
    np.testing.assert_array_equal(short, [[0.3, 0.0], [0.0, 0.1]])
    np.testing.assert_array_equal(attached(points[:1], np.array([0.2, 0.0]), last=True), [[0.2, 0.0]])


@given(arrays(float, st.integers(1, 60), elements=st.floats(-9, 9)), st.floats(0.1, 20.0))
def test_smoothing_keeps_the_ends_and_lines(values: ndarray, width: float) -> None:
    line = np.linspace(1.0, 3.0, len(values))
    for smooth in (smoothed, gaussian):
        made = smooth(values, width)
        assert made[0] == pytest.approx(values[0], abs=1e-9)
        assert made[-1] == pytest.approx(values[-1], abs=1e-9)
        np.testing.assert_allclose(smooth(line, width), line, atol=1e-5)
    rising = gaussian(np.sort(values), width)
    assert (np.diff(rising) > -1e-9).all()


def test_smoothing_takes_the_tremble_and_leaves_the_bow() -> None:
    at = np.arange(400)
    bow, tremble = np.sin(at / 60.0), 0.1 * np.sin(at / 1.5)
    made = smoothed(np.stack([bow + tremble, bow], axis=-1), 5.0)
    assert np.abs(made[20:-20] - bow[20:-20, None]).max() < 0.005
