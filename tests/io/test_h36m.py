"""Human3.6M files that the tests write themselves, posed with row vectors as its own code does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mocap_files import BODY, PARENTS, exponential_maps, h36m_text, standing, t_pose
from numpy import ndarray
from scipy.spatial.transform import Rotation
from strategies import motions

from interpose import io, retarget, rotation
from interpose.errors import InputError
from interpose.io import grounding, h36m
from interpose.motion import Motion, concatenate
from interpose.skeleton import HUMANOID


def parsed(rows: ndarray) -> Motion:
    return h36m.parse(h36m_text(rows), "walking_1.txt")


def bone(motion: Motion, start: str, end: str, frame: int = -1) -> ndarray:
    points = motion.global_positions()[frame]
    return points[motion.skeleton.index(end)] - points[motion.skeleton.index(start)]


def test_the_joints_and_their_places_among_the_32_are_the_published_ones() -> None:
    names = h36m.H36M_SKELETON.names
    assert set(names) == set(BODY)
    for name, parent in zip(names[1:], h36m.H36M_SKELETON.parents[1:], strict=True):
        assert PARENTS[BODY[name]] == BODY[names[parent]]
    for name in names:
        if name.startswith("Left"):
            other = name.replace("Left", "Right")
            left, right = (h36m.H36M_SKELETON.offsets[h36m.H36M_SKELETON.index(n)] for n in (name, other))
            np.testing.assert_allclose(left, right * np.array([-1.0, 1.0, 1.0]))


def test_a_t_pose_stands_on_the_floor_looking_along_z_with_its_left_at_x() -> None:
    motion = parsed(t_pose())
    assert (len(motion), motion.rate) == (5, 50.0)
    np.testing.assert_allclose(motion.local_rotations, np.broadcast_to(rotation.IDENTITY, (5, 21, 4)), atol=1e-6)
    assert bone(motion, "LeftArm", "LeftHand") == pytest.approx([0.53, 0.0, 0.0], abs=1e-6)
    assert bone(motion, "RightArm", "RightHand") == pytest.approx([-0.53, 0.0, 0.0], abs=1e-6)
    assert bone(motion, "LeftUpLeg", "LeftFoot") == pytest.approx([0.0, -0.87, 0.0], abs=1e-6)
    assert bone(motion, "Hips", "Neck") == pytest.approx([0.0, 0.49, 0.0], abs=1e-6)
    assert bone(motion, "LeftFoot", "LeftToeBase")[2] > 0.1
    assert motion.global_positions()[0, :, 1].min() == pytest.approx(grounding.TOE_HEIGHT, abs=1e-6)


def test_arms_that_the_file_does_not_turn_point_up_and_those_it_turns_by_plus_90_about_z_to_the_left() -> None:
    """Numbers as they are in a file: a rotation is minus its exponential map."""
    rows = t_pose()
    assert rows[-1, 3 + 3 * 16 : 6 + 3 * 16] == pytest.approx([0.0, 0.0, np.pi / 2])
    rows[-1, 3 + 3 * 16 : 6 + 3 * 16] = 0.0
    assert bone(parsed(rows), "LeftArm", "LeftHand") == pytest.approx([0.0, 0.53, 0.0], abs=1e-6)


@pytest.mark.parametrize(
    ("joint", "turn", "moved", "towards"),
    [
        ("LeftForeArm", ("x", 90.0), "LeftHand", [0.0, 0.0, 0.25]),
        ("RightForeArm", ("x", 90.0), "RightHand", [0.0, 0.0, 0.25]),
        ("LeftLeg", ("x", 90.0), "LeftFoot", [0.0, 0.0, -0.43]),
        ("RightUpLeg", ("x", -90.0), "RightLeg", [0.0, 0.0, 0.44]),
        ("RightArm", ("z", 90.0), "RightForeArm", [0.0, -0.28, 0.0]),
        ("Spine1", ("z", 90.0), "Neck", [-0.25, 0.0, 0.0]),
    ],
)
def test_a_joint_turned_by_90_degrees_takes_the_next_one_with_it(
    joint: str, turn: tuple[str, float], moved: str, towards: list[float]
) -> None:
    motion, resting = parsed(t_pose(**{joint: turn})), parsed(t_pose())
    assert bone(motion, joint, moved) == pytest.approx(towards, abs=1e-6)
    assert bone(motion, "Hips", joint) == pytest.approx(bone(resting, "Hips", joint), abs=1e-6)


def test_the_first_columns_are_steps_in_millimetres_in_the_root_s_own_frame() -> None:
    rows = t_pose(41)
    rows[1:, 2] = 20.0
    rows[21:, 4] = -np.pi / 40.0  # a quarter turn to the left in 20 rows
    motion = parsed(rows)
    ahead = np.cumsum(np.full(20, 0.02))
    np.testing.assert_allclose(motion.root_positions[1:21, 2], ahead, atol=1e-6)
    np.testing.assert_allclose(motion.root_positions[:21, 0], 0.0, atol=1e-6)
    angles = np.pi / 40.0 * np.arange(20)  # a step goes where the row before it looks
    end = motion.root_positions[20] + 0.02 * np.array([np.sin(angles).sum(), 0.0, np.cos(angles).sum()])
    np.testing.assert_allclose(motion.root_positions[40], end, atol=1e-5)
    assert bone(motion, "LeftFoot", "LeftToeBase")[0] == pytest.approx(0.14, abs=1e-5)


@pytest.mark.parametrize("lean", [-0.4, 0.3])
def test_people_stand_upright_however_their_pelvis_leans(lean: float) -> None:
    pelvis = rotation.from_rotation_vector(np.array([lean, 0.0, 0.1]))
    motion = standing(10)
    local = motion.local_rotations.copy()
    local[:, 0] = pelvis
    for name in ("LeftUpLeg", "RightUpLeg", "Spine"):
        local[:, motion.skeleton.index(name)] = rotation.inverse(pelvis)
    rows = exponential_maps(replace(motion, local_rotations=local))
    np.testing.assert_allclose(rows[:, :6], 0.0, atol=1e-12)
    back = parsed(rows)
    assert bone(back, "LeftUpLeg", "LeftFoot") == pytest.approx([0.0, -0.87, 0.0], abs=0.02)
    assert bone(back, "Spine1", "Neck") == pytest.approx([0.0, 0.25, 0.0], abs=0.01)


def visits(slope: float) -> Motion:
    """A T-pose that stands for ten frames each at places of a floor that rises by ``slope`` along X."""
    places = [(0.0, 0.0), (1.5, 0.0), (1.5, 2.0), (0.0, 2.0), (-1.0, 1.0)]
    return concatenate(*[replace(standing(10), root_positions=np.tile([x, slope * x, z], (10, 1))) for x, z in places])


@pytest.mark.parametrize("slope", [-0.1, 0.0, 0.05])
def test_up_is_away_from_the_floor_that_still_toes_stand_on(slope: float) -> None:
    normal = np.array([-slope, 1.0, 0.0]) / np.hypot(slope, 1.0)
    assert np.degrees(np.arccos(h36m.up(visits(slope)) @ normal)) < 0.5


def test_toes_on_something_higher_do_not_count() -> None:
    motion = visits(0.0)
    root = motion.root_positions.copy()
    root[10:15, 1] += 0.4
    assert h36m.up(replace(motion, root_positions=root)) == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)


def test_toes_in_one_place_and_toes_that_are_never_still_leave_up_as_it_is() -> None:
    assert h36m.up(standing(1)) == pytest.approx([0.0, 1.0, 0.0])
    assert h36m.up(standing(50)) == pytest.approx([0.0, 1.0, 0.0])
    flying = replace(standing(50), root_positions=np.arange(50)[:, None] * np.array([0.1, 0.02, 0.0]))
    assert h36m.up(flying) == pytest.approx([0.0, 1.0, 0.0])


@given(motion=motions(st.just(h36m.H36M_SKELETON)))
def test_a_motion_written_as_exponential_maps_comes_back(motion: Motion) -> None:
    """Seen from its first pelvis, for the file does not say where that is. Single poses: steps would be too long."""
    for frame in range(len(motion)):
        back = parsed(exponential_maps(motion[frame]))
        np.testing.assert_allclose(from_pelvis(back), from_pelvis(motion[frame]), atol=1e-5)


@given(motion=motions(st.just(h36m.H36M_SKELETON)), seed=st.integers(0, 100))
def test_the_root_path_comes_back(motion: Motion, seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames = 30
    root = np.cumsum(rng.normal(0.0, 0.02, (frames, 3)), axis=0)
    turned = np.tile(motion.local_rotations[:1], (frames, 1, 1))
    for frame in range(1, frames):
        step = rotation.from_rotation_vector(rng.normal(0.0, 0.05, 3))
        turned[frame, 0] = rotation.multiply(turned[frame - 1, 0], step)
    drifting = Motion(h36m.H36M_SKELETON, root, turned, 50.0)
    back = parsed(exponential_maps(drifting))
    if np.array_equal(back.skeleton.offsets, h36m.H36M_SKELETON.offsets):  # its toes may happen to tell another size
        np.testing.assert_allclose(from_pelvis(back), from_pelvis(drifting), atol=1e-4)


def from_pelvis(motion: Motion) -> ndarray:
    """Joint positions in the first frame's pelvis."""
    turn = Rotation.from_quat(motion.local_rotations[0, 0]).inv()
    return turn.apply((motion.global_positions() - motion.root_positions[0]).reshape(-1, 3))


def test_the_humanoid_stands_in_its_t_pose() -> None:
    motion = parsed(t_pose())
    mapping = retarget.map_skeleton(motion)
    assert mapping.missing == ("Spine1",)  # two joints of the spine stand for three
    back = retarget.to_humanoid(motion, mapping)
    np.testing.assert_allclose(back.global_rotations()[0], np.broadcast_to(rotation.IDENTITY, (22, 4)), atol=1e-6)
    assert back.global_positions()[0, HUMANOID.index("LeftToe"), 1] == pytest.approx(0.0, abs=0.01)


def test_blank_lines_a_mark_and_other_line_ends_do_not_matter(tmp_path: Path) -> None:
    text = h36m_text(t_pose())
    (tmp_path / "walking_1.txt").write_bytes(b"\xef\xbb\xbf" + text.replace(b"\n", b"\r\n") + b"\r\n \r\n")
    motion = io.read(tmp_path / "walking_1.txt")
    np.testing.assert_array_equal(motion.global_positions(), parsed(t_pose()).global_positions())
    spaced = h36m.parse(text.replace(b",", b", "), "walking_1.txt")
    np.testing.assert_array_equal(spaced.global_positions(), motion.global_positions())


def changed(row: int, column: int, value: float | str) -> bytes:
    lines = [line.split(b",") for line in h36m_text(t_pose()).splitlines()]
    lines[row][column] = str(value).encode()
    return b"\n".join(b",".join(line) for line in lines)


CASES: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "walking_1.txt: the file is empty"),
    "blank": (b"\n \r\n\n", "walking_1.txt: the file is empty"),
    "a column too few": (
        h36m_text(t_pose()[:, 1:]),
        "line 1: 98 comma-separated fields, expected the 99 numbers",
    ),
    "blanks for commas": (h36m_text(t_pose()).replace(b",", b" "), "line 1: 1 comma-separated fields"),
    "cut short": (h36m_text(t_pose())[:-400], "line 5: "),
    "prose": (b"Please cite our paper.\n", "line 1: 1 comma-separated fields"),
    "binary": (b"\x89PNG\r\n\x1a\n\0\0" * 9, "line 1: 1 comma-separated fields"),
    "a word": (changed(2, 50, "walking"), "line 3: 'walking' is not a number"),
    "a hole": (changed(1, 7, " "), "line 2: '' is not a number"),
    "nan": (changed(3, 98, "nan"), "line 4: holds nan or infinity"),
    "infinity": (changed(3, 0, "-inf"), "line 4: holds nan or infinity"),
    "unwound": (changed(1, 60, 1e9), "line 2: holds an angle of more than a thousand radians"),
    "places for steps": (
        changed(0, 1, 900.0),
        "line 1: moves the root by more than 0.3 m; columns 1 to 6 must be differences",
    ),
    "turned for turns": (
        changed(4, 3, 1.5),
        "line 5: rotates the root by more than 1 rad; columns 1 to 6 must be differences",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_file_that_is_no_whole_motion_is_refused_in_one_line(case: str) -> None:
    data, message = CASES[case]
    with pytest.raises(InputError) as refused:
        h36m.parse(data, "walking_1.txt")
    assert str(refused.value).startswith("walking_1.txt")
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_missing_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.txt: no such file"):
        io.read(tmp_path / "nowhere.txt")


WHOLE = h36m_text(t_pose(2))


@given(
    start=st.integers(0, len(WHOLE)),
    length=st.integers(0, 40),
    put=st.one_of(st.binary(max_size=8), st.text("0123456789.,-+eE_naif\n\r\f \x1c", max_size=12).map(str.encode)),
)
@settings(max_examples=300)
def test_damage_is_refused_or_harmless(start: int, length: int, put: bytes) -> None:
    refused = ""
    try:
        motion = h36m.parse(WHOLE[:start] + put + WHOLE[start + length :], "walking_1.txt")
        assert np.isfinite(motion.global_positions()).all()
    except InputError as error:
        refused = str(error)
    assert "\n" not in refused
