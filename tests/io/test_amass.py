"""AMASS files that the tests write themselves: poses whose joints are known, all widths, and every kind of damage."""

from __future__ import annotations

import os
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mocap_files import UPRIGHT, amass_arrays, npz
from numpy import ndarray
from scipy.spatial.transform import Rotation
from strategies import motions

from interpose import io, retarget
from interpose.errors import InputError
from interpose.io import amass, grounding
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

NAMES = """
    pelvis left_hip right_hip spine1 left_knee right_knee spine2 left_ankle right_ankle spine3 left_foot right_foot
    neck left_collar right_collar head left_shoulder right_shoulder left_elbow right_elbow left_wrist right_wrist
""".split()  # noqa: SIM905
"""The first 22 joints in the order in which the body models' makers list them."""


def parsed(content: dict[str, Any]) -> Motion:
    return amass.parse(npz(content), "clip.npz")


def at(motion: Motion, name: str, frame: int = 0) -> ndarray:
    """Where a joint is, relative to the pelvis."""
    points = motion.global_positions()[frame]
    return points[NAMES.index(name)] - points[0]


def test_the_joints_are_those_of_the_body_models_in_their_order() -> None:
    ours = [name.lower() for name in amass.SMPL_SKELETON.names]
    assert ours == [name.replace("left_", "l_").replace("right_", "r_") for name in NAMES]
    parents = [amass.SMPL_SKELETON.names[p] if p >= 0 else "" for p in amass.SMPL_SKELETON.parents]
    above = dict(zip(amass.SMPL_SKELETON.names, parents, strict=True))
    assert (above["L_Collar"], above["Neck"], above["L_Hip"]) == ("Spine3", "Spine3", "Pelvis")
    assert (above["R_Wrist"], above["R_Foot"], above["Spine3"]) == ("R_Elbow", "R_Ankle", "Spine2")
    flipped = amass.SMPL_SKELETON.offsets * np.array([-1.0, 1.0, 1.0])
    for name in ("Hip", "Knee", "Ankle", "Foot", "Collar", "Shoulder", "Elbow", "Wrist"):
        left, right = (amass.SMPL_SKELETON.index(side + name) for side in ("L_", "R_"))
        np.testing.assert_allclose(amass.SMPL_SKELETON.offsets[right], flipped[left])


def test_a_t_pose_stands_on_the_floor_looking_along_z_with_its_left_at_x() -> None:
    motion = parsed(amass_arrays())
    assert (len(motion), motion.rate) == (3, 120.0)
    sums = np.zeros((22, 3))
    for joint, parent in enumerate(amass.SMPL_SKELETON.parents[1:], start=1):
        sums[joint] = sums[parent] + amass.SMPL_SKELETON.offsets[joint]
    np.testing.assert_allclose(motion.global_positions() - motion.root_positions[:, None], [sums] * 3, atol=1e-9)
    assert at(motion, "left_wrist")[0] > 0.6
    assert at(motion, "right_wrist")[0] < -0.6
    assert at(motion, "head")[1] > 0.5
    assert at(motion, "left_foot")[2] > at(motion, "left_ankle")[2] + 0.1
    heights = motion.global_positions()[0, :, 1]
    assert min(heights) == pytest.approx(grounding.TOE_HEIGHT)
    assert 1.4 < max(heights) < 1.7


@pytest.mark.parametrize(
    ("joint", "turn", "moved", "towards"),
    [
        ("left_elbow", [0.0, -90.0, 0.0], "left_wrist", [0.0, 0.0, 1.0]),
        ("right_elbow", [0.0, 90.0, 0.0], "right_wrist", [0.0, 0.0, 1.0]),
        ("left_shoulder", [0.0, 0.0, 90.0], "left_elbow", [0.0, 1.0, 0.0]),
        ("right_knee", [90.0, 0.0, 0.0], "right_ankle", [0.0, 0.0, -1.0]),
        ("left_hip", [-90.0, 0.0, 0.0], "left_knee", [0.0, 0.0, 1.0]),
        ("spine3", [0.0, 0.0, 90.0], "neck", [-1.0, 0.0, 0.0]),
    ],
)
def test_a_joint_turned_by_90_degrees_takes_the_next_one_with_it(
    joint: str, turn: list[float], moved: str, towards: list[float]
) -> None:
    content = amass_arrays()
    content["poses"][:, 3 * NAMES.index(joint) :][:, :3] = np.radians(turn)
    motion, resting = parsed(content), parsed(amass_arrays())
    bone = at(motion, moved) - at(motion, joint)
    assert bone / np.linalg.norm(bone) == pytest.approx(towards, abs=0.15)  # bones of the T-pose are not quite square
    turned = Rotation.from_euler("xyz", turn, degrees=True).apply(at(resting, moved) - at(resting, joint))
    np.testing.assert_allclose(bone, turned, atol=1e-9)
    np.testing.assert_allclose(at(motion, joint), at(resting, joint), atol=1e-9)


def test_z_is_up_in_the_file_and_y_in_the_motion() -> None:
    content = amass_arrays(4)
    content["trans"] = np.array([[0.0, 0.0, 0.9], [1.0, 0.0, 0.9], [0.0, 2.0, 0.9], [0.0, 0.0, 3.9]])
    root = parsed(content).root_positions
    np.testing.assert_allclose(root - root[0], [[0, 0, 0], [1, 0, 0], [0, 0, -2], [0, 3, 0]], atol=1e-12)


def test_the_root_turns_about_the_vertical() -> None:
    content = amass_arrays(2)
    quarter = Rotation.from_rotvec([0.0, 0.0, np.pi / 2.0])  # AMASS's vertical
    content["poses"][1, :3] = (quarter * Rotation.from_rotvec(UPRIGHT)).as_rotvec()
    motion = parsed(content)
    x, y, z = at(motion, "left_wrist", 0)
    np.testing.assert_allclose(at(motion, "left_wrist", 1), [z, y, -x], atol=1e-9)


@pytest.mark.parametrize(
    ("width", "key"), [(156, "mocap_framerate"), (165, "mocap_frame_rate"), (72, "mocap_framerate")]
)
def test_all_body_models_give_the_same_22_joints(width: int, key: str) -> None:
    body = np.random.default_rng(0).normal(0.0, 0.3, (5, 66))
    content = amass_arrays(5, width, mocap_framerate=None)
    content |= {key: np.array(100), "poses": np.concatenate([body, np.full((5, width - 66), 9.0)], axis=1)}
    motion = parsed(content)
    reference = parsed(amass_arrays(5, mocap_framerate=100) | {"poses": np.pad(body, ((0, 0), (0, 90)))})
    assert motion.rate == 100.0
    np.testing.assert_array_equal(motion.global_positions(), reference.global_positions())


def test_parts_of_the_pose_serve_where_the_whole_is_missing() -> None:
    content = amass_arrays(4, 165, surface_model_type=np.array("smplx"))
    content["poses"][:, 5:66] = 0.1
    parts = {"root_orient": content["poses"][:, :3], "pose_body": content["poses"][:, 3:66]}
    np.testing.assert_array_equal(
        parsed(content | parts | {"poses": None}).global_positions(), parsed(content).global_positions()
    )


@pytest.mark.parametrize("kind", ["float32", "float64", "int16"])
def test_any_kind_of_number_is_read(kind: str) -> None:
    content = amass_arrays()
    motion = parsed(content | {"poses": content["poses"].astype(kind), "mocap_framerate": np.array([60], dtype=kind)})
    assert motion.rate == 60.0
    assert motion.local_rotations.dtype == float


def test_what_else_a_file_holds_is_not_looked_at(tmp_path: Path) -> None:
    """Pickled labels are common; they are left where they are."""
    np.savez_compressed(
        tmp_path / "clip.npz", **amass_arrays(labels=np.array([{"a": 1}, None], dtype=object), betas=None)
    )
    assert len(io.read(tmp_path / "clip.npz")) == 3


@given(motion=motions(st.just(amass.SMPL_SKELETON)))
def test_a_motion_written_as_amass_comes_back(motion: Motion) -> None:
    """Written here with matrices: the world turned so that Z is up, and each joint's logarithm taken."""
    stand = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    local = Rotation.from_quat(motion.local_rotations.reshape(-1, 4)).as_matrix().reshape(len(motion), 22, 3, 3)
    local[:, 0] = stand @ local[:, 0]
    poses = np.zeros((len(motion), 156))
    poses[:, :66] = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_rotvec().reshape(len(motion), 66)
    where = motion.root_positions @ stand.T + np.array([0.0, -0.23, 0.03])  # the pelvis is not at ``trans``
    back = parsed({"poses": poses, "trans": where, "mocap_framerate": motion.rate})
    assert back.rate == motion.rate
    shift = back.root_positions[0] - motion.root_positions[0]
    np.testing.assert_allclose(back.global_positions() - shift, motion.global_positions(), atol=1e-6)


def test_the_humanoid_stands_in_its_t_pose() -> None:
    motion = parsed(amass_arrays())
    mapping = retarget.map_skeleton(motion)
    assert (mapping.profile, mapping.missing) == ("SMPL", ())
    points = retarget.to_humanoid(motion, mapping).global_positions()[0]
    hips = {name: points[HUMANOID.index(name)] for name in HUMANOID.names}
    straight = hips["LeftUpLeg"] - np.array([0.0, 0.435 + 0.4237, 0.0])
    assert np.linalg.norm(hips["LeftFoot"] - straight) < 0.1  # the feet are apart in the body models' T-pose
    assert hips["LeftToe"][1] == pytest.approx(0.0, abs=0.02)
    assert hips["LeftHand"][0] - hips["LeftArm"][0] > 0.55
    assert hips["Head"][1] > 1.5


def pickled(tmp_path: Path) -> Any:
    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.mkdir, (str(tmp_path / "sprung"),)

    return np.array([Trap()], dtype=object)


CASES: dict[str, tuple[dict[str, Any], str]] = {
    "a body's shape": ({"poses": None, "trans": None, "mocap_framerate": None}, "has no 'poses', so no motion"),
    "no translation": ({"trans": None}, "has no 'trans'"),
    "no rate": ({"mocap_framerate": None}, "has no frame rate; expected mocap_framerate or mocap_frame_rate"),
    "rate zero": ({"mocap_framerate": 0.0}, "frame rate 'mocap_framerate' is 0, expected one number from 1 to 1000"),
    "rate infinite": ({"mocap_framerate": np.inf}, "'mocap_framerate' holds inf"),
    "rate a text": ({"mocap_framerate": "fast"}, "'mocap_framerate' holds <U4, expected real numbers"),
    "two rates": ({"mocap_framerate": [30.0, 60.0]}, "is 2 numbers"),
    "no frames": ({"poses": np.zeros((0, 156)), "trans": np.zeros((0, 3))}, "'poses' has no rows"),
    "one row": ({"poses": np.zeros(156)}, "'poses' is (156,), expected"),
    "another width": ({"poses": np.zeros((3, 63))}, "156 (SMPL-H), 165 (SMPL-X), 72 (SMPL) columns"),
    "three axes": ({"poses": np.zeros((3, 52, 3))}, "'poses' is (3, 52, 3), expected"),
    "translation too short": ({"trans": np.zeros((2, 3))}, "'trans' is (2, 3), expected (3, 3)"),
    "translation a plane": ({"trans": np.zeros((3, 2))}, "'trans' is (3, 2), expected (3, 3)"),
    "parts of a pose": (
        {"poses": None, "root_orient": np.zeros((3, 3)), "pose_body": np.zeros((2, 63))},
        "are (3, 3) and",
    ),
    "a number": ({"poses": None, "root_orient": 1.0, "pose_body": 1.0}, "are () and ()"),
    "nan in the pose": ({"poses": np.full((3, 156), np.nan)}, "'poses' row 1 holds nan"),
    "nan in the translation": ({"trans": np.array([[0.0] * 3, [0, np.nan, 0], [0] * 3])}, "'trans' row 2 holds nan"),
    "beyond the horizon": ({"trans": np.full((3, 3), 1e5)}, "'trans' row 1 holds 100000"),
    "unwound": ({"poses": np.full((3, 156), 1e300)}, "'poses' row 1 holds 1e+300"),
    "complex": ({"poses": np.zeros((3, 156), complex)}, "'poses' holds complex128, expected real numbers"),
    "text": ({"poses": np.full((3, 156), "x")}, "'poses' holds <U1, expected real numbers"),
    "a hand": ({"surface_model_type": "mano"}, "is of the model 'mano', expected a body model (smpl, smplh, smplx)"),
    "bytes": ({"surface_model_type": np.array(b"animal")}, "is of the model 'animal'"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_file_that_is_no_whole_motion_is_refused_in_one_line(case: str) -> None:
    change, message = CASES[case]
    with pytest.raises(InputError) as refused:
        parsed(amass_arrays() | change)
    assert str(refused.value).startswith("clip.npz: ")
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("key", ["poses", "trans", "mocap_framerate"])
def test_pickled_objects_are_never_loaded(tmp_path: Path, key: str) -> None:
    np.savez(tmp_path / "clip.npz", **{**amass_arrays(), key: pickled(tmp_path)})
    with pytest.raises(InputError, match=f"'{key}' holds pickled Python objects, which are never loaded"):
        io.read(tmp_path / "clip.npz")
    assert not (tmp_path / "sprung").exists()


def test_a_model_type_that_is_pickled_does_not_matter(tmp_path: Path) -> None:
    assert len(parsed(amass_arrays(surface_model_type=pickled(tmp_path)))) == 3
    assert len(parsed(amass_arrays(surface_model_type=np.array(["smplx", "smplh"])))) == 3
    assert not (tmp_path / "sprung").exists()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "the file is empty"),
        (b"HIERARCHY\n", "not an AMASS .npz file, or damaged"),
        (b"PK\x03\x04 and no more", "not an AMASS .npz file, or damaged"),
        (b"\x80\x04K\x01.", "not an AMASS .npz file, or damaged"),
    ],
)
def test_what_is_no_archive_is_refused(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        amass.parse(data, "clip.npz")


def test_a_lone_array_is_refused() -> None:
    with pytest.raises(InputError, match="a single array"):
        amass.parse(npy(np.zeros((3, 156))), "clip.npz")


def test_members_that_are_no_arrays_or_too_large_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="'poses' holds bytes"):
        amass.parse(with_poses(b"no array at all"), "clip.npz")
    monkeypatch.setattr(amass, "MAX_BYTES", 1024)
    with pytest.raises(InputError, match="'poses' is larger than 0 MB"):
        parsed(amass_arrays())


def with_poses(raw: bytes) -> bytes:
    """A file whose 'poses' are these bytes."""
    out = BytesIO(npz(amass_arrays(poses=None)))
    with zipfile.ZipFile(out, "a") as archive:
        archive.writestr("poses.npy", raw)
    return out.getvalue()


def npy(values: ndarray) -> bytes:
    out = BytesIO()
    np.save(out, values)
    return out.getvalue()


@pytest.mark.parametrize("shape", [b"(9999999999, 156)", b"(3, 157), }", b"(-3, 156)", b"((3, 156", b"'3'", b"{3: 4}"])
def test_a_header_that_does_not_fit_is_refused(shape: bytes) -> None:
    raw = npy(np.zeros((3, 156)))
    assert raw.count(b"(3, 156), }       ") == 1
    with pytest.raises(InputError, match=r"clip\.npz: 'poses'"):
        amass.parse(with_poses(raw.replace(b"(3, 156), }       ", shape.ljust(18))), "clip.npz")


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.npz: no such file"):
        io.read(tmp_path / "nowhere.npz")


WHOLE = npz(amass_arrays())
POSES = npy(amass_arrays()["poses"])


@st.composite
def damaged(draw: st.DrawFn, whole: bytes) -> bytes:
    """Some bytes of it replaced, its end perhaps cut off; damage near the start, where the header is, is common."""
    start = draw(st.one_of(st.integers(0, 128), st.integers(0, len(whole))))
    data = whole[:start] + draw(st.binary(max_size=12)) + whole[start + draw(st.integers(0, 40)) :]
    return data[: draw(st.one_of(st.none(), st.integers(0, len(whole))))]


@given(data=st.one_of(damaged(WHOLE), damaged(POSES).map(with_poses)))
@settings(max_examples=300)
def test_damage_is_refused_or_harmless(data: bytes) -> None:
    refused = ""
    try:
        assert np.isfinite(amass.parse(data, "clip.npz").global_positions()).all()
    except InputError as error:
        refused = str(error)
    assert "\n" not in refused
