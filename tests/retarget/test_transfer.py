from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from retarget.characters import RIGS, Rig, about, build, random_motion, repose

from interpose import rotation
from interpose.errors import InputError
from interpose.io.grounding import UnitLayout
from interpose.motion import Motion
from interpose.retarget import from_humanoid, map_skeleton, to_humanoid
from interpose.skeleton import HUMANOID, Skeleton

SEEDS = st.integers(0, 2**32 - 1)
RIG = st.sampled_from(RIGS)


def chain(skeleton: Skeleton, top: str) -> list[str]:
    """A joint and all below it."""
    out = [top]
    for name, parent in zip(skeleton.names, skeleton.parents, strict=True):
        if parent >= 0 and skeleton.names[parent] in out:
            out.append(name)
    return out


def turned(a: Motion, b: Motion) -> float:
    """The largest angle between two motions' global rotations."""
    difference = rotation.multiply(rotation.inverse(a.global_rotations()), b.global_rotations())
    return float(rotation.angle(difference).max())


def mapped(motion: Motion, names: set[str | None]) -> list[int]:
    return [j for j, name in enumerate(motion.skeleton.names) if name in names]


@settings(max_examples=12)
@given(rig=RIG, seed=SEEDS)
def test_mapped_joints_return_as_they_went(rig: Rig, seed: int) -> None:
    motion = random_motion(build(rig), seed)
    mapping = map_skeleton(motion)
    back = from_humanoid(to_humanoid(motion, mapping), mapping)
    joints = mapped(motion, set(mapping.pairs().values()))
    angles = rotation.angle(
        rotation.multiply(rotation.inverse(motion.global_rotations()), back.global_rotations())[:, joints]
    )
    assert angles.max() < 1e-6
    hips = mapping.hips
    np.testing.assert_allclose(back.global_positions()[:, hips], motion.global_positions()[:, hips], atol=1e-9)


@settings(max_examples=12)
@given(rig=RIG, seed=SEEDS)
def test_the_whole_pose_returns_beside_its_own_details(rig: Rig, seed: int) -> None:
    motion = random_motion(build(rig), seed)
    mapping = map_skeleton(motion)
    there = to_humanoid(motion, mapping)
    back = from_humanoid(there, mapping, like=motion)
    np.testing.assert_allclose(back.global_positions(), motion.global_positions(), atol=1e-9)
    first = from_humanoid(there[:1], mapping, like=motion[0])
    np.testing.assert_allclose(first.global_positions(), motion[0].global_positions(), atol=1e-9)


@settings(max_examples=12)
@given(seed=SEEDS)
def test_the_humanoid_returns_from_any_skeleton(seed: int) -> None:
    motion = random_motion(HUMANOID, seed)
    for rig in (RIGS[0], RIGS[3], RIGS[6]):
        mapping = map_skeleton(build(rig))
        again = to_humanoid(from_humanoid(motion, mapping), mapping)
        assert turned(motion, again) < 1e-6
        np.testing.assert_allclose(again.root_positions, motion.root_positions, atol=1e-9)


RESTS = ("A", "arms down", "lying on the back", "lying on the side", "facing away", "bent limbs")


@pytest.mark.parametrize("rest", RESTS)
@settings(max_examples=12)
@given(seed=SEEDS)
def test_the_rest_pose_does_not_change_the_motion(rest: str, seed: int) -> None:
    skeleton = build(RIGS[7])
    motion = random_motion(skeleton, seed)
    expected = to_humanoid(motion, map_skeleton(skeleton))
    turns = {}
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        arm, fore = chain(skeleton, side + "Arm"), chain(skeleton, side + "ForeArm")
        leg, shin = (side + "UpLeg", side + "Leg"), side + "Leg"
        if rest in ("A", "arms down"):
            turns |= dict.fromkeys(arm, about("z", -sign * (45.0 if rest == "A" else 85.0)))
        if rest == "A":
            turns |= dict.fromkeys(leg, about("z", sign * 9.0))
        if rest == "bent limbs":
            turns |= dict.fromkeys(fore, about("y", -sign * 30.0))
            turns |= dict.fromkeys(leg, about("x", -15.0)) | {shin: about("x", 10.0)}
    whole = {
        "lying on the back": about("x", -90.0),
        "lying on the side": about("z", 90.0),
        "facing away": about("y", 180.0),
    }
    if rest in whole:
        turns = dict.fromkeys(skeleton.names, whole[rest])
    other, same = repose(skeleton, motion, turns)
    np.testing.assert_allclose(same.global_positions(), motion.global_positions(), atol=1e-9)
    found = to_humanoid(same, map_skeleton(other))
    assert turned(expected, found) < 1e-6
    np.testing.assert_allclose(found.root_positions, expected.root_positions, atol=1e-9)


def along_x(skeleton: Skeleton, motion: Motion) -> tuple[Skeleton, Motion]:
    """The character rebuilt with every bone along its joint's x axis, as LaFAN1's and Bandai-Namco's are."""
    frames = {}
    for name in skeleton.names:
        leg = any(part in name for part in ("UpLeg", "Leg", "Foot", "Toe"))
        if name == "Hips" or "Spine" in name or name in ("Neck", "Head"):
            axes = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]  # x up, y forward, z left
        elif leg and "Foot" not in name and "Toe" not in name:
            axes = [[0, -1, 0], [0, 0, 1], [-1, 0, 0]]  # x down, y forward, z right
        elif leg:
            down = np.arctan2(0.08, 0.157) - (np.radians(21.455) if "Toe" in name else 0.0)
            bone = np.array([0.0, -np.sin(down), np.cos(down)])
            axes = [bone, np.cross([-1.0, 0.0, 0.0], bone), [-1, 0, 0]]
        else:
            sign = 1 if name.startswith("Left") else -1
            axes = [[sign, 0, 0], [0, 0, -1], [0, sign, 0]]
        frames[name] = rotation.inverse(rotation.from_matrix(np.array(axes, dtype=float).T))
    return repose(skeleton, motion, frames)


def walk(skeleton: Skeleton) -> Motion:
    """Upright, knees and elbows bending to and fro, standing on its soles."""
    frames = 41
    phase = np.linspace(0.0, 4.0 * np.pi, frames)
    local = np.tile(rotation.IDENTITY, (frames, len(skeleton), 1))

    def bend(name: str, axis: int, angles: np.ndarray) -> None:
        vector = np.zeros((frames, 3))
        vector[:, axis] = angles
        local[:, skeleton.index(name)] = rotation.from_rotation_vector(vector)

    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        knee = 0.5 * (1.0 + sign * np.sin(phase))
        bend(side + "UpLeg", 0, -knee / 2)
        bend(side + "Leg", 0, knee)
        bend(side + "Foot", 0, -knee / 2)
        bend(side + "Arm", 2, np.full(frames, -sign * 1.2))
        bend(side + "ForeArm", 1, -sign * 0.4 * (1.5 + np.sin(phase)))
    root = np.stack([0.0 * phase, np.full(frames, 0.92), 0.1 * phase], axis=-1)
    return Motion(skeleton, root, local, 30.0)


@pytest.mark.parametrize("names", ["LaFAN1", "none"])
def test_bones_along_one_axis_are_understood_by_profile_or_from_the_motion(names: str) -> None:
    skeleton = build(RIGS[0])
    motion = walk(skeleton)
    other, same = along_x(skeleton, motion)
    if names == "none":
        other = replace(other, names=tuple(f"joint{j}" for j in range(len(other))))
        same = replace(same, skeleton=other)
        with pytest.raises(InputError, match="rest pose"):
            map_skeleton(other)
    mapping = map_skeleton(same)
    assert mapping.profile == ("LaFAN1" if names == "LaFAN1" else "hierarchy")
    expected = to_humanoid(motion, map_skeleton(skeleton))
    found = to_humanoid(same, mapping)
    difference = rotation.angle(
        rotation.multiply(rotation.inverse(expected.global_rotations()), found.global_rotations())
    ).max(axis=0)
    feet = [HUMANOID.index(side + part) for side in ("Left", "Right") for part in ("Foot", "Toe")]
    assert np.delete(difference, feet).max() < 1e-6
    assert difference[feet].max() < np.radians(5.0)  # how far down a flat foot points is not in such a rig
    back = from_humanoid(found, mapping)
    np.testing.assert_allclose(back.global_positions(), same.global_positions(), atol=1e-9)


def test_a_flat_foot_stands_on_the_same_floor() -> None:
    skeleton = build(RIGS[7])
    ankle = (
        0.08 + 0.02 * 0.78
    )  # the toe joint of a rig of unknown measures is taken to be 2 % of the leg above the floor
    rest = np.tile(rotation.IDENTITY, (1, len(skeleton), 1))
    standing = Motion(skeleton, np.array([[1.0, ankle + 0.78 + 0.03, 2.0]]), rest, 30.0)
    points = to_humanoid(standing, map_skeleton(skeleton)).global_positions()[0]
    assert points[HUMANOID.index("LeftToe"), 1] == pytest.approx(0.0, abs=1e-9)
    assert points[HUMANOID.index("RightFoot"), 1] == pytest.approx(0.0745, abs=1e-9)


def test_missing_torso_joints_bend_evenly_and_missing_arms_hang() -> None:
    skeleton = build(RIGS[2])
    motion = random_motion(skeleton, 5)
    pose = to_humanoid(motion, map_skeleton(skeleton)).global_rotations()
    low, middle, high = (pose[:, HUMANOID.index(name)] for name in ("Spine", "Spine1", "Spine2"))
    np.testing.assert_allclose(
        rotation.angle(rotation.multiply(rotation.inverse(low), middle)),
        rotation.angle(rotation.multiply(rotation.inverse(middle), high)),
        atol=1e-6,
    )
    legs = Skeleton(skeleton.names[:10], skeleton.parents[:10], skeleton.offsets[:10])
    still = Motion(legs, np.zeros((1, 3)), np.tile(rotation.IDENTITY, (1, 10, 1)), 30.0)
    points = to_humanoid(still, map_skeleton(legs)).global_positions()[0]
    assert points[HUMANOID.index("LeftHand"), 1] < points[HUMANOID.index("LeftArm"), 1] - 0.5


def test_inner_joints_without_a_counterpart_bend_with_their_neighbours() -> None:
    skeleton = build(RIGS[1])
    bend = np.tile(rotation.IDENTITY, (1, len(skeleton), 1))
    for name in ("Chest3", "Chest4"):
        bend[:, skeleton.index(name)] = about("x", 12.0)
    motion = Motion(skeleton, np.zeros((1, 3)), bend, 30.0)
    mapping = map_skeleton(skeleton)
    back = from_humanoid(to_humanoid(motion, mapping), mapping)
    np.testing.assert_allclose(back.global_positions(), motion.global_positions(), atol=1e-9)


def animated(motion: Motion, seed: int) -> Motion:
    """The motion with every joint's place in its parent's frame moving a little."""
    rng = np.random.default_rng(seed)
    moved = motion.skeleton.offsets + rng.normal(0.0, 0.01, (len(motion), len(motion.skeleton), 3))
    moved[:, 0] = motion.root_positions
    return replace(motion, translations=moved)


def test_the_result_keeps_rate_and_layout() -> None:
    layout = UnitLayout(0.01)
    motion = replace(random_motion(build(RIGS[1]), 2), rate=60.0, layout=layout)
    mapping = map_skeleton(motion)
    there = to_humanoid(motion, mapping)
    assert (there.rate, there.layout) == (60.0, None)
    back = from_humanoid(there, mapping, like=motion[0])
    assert (back.rate, back.layout, len(back)) == (60.0, layout, len(motion))


def test_motions_of_another_skeleton_are_refused() -> None:
    mapping = map_skeleton(build(RIGS[0]))
    stranger = random_motion(build(RIGS[1]), 0)
    with pytest.raises(InputError, match="another skeleton than the mapping"):
        to_humanoid(stranger, mapping)
    with pytest.raises(InputError, match="22-joint"):
        from_humanoid(stranger, mapping)
