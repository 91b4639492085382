from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from retarget.characters import RIGS, Rig, build, random_motion

from interpose import rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget import map_skeleton, to_humanoid
from interpose.retarget.mapping import MOST_SPARE
from interpose.retarget.naming import split_side
from interpose.skeleton import HUMANOID, Skeleton

IDS = [f"{rig.profile}-{rig.hips}" for rig in RIGS]


def without(skeleton: Skeleton, *names: str) -> Skeleton:
    """The skeleton less those joints and all below them."""
    kept: list[int] = []
    for joint, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents, strict=True)):
        if name not in names and (parent < 0 or parent in kept):
            kept.append(joint)
    parents = tuple(-1 if skeleton.parents[j] < 0 else kept.index(skeleton.parents[j]) for j in kept)
    return Skeleton(tuple(skeleton.names[j] for j in kept), parents, skeleton.offsets[kept])


@pytest.mark.parametrize("rig", RIGS, ids=IDS)
def test_every_dialect_maps_all_that_it_has(rig: Rig) -> None:
    mapping = map_skeleton(build(rig))
    pairs = mapping.pairs()
    assert mapping.profile == rig.profile
    assert pairs["Hips"] == rig.hips
    assert pairs["Head"] == rig.head
    assert pairs["Neck"] == rig.neck[0]
    for side, spelled in zip(("Left", "Right"), rig.sides, strict=True):
        for ours, theirs in zip(("UpLeg", "Leg", "Foot", "Toe"), rig.leg, strict=False):
            assert pairs[side + ours] == theirs.replace("*", spelled)
        for ours, theirs in zip(("Shoulder", "Arm", "ForeArm", "Hand"), rig.arm, strict=False):
            assert pairs[side + ours] == theirs.replace("*", spelled)
    spine = rig.spine
    assert pairs["Spine2"] == spine[-1]
    assert pairs["Spine"] == spine[0]
    expected = {2: None, 3: spine[1 % len(spine)], 4: spine[1 % len(spine)], 5: spine[2 % len(spine)]}
    assert pairs["Spine1"] == expected[len(spine)]
    assert mapping.missing == (("Spine1",) if len(spine) == 2 else ())
    assert set(mapping.unmapped) == set(mapping.skeleton.names) - set(pairs.values())


@pytest.mark.parametrize("rig", RIGS, ids=IDS)
def test_the_rest_pose_becomes_the_humanoid_t_pose_on_the_floor(rig: Rig) -> None:
    skeleton = build(rig)
    mapping = map_skeleton(skeleton)
    standing = random_motion(skeleton, 0, frames=1, spread=0.0)
    pose = to_humanoid(standing, mapping)
    np.testing.assert_allclose(rotation.angle(pose.global_rotations()), 0.0, atol=1e-7)
    assert mapping.scale == pytest.approx(0.8587 / 0.78)


def test_the_humanoid_maps_to_itself_unchanged() -> None:
    mapping = map_skeleton(HUMANOID)
    assert mapping.joints == tuple(range(22))
    np.testing.assert_array_equal(mapping.rest_global, np.tile(rotation.IDENTITY, (22, 1)))
    assert mapping.scale == 1.0
    assert mapping.lift == pytest.approx(0.0, abs=1e-15)
    motion = random_motion(HUMANOID, 3)
    np.testing.assert_allclose(to_humanoid(motion, mapping).global_positions(), motion.global_positions(), atol=1e-12)


def test_the_fallback_tells_left_from_right_by_the_feet() -> None:
    rig = next(rig for rig in RIGS if rig.profile == "hierarchy")
    skeleton = build(rig)
    turned = Skeleton(skeleton.names, skeleton.parents, skeleton.offsets * np.array([-1.0, 1.0, -1.0]))
    mirrored = Skeleton(skeleton.names, skeleton.parents, skeleton.offsets * np.array([-1.0, 1.0, 1.0]))
    assert map_skeleton(turned).pairs()["LeftUpLeg"] == "xb1"  # the whole body turned round
    assert map_skeleton(mirrored).pairs()["LeftUpLeg"] == "yb1"  # the sides exchanged
    assert map_skeleton(mirrored).pairs()["LeftHand"] == "yc4"


@pytest.mark.parametrize(
    ("gone", "said"),
    [(("LeftLeg",), "LeftLeg"), (("RightUpLeg",), "RightUpLeg"), (("RightFoot", "LeftFoot"), "LeftFoot, RightFoot")],
)
def test_missing_legs_are_named(gone: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError, match=f"missing {said}"):
        map_skeleton(without(build(RIGS[0]), *gone))


def test_missing_hips_are_named() -> None:
    skeleton = Skeleton(("spoon", "LeftFoot", "RightFoot"), (-1, 0, 0), np.eye(3))
    with pytest.raises(InputError, match="missing Hips, LeftUpLeg"):
        map_skeleton(skeleton)


def many_legged(legs: int) -> Motion:
    """A body with legs all round it, in a few poses."""
    names, parents, offsets = ["body"], [-1], [np.zeros(3)]
    for leg in range(legs):
        out = np.array([np.cos(2 * np.pi * leg / legs), 0.0, np.sin(2 * np.pi * leg / legs)])
        places = (0.05 * out, 0.2 * out + [0.0, 0.1, 0.0], 0.2 * out - [0.0, 0.3, 0.0])
        for part, place in zip("abc", places, strict=True):
            names.append(f"{part}{leg}")
            parents.append(0 if part == "a" else len(names) - 2)
            offsets.append(place)
    return random_motion(Skeleton(tuple(names), tuple(parents), np.array(offsets)), 1, frames=4)


def test_what_has_eight_legs_is_no_humanoid() -> None:
    with pytest.raises(InputError, match=r"6\d % of its bones' length has no counterpart .* more than two legs"):
        map_skeleton(many_legged(8))


def with_tails(rig: Rig) -> Skeleton:
    tails = tuple((f"tail{i}", rig.hips, (0.0, 0.5, -1.0)) for i in range(4))
    return build(replace(rig, extra=tails))


def test_names_of_a_known_family_are_believed_whatever_hangs_on_them() -> None:
    known = map_skeleton(with_tails(next(rig for rig in RIGS if rig.profile == "Mixamo")))
    assert known.spare > MOST_SPARE
    assert known.missing == ()
    with pytest.raises(InputError, match="tail0, tail1"):
        map_skeleton(with_tails(next(rig for rig in RIGS if rig.profile == "hierarchy")))


@pytest.mark.parametrize("rig", RIGS, ids=IDS)
def test_little_of_a_humanoid_is_spare(rig: Rig) -> None:
    assert map_skeleton(build(rig)).spare < 0.1


def test_a_skeleton_without_lengths_is_refused() -> None:
    skeleton = build(RIGS[0])
    with pytest.raises(InputError):
        map_skeleton(Skeleton(skeleton.names, skeleton.parents, np.zeros_like(skeleton.offsets)))


@pytest.mark.parametrize(
    ("gone", "missing"),
    [
        (("LeftToe", "RightToe"), {"LeftToe", "RightToe"}),
        (("Neck",), {"Neck", "Head"}),
        (("LeftShoulder",), {"LeftShoulder", "LeftArm", "LeftForeArm", "LeftHand"}),
        (("Spine",), {n for n in HUMANOID.names if "Leg" not in n and "Foot" not in n and "Toe" not in n} - {"Hips"}),
    ],
)
def test_optional_joints_may_be_missing(gone: tuple[str, ...], missing: set[str]) -> None:
    skeleton = without(build(RIGS[0]), *gone)
    mapping = map_skeleton(skeleton)
    assert set(mapping.missing) == missing
    pose = to_humanoid(random_motion(skeleton, 1), mapping)
    np.testing.assert_allclose(np.linalg.norm(pose.local_rotations, axis=-1), 1.0)


@pytest.mark.parametrize(
    ("name", "side", "part"),
    [
        ("LeftUpLeg", "Left", "upleg"),
        ("mixamorig:RightArm", "Right", "arm"),
        ("L_Thigh", "Left", "thigh"),
        ("thigh.r", "Right", "thigh"),
        ("lfemur", "Left", "femur"),
        ("CC_Base_R_Calf", "Right", "calf"),
        ("ValveBiped.Bip01_L_Hand", "Left", "hand"),
        ("pelvis", "", "pelvis"),
        ("Leg", "", "leg"),
    ],
)
def test_sides_are_read_however_they_are_spelled(name: str, side: str, part: str) -> None:
    assert split_side(name) == (side, part)
