"""The division of a gap into stances and swings is the cheapest there is, and what is known for sure decides it."""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np
import pytest
from numpy import ndarray

from interpose.runtime.feet.stances import FOOT_DEFAULTS, FootSettings, divide, divide_pairs

FRAMES = 60


def still(frames: int = FRAMES, height: float = 0.01) -> ndarray:
    """A toe that rests."""
    toe = np.zeros((frames, 3))
    toe[:, 1] = height
    return toe


def step(frames: int, begin: int, end: int, way: float, height: float = 0.08) -> ndarray:
    """A toe that rests, swings over ``way`` metres from ``begin`` to ``end``, and rests again."""
    toe = still(frames)
    share = np.clip((np.arange(frames) - begin) / (end - begin), 0.0, 1.0)
    toe[:, 2] = way * share**2 * (3.0 - 2.0 * share)
    toe[:, 1] += height * np.sin(np.pi * share) ** 2
    return toe


def spans(toe: ndarray, probability: ndarray | float, settings: FootSettings = FOOT_DEFAULTS) -> list[tuple[int, int]]:
    """The stances of one foot."""
    found = divide(toe[None], np.broadcast_to(probability, (1, len(toe))).astype(float), settings)[0]
    return [(span.start, span.stop) for span in found]


def test_a_step_lies_between_two_stances() -> None:
    toe = step(FRAMES, 20, 34, 0.6)
    (first, begin), (end, last) = spans(toe, np.where((np.arange(FRAMES) > 21) & (np.arange(FRAMES) < 32), 0.05, 0.95))
    assert (first, last) == (0, FRAMES)
    assert 20 <= begin <= 24
    assert 30 <= end <= 34


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_a_foot_that_does_not_move_stands_unless_a_network_is_sure_that_it_does_not(probability: float) -> None:
    assert spans(still(), probability) == [(0, FRAMES)]


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_a_foot_high_and_fast_swings_whatever_a_network_says(probability: float) -> None:
    toe = still(height=0.3)
    toe[:, 0] = 0.08 * np.arange(FRAMES)
    inner = [(begin, end) for begin, end in spans(toe, probability) if begin > 0 and end < FRAMES]
    assert inner == []


def test_a_foot_that_glides_steps_from_place_to_place() -> None:
    toe = still()
    toe[:, 0] = 0.02 * np.arange(FRAMES)
    found = spans(toe, 0.6)
    assert 3 <= len(found) <= 7
    for begin, end in found:
        assert np.ptp(toe[begin:end, 0]) < 2.0 * FOOT_DEFAULTS.stretch
    for (_, leaves), (lands, _) in pairwise(found):
        assert lands - leaves >= FOOT_DEFAULTS.shortest_swing


def test_two_feet_that_glide_take_turns() -> None:
    toe = still(2 * FRAMES)
    toe[:, 0] = 0.02 * np.arange(2 * FRAMES)
    toes, probability = np.stack([toe, toe]), np.full((2, 2 * FRAMES), 0.4)

    def floating(found: list[list[slice]]) -> int:
        """Frames in which no foot stands."""
        stands = np.zeros(2 * FRAMES, dtype=bool)
        for span in [*found[0], *found[1]]:
            stands[span] = True
        return int(np.count_nonzero(~stands))

    apart, pair = divide(toes, probability), divide_pairs(toes, probability)
    assert floating(pair) < 0.5 * floating(apart)
    leaping = toes + np.where((np.arange(2 * FRAMES) % 20 > 4)[:, None], [0.0, 0.1, 0.0], 0.0)
    assert divide_pairs(leaping[[0, 0]], probability) == divide(leaping[[0, 0]], probability)


def test_short_doubts_neither_break_a_stance_nor_make_one() -> None:
    sure = np.full(FRAMES, 0.9)
    sure[[14, 30, 31]] = 0.1
    assert spans(still(), sure) == [(0, FRAMES)]
    swinging = still(height=0.12)
    swinging[:, 0] = 0.05 * np.arange(FRAMES)
    doubt = np.full(FRAMES, 0.05)
    doubt[[20, 40]] = 0.97
    assert [span for span in spans(swinging, doubt) if span[0] > 0 and span[1] < FRAMES] == []


def test_a_low_key_stands_unless_it_is_known_not_to() -> None:
    toe = step(FRAMES, 2, 16, 0.5)
    unsure = np.full(FRAMES, 0.5)
    assert spans(toe, unsure)[0][0] == 0
    moving = unsure.copy()
    moving[:3] = 0.0
    assert spans(toe, moving)[0][0] > 2


def test_a_foot_does_not_stand_in_the_air_where_a_key_holds_it() -> None:
    toe = still()
    toe[:3, 1] = [0.13, 0.05, 0.02]
    begin, end = spans(toe, 0.95)[-1]
    assert begin <= 3
    assert end == FRAMES
    assert all(first >= 1 or last <= 1 for first, last in spans(toe, 0.95))
    on_a_box = still(height=0.4)
    assert spans(on_a_box, 0.95) == [(0, FRAMES)]


def test_a_stance_from_key_to_key_needs_one_place() -> None:
    toe = still()
    toe[:, 0] = np.linspace(0.0, 0.9 * FOOT_DEFAULTS.step, FRAMES)
    assert spans(toe, 0.95) == [(0, FRAMES)]
    toe[:, 0] = np.linspace(0.0, 2.0 * FOOT_DEFAULTS.step, FRAMES)
    assert len(spans(toe, 0.95)) == 2


def test_each_foot_is_divided_by_itself_and_in_blocks_as_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    draw = np.random.default_rng(0)
    toes = np.cumsum(draw.normal(0.0, 0.01, (5, FRAMES, 3)), axis=1)
    toes[..., 1] = np.abs(toes[..., 1])
    probability = draw.uniform(size=(5, FRAMES))
    together = divide(toes, probability)
    assert together == [divide(toes[k : k + 1], probability[k : k + 1])[0] for k in range(5)]
    monkeypatch.setattr("interpose.runtime.feet.stances._ENDS_AT_ONCE", 7)
    assert divide(toes, probability) == together


def cost(toe: ndarray, probability: ndarray, stands: ndarray) -> float:
    """What a division costs, added up stance by stance and swing by swing as the module says."""
    s, frames = FOOT_DEFAULTS, len(toe)
    sure = np.clip(probability, 0.03, 0.97)
    speed = np.linalg.norm(np.gradient(toe, axis=0), axis=-1)
    low = [toe[key, 1] < s.key_low and probability[key] > 0.03 for key in (0, -1)]
    total, begin = 0.0, 0
    for stance, run in groupby(stands.tolist()):
        end = begin + len(list(run))
        part, inner = slice(begin, end), begin > 0 and end < frames
        if stance:
            place = toe[part].mean(axis=0) if inner else toe[0] if begin == 0 else toe[-1]
            if begin == 0 and end == frames and np.linalg.norm(toe[-1] - toe[0]) > s.step:
                return np.inf
            if begin == 0 and end == frames:  # about the target, within a step of the start
                place = toe[-1]
            if inner and end - begin < s.shortest:
                return np.inf
            total += np.sum((toe[part] - place) ** 2) / (s.loose if inner else s.loose_key) ** 2
            total -= s.trust * np.sum(np.log(sure[part] / (1.0 - sure[part])))
            if not inner:
                hovers = np.maximum(place[1] - toe[part, 1], 0.0) * (place[1] > s.high)
                total += np.sum((hovers / s.high_scale) ** 2)
            if inner:
                above = np.maximum(toe[part, 1] - s.high, 0.0) / s.high_scale
                total += np.sum(np.minimum(above**2, s.high_most))
        else:
            total += 0.5 * np.sum((np.clip(s.clear - toe[part, 1], 0.0, s.clear) / s.lift_scale) ** 2)
            total += s.slow_cost * np.sum(np.clip(1.0 - speed[part] / s.slow, 0.0, 1.0) * (toe[part, 1] < s.high))
            total += s.key_cost * ((begin == 0 and low[0]) + (end == frames and low[1]))
            left, reached = begin > 0 or low[0], end < frames or low[1]
            total += s.change if left else 0.0
            total += s.long_cost * max(np.count_nonzero(toe[part, 1] < s.high) - s.long, 0)
            if inner and end - begin < 2:
                return np.inf
            if left and reached:
                far = np.linalg.norm(toe[min(end, frames - 1)] - toe[max(begin - 1, 0)])
                total += 2.0 * max(s.shortest_swing + far / s.pace_swing - (end - begin), 0.0)
        begin = end
    return float(total)


@pytest.mark.parametrize("seed", range(6))
def test_no_division_is_cheaper(seed: int) -> None:
    draw = np.random.default_rng(seed)
    frames = 11
    toe = np.cumsum(draw.normal(0.0, 0.03, (frames, 3)), axis=0)
    toe[:, 1] = draw.uniform(-0.03, 0.09, frames)
    probability = draw.uniform(size=frames)
    found = np.zeros(frames, dtype=bool)
    for begin, end in spans(toe, probability):
        found[begin:end] = True
    every = (np.arange(2**frames)[:, None] >> np.arange(frames)) & 1
    cheapest = min(cost(toe, probability, row.astype(bool)) for row in every)
    assert cost(toe, probability, found) == pytest.approx(cheapest, abs=1e-9)
