"""Motions: slices, sampling, resampling, mirroring, velocities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import TypeCheckError
from strategies import humanoid_motions, motions

from interpose import rotation
from interpose.motion import Motion, concatenate, from_global, mirror, resample, sample, velocities
from interpose.skeleton import HUMANOID, MIRROR, Skeleton


def assert_same(a: Motion, b: Motion) -> None:
    """The same motion to the last bit."""
    assert a.skeleton == b.skeleton
    assert a.rate == b.rate
    np.testing.assert_array_equal(a.root_positions, b.root_positions)
    np.testing.assert_array_equal(a.local_rotations, b.local_rotations)
    assert (a.translations is None) == (b.translations is None)
    if a.translations is not None and b.translations is not None:
        np.testing.assert_array_equal(a.translations, b.translations)


def turning(frames: int, rate: float) -> Motion:
    """A humanoid that walks along z at 1 m/s and turns about y at 1 rad/s, all joints with it."""
    seconds = np.arange(frames) / rate
    root = seconds[:, None] * np.array([0.0, 0.0, 1.0])
    local = np.tile(rotation.IDENTITY, (frames, 22, 1))
    local[:, 0] = rotation.from_rotation_vector(seconds[:, None] * np.array([0.0, 1.0, 0.0]))
    return Motion(HUMANOID, root, local, rate)


@given(motions())
def test_slices_put_together_again_are_the_motion(motion: Motion) -> None:
    for cut in range(1, len(motion)):
        assert_same(concatenate(motion[:cut], motion[cut:]), motion)
    assert_same(motion[-1], motion[len(motion) - 1])
    assert len(motion[0]) == 1


def test_a_frame_that_is_not_there_raises() -> None:
    motion = turning(4, 30.0)
    for frame in (4, -5):
        with pytest.raises(IndexError, match="of a motion of 4 frames"):
            motion[frame]


def test_motions_of_other_skeletons_or_rates_do_not_join() -> None:
    motion = turning(4, 30.0)
    with pytest.raises(ValueError, match="share"):
        concatenate(motion, turning(4, 60.0))


@given(motions())
def test_whole_frames_are_sampled_unchanged(motion: Motion) -> None:
    assert_same(sample(motion, np.arange(len(motion), dtype=float)), motion)
    assert_same(sample(motion, np.array([-3.0, len(motion) + 5.0])), concatenate(motion[0], motion[-1]))


@given(motions(), st.floats(0.0, 1.0))
def test_between_two_frames_the_root_is_linear_and_joints_slerp(motion: Motion, part: float) -> None:
    if len(motion) == 1:
        return
    at = sample(motion, np.array([part]))
    root = motion.root_positions
    np.testing.assert_allclose(at.root_positions[0], (1.0 - part) * root[0] + part * root[1], atol=1e-12)
    expected = rotation.slerp(motion.local_rotations[0], motion.local_rotations[1], np.array(part))
    apart = rotation.angle(rotation.multiply(rotation.inverse(expected), at.local_rotations[0]))
    assert np.max(apart) < 1e-7


@given(motions())
def test_resampling_to_the_same_rate_is_the_identity(motion: Motion) -> None:
    assert_same(resample(motion, motion.rate), motion)


@pytest.mark.parametrize("rate", [24.0, 25.0, 29.97, 30.0, 50.0, 60.0, 120.0])
@pytest.mark.parametrize("target", [24.0, 30.0, 120.0])
def test_resampling_keeps_the_motion_and_its_duration(rate: float, target: float) -> None:
    there = resample(turning(101, rate), target)
    assert there.rate == target
    assert 0.0 <= 100 / rate - there.duration < 1.0 / target
    expected = turning(len(there), target)
    np.testing.assert_allclose(there.root_positions, expected.root_positions, atol=1e-9)
    np.testing.assert_allclose(there.local_rotations, expected.local_rotations, atol=1e-9)


@given(motions())
def test_every_second_frame_of_a_doubled_rate_is_the_motion(motion: Motion) -> None:
    doubled = resample(motion, 2.0 * motion.rate)
    assert len(doubled) == 2 * len(motion) - 1
    assert_same(replace(doubled[::2], rate=motion.rate), motion)


@pytest.mark.parametrize("rate", [24.0, 25.0, 29.97, 30.0, 50.0, 60.0, 120.0])
def test_rounding_loses_no_frame(rate: float) -> None:
    point = Skeleton(("root",), (-1,), np.zeros((1, 3)))
    for frames in range(1, 400, 23):
        clip = Motion(point, np.zeros((frames, 3)), np.tile(rotation.IDENTITY, (frames, 1, 1)), rate)
        assert len(resample(clip, 3.0 * rate)) == 3 * frames - 2
        assert len(resample(resample(clip, rate / 3.0), rate)) == frames - (frames - 1) % 3


@given(humanoid_motions())
def test_mirroring_twice_is_the_identity(motion: Motion) -> None:
    assert_same(mirror(mirror(motion)), motion)


@given(humanoid_motions())
def test_mirroring_reflects_every_joint(motion: Motion) -> None:
    expected = motion.global_positions()[:, list(MIRROR)] * np.array([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(mirror(motion).global_positions(), expected, atol=1e-11)


@given(motions())
def test_only_the_humanoid_is_mirrored(motion: Motion) -> None:
    with pytest.raises(ValueError, match="retarget"):
        mirror(motion)


@given(motions())
def test_a_motion_from_its_own_global_rotations(motion: Motion) -> None:
    again = from_global(motion.skeleton, motion.root_positions, motion.global_rotations(), motion.rate)
    still = replace(motion, translations=None)
    np.testing.assert_allclose(again.global_positions(), still.global_positions(), atol=1e-9)
    assert np.all(np.sum(again.local_rotations[1:] * again.local_rotations[:-1], axis=-1) >= 0.0)


@given(motions(), st.sampled_from([24.0, 30.0, 120.0]))
def test_velocities_are_backward_differences_a_second(motion: Motion, rate: float) -> None:
    x = motion.global_positions()
    v = velocities(x, rate)
    assert v.shape == x.shape
    np.testing.assert_allclose(x[0] + np.cumsum(v[1:], axis=0) / rate, x[1:], atol=1e-9)
    np.testing.assert_array_equal(v[0], v[1] if len(x) > 1 else np.zeros_like(x[0]))


def test_velocity_is_in_metres_a_second() -> None:
    v = velocities(turning(10, 24.0).root_positions, 24.0)
    np.testing.assert_allclose(v, np.broadcast_to(np.array([0.0, 0.0, 1.0]), (10, 3)), atol=1e-12)


def bad_motions() -> list[tuple[dict[str, object], type[Exception]]]:
    still: dict[str, object] = {
        "skeleton": HUMANOID,
        "root_positions": np.zeros((3, 3)),
        "local_rotations": np.tile(rotation.IDENTITY, (3, 22, 1)),
        "rate": 30.0,
    }
    return [
        (still | {"root_positions": np.zeros((2, 3))}, TypeCheckError),
        (still | {"local_rotations": np.tile(rotation.IDENTITY, (3, 21, 1))}, ValueError),
        (still | {"local_rotations": np.zeros((3, 22, 3))}, TypeCheckError),
        (still | {"rate": 0.0}, ValueError),
        (still | {"rate": float("nan")}, ValueError),
        (still | {"translations": np.zeros((3, 21, 3))}, TypeCheckError),
    ]


@pytest.mark.parametrize(("fields", "error"), bad_motions())
def test_wrong_shapes_and_rates_raise(fields: dict[str, object], error: type[Exception]) -> None:
    with pytest.raises(error):
        Motion(**fields)  # type: ignore[arg-type]
