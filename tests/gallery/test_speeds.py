"""Durations: the suggestion, and the groups named fast, medium and slow."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.cluster.vq import kmeans2

from interpose.errors import InputError
from interpose.gallery.speeds import SPEEDS, exact_groups, group_of, suggest

durations = st.lists(st.integers(15, 150), min_size=1, max_size=60)
# fmt: off
SLOW_TO_SETTLE = [
    16, 17, 19, 19, 19, 27, 27, 28, 32, 35, 41, 44, 45, 45, 53, 54, 56, 57, 58, 59,
    61, 62, 63, 65, 66, 71, 72, 74, 78, 78, 79, 86, 88, 91, 93, 94, 96, 104, 105, 112,
    114, 117, 120, 122, 124, 124, 126, 127, 129, 130, 131, 131, 133, 137, 143, 144, 144, 145, 146, 149,
]
# fmt: on
"""Durations that k-means takes more than ten rounds for."""
some_weights = st.lists(st.floats(0.01, 1.0), min_size=60, max_size=60)


def told(steps, weights=None):
    steps = np.array(steps)
    return suggest(steps, np.ones(len(steps)) if weights is None else np.array(weights[: len(steps)], float))


@given(durations, some_weights)
def test_groups_are_ordered_named_and_apart(steps, weights):
    made = told(steps, weights)
    count = len(made.groups)
    assert 1 <= count <= min(3, len(set(steps)))
    assert [group.speed for group in made.groups] == {1: ["medium"], 2: ["fast", "slow"], 3: list(SPEEDS)}[count]
    for group in made.groups:
        assert group.fewest <= group.steps <= group.most
        assert {group.fewest, group.steps, group.most, made.steps} <= set(steps)
    for a, b in zip(made.groups, made.groups[1:], strict=False):
        assert a.most < b.fewest
    assert sum(group.fit for group in made.groups) == pytest.approx(1.0)
    assert all(group.fit > 0.0 for group in made.groups)


@given(durations)
def test_groups_hold_every_duration_of_equal_weights(steps):
    groups = told(steps).groups
    held = [[n for n in steps if group.fewest <= n <= group.most] for group in groups]
    assert sorted(n for mine in held for n in mine) == sorted(steps)
    for group, mine in zip(groups, held, strict=True):
        assert (min(mine), max(mine)) == (group.fewest, group.most)
        assert group.fit == pytest.approx(len(mine) / len(steps), abs=0.01)


@given(durations)
@example(SLOW_TO_SETTLE)
def test_every_duration_is_nearest_to_its_own_groups_mean(steps):
    groups = told(steps).groups
    held = [[n for n in steps if group.fewest <= n <= group.most] for group in groups]
    means = np.array([np.mean(mine) for mine in held])
    for own, mine in zip(means, held, strict=True):
        for n in mine:  # the means are those of points drawn by weight, a little off
            assert abs(n - own) <= np.abs(means - n).min() + 0.5


@given(durations, some_weights)
def test_the_suggestion_is_the_weighted_median(steps, weights):
    made, order = told(steps, weights), np.argsort(steps, kind="stable")
    share = np.cumsum(np.array(weights[: len(steps)])[order])
    share /= share[-1]
    near = [np.array(steps)[order][np.searchsorted(share, at)] for at in (0.498, 0.502)]
    assert near[0] <= made.steps <= near[1]


@given(durations, some_weights, st.integers(-20, 20), st.randoms(use_true_random=False))
def test_neither_the_scale_of_the_weights_nor_the_order_changes_anything(steps, weights, power, random):
    made = told(steps, weights)
    assert told(steps, [w * 2.0**power for w in weights]) == made
    order = list(range(len(steps)))
    random.shuffle(order)
    equal = told(steps)
    assert told([steps[i] for i in order]) == equal
    assert told(steps) == equal


def test_three_clusters_are_told_apart():
    steps = [20, 21, 22, 50, 50, 50, 52, 120, 125]
    made = told(steps)
    assert [(group.fewest, group.most) for group in made.groups] == [(20, 22), (50, 52), (120, 125)]
    assert [group.steps for group in made.groups] == [21, 50, 120]
    assert made.steps == 50
    np.testing.assert_allclose([group.fit for group in made.groups], [3 / 9, 4 / 9, 2 / 9], atol=0.005)


def test_weights_move_the_suggestion():
    steps = [20, 60, 120]
    assert [told(steps, weights).steps for weights in ([8, 1, 1], [1, 8, 1], [1, 1, 8])] == steps
    assert told(steps, [1.0, 0.0, 0.0]).groups == (told([20]).groups[0],)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_fewer_different_durations_make_fewer_groups(count):
    made = told([30, 60, 90][:count] * 5)
    assert [group.steps for group in made.groups] == [30, 60, 90][:count]
    for speed, steps in zip(SPEEDS, {1: (30, 30, 30), 2: (30, 60, 60), 3: (30, 60, 90)}[count], strict=True):
        assert group_of(made, speed).steps == steps


@pytest.mark.parametrize("speed", ["quick", "", "Fast"])
def test_another_word_is_no_speed(speed):
    with pytest.raises(InputError, match=f"unknown speed '{speed}'; use fast, medium, slow"):
        group_of(told([30, 60, 90]), speed)


def inertia(points, label):
    return sum(np.var(points[label == each]) * np.sum(label == each) for each in np.unique(label))


@pytest.mark.filterwarnings("ignore:One of the clusters is empty")
@given(st.lists(st.integers(1, 300), min_size=6, max_size=60))
def test_no_start_of_k_means_finds_better_groups(steps):
    points = np.sort(np.array(steps))
    ours = inertia(points, exact_groups(points))
    for seed in range(8):
        _, label = kmeans2(points[:, None].astype(float), 3, 20, seed=seed, minit="points", missing="warn")
        assert ours <= inertia(points, label) + 1e-6
