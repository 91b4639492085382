"""The benchmark of filled clips: kept keys, pops and foot slide, `benchmarks/fill_measures.py`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fill_measures import around_keys, fill_quality

from interpose.errors import InputError
from interpose.motion import Motion
from interpose.skeleton import HUMANOID


@pytest.fixture
def walk() -> Motion:
    """An upright humanoid that glides at 1 m/s with one toe on the floor, its arms swinging."""
    time = np.arange(60) / 30.0
    local = np.tile([0.0, 0.0, 0.0, 1.0], (60, 22, 1))
    swing = 0.3 * np.sin(6.0 * time)
    local[:, HUMANOID.index("LeftArm")] = np.stack([np.sin(swing), 0 * time, 0 * time, np.cos(swing)], axis=-1)
    height = -HUMANOID.offsets[[1, 2, 3, 4], 1].sum()
    root = np.stack([0 * time, 0 * time + height, time], axis=-1)
    return Motion(HUMANOID, root, local, 30.0)


def test_the_clip_itself_is_perfect(walk: Motion) -> None:
    found = fill_quality(walk, walk, [0, 20, 59])
    assert found.key_difference == 0.0
    assert found.pops == ()
    assert found.foot_slide == pytest.approx(found.clip_foot_slide) == pytest.approx(100.0 / 30.0, rel=0.05)


def test_a_sign_is_no_difference_and_a_moved_key_is_one(walk: Motion) -> None:
    flipped = replace(walk, local_rotations=-walk.local_rotations)
    assert fill_quality(walk, flipped, [0, 59]).key_difference == 0.0
    root = walk.root_positions.copy()
    root[20] += [0.0, 0.0, 1e-6]
    moved = replace(walk, root_positions=root)
    assert fill_quality(walk, moved, [0, 59]).key_difference == 0.0
    assert fill_quality(walk, moved, [0, 20, 59]).key_difference == pytest.approx(1e-6)


def test_a_jump_beside_a_key_is_a_pop_and_slides(walk: Motion) -> None:
    root = walk.root_positions.copy()
    root[21:59] += [0.1, 0.0, 0.0]
    found = fill_quality(walk, replace(walk, root_positions=root), [0, 20, 59])
    assert found.key_frames == (1, 19, 20, 21, 58)
    assert found.pops == (20, 21, 58)
    assert found.key_accelerations[2] == pytest.approx(0.1 * 900.0, rel=0.1)
    assert found.foot_slide > found.clip_foot_slide


def test_the_frames_around_keys_are_keys_with_a_gap_and_their_neighbours() -> None:
    kept = np.array([1, 0, 0, 1, 1, 1, 0, 1, 0], dtype=bool)
    generated = np.array([0, 1, 1, 0, 0, 0, 1, 0, 0], dtype=bool)
    np.testing.assert_array_equal(np.flatnonzero(around_keys(kept, generated)), [1, 2, 3, 5, 6, 7])


def test_clips_that_do_not_fit_or_have_no_gap(walk: Motion) -> None:
    with pytest.raises(InputError, match="both must share rig and frames"):
        fill_quality(walk, walk[:50], [0, 49])
    with pytest.raises(InputError, match="no generated frame"):
        fill_quality(walk, walk, [3, 4, 5])
