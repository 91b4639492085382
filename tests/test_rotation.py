"""Rotations obey the axioms of the group SO(3), near the identity and near half a turn too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jaxtyping import TypeCheckError
from numpy import ndarray
from scipy.spatial.transform import Rotation, Slerp
from strategies import angles, batches, directions, quaternions, vectors

from interpose import rotation

TINY = 1e-12
"""What double precision leaves of quaternion products of unit size."""


def distance(a: ndarray, b: ndarray) -> float:
    """Largest difference of two arrays of quaternions as rotations: q and -q are the same."""
    same = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    return float(np.max(same))


@given(batches(quaternions()))
def test_identity_changes_nothing(q: ndarray) -> None:
    assert distance(rotation.multiply(q, rotation.IDENTITY), q) < TINY
    assert distance(rotation.multiply(rotation.IDENTITY, q), q) < TINY


@given(batches(quaternions()))
def test_a_rotation_and_its_inverse_cancel(q: ndarray) -> None:
    identity = np.broadcast_to(rotation.IDENTITY, q.shape)
    assert distance(rotation.multiply(q, rotation.inverse(q)), identity) < TINY
    assert distance(rotation.multiply(rotation.inverse(q), q), identity) < TINY
    assert np.array_equal(rotation.inverse(rotation.inverse(q)), q)


@given(quaternions(), quaternions(), quaternions())
def test_multiplication_is_associative_and_stays_in_the_group(a: ndarray, b: ndarray, c: ndarray) -> None:
    left = rotation.multiply(rotation.multiply(a, b), c)
    assert distance(left, rotation.multiply(a, rotation.multiply(b, c))) < TINY
    assert abs(np.linalg.norm(left) - 1.0) < TINY


@given(quaternions(), quaternions(), vectors())
def test_a_product_rotates_by_its_right_factor_first(a: ndarray, b: ndarray, v: ndarray) -> None:
    together = rotation.rotate(rotation.multiply(a, b), v)
    np.testing.assert_allclose(together, rotation.rotate(a, rotation.rotate(b, v)), atol=1e-11)


@given(quaternions(), vectors(), vectors())
def test_rotating_keeps_lengths_angles_and_handedness(q: ndarray, v: ndarray, w: ndarray) -> None:
    turned_v, turned_w = rotation.rotate(q, v), rotation.rotate(q, w)
    assert abs(turned_v @ turned_w - v @ w) < 1e-10
    np.testing.assert_allclose(np.cross(turned_v, turned_w), rotation.rotate(q, np.cross(v, w)), atol=1e-10)


def test_a_positive_turn_about_y_brings_z_to_x() -> None:
    quarter = rotation.from_rotation_vector(np.array([0.0, np.pi / 2, 0.0]))
    np.testing.assert_allclose(quarter, np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)]), atol=TINY)
    np.testing.assert_allclose(rotation.rotate(quarter, np.array([0.0, 0.0, 1.0])), [1.0, 0.0, 0.0], atol=TINY)


def test_shapes_broadcast() -> None:
    q = rotation.from_rotation_vector(np.linspace(-1.0, 1.0, 30).reshape(5, 2, 3))
    one, v = q[0, 0], np.arange(6.0).reshape(2, 3)
    assert rotation.multiply(one, q).shape == (5, 2, 4)
    assert rotation.multiply(q[:, :1], q[:1]).shape == (5, 2, 4)
    np.testing.assert_allclose(rotation.multiply(q[:, :1], q[:1])[3, 1], rotation.multiply(q[3, 0], q[0, 1]))
    assert rotation.rotate(q, v).shape == (5, 2, 3)
    np.testing.assert_allclose(rotation.rotate(q, v)[4, 1], rotation.rotate(q[4, 1], v[1]))
    assert rotation.slerp(one, q, np.linspace(0.0, 1.0, 5)[:, None]).shape == (5, 2, 4)


@given(batches(quaternions()))
def test_matrices_and_back(q: ndarray) -> None:
    m = rotation.to_matrix(q)
    np.testing.assert_allclose(m @ np.swapaxes(m, -1, -2), np.broadcast_to(np.eye(3), m.shape), atol=TINY)
    np.testing.assert_allclose(np.linalg.det(m), 1.0, atol=TINY)
    assert distance(rotation.from_matrix(m), q) < 1e-7


@given(batches(quaternions()))
def test_six_dimensions_and_back(q: ndarray) -> None:
    x = rotation.to_6d(q)
    np.testing.assert_array_equal(x[..., :3], rotation.to_matrix(q)[..., :, 0])
    np.testing.assert_array_equal(x[..., 3:], rotation.to_matrix(q)[..., :, 1])
    assert distance(rotation.from_6d(x), q) < 1e-7


@given(quaternions(), st.floats(0.1, 10.0), st.floats(0.1, 10.0), st.floats(-5.0, 5.0))
def test_six_dimensions_take_any_two_vectors_of_the_same_frame(q: ndarray, a: float, b: float, shear: float) -> None:
    x = rotation.to_6d(q)
    stretched = np.concatenate([a * x[:3], b * x[3:] + shear * x[:3]])
    assert distance(rotation.from_6d(stretched), q) < 1e-6


@given(batches(quaternions()))
def test_rotation_vectors_and_back(q: ndarray) -> None:
    v = rotation.to_rotation_vector(q)
    np.testing.assert_allclose(np.linalg.norm(v, axis=-1), rotation.angle(q), atol=1e-11)
    assert distance(rotation.from_rotation_vector(v), q) < TINY


@given(directions(), angles)
def test_angle_is_how_far_it_turns(axis: ndarray, angle: float) -> None:
    q = rotation.from_rotation_vector(axis * angle)
    assert abs(rotation.angle(q) - angle) < 1e-11
    assert rotation.angle(q) == rotation.angle(-q)


@given(batches(quaternions()), quaternions())
def test_slerp_ends_at_its_ends(a: ndarray, b: ndarray) -> None:
    assert distance(rotation.slerp(a, b, np.array(0.0)), a) < TINY
    assert distance(rotation.slerp(a, b, np.array(1.0)), np.broadcast_to(b, a.shape)) < 1e-7


@given(quaternions(), quaternions(), st.floats(0.0, 1.0))
def test_slerp_takes_the_shorter_arc_at_a_constant_speed(a: ndarray, b: ndarray, t: float) -> None:
    whole = rotation.angle(rotation.multiply(rotation.inverse(a), b))
    at = rotation.slerp(a, b, np.array(t))
    assert abs(rotation.angle(rotation.multiply(rotation.inverse(a), at)) - t * whole) < 1e-7
    assert abs(rotation.angle(rotation.multiply(rotation.inverse(at), b)) - (1.0 - t) * whole) < 1e-7


@given(quaternions(), quaternions(), st.floats(0.0, 1.0))
def test_slerp_is_scipys(a: ndarray, b: ndarray, t: float) -> None:
    theirs = Slerp([0.0, 1.0], Rotation.from_quat(np.stack([a, b])))(t).as_quat()
    apart = rotation.angle(rotation.multiply(rotation.inverse(a), b))
    if apart < np.pi - 1e-6:  # at half a turn either way round is as short
        assert distance(rotation.slerp(a, b, np.array(t)), theirs) < 1e-7


@given(batches(quaternions()), directions())
def test_swing_times_twist_is_the_rotation(q: ndarray, axis: ndarray) -> None:
    twist = rotation.twist(q, axis)
    assert np.max(np.abs(np.cross(twist[..., :3], axis))) < 1e-9  # it turns about the axis
    swing = rotation.multiply(q, rotation.inverse(twist))
    assert distance(rotation.multiply(swing, twist), q) < TINY
    defined = np.hypot(np.sum(q[..., :3] * axis, axis=-1), q[..., 3]) > 1e-6
    left = np.where(defined, np.sum(swing[..., :3] * axis, axis=-1), 0.0)
    assert np.max(np.abs(left)) < 1e-9  # and what is left does not


def test_the_twist_of_half_a_turn_across_the_axis_is_the_identity() -> None:
    across = np.array([1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(rotation.twist(across, np.array([0.0, 1.0, 0.0])), rotation.IDENTITY)


@given(directions(), directions(), st.floats(0.01, 100.0))
def test_between_brings_one_direction_to_the_other_the_short_way(a: ndarray, b: ndarray, length: float) -> None:
    q = rotation.between(length * a, b)
    np.testing.assert_allclose(rotation.rotate(q, a), b, atol=1e-6)
    assert abs(rotation.angle(q) - np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)) < 1e-6


@given(directions(), st.sampled_from([0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3]))
def test_between_near_opposite_directions(a: ndarray, off: float) -> None:
    normal = np.cross(a, np.roll(a, 1) + np.array([0.1, 0.0, 0.3]))
    b = -a + off * normal / np.linalg.norm(normal)
    q = rotation.between(a, b)
    np.testing.assert_allclose(rotation.rotate(q, a), b / np.linalg.norm(b), atol=1e-6)


@given(st.lists(quaternions(), min_size=1, max_size=8))
def test_continuous_changes_signs_alone_and_leaves_no_jump(frames: list[ndarray]) -> None:
    q = np.stack(frames)[:, None]
    out = rotation.continuous(q)
    assert np.array_equal(np.abs(out), np.abs(q))
    assert np.array_equal(out[0], q[0])
    assert distance(out, q) == 0.0
    assert np.all(np.sum(out[1:] * out[:-1], axis=-1) >= 0.0)


def test_wrong_shapes_raise() -> None:
    with pytest.raises(TypeCheckError):
        rotation.multiply(np.zeros(3), rotation.IDENTITY)
    with pytest.raises(TypeCheckError):
        rotation.rotate(rotation.IDENTITY, np.zeros(4))
    with pytest.raises(TypeCheckError):
        rotation.from_6d(np.zeros((2, 5)))
    with pytest.raises(TypeCheckError):
        rotation.to_matrix(np.array([0, 0, 0, 1]))
    with pytest.raises(ValueError, match="zero norm"):
        rotation.to_matrix(np.zeros(4))


@given(st.floats(-50.0, 50.0))
def test_a_wrapped_angle_is_the_shorter_way_round(turn):
    short = float(rotation.wrapped(turn))
    assert -np.pi <= short < np.pi
    np.testing.assert_allclose([np.sin(short), np.cos(short)], [np.sin(turn), np.cos(turn)], atol=1e-9)
