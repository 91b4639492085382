"""Opened files: kept as long as there is room, and what the browser is told of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from numpy import ndarray
from retarget.characters import RIGS, about, build, random_motion, repose
from retarget.characters import Rig as Character
from strategies import motions
from studio_rigs import STAND, moved, no_humanoid, opened, walk

from interpose import io
from interpose.data.contacts import CONTACT_JOINTS
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.skeleton import HUMANOID, Skeleton
from interpose.studio import pose_rows, rigs
from interpose.studio.messages import shapes
from interpose.studio.protocol import Rig
from interpose.studio.rigs import RigStore, UnknownRig


def file(number: int) -> bytes:
    motion = replace(STAND, root_positions=STAND.root_positions + np.array([float(number), 0.0, 0.0]))
    return io.serialize(motion, "clip.bvh")


def told(motion: Motion) -> tuple[Rig, dict[str, ndarray]]:
    return rigs.describe(opened(motion), "a.bvh")


def test_the_same_bytes_are_the_same_rig_and_are_read_once() -> None:
    store = RigStore()
    one = store.open(file(1), "one.bvh")
    assert store.open(file(1), "again.bvh") is one
    assert store.get(one.id) is one
    other = store.open(file(2), "one.bvh")
    assert other.id != one.id
    assert store.get(other.id).motion.root_positions[0, 0] == pytest.approx(2.0)


def test_what_is_not_there_is_unknown() -> None:
    with pytest.raises(UnknownRig, match="open its file again"):
        RigStore().get("x")


def test_what_cannot_be_read_is_not_kept() -> None:
    store = RigStore()
    with pytest.raises(InputError, match=r"broken\.bvh"):
        store.open(b"HIERARCHY\n", "broken.bvh")
    with pytest.raises(UnknownRig):
        store.get(rigs.identity(b"HIERARCHY\n"))


def test_only_so_many_are_kept_those_used_last() -> None:
    store = RigStore(most=3)
    ids = [store.open(file(i), "a.bvh").id for i in range(3)]
    store.get(ids[0])
    store.open(file(1), "a.bvh")  # used, too
    ids.append(store.open(file(3), "a.bvh").id)
    with pytest.raises(UnknownRig):
        store.get(ids[2])
    assert [store.get(ids[i]).id for i in (0, 1, 3)] == [ids[0], ids[1], ids[3]]


def test_only_so_many_bytes_are_kept_but_the_newest_always() -> None:
    size = opened(STAND).size
    assert size > len(file(0).split(b"Frame Time")[1])
    store = RigStore(room=2 * size + size // 2)
    ids = [store.open(file(i), "a.bvh").id for i in range(3)]
    with pytest.raises(UnknownRig):
        store.get(ids[0])
    assert store.get(ids[1])
    small = RigStore(room=1)
    last = [small.open(file(i), "a.bvh").id for i in range(3)][-1]
    assert small.get(last)
    with pytest.raises(UnknownRig):
        small.get(ids[1])


@pytest.mark.parametrize("motion", [walk(), moved(walk()), no_humanoid()], ids=["fixed", "moved", "other"])
def test_what_is_told_fits_together(motion: Motion) -> None:
    rig, arrays = told(motion)
    count = len(motion.skeleton)
    assert rig.arrays == shapes(arrays)
    assert rig.joints == list(motion.skeleton.names)
    assert rig.parents == list(motion.skeleton.parents)
    assert rig.moved == (motion.translations is not None)
    assert rig.name == "a.bvh"
    assert rig.rate == pytest.approx(30.0, abs=1e-3)
    np.testing.assert_allclose(arrays["offsets"][1:], motion.skeleton.offsets[1:], atol=1e-6)
    np.testing.assert_allclose(arrays["frames"], pose_rows.of_motion(motion), atol=1e-5)
    assert arrays["vertices"].shape == arrays["normals"].shape == (len(arrays["carriers"]), 3)
    assert arrays["triangles"].shape == (len(arrays["sides"]), 3)
    assert 0 <= arrays["triangles"].min() <= arrays["triangles"].max() < len(arrays["vertices"])
    assert 0 <= arrays["carriers"].min() <= arrays["carriers"].max() < count
    assert set(arrays["sides"].tolist()) <= {0, 1, 2}
    np.testing.assert_allclose(np.linalg.norm(arrays["normals"], axis=-1), 1.0, atol=1e-3)
    assert all(np.isfinite(array).all() for array in arrays.values())


def test_the_figure_has_the_sides_of_the_joints() -> None:
    _, arrays = told(walk())
    for vertex, side in zip(arrays["triangles"][:, 0].tolist(), arrays["sides"].tolist(), strict=True):
        name = HUMANOID.names[int(arrays["carriers"][vertex])]
        allowed = {"L": (1,), "R": (2,)}.get(name[0], (0, 1, 2))  # a shoulder's flesh hangs on the chest
        assert side in allowed


@settings(max_examples=25)
@given(motions())
def test_any_file_that_is_read_can_be_told_of(motion: Motion) -> None:
    rig, arrays = told(motion)
    assert rig.size > 0.0
    assert all(np.isfinite(array).all() for array in arrays.values())


def test_a_humanoid_has_its_joints_by_our_names_and_its_size() -> None:
    rig, _ = told(walk())
    assert rig.humanoid == {name: i for i, name in enumerate(HUMANOID.names)}
    assert rig.reason is None
    assert rig.profile == "LaFAN1"
    assert rig.size == pytest.approx(STAND.root_positions[0, 1], abs=0.03)


def test_another_rig_is_told_why_it_is_none() -> None:
    rig, _ = told(no_humanoid())
    assert rig.humanoid == {}
    assert rig.feet == []
    assert rig.profile is None
    assert rig.reason is not None
    assert "no humanoid" in rig.reason
    assert rig.size == pytest.approx(0.6, abs=0.1)


def heights(rig: Rig, motion: Motion) -> dict[str, tuple[float, float]]:
    """For each joint of the feet, how high it is expected to be, and how high it is in the first frame."""
    name_of = {joint: name for name, joint in rig.humanoid.items()}
    at = motion.global_positions()[0, :, 1]
    return {name_of[foot.joint]: (foot.height, float(at[foot.joint])) for foot in rig.feet}


def check_heights(found: dict[str, tuple[float, float]], size: float = 1.0) -> None:
    """Our figure's soles are 5 mm thicker than those that contacts are judged by, and its soles are quite flat."""
    assert tuple(found) == CONTACT_JOINTS
    for name, (expected, there) in found.items():
        if name.endswith("Toe"):
            assert expected == pytest.approx(there, abs=0.006 * size)
        else:
            assert expected == pytest.approx(there, abs=0.02 * size)
            assert expected > 0.06 * size


def test_feet_stand_at_the_height_that_is_told() -> None:
    rig, _ = told(walk())
    check_heights(heights(rig, STAND))


def test_feet_of_a_rig_in_another_size_stand_at_their_own() -> None:
    for factor in (100.0, 0.5):
        skeleton = Skeleton(HUMANOID.names, HUMANOID.parents, HUMANOID.offsets * factor)
        large = Motion(skeleton, STAND.root_positions * factor, STAND.local_rotations, 30.0)
        rig, arrays = told(large)  # a file in centimetres comes out in metres
        size = float(arrays["frames"][0, 1] / STAND.root_positions[0, 1])
        check_heights(heights(rig, opened(large).motion), size)
        assert rig.size == pytest.approx(size * 0.933, rel=0.02)


SPREAD = {
    name: about("z", (20.0 if "Arm" in name else 8.0) * (1.0 if name.startswith("Right") else -1.0))
    for name in HUMANOID.names
    if name.endswith(("Arm", "Hand", "Leg", "Foot", "Toe"))
}
SIDEWAYS = {name: about("y", 90.0) for name in HUMANOID.names}


@pytest.mark.parametrize("turns", [SPREAD, SIDEWAYS], ids=["spread", "sideways"])
def test_feet_of_a_rig_whose_rest_pose_is_turned_stand_at_the_same_height(turns: dict[str, ndarray]) -> None:
    motion = repose(HUMANOID, walk(), turns)[1]
    rig, _ = told(motion)
    np.testing.assert_allclose(motion.global_positions(), walk().global_positions(), atol=1e-9)
    check_heights(heights(rig, motion))


@pytest.mark.parametrize("character", RIGS, ids=lambda one: f"{one.profile}-{one.hips}")
def test_every_family_of_rigs_has_feet_near_the_floor(character: Character) -> None:
    skeleton = build(character)
    made, _ = told(random_motion(skeleton, 0, spread=0.05))
    assert made.reason is None
    assert made.size == pytest.approx(0.9, abs=0.1)
    toes = {made.humanoid.get("LeftToe"), made.humanoid.get("RightToe")}
    for foot in made.feet:
        assert 0.0 <= foot.height < (0.05 if foot.joint in toes else 0.12)
