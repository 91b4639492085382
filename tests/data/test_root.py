from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interpose import motion as motions
from interpose import rotation
from interpose.data import root
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

RATE = 30.0
ANGLES = st.floats(-3.1, 3.1)


def about_y(angle: np.ndarray | float) -> np.ndarray:
    return rotation.from_rotation_vector(np.multiply.outer(np.asarray(angle, dtype=float), rotation.UP))


def turning(yaw: np.ndarray, seed: int | None = None) -> Motion:
    """A character that walks where it faces, with the given yaw a frame, its joints bent at random if seeded."""
    frames = len(yaw)
    local = np.tile(rotation.IDENTITY, (frames, len(HUMANOID), 1))
    if seed is not None:
        bend = np.random.default_rng(seed).normal(size=(frames, len(HUMANOID), 3))
        local = rotation.from_rotation_vector(0.3 * np.cumsum(bend, axis=0) / np.sqrt(frames))
    local[:, 0] = rotation.multiply(about_y(yaw), local[:, 0])
    place = np.cumsum(np.stack([np.sin(yaw), 0.0 * yaw, np.cos(yaw)], axis=-1) / RATE, axis=0)
    place[:, 1] = 0.95
    return Motion(HUMANOID, place, local, RATE)


def wrapped(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def test_the_rest_pose_faces_z_and_a_quarter_turn_faces_x() -> None:
    for yaw, expected in ((0.0, [0.0, 1.0]), (np.pi / 2, [1.0, 0.0])):
        out = root.trajectory(turning(np.full(5, yaw)).global_positions(), RATE)
        np.testing.assert_allclose(out[:, 2:], [expected] * 5, atol=1e-9)


def test_the_place_is_that_of_the_hips_on_the_ground() -> None:
    clip = turning(np.linspace(0.0, 1.0, 40))
    out = root.trajectory(clip.global_positions(), RATE)
    np.testing.assert_array_equal(out[:, :2], clip.root_positions[:, [0, 2]])
    np.testing.assert_allclose(np.linalg.norm(out[:, 2:], axis=-1), 1.0, atol=1e-12)


@given(yaw=ANGLES, x=st.floats(-5, 5), z=st.floats(-5, 5), seed=st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_turning_and_moving_the_world_turns_and_moves_the_root(yaw: float, x: float, z: float, seed: int) -> None:
    positions = turning(np.linspace(0.0, 3.0, 80), seed).global_positions()
    moved = rotation.rotate(about_y(yaw), positions) + np.array([x, 0.3, z])
    before, after = root.trajectory(positions, RATE), root.trajectory(moved, RATE)
    place = rotation.rotate(about_y(yaw), np.insert(before[:, :2], 1, 0.0, axis=1))[:, [0, 2]] + [x, z]
    np.testing.assert_allclose(after[:, :2], place, atol=1e-9)
    np.testing.assert_allclose(wrapped(root.yaw(after[:, 2:]) - root.yaw(before[:, 2:]) - yaw), 0.0, atol=1e-7)


@given(seed=st.integers(0, 99))
@settings(max_examples=20, deadline=None)
def test_a_mirrored_clip_has_the_mirrored_root(seed: int) -> None:
    clip = turning(np.linspace(0.0, 3.0, 80), seed)
    before = root.trajectory(clip.global_positions(), RATE)
    after = root.trajectory(motions.mirror(clip).global_positions(), RATE)
    np.testing.assert_allclose(after, before * [-1.0, 1.0, -1.0, 1.0], atol=1e-9)


def test_a_clip_played_backwards_has_the_same_roots() -> None:
    positions = turning(np.cumsum(np.random.default_rng(0).normal(0.0, 0.05, 100)), seed=1).global_positions()
    forward, backward = (root.trajectory(p, RATE) for p in (positions, positions[::-1]))
    # the yaw rate is a backward difference, so the window widths, and only they, are half a frame apart
    np.testing.assert_allclose(backward[::-1], forward, atol=0.02)


def test_sway_on_the_spot_is_averaged_away() -> None:
    time = np.arange(150) / RATE
    sway = 0.3 * np.sin(2.0 * np.pi * time * 1.5)
    facing = root.yaw(root.trajectory(turning(sway).global_positions(), RATE)[:, 2:])
    assert np.abs(facing[30:-30]).max() < 0.03


@pytest.mark.parametrize("rate", [0.5, 2.0, 6.0])
def test_a_steady_turn_is_followed_without_lag_up_to_the_ends(rate: float) -> None:
    yaw = np.arange(120) / RATE * rate
    facing = root.yaw(root.trajectory(turning(yaw).global_positions(), RATE)[:, 2:])
    np.testing.assert_allclose(wrapped(facing - yaw), 0.0, atol=1e-6)


def test_a_quick_turn_between_two_stands_stays_quick() -> None:
    yaw = np.clip((np.arange(180) - 90) / 12.0, 0.0, 1.0) * np.pi * 0.75
    facing = np.unwrap(root.yaw(root.trajectory(turning(yaw).global_positions(), RATE)[:, 2:]))
    inside = (facing > 0.1 * facing[-1]) & (facing < 0.9 * facing[-1])
    box = np.convolve(np.pad(yaw, 30, mode="edge"), np.ones(61) / 61, mode="valid")
    boxed = (box > 0.1 * yaw[-1]) & (box < 0.9 * yaw[-1])
    assert inside.sum() < 0.6 * boxed.sum()


@pytest.mark.parametrize("frames", [1, 2, 3, 29, 30, 31, 32])
def test_short_clips_have_roots(frames: int) -> None:
    out = root.trajectory(turning(np.linspace(0.3, 0.4, frames)).global_positions(), RATE)
    assert out.shape == (frames, 4)
    assert np.all(np.abs(root.yaw(out[:, 2:]) - 0.35) < 0.051)


def test_rolling_over_on_the_ground_gives_finite_unit_facings() -> None:
    local = np.tile(rotation.IDENTITY, (90, len(HUMANOID), 1))
    lying = rotation.from_rotation_vector(np.array([-np.pi / 2, 0.0, 0.0]))
    roll = rotation.from_rotation_vector(np.linspace(0.0, 2.0 * np.pi, 90)[:, None] * [0.0, 0.0, 1.0])
    local[:, 0] = rotation.multiply(roll, lying)
    clip = Motion(HUMANOID, np.tile([0.0, 0.15, 0.0], (90, 1)), local, RATE)
    out = root.trajectory(clip.global_positions(), RATE)
    np.testing.assert_allclose(np.linalg.norm(out[:, 2:], axis=-1), 1.0, atol=1e-9)
    yaw = np.unwrap(root.pose_yaw(local[:, 0]))
    assert np.abs(np.diff(yaw)).max() < 0.1


@given(yaw=ANGLES, world=ANGLES, x=st.floats(-1.4, 1.4), z=st.floats(-1.4, 1.4))
@settings(deadline=None)
def test_pose_yaw_turns_with_the_world(yaw: float, world: float, x: float, z: float) -> None:
    tilt = rotation.from_rotation_vector(np.array([x, 0.0, z]))
    q = rotation.multiply(about_y(yaw), tilt)
    assert root.pose_yaw(q).shape == ()
    np.testing.assert_allclose(wrapped(root.pose_yaw(q) - yaw), 0.0, atol=1e-7)
    turned = root.pose_yaw(rotation.multiply(about_y(world), q))
    np.testing.assert_allclose(wrapped(turned - yaw - world), 0.0, atol=1e-7)


def test_pose_yaw_of_hips_upside_down_is_zero() -> None:
    assert root.pose_yaw(np.array([1.0, 0.0, 0.0, 0.0])) == 0.0


def test_pose_yaw_ignores_the_sign_of_the_quaternion() -> None:
    q = about_y(np.linspace(-3.1, 3.1, 50))
    np.testing.assert_allclose(root.pose_yaw(q), root.pose_yaw(-q), atol=1e-12)


def test_ground_vectors_turn_as_poses_do():
    for yaw in (0.0, 0.7, -2.5):
        about = rotation.from_rotation_vector(np.array([0.0, yaw, 0.0]))
        v = np.array([[0.3, -1.2], [2.0, 0.1]])
        there = rotation.rotate(about, np.stack([v[:, 0], np.zeros(2), v[:, 1]], axis=-1))[:, ::2]
        np.testing.assert_allclose(root.turned(v, yaw), there, atol=1e-12)
        assert root.yaw(root.turned(np.array([0.0, 1.0]), yaw)) == pytest.approx(yaw)
