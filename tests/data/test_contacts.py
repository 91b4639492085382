from __future__ import annotations

import numpy as np
import pytest

from interpose.data import contacts
from interpose.skeleton import HUMANOID

RATE = 30.0


def feet(heights: np.ndarray, forward: np.ndarray) -> np.ndarray:
    """Positions of 22 joints, the four foot joints at ``heights`` (frame, 4) and at z ``forward`` (frame, 4)."""
    positions = np.zeros((len(heights), len(HUMANOID), 3))
    positions[:, contacts.CONTACT_INDICES, 1] = heights
    positions[:, contacts.CONTACT_INDICES, 2] = forward
    return positions


def walk(steps: int = 4, half: int = 15) -> tuple[np.ndarray, np.ndarray]:
    """A walk with alternate feet, ``half`` frames planted and ``half`` in the air: positions and true contacts."""
    phase = np.arange(2 * half * steps)[:, None] - np.array([0, half])
    planted = phase % (2 * half) < half
    swing = np.clip((phase % (2 * half) - half) / half, 0.0, 1.0)
    forward = phase // (2 * half) + 0.5 * (1.0 - np.cos(np.pi * swing))
    lift = 0.12 * np.sin(np.pi * swing)
    heights = np.repeat(lift, 2, axis=1) + contacts.REST_HEIGHTS
    return feet(heights, np.repeat(forward, 2, axis=1)), np.repeat(planted, 2, axis=1)


def test_columns_are_the_benchmarks_joints() -> None:
    assert contacts.CONTACT_INDICES == (3, 4, 7, 8)


def test_a_walk_is_planted_and_lifted_where_it_should_be() -> None:
    positions, planted = walk()
    found = contacts.detect(positions, RATE)
    wrong = found != planted
    edges = np.zeros_like(planted)
    edges[1:] |= planted[1:] != planted[:-1]
    near = np.array([np.convolve(column, np.ones(7), mode="same") > 0 for column in edges.T]).T
    assert not np.any(wrong & ~near)
    assert wrong.mean() < 0.1


def test_a_foot_held_still_in_the_air_is_not_in_contact() -> None:
    positions = feet(np.full((20, 4), 0.3), np.zeros((20, 4)))
    assert not contacts.detect(positions, RATE).any()


def test_a_foot_that_creeps_on_the_floor_is_in_contact() -> None:
    creep = np.arange(20)[:, None] / RATE * 0.1 * np.ones(4)
    positions = feet(np.tile(contacts.REST_HEIGHTS, (20, 1)), creep)
    assert contacts.detect(positions, RATE).all()


def test_the_benchmarks_limit_is_a_squared_displacement_of_two_hundredths_of_a_square_centimetre() -> None:
    assert pytest.approx(0.02) == (100.0 * contacts.BENCHMARK_SPEED / 30.0) ** 2


def test_a_single_slip_does_not_break_a_contact() -> None:
    forward = np.zeros((20, 4))
    forward[10:] = 0.02
    positions = feet(np.tile(contacts.REST_HEIGHTS, (20, 1)), forward)
    assert contacts.detect(positions, RATE).all()


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_short_clips_have_contacts(frames: int) -> None:
    positions = feet(np.tile(contacts.REST_HEIGHTS, (frames, 1)), np.zeros((frames, 4)))
    assert contacts.detect(positions, RATE).all()


@pytest.mark.parametrize(
    ("height", "weight"), [(-0.1, 1.0), (0.0, 1.0), (0.0125, 2.0 - np.sqrt(2.0)), (0.025, 0.0), (1.0, 0.0)]
)
def test_the_weight_of_a_slide_falls_from_one_on_the_floor_to_zero(height: float, weight: float) -> None:
    assert float(contacts.slide_weight(np.array(height))) == pytest.approx(weight)


def test_foot_slide_counts_low_toes_of_each_window_apart() -> None:
    toes = np.zeros((2, 4, 2, 3))
    toes[..., 1, 1] = 0.3  # one foot in the air throughout
    toes[0, :, :, 2] = 0.01 * np.arange(4)[:, None]
    toes[1, 2:, 0, 1] = 0.1  # the other leaves the floor half-way
    travel, samples = contacts.foot_slide(toes)
    np.testing.assert_allclose(travel, [3.0, 0.0])
    np.testing.assert_array_equal(samples, [3, 1])
    assert [float(part) for part in contacts.foot_slide(toes[0])] == pytest.approx([3.0, 3.0])
