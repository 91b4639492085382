"""A pose in its own mirror, on any rig."""

from __future__ import annotations

from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from retarget.characters import RIGS, Rig, about, build, random_motion, repose
from strategies import humanoid_motions

from interpose import retarget, rotation
from interpose.demo import poses
from interpose.motion import Motion, SourceLayout, concatenate, mirror
from interpose.retarget.mirrored import counterparts, mirrored
from interpose.skeleton import HUMANOID, MIRROR, Skeleton

STAND_MAPPING = retarget.map_skeleton(poses.pose(poses.STAND))
TRUNK = [i for i, name in enumerate(HUMANOID.names) if not name.startswith(("Left", "Right"))]


def mapped(motion: Motion) -> retarget.Mapping:
    return retarget.map_skeleton(motion)


def close(one: Motion, other: Motion, atol: float = 1e-5) -> None:
    """The same poses: every joint where it was and turned as it was."""
    np.testing.assert_allclose(one.root_positions, other.root_positions, atol=atol)
    np.testing.assert_allclose(one.global_positions(), other.global_positions(), atol=atol)
    apart = rotation.angle(rotation.multiply(rotation.inverse(one.global_rotations()), other.global_rotations()))
    assert apart.max() < atol


def facing(motion: Motion, hips: int = 0) -> ndarray:
    """The yaw of the hips of a rig whose rest pose looks along +Z."""
    turned = rotation.twist(motion.global_rotations()[:, hips], np.array([0.0, 1.0, 0.0]))
    return 2.0 * np.arctan2(turned[:, 1], turned[:, 3])


@given(humanoid_motions())
def test_twice_is_the_pose_itself(motion: Motion) -> None:
    close(mirrored(mirrored(motion, STAND_MAPPING), STAND_MAPPING), motion)


@pytest.mark.parametrize("rig", RIGS, ids=lambda rig: f"{rig.profile}-{rig.hips}")
def test_twice_is_the_pose_itself_on_every_family_of_rigs(rig: Rig) -> None:
    motion = random_motion(build(rig), 1)
    mapping = mapped(motion)
    once = mirrored(motion, mapping)
    close(mirrored(once, mapping), motion)
    assert np.abs(once.global_positions() - motion.global_positions()).max() > 0.1
    hips = mapping.hips
    np.testing.assert_allclose(once.global_positions()[:, hips], motion.global_positions()[:, hips], atol=1e-9)


@pytest.mark.parametrize("rig", RIGS, ids=lambda rig: f"{rig.profile}-{rig.hips}")
def test_every_joint_is_seen_in_the_mirror(rig: Rig) -> None:
    """On a rig that is its own mirror each joint lies where the other side's is seen."""
    motion = random_motion(build(rig), 2)
    mapping = mapped(motion)
    made = mirrored(motion, mapping)
    hips, yaw = motion.global_positions()[:, mapping.hips], facing(motion, mapping.hips)
    mirror_at = np.stack([np.cos(yaw), np.zeros_like(yaw), -np.sin(yaw)], axis=-1)  # the plane's normal, to the left
    away = motion.global_positions() - hips[:, None]
    seen = away - 2.0 * (away * mirror_at[:, None]).sum(axis=-1, keepdims=True) * mirror_at[:, None]
    for ours in range(len(HUMANOID)):
        here, there = mapping.joints[ours], mapping.joints[MIRROR[ours]]
        if here is not None and there is not None:
            got = made.global_positions()[:, here] - hips
            np.testing.assert_allclose(got, seen[:, there], atol=1e-6, err_msg=HUMANOID.names[ours])


@pytest.mark.parametrize("heading", [0.0, 30.0, -170.0])
def test_feet_exchange_and_the_hips_stay_where_they_are_and_as_they_face(heading: float) -> None:
    for pose in (poses.WALK_LEFT, poses.KARATE, poses.DRUNK):
        motion = poses.pose(pose, (3.0, -2.0), heading)
        made = mirrored(motion, STAND_MAPPING)
        np.testing.assert_allclose(made.root_positions, motion.root_positions, atol=1e-9)
        np.testing.assert_allclose(facing(made), facing(motion), atol=1e-9)
        ahead = np.array([np.sin(facing(motion)[0]), 0.0, np.cos(facing(motion)[0])])
        for name in ("Foot", "Toe"):
            there, here = HUMANOID.index(f"Left{name}"), HUMANOID.index(f"Right{name}")
            for one, other in ((there, here), (here, there)):
                was = motion.global_positions()[0, one] - motion.root_positions[0]
                now = made.global_positions()[0, other] - made.root_positions[0]
                assert was[1] == pytest.approx(now[1], abs=1e-9)
                assert was @ ahead == pytest.approx(now @ ahead, abs=1e-9)


def test_it_is_the_mirror_of_the_humanoid_about_its_own_facing() -> None:
    motion = concatenate(*(poses.pose(one) for one in (poses.AEROPLANE, poses.KARATE)))
    made = mirrored(motion, STAND_MAPPING)
    plain = mirror(motion)
    # `mirror` faces the other way where the hips are turned; turned back, the poses are the same.
    back = rotation.from_rotation_vector(2.0 * facing(motion)[:, None] * np.array([0.0, 1.0, 0.0]))
    expected = rotation.multiply(back[:, None], plain.global_rotations())
    apart = rotation.angle(rotation.multiply(rotation.inverse(expected), made.global_rotations()))
    assert apart.max() < 1e-6


@given(st.integers(0, 1000))
def test_places_of_joints_that_a_file_animates_are_seen_in_the_mirror_and_come_back(seed: int) -> None:
    motion = random_motion(HUMANOID, seed, frames=2)
    rng = np.random.default_rng(seed)
    places = HUMANOID.offsets + rng.normal(0.0, 0.02, (2, len(HUMANOID), 3))
    places[:, 0] = motion.root_positions
    motion = Motion(HUMANOID, motion.root_positions, motion.local_rotations, 30.0, places)
    once = mirrored(motion, STAND_MAPPING)
    twice = mirrored(once, STAND_MAPPING)
    close(twice, motion)
    assert once.translations is not None
    np.testing.assert_array_equal(once.translations[:, 0], once.root_positions)
    assert twice.translations is not None
    np.testing.assert_allclose(twice.translations, places, atol=1e-9)
    longer = np.linalg.norm(places[:, 1:], axis=-1)[:, [MIRROR[i] - 1 for i in range(1, 22)]]
    np.testing.assert_allclose(np.linalg.norm(once.translations[:, 1:], axis=-1), longer, atol=1e-9)


def test_a_turned_rest_pose_makes_no_difference() -> None:
    turns = {name: about("z", 8.0 if name.startswith("Right") else -8.0)
             for name in HUMANOID.names if name.endswith(("Arm", "Hand", "Leg", "Foot"))}  # fmt: skip
    motion = concatenate(poses.pose(poses.KARATE), poses.pose(poses.WARY, (1.0, 0.0), 70.0))
    _, other = repose(HUMANOID, motion, turns)
    expected = mirrored(motion, STAND_MAPPING).global_positions()
    np.testing.assert_allclose(mirrored(other, mapped(other)).global_positions(), expected, atol=1e-6)


def test_joints_beyond_the_22_find_their_other_side_by_name() -> None:
    names = (*HUMANOID.names, "LeftThumb", "LeftIndex", "RightIndex", "RightThumb", "LeftEar", "Tail")
    left, right = HUMANOID.index("LeftHand"), HUMANOID.index("RightHand")
    parents = (*HUMANOID.parents, left, left, right, right, HUMANOID.index("Head"), 0)
    some = np.tile([0.05, 0.0, 0.0], (6, 1))
    skeleton = Skeleton(names, parents, np.concatenate([HUMANOID.offsets, some]))
    mapping = mapped(random_motion(skeleton, 0))
    other = counterparts(mapping)
    pairs = {names[i]: names[j] for i, j in enumerate(other.tolist())}
    assert pairs["LeftThumb"] == "RightThumb"
    assert pairs["RightIndex"] == "LeftIndex"
    assert pairs["LeftEar"] == "LeftEar"
    assert pairs["Tail"] == "Tail"
    assert pairs["LeftFoot"] == "RightFoot"
    assert pairs["Spine1"] == "Spine1"
    np.testing.assert_array_equal(other[other], np.arange(len(names)))


@pytest.mark.parametrize(
    "pair",
    [
        ("lthumb", "rthumb"),
        ("LThumb", "RThumb"),
        ("thumb_01_l", "thumb_01_r"),
        ("DEF-thumb.L.001", "DEF-thumb.R.001"),
        ("mixamorig:LeftHandThumb1", "mixamorig:RightHandThumb1"),
        ("Bip01 L Finger0", "Bip01 R Finger0"),
    ],
)
def test_sides_are_spelled_in_many_ways(pair: tuple[str, str]) -> None:
    left, right = HUMANOID.index("LeftHand"), HUMANOID.index("RightHand")
    names = (*HUMANOID.names, *pair, "lore", "rest", "x.l.y")
    parents = (*HUMANOID.parents, left, right, 0, 0, 0)
    offsets = np.concatenate([HUMANOID.offsets, np.full((5, 3), 0.05)])
    other = counterparts(mapped(random_motion(Skeleton(names, parents, offsets), 0)))
    assert other[22:].tolist() == [23, 22, 24, 25, 26]


def test_a_namesake_elsewhere_is_not_the_other_side() -> None:
    left, head = HUMANOID.index("LeftHand"), HUMANOID.index("Head")
    skeleton = Skeleton(
        (*HUMANOID.names, "LeftProp", "RightProp"),
        (*HUMANOID.parents, left, head),
        np.concatenate([HUMANOID.offsets, np.full((2, 3), 0.05)]),
    )
    other = counterparts(mapped(random_motion(skeleton, 0)))
    assert other[22:].tolist() == [22, 23]


def test_fingers_bend_on_the_other_hand() -> None:
    left, right = HUMANOID.index("LeftHand"), HUMANOID.index("RightHand")
    skeleton = Skeleton(
        (*HUMANOID.names, "LeftThumb", "RightThumb"),
        (*HUMANOID.parents, left, right),
        np.concatenate([HUMANOID.offsets, [[0.05, 0.0, 0.0], [-0.05, 0.0, 0.0]]]),
    )
    stand = poses.pose(poses.STAND)
    local = np.concatenate([stand.local_rotations, np.tile(rotation.IDENTITY, (1, 2, 1))], axis=1)
    local[0, 22] = about("y", 50.0)
    motion = Motion(skeleton, stand.root_positions, local, 30.0)
    made = mirrored(motion, mapped(motion))
    np.testing.assert_allclose(np.abs(made.local_rotations[0, 22] @ rotation.IDENTITY), 1.0, atol=1e-6)
    np.testing.assert_allclose(np.abs(made.local_rotations[0, 23] @ about("y", -50.0)), 1.0, atol=1e-6)


def test_hips_that_hang_beside_their_root_stay_where_they_are() -> None:
    skeleton = Skeleton(
        ("Root", *HUMANOID.names),
        (-1, *(parent + 1 for parent in HUMANOID.parents)),
        np.concatenate([np.zeros((1, 3)), [[0.2, 0.9, 0.05]], HUMANOID.offsets[1:]]),
    )
    motion = random_motion(skeleton, 4)
    mapping = mapped(motion)
    made = mirrored(motion, mapping)
    assert mapping.hips == 1
    np.testing.assert_allclose(made.global_positions()[:, 1], motion.global_positions()[:, 1], atol=1e-9)


def test_rate_and_layout_stay() -> None:
    layout = Mock(spec=SourceLayout)
    motion = Motion(HUMANOID, np.zeros((1, 3)), np.tile(rotation.IDENTITY, (1, 22, 1)), 24.0, layout=layout)
    made = mirrored(motion, STAND_MAPPING)
    assert made.rate == 24.0
    assert made.layout is layout
    assert made.translations is None
