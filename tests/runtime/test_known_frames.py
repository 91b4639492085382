"""Known frames that are no motion are not used; those that are motion all are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import io, retarget, rotation
from interpose.motion import Motion, concatenate, sample
from interpose.runtime import known_frames
from interpose.runtime.inbetween import fill
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID

CASES = Path(__file__).parent.parent / "cases"
ON_22 = retarget.map_skeleton(Motion(HUMANOID, np.zeros((1, 3)), np.tile(rotation.IDENTITY, (1, 22, 1)), 30.0))


def moving(frames: int, rate: float, speed: float = 1.3) -> Motion:
    """A walk of swinging limbs, hips forward at ``speed``."""
    times = np.arange(frames) / rate
    root = np.stack([0.0 * times, 0.93 + 0.02 * np.cos(6.0 * times), speed * times], axis=-1)
    axes = np.random.default_rng(3).normal(size=(22, 3))
    angles = 0.4 * np.sin(5.0 * times[:, None] + np.arange(22))
    return Motion(HUMANOID, root, rotation.from_rotation_vector(angles[..., None] * axes), rate)


@pytest.mark.parametrize(("name", "first"), [("tpose", 1), ("tpose_far", 1)])
def test_a_t_pose_in_the_first_row(name: str, first: int) -> None:
    clip = io.read(CASES / f"{name}.bvh")
    mapping = retarget.map_skeleton(clip)
    kept = known_frames.motion_before(clip[: first + 1], mapping)
    np.testing.assert_array_equal(kept.root_positions, clip[first].root_positions)


def test_a_cut_after_the_target() -> None:
    clip = io.read(CASES / "cut_after.bvh")
    assert len(known_frames.motion_after(clip[40:], retarget.map_skeleton(clip))) == 1


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0, 120.0, 240.0])
@pytest.mark.parametrize("speed", [0.0, 1.3, 9.0])
def test_motion_is_used_whole(rate: float, speed: float) -> None:
    clip = moving(40, rate, speed)
    assert len(known_frames.motion_before(clip, ON_22)) == 40
    assert len(known_frames.motion_after(clip, ON_22)) == 40


@pytest.mark.parametrize("rate", [24.0, 30.0, 120.0])
@pytest.mark.parametrize("ago", [1, 2, 5])
def test_a_jump_of_a_metre_is_a_cut(rate: float, ago: int) -> None:
    clip = moving(12, rate)
    cut = Motion(HUMANOID, clip.root_positions.copy(), clip.local_rotations, rate)
    cut.root_positions[: 12 - ago] += [1.0, 0.0, 0.0]
    assert len(known_frames.motion_before(cut, ON_22)) == ago
    assert len(known_frames.motion_after(cut[::-1], ON_22)) == ago


def test_a_key_alone_is_kept() -> None:
    assert len(known_frames.motion_before(moving(1, 30.0), ON_22)) == 1


def test_filling_after_a_t_pose_gives_what_filling_without_it_gives() -> None:
    clip = io.read(CASES / "tpose.bvh")
    request = Request(method="interp")
    with_it, without = fill(clip, (1, 41), request)[0], fill(clip[1:], (0, 40), request)[0]
    np.testing.assert_allclose(with_it.motion[1:].root_positions, without.motion.root_positions, atol=1e-9)
    assert "not used" in with_it.gaps[0].warnings[0]
    assert not without.gaps[0].warnings


def test_one_known_pose_repeated_is_no_jump() -> None:
    pose = moving(1, 30.0)
    still = sample(concatenate(pose, pose), np.zeros(8))
    assert len(known_frames.motion_before(still, ON_22)) == 8
