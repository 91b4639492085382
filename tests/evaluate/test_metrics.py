from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interpose import rotation
from interpose.evaluate import metrics
from interpose.evaluate.metrics import Scores


def positions(seed: int, shape: tuple[int, ...] = (3, 8, 4)) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(*shape, 3))


def quaternions(seed: int, shape: tuple[int, ...] = (3, 8, 4)) -> np.ndarray:
    q = np.random.default_rng(seed).normal(size=(*shape, 4))
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def test_l2p_of_one_joint_off_by_two_deviations_along_each_of_two_axes() -> None:
    true = positions(0, (2, 5, 3))
    scale = np.array([[1.0, 2.0, 4.0]] * 3)
    pred = true.copy()
    pred[:, :, 1] += [0.0, 4.0, 8.0]
    assert metrics.l2p(pred, true, scale).value == pytest.approx(math.sqrt(8.0))


def test_l2p_has_no_unit() -> None:
    pred, true, scale = positions(0), positions(1), np.abs(positions(2, (4,))) + 0.1
    in_centimetres = metrics.l2p(100.0 * pred, 100.0 * true, 100.0 * scale)
    assert metrics.l2p(pred, true, scale).value == pytest.approx(in_centimetres.value)


def test_l2q_counts_a_flipped_sign_and_the_aligned_one_does_not() -> None:
    true = quaternions(0, (2, 5, 3))
    pred = true.copy()
    pred[:, :, 2] *= -1.0
    assert metrics.l2q(pred, true).value == pytest.approx(2.0)
    assert metrics.l2q_aligned(pred, true).value == pytest.approx(0.0)


@given(st.integers(0, 1000))
def test_sign_alignment_never_makes_l2q_larger(seed: int) -> None:
    pred, true = quaternions(seed), quaternions(seed + 1)
    assert metrics.l2q_aligned(pred, true).value <= metrics.l2q(pred, true).value + 1e-12


@given(st.integers(0, 1000))
def test_distances_are_zero_for_the_truth_alone(seed: int) -> None:
    x, other, q = positions(seed), positions(seed + 1), quaternions(seed)
    scale = np.ones((4, 3))
    for same, different in [
        (metrics.l2p(x, x, scale), metrics.l2p(x, other, scale)),
        (metrics.ade(x, x), metrics.ade(x, other)),
        (metrics.slde(x, x), metrics.slde(x, other)),
        (metrics.l2q(q, q), metrics.l2q(q, quaternions(seed + 1))),
        (metrics.npss(q, q), metrics.npss(q, quaternions(seed + 1))),
    ]:
        assert same.value == 0.0
        assert different.value > 0.01


def test_npss_of_a_constant_against_the_fastest_wave_by_hand() -> None:
    # Spectra of 4 frames: the constant has all power at frequency 0, the alternating wave all at frequency 2. Their
    # cumulative sums 1 1 1 1 and 0 0 1 1 differ by 2 in all.
    constant = np.ones((1, 4, 1))
    wave = np.array([1.0, -1.0, 1.0, -1.0]).reshape(1, 4, 1)
    assert metrics.npss(constant, wave).value == pytest.approx(2.0)


def test_npss_weighs_channels_by_their_true_power_and_ignores_the_scale_of_the_prediction() -> None:
    wave = np.array([1.0, -1.0, 1.0, -1.0])
    true = np.stack([3.0 * np.ones(4), wave], axis=-1)[None]
    pred = np.stack([np.ones(4), np.ones(4)], axis=-1)[None]
    # Powers 9 * 16 and 16: the first channel's distance is 0, the second's 2.
    assert metrics.npss(pred, true).value == pytest.approx(2.0 * 1.0 / (9.0 + 1.0))
    assert metrics.npss(5.0 * pred, true).value == pytest.approx(0.2)


def test_npss_takes_the_real_part_only() -> None:
    # A sine over 4 frames has a purely imaginary spectrum: no power, hence no weight.
    sine = np.array([0.0, 1.0, 0.0, -1.0]).reshape(1, 4, 1)
    assert metrics.npss(np.ones((1, 4, 1)), sine).weight[0] == pytest.approx(0.0, abs=1e-20)


def test_ade_and_slde_in_metres() -> None:
    true = np.zeros((1, 4, 2, 3))
    pred = true.copy()
    pred[0, :, 0] = np.arange(4)[:, None] * np.array([3.0, 0.0, 4.0])
    assert metrics.ade(pred, true).value == pytest.approx(5.0 * 1.5 / 2.0)
    assert metrics.slde(pred, true).value == pytest.approx(15.0 / 2.0)


def test_apd_is_the_mean_over_pairs() -> None:
    candidates = np.zeros((3, 1, 2, 1, 3))
    candidates[1, ..., 0] = 1.0
    candidates[2, ..., 0] = 4.0
    assert metrics.apd(candidates).value == pytest.approx((1.0 + 4.0 + 3.0) / 3.0)
    with pytest.raises(ValueError, match="at least two"):
        metrics.apd(candidates[:1])


def test_foot_slide_averages_over_samples_in_contact_only() -> None:
    toes = np.zeros((1, 4, 2, 3))
    toes[0, :, 0, 0] = [0.0, 0.01, 0.02, 0.06]  # on the floor: 1, 1, 4 cm
    toes[0, :, 1, 0] = [0.0, 1.0, 2.0, 3.0]  # fast and in the air
    toes[0, :, 1, 1] = 0.2
    assert metrics.foot_slide(toes).value == pytest.approx(2.0)
    assert metrics.foot_slide_speed(toes, 30.0).value == pytest.approx(0.02 * 30.0 / 2.0)
    assert metrics.foot_slide_share(toes, 30.0).value == pytest.approx(1.0)
    assert metrics.foot_slide_share(toes, 1.2).value == pytest.approx(1.0 / 3.0)


def test_foot_slide_of_a_still_foot_is_zero_and_of_one_in_the_air_undefined() -> None:
    toes = np.zeros((2, 4, 2, 3))
    assert metrics.foot_slide(toes).value == 0.0
    assert math.isnan(metrics.foot_slide(toes + np.array([0.0, 1.0, 0.0])).value)


def test_foot_slide_does_not_depend_on_where_or_which_way_one_walks() -> None:
    toes = 0.02 * positions(3, (2, 9, 2))
    turned = rotation.rotate(rotation.from_rotation_vector(np.array([0.0, 0.7, 0.0])), toes)
    turned = turned + np.array([5.0, 0.0, -3.0])
    assert metrics.foot_slide(turned).value == pytest.approx(metrics.foot_slide(toes).value)
    assert metrics.foot_slide_speed(turned, 30.0).value == pytest.approx(metrics.foot_slide_speed(toes, 30.0).value)


def test_arrival_is_exact_for_constant_velocity_and_misses_by_what_is_left() -> None:
    line = np.arange(6.0)[None, :, None, None] * np.array([0.1, 0.0, 0.0])
    assert metrics.arrival_position(line[:, :6]).value == pytest.approx(0.0, abs=1e-15)
    line[:, 5] += [0.0, 0.3, 0.4]
    assert metrics.arrival_position(line[:, :6]).value == pytest.approx(0.5)


def test_acceleration_of_free_fall() -> None:
    time = np.arange(10)[:, None, None] / 30.0
    fall = 0.5 * 9.81 * time**2 * np.array([0.0, -1.0, 0.0])
    np.testing.assert_allclose(metrics.acceleration(fall, 30.0), 9.81)


def test_a_pop_at_a_key_shows_as_acceleration_there() -> None:
    line = np.arange(9.0)[None, :, None, None] * np.array([0.1, 0.0, 0.0])
    assert metrics.key_acceleration(line, 30.0, 2, 6).value == pytest.approx(0.0, abs=1e-9)
    line[:, 6:] += [0.0, 0.03, 0.0]  # appears between the last generated frame, 5, and the target, 6
    assert metrics.key_acceleration(line, 30.0, 2, 6).value == pytest.approx(2 * 0.03 * 900.0 / 4.0)


def test_jerk_ratio_is_one_for_the_truth_and_twice_as_large_at_twice_the_size() -> None:
    true = positions(0)
    assert metrics.jerk_ratio(true, true).value == pytest.approx(1.0)
    assert metrics.jerk_ratio(2.0 * true, true).value == pytest.approx(2.0)
    parabola = np.arange(8.0)[None, :, None, None] ** 2 * np.ones((3, 8, 4, 3))
    assert metrics.jerk_ratio(parabola, true).value == pytest.approx(0.0, abs=1e-9)


def test_scores_are_a_ratio_of_sums() -> None:
    assert Scores(np.array([1.0, 5.0]), np.array([1.0, 2.0])).value == pytest.approx(2.0)
    assert math.isnan(Scores(np.zeros(2), np.zeros(2)).value)


def test_bootstrap_is_seeded_paired_and_covers_the_mean() -> None:
    values = np.random.default_rng(5).normal(10.0, 2.0, size=400)
    score, double = (Scores(factor * values, np.ones(400)) for factor in (1.0, 2.0))
    np.testing.assert_array_equal(score.bootstrap(seed=1), score.bootstrap(seed=1))
    assert not np.array_equal(score.bootstrap(seed=1), score.bootstrap(seed=2))
    np.testing.assert_allclose(double.bootstrap() / score.bootstrap(), 2.0)
    low, high = metrics.interval(score.bootstrap())
    assert low < score.value < high
    assert high - low == pytest.approx(2 * 1.96 * 2.0 / math.sqrt(400), rel=0.15)


def test_an_interval_of_nothing_is_nan() -> None:
    assert all(math.isnan(end) for end in metrics.interval(Scores(np.zeros(3), np.zeros(3)).bootstrap()))


def test_the_best_follows_the_window() -> None:
    a = Scores(np.array([1.0, 4.0]), np.array([1.0, 2.0]))
    b = Scores(np.array([3.0, 1.0]), np.array([2.0, 1.0]))
    best = metrics.best_of_samples([{"ADE": a}, {"ADE": b}], ["ADE"])["ADE"]
    np.testing.assert_array_equal(best.total, [1.0, 1.0])
    np.testing.assert_array_equal(best.weight, [1.0, 1.0])


def test_a_kink_in_the_middle_shows_as_a_seam() -> None:
    time = np.arange(21.0)
    smooth = np.sin(time / 5.0)
    kinked = smooth + np.where(time > 10.0, 1.0, 0.0)
    whole = np.zeros((2, 21, 3, 3))
    whole[0, :, :, 0], whole[1, :, :, 0] = smooth[:, None], kinked[:, None]
    speed, acceleration = metrics.seam(whole)
    assert speed.total[1] / speed.weight[1] > 1.5 > speed.total[0] / speed.weight[0]
    assert acceleration.total[1] / acceleration.weight[1] > 3.0
    assert acceleration.total[0] / acceleration.weight[0] < 2.0
