"""Forward kinematics and its inverse undo each other; skeletons refuse trees that are none."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from numpy import ndarray
from scipy.spatial.transform import Rotation
from strategies import motions, skeletons

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.motion import Motion
from interpose.skeleton import HUMANOID, MIRROR, Skeleton


def same_rotations(a: ndarray, b: ndarray) -> bool:
    return bool(np.max(np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))) < 1e-9)


@given(motions())
def test_local_rotations_undo_global_ones(motion: Motion) -> None:
    parents = motion.skeleton.parents
    world = kinematics.global_rotations(motion.local_rotations, parents)
    assert same_rotations(kinematics.local_rotations(world, parents), motion.local_rotations)


@given(motions())
def test_global_rotations_undo_local_ones(motion: Motion) -> None:
    world, parents = motion.local_rotations, motion.skeleton.parents  # any rotations may be called global
    local = kinematics.local_rotations(world, parents)
    assert same_rotations(kinematics.global_rotations(local, parents), world)


@given(motions())
def test_forward_kinematics_is_a_product_of_rigid_transforms(motion: Motion) -> None:
    positions = motion.global_positions()
    offsets = motion.skeleton.offsets if motion.translations is None else motion.translations[-1]
    for joint in range(len(motion.skeleton)):
        chain = np.eye(4)
        at = joint
        while at != -1:
            step = np.eye(4)
            step[:3, :3] = Rotation.from_quat(motion.local_rotations[-1, at]).as_matrix()
            step[:3, 3] = motion.root_positions[-1] if at == 0 else offsets[at]
            chain, at = step @ chain, motion.skeleton.parents[at]
        np.testing.assert_allclose(positions[-1, joint], chain[:3, 3], atol=1e-10)


@given(motions())
def test_turning_and_moving_the_root_moves_the_body_as_one(motion: Motion) -> None:
    turn, shift = rotation.from_rotation_vector(np.array([0.3, -2.0, 0.7])), np.array([1.0, 2.0, 3.0])
    skeleton, world = motion.skeleton, motion.global_rotations()
    place = motion.skeleton.offsets if motion.translations is None else motion.translations
    before = kinematics.global_positions(motion.root_positions, world, skeleton.parents, place)
    after = kinematics.global_positions(
        rotation.rotate(turn, motion.root_positions) + shift, rotation.multiply(turn, world), skeleton.parents, place
    )
    np.testing.assert_allclose(after, rotation.rotate(turn, before) + shift, atol=1e-10)


def test_leading_axes_are_batches() -> None:
    generator = np.random.default_rng(0)
    local = generator.normal(size=(2, 3, 22, 4))
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    root = generator.normal(size=(2, 3, 3))
    world = kinematics.global_rotations(local, HUMANOID.parents)
    positions = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)
    assert positions.shape == (2, 3, 22, 3)
    one = Motion(HUMANOID, root[1], local[1], 30.0)
    np.testing.assert_allclose(positions[1], one.global_positions(), atol=1e-12)


@given(skeletons())
def test_equal_skeletons_hash_alike(skeleton: Skeleton) -> None:
    twin = Skeleton(skeleton.names, skeleton.parents, skeleton.offsets.copy())
    assert twin == skeleton
    assert hash(twin) == hash(skeleton)
    assert twin != Skeleton(skeleton.names, skeleton.parents, skeleton.offsets + 1.0)
    assert twin != "a skeleton"


@pytest.mark.parametrize(
    ("names", "parents", "complaint"),
    [
        (("a", "b"), (-1,), "2 names, 1 parents"),
        (("a", "a"), (-1, 0), "not unique"),
        (("a", "b"), (0, 0), "only root"),
        (("a", "b"), (-1, -1), "only root"),
        (("a", "b", "c"), (-1, 2, 0), "before their children"),
        (("a", "b"), (-1, 1), "before their children"),
    ],
)
def test_what_is_no_tree_raises(names: tuple[str, ...], parents: tuple[int, ...], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        Skeleton(names, parents, np.zeros((len(names), 3)))


def test_the_humanoid_is_lafan1s() -> None:
    # Joint order of LaFAN1 and its bone lengths, metres.
    assert HUMANOID.names[:5] == ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe")
    some = ("RightUpLeg", "Spine", "Head", "LeftShoulder", "RightHand")
    assert [HUMANOID.index(name) for name in some] == [5, 9, 13, 14, 21]
    assert len(HUMANOID) == 22
    lengths = np.linalg.norm(HUMANOID.offsets, axis=1)
    expected = {"LeftLeg": 0.4350, "LeftFoot": 0.4237, "LeftToe": 0.1730, "LeftArm": 0.1128, "LeftForeArm": 0.3300}
    for name, length in expected.items():
        assert abs(lengths[HUMANOID.index(name)] - length) < 5e-5
    assert HUMANOID.parents[HUMANOID.index("LeftShoulder")] == HUMANOID.index("Spine2")
    with pytest.raises(ValueError, match="Tail"):
        HUMANOID.index("Tail")


def test_the_humanoid_is_symmetric() -> None:
    mirrored = HUMANOID.offsets[list(MIRROR)] * np.array([-1.0, 1.0, 1.0])
    np.testing.assert_array_equal(mirrored, HUMANOID.offsets)
    assert [MIRROR[j] for j in MIRROR] == list(range(22))
    assert [MIRROR[p] if p >= 0 else -1 for p in HUMANOID.parents] == [HUMANOID.parents[j] for j in MIRROR]
