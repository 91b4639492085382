"""Method interp, on any skeleton."""

from dataclasses import replace

import numpy as np
import pytest

from interpose import rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.runtime.interpolate import aligned, interpolate
from interpose.skeleton import HUMANOID, Skeleton

ARM = Skeleton(("base", "elbow", "tip"), (-1, 0, 1), np.array([[0.0, 0, 0], [0, 1, 0], [0, 1, 0]]))


def pose(skeleton=ARM, seed=0, rate=24.0):
    rng = np.random.default_rng(seed)
    return Motion(
        skeleton,
        rng.normal(size=(1, 3)),
        rotation.from_rotation_vector(rng.normal(size=(1, len(skeleton), 3))),
        rate,
    )


@pytest.mark.parametrize("frames", [1, 2, 5, 44, 600])
@pytest.mark.parametrize("skeleton", [ARM, HUMANOID], ids=["arm", "humanoid"])
def test_frame_i_of_n_lies_at_i_over_n_plus_one(skeleton, frames):
    start, target = pose(skeleton, 1), pose(skeleton, 2)
    between = interpolate(start, target, frames)
    assert len(between) == frames
    assert between.rate == start.rate
    for i in {0, frames // 2, frames - 1}:
        t = (i + 1) / (frames + 1)
        np.testing.assert_allclose(
            between.root_positions[i], (1 - t) * start.root_positions[0] + t * target.root_positions[0], atol=1e-12
        )
        turned = rotation.multiply(rotation.inverse(start.local_rotations[0]), between.local_rotations[i])
        whole = rotation.multiply(rotation.inverse(start.local_rotations[0]), target.local_rotations[0])
        np.testing.assert_allclose(rotation.angle(turned), t * rotation.angle(whole), atol=1e-9)


def test_the_sign_of_a_quaternion_does_not_matter():
    start, target = pose(seed=1), pose(seed=2)
    flipped = replace(target, local_rotations=-target.local_rotations)
    one, other = interpolate(start, target, 7), interpolate(start, flipped, 7)
    np.testing.assert_allclose(one.global_positions(), other.global_positions(), atol=1e-9)


def test_equal_keys_stay_where_they_are():
    between = interpolate(pose(), pose(), 3)
    np.testing.assert_allclose(between.global_positions(), np.repeat(pose().global_positions(), 3, axis=0), atol=1e-9)


def test_it_starts_from_the_last_frame_and_ends_at_the_first():
    clip = interpolate(pose(seed=1), pose(seed=2), 9)
    between = interpolate(clip[:3], clip[6:], 3)
    np.testing.assert_allclose(between.root_positions, clip.root_positions[3:6], atol=1e-9)


def test_joint_positions_are_interpolated_too():
    target = pose(seed=2)
    moved = np.stack([target.root_positions, [[0.0, 1.0, 0.0]], [[0.0, 3.0, 0.0]]], axis=1)
    between = interpolate(pose(seed=1), replace(target, translations=moved), 1)
    assert between.translations is not None
    np.testing.assert_allclose(between.translations[0, 1:], [[0.0, 1.0, 0.0], [0.0, 2.0, 0.0]])
    np.testing.assert_array_equal(between.translations[:, 0], between.root_positions)


def test_a_pose_has_no_rate_of_its_own():
    start, target = pose(rate=24.0), pose(seed=1, rate=120.0)
    assert interpolate(start, target, 4).rate == 24.0
    assert aligned(start, target)[1].rate == 24.0


@pytest.mark.parametrize("frames", [0, -1, 10**9])
def test_a_gap_of_no_length_is_refused(frames):
    with pytest.raises(InputError, match=f"got {frames}"):
        interpolate(pose(), pose(), frames)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (HUMANOID, "base, elbow, tip .3 joints., the target's are Hips"),
        (Skeleton(ARM.names, (-1, 0, 0), ARM.offsets), "other parents"),
        (Skeleton(ARM.names, ARM.parents, ARM.offsets * 1.5), "offset of elbow differs by 50.00 cm"),
    ],
)
def test_two_skeletons_are_refused(other, said):
    with pytest.raises(InputError, match=said):
        interpolate(pose(), pose(other), 3)


def test_offsets_that_differ_by_rounding_are_one_skeleton():
    near = Skeleton(ARM.names, ARM.parents, ARM.offsets + 1e-6)
    assert interpolate(pose(), pose(near), 3).skeleton == ARM
