"""The poses that ship, on rigs of several kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from retarget.characters import RIGS, build
from retarget.characters import Rig as Character
from studio_rigs import moved, opened, walk

from interpose import retarget, rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.runtime.inbetween import mapping_of
from interpose.skeleton import HUMANOID
from interpose.studio import pose_library
from interpose.studio.rigs import Clip


def on(motion: Motion) -> Clip:
    return Clip("id", motion, mapping_of(motion))


def check(clip: Clip) -> Motion:
    made = pose_library.posed(clip)
    assert len(made) == len(pose_library.POSES)
    assert made.skeleton == clip.motion.skeleton
    assert made.rate == clip.motion.rate
    at = made.global_positions()
    size = 1.0 / clip.humanoid.scale
    hips = at[:, clip.humanoid.hips]
    np.testing.assert_allclose(hips[:, [0, 2]], 0.0, atol=1e-6)
    feet = [joint for name in ("LeftToe", "RightToe", "LeftFoot", "RightFoot")
            if (joint := clip.humanoid.joints[HUMANOID.index(name)]) is not None]  # fmt: skip
    lowest = at[:, feet, 1].min(axis=1)
    assert lowest.min() > -0.03 * size
    assert lowest.max() < 0.12 * size
    ours = retarget.to_humanoid(made, clip.humanoid).global_positions()
    across = ours[:, HUMANOID.index("LeftUpLeg")] - ours[:, HUMANOID.index("RightUpLeg")]
    assert (across[:, 0] > 0.7 * np.linalg.norm(across, axis=-1)).all(), "the left is at +X: it looks along +Z"
    return made


@pytest.mark.parametrize("motion", [walk(), moved(walk())], ids=["fixed", "moved"])
def test_they_stand_on_the_floor_with_the_hips_above_the_origin(motion: Motion) -> None:
    made = check(opened(motion))
    toes = made.global_positions()[:, [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")], 1]
    np.testing.assert_allclose(toes.min(axis=1), 0.02, atol=2e-3)
    if made.translations is not None:
        np.testing.assert_array_equal(made.translations[:, 0], made.root_positions)


def test_they_are_the_poses_of_their_names() -> None:
    made = pose_library.posed(on(walk()))
    for i, pose in enumerate(pose_library.POSES.values()):
        expected = pose_library.poses.pose(pose)
        apart = rotation.multiply(rotation.inverse(made.local_rotations[i]), expected.local_rotations[0])
        assert rotation.angle(apart).max() < 1e-5
    assert len({made.local_rotations[i].tobytes() for i in range(len(made))}) == len(made)


@pytest.mark.parametrize("character", RIGS, ids=lambda one: f"{one.profile}-{one.hips}")
def test_they_stand_on_every_family_of_rigs(character: Character) -> None:
    skeleton = build(character)
    turns = np.tile(rotation.IDENTITY, (2, len(skeleton), 1))
    root = np.array([[5.0, 0.9, -3.0], [6.0, 0.9, -3.0]])
    check(on(Motion(skeleton, root, turns, 24.0)))


def test_where_the_files_first_frame_is_makes_no_difference() -> None:
    far = replace(walk(), root_positions=walk().root_positions + np.array([7.0, 3.0, -2.0]))
    one, other = pose_library.posed(on(walk())), pose_library.posed(on(far))
    np.testing.assert_allclose(one.global_positions(), other.global_positions(), atol=1e-9)


def test_a_rig_that_is_no_humanoid_has_none(other: Clip) -> None:
    with pytest.raises(InputError, match="this rig is not a humanoid"):
        pose_library.posed(other)
