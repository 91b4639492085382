"""Reading BVH: dialects, units, rates, and the poses against an independent decoding."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from interpose import io
from interpose.io import bvh_layout, bvh_read
from interpose.motion import Motion

Save = Callable[[str | bytes], Path]
AXES = "XYZ"


def assert_same_poses(one: Motion, other: Motion, tolerance: float = 1e-12) -> None:
    """Same skeleton, places and rotations (q and -q being one rotation)."""
    assert one.skeleton == other.skeleton
    np.testing.assert_allclose(one.root_positions, other.root_positions, rtol=0, atol=tolerance)
    dots = np.abs(np.sum(one.local_rotations * other.local_rotations, axis=-1))
    np.testing.assert_allclose(dots, 1.0, rtol=0, atol=tolerance)
    assert (one.translations is None) == (other.translations is None)
    if one.translations is not None and other.translations is not None:
        np.testing.assert_allclose(one.translations, other.translations, rtol=0, atol=tolerance)


def test_reads_joints_poses_and_layout(save: Save, two_joints: str) -> None:
    motion = io.read(save(two_joints))
    assert motion.skeleton.names == ("Hips", "Spine")
    assert motion.skeleton.parents == (-1, 0)
    np.testing.assert_allclose(motion.skeleton.offsets, [[0, 0, 0], [0, 0.1, 0]])
    np.testing.assert_allclose(motion.root_positions, [[0.10, 0.90, -0.05], [0.11, 0.91, -0.04]])
    expected = Rotation.from_euler("ZYX", [[10, 20, 30], [11, 21, 31]], degrees=True).as_quat()
    np.testing.assert_allclose(motion.local_rotations[:, 0], expected, atol=1e-15)
    assert motion.rate == 30.0
    assert motion.translations is None
    layout = motion.layout
    assert isinstance(layout, bvh_layout.BvhLayout)
    assert layout.channels[1] == ("Zrotation", "Yrotation", "Xrotation")
    assert layout.end_sites == (1,)
    np.testing.assert_allclose(layout.end_offsets, [[0, 0.05, 0]])
    assert layout.metres_per_unit == 0.01
    assert layout.row(1) == "11.0 91.0 -4.0 11.0 21.0 31.0 2.5 -3.5 4.5"


DIALECTS: dict[str, Callable[[str], str | bytes]] = {
    "crlf": lambda text: text.replace("\n", "\r\n"),
    "carriage returns alone": lambda text: text.replace("\n", "\r"),
    "tabs and several spaces": lambda text: text.replace(" ", "\t  "),
    "blank lines everywhere": lambda text: text.replace("\n", "\n \n\n"),
    "byte order mark": lambda text: b"\xef\xbb\xbf" + text.encode(),
    "no newline at the end": lambda text: text.rstrip(),
    "trailing blanks": lambda text: text.replace("\n", "  \t\n") + "\n\n  ",
    "Frames:2": lambda text: text.replace("Frames: 2", "Frames:2"),
    "FRAMES : 2": lambda text: text.replace("Frames: 2", "FRAMES : 2"),
    "Frames 2": lambda text: text.replace("Frames: 2", "Frames 2"),
    "frame time:.033333": lambda text: text.replace("Frame Time: 0.033333", "frame time:.033333"),
    "FrameTime : 3.3333E-02": lambda text: text.replace("Frame Time: 0.033333", "FrameTime : 3.3333E-02"),
    "lower case": lambda text: text.lower().replace("hips", "Hips").replace("spine", "Spine"),
    "upper case": lambda text: text.upper().replace("HIPS", "Hips").replace("SPINE", "Spine"),
    "brace on the joint's line": lambda text: text.replace("Hips\n{", "Hips {").replace("End Site\n    {", "EndSite{"),
    "everything on one line": lambda text: " ".join(text.split()),
    "rows wrapped": lambda text: text.replace(" 10.0 20", "\n10.0\n20").replace(" 31.0", "\n  31.0"),
    "both rows on a line": lambda text: text.replace("3.5\n11.0", "3.5 11.0"),
    "scientific": lambda text: text.replace("10.0 90.0 -5.0", "1e1 +9.0E+01 -500.e-2"),
    "other decimals": lambda text: text.replace("10.0 90.0 -5.0", "10 90. -5.0000000"),
    "more decimals": lambda text: text.replace(".0 ", ".000000 ").replace(".5", ".500000").replace(".0\n", ".000000\n"),
    "children before channels": lambda text: _move_root_channels(text),
}


def _move_root_channels(text: str) -> str:
    line = text.splitlines()[4]
    return text.replace(line + "\n", "", 1).replace("}\nMOTION", line + "\n}\nMOTION")


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_mean_the_same(dialect: str, save: Save, two_joints: str, tmp_path: Path) -> None:
    plain = io.read(save(two_joints))
    motion = io.read(save(DIALECTS[dialect](two_joints)))
    assert_same_poses(motion, plain)
    assert motion.rate == 30.0
    io.write(tmp_path / "again.bvh", motion)
    again = io.read(tmp_path / "again.bvh")
    assert_same_poses(again, motion)
    assert again.layout.row(0).split() == motion.layout.row(0).split()


@pytest.mark.parametrize("name", ["mixamorig:Hips", "Bip01 L Thigh", "a.b-c_d 1", "Hüfte", "腰", "JOINT", "End Site"])
def test_names_are_kept(name: str, save: Save, two_joints: str) -> None:
    assert io.read(save(two_joints.replace("Spine", name))).skeleton.names == ("Hips", name)


def test_names_that_are_not_utf8_are_read_as_latin1_and_written_back(
    save: Save, two_joints: str, tmp_path: Path
) -> None:
    data = two_joints.encode().replace(b"Spine", b"H\xfcfte")
    motion = io.read(save(data))
    assert motion.skeleton.names[1] == "Hüfte"
    io.write(tmp_path / "again.bvh", motion)
    assert (tmp_path / "again.bvh").read_bytes() == data


def test_root_without_position_channels_stays_at_its_offset(save: Save, two_joints: str) -> None:
    text = two_joints.replace("6 Xposition Yposition Zposition", "4 Yposition").replace("10.0 90.0 -5.0", "90.0")
    motion = io.read(save(text.replace("11.0 91.0 -4.0", "91.0")))
    np.testing.assert_allclose(motion.root_positions, [[0.01, 0.90, 0.03], [0.01, 0.91, 0.03]])


def test_position_channels_of_a_joint_replace_its_offset_axis_by_axis(save: Save, two_joints: str) -> None:
    text = two_joints.replace(
        "3 Zrotation Yrotation Xrotation\n    End", "4 Zrotation Zposition Yrotation Xrotation\n End"
    )
    text = text.replace("1.5 -2.5", "1.5 7.0 -2.5").replace("2.5 -3.5", "2.5 8.0 -3.5")
    motion = io.read(save(text))
    assert motion.translations is not None
    np.testing.assert_allclose(motion.translations[:, 0], motion.root_positions)
    np.testing.assert_allclose(motion.translations[:, 1], [[0, 0.1, 0.07], [0, 0.1, 0.08]])
    plain = io.read(save(two_joints))
    np.testing.assert_allclose(motion.local_rotations, plain.local_rotations)


def test_a_joint_without_channels_is_fixed(save: Save, two_joints: str) -> None:
    text = two_joints.replace("    CHANNELS 3 Zrotation Yrotation Xrotation\n", "")
    motion = io.read(save(text.replace(" 1.5 -2.5 3.5", "").replace(" 2.5 -3.5 4.5", "")))
    np.testing.assert_array_equal(motion.local_rotations[:, 1], [[0, 0, 0, 1]] * 2)


@pytest.mark.parametrize("unit", [0.001, 0.01, 0.0254, 0.0254 / 0.45, 1.0])
@pytest.mark.parametrize("size", [0.75, 1.0, 1.2])
def test_the_unit_is_found_from_the_size(
    unit: float, size: float, save: Save, humanoid_text: Callable[..., str]
) -> None:
    # Children and giants in metres and centimetres; adults where inches and CMU's unit lie nearer each other.
    size = size if unit in (0.001, 0.01, 1.0) else np.sqrt(size)
    motion = io.read(save(humanoid_text(1, metres_per_unit=unit / size)))
    assert motion.layout.metres_per_unit == unit


def test_the_unit_can_be_given(two_joints: str) -> None:
    motion = bvh_read.parse(two_joints.encode(), "clip", metres_per_unit=0.5)
    np.testing.assert_allclose(motion.root_positions[0], [5.0, 45.0, -2.5])
    np.testing.assert_allclose(motion.skeleton.offsets[1], [0.0, 5.0, 0.0])


def test_small_and_odd_skeletons_are_in_centimetres() -> None:
    assert bvh_read.detect_unit([-1], np.zeros((1, 3))) == 0.01
    assert bvh_read.detect_unit([-1, 0, 1], np.full((3, 3), 500.0)) == 0.01
    assert bvh_read.detect_unit([-1, 0, 0], np.full((3, 3), 0.01)) == 0.01


@pytest.mark.parametrize(
    ("text", "rate"),
    [
        ("0.033333", 30.0),
        ("0.0333333", 30.0),
        ("0.0333330", 30.0),
        ("0.033", 30.0),
        (".0333", 30.0),
        ("0.0333667", 30000 / 1001),
        ("0.04", 25.0),
        ("0.041667", 24.0),
        ("0.0417083", 24000 / 1001),
        ("0.016667", 60.0),
        ("0.0083333", 120.0),
        ("8.3333e-3", 120.0),
        ("0.008333", 120.0),
        ("0.02", 50.0),
        ("0.01", 100.0),
        ("0.03", 1 / 0.03),
        ("0.006", 1 / 0.006),
        ("1", 1.0),
        ("2.5", 0.4),
    ],
)
def test_rates(text: str, rate: float) -> None:
    assert bvh_read.rate_of(text) == rate


@st.composite
def trees(draw: st.DrawFn) -> list[tuple[int, tuple[str, ...], list[float]]]:
    """Joints in depth-first order as (parent, channels, offset): any channels in any order, at least one in all."""
    joints: list[tuple[int, tuple[str, ...], list[float]]] = []
    for index in range(draw(st.integers(1, 5))):
        chain = [index - 1] if index else [-1]
        while chain[-1] > 0:
            chain.append(joints[chain[-1]][0])
        count = draw(st.integers(0 if index else 1, 6))
        names = draw(st.permutations(bvh_layout.CHANNEL_NAMES))[:count]
        offset = draw(st.lists(st.integers(-500, 500).map(lambda n: n / 10), min_size=3, max_size=3))
        joints.append((draw(st.sampled_from(chain)), tuple(names), offset))
    return joints


NUMBERS = st.one_of(
    st.floats(-400.0, 400.0).map(lambda x: f"{x:.6f}"),
    st.floats(-400.0, 400.0).map(lambda x: f"{x:g}"),
    st.floats(-400.0, 400.0).map(repr),
    st.sampled_from(["0", "-0.0", "90", "-90.000000", "180", "+45.", ".5", "1e2"]),
)


def tree_text(joints: list[tuple[int, tuple[str, ...], list[float]]], rows: list[list[str]]) -> str:
    """A BVH file of those joints and rows."""
    lines, opened = ["HIERARCHY"], []
    for index, (parent, channels, offset) in enumerate(joints):
        while opened and opened[-1] != parent:
            lines.append("}")
            opened.pop()
        lines += [f"{'JOINT' if opened else 'ROOT'} j{index}", "{", "OFFSET " + " ".join(map(str, offset))]
        lines += [f"CHANNELS {len(channels)} {' '.join(channels)}"]
        opened.append(index)
    lines += ["}"] * len(opened) + ["MOTION", f"Frames: {len(rows)}", "Frame Time: 0.04"]
    return "\n".join(lines + [" ".join(row) for row in rows]) + "\n"


def world_matrices(joints: list[tuple[int, tuple[str, ...], list[float]]], row: list[str]) -> list[np.ndarray]:
    """Each joint's 4 x 4 world matrix in centimetres, decoded channel by channel."""
    numbers = iter(row)
    worlds: list[np.ndarray] = []
    for parent, channels, offset in joints:
        place, turn = np.array(offset), Rotation.identity()
        for channel in channels:
            value, axis = float(next(numbers)), AXES.index(channel[0])
            if channel.endswith("position"):
                place[axis] = value
            else:
                turn = turn * Rotation.from_euler(AXES[axis], value, degrees=True)
        local = np.eye(4)
        local[:3, :3], local[:3, 3] = turn.as_matrix(), place
        worlds.append(local if parent < 0 else worlds[parent] @ local)
    return worlds


@given(st.data())
def test_any_channels_in_any_order_give_the_poses_they_mean(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    joints = data.draw(trees())
    count = sum(len(channels) for _, channels, _ in joints)
    rows = data.draw(st.lists(st.lists(NUMBERS, min_size=count, max_size=count), min_size=1, max_size=4))
    folder = tmp_path_factory.mktemp("tree")
    (folder / "in.bvh").write_text(tree_text(joints, rows))
    motion = bvh_read.parse((folder / "in.bvh").read_bytes(), "in", metres_per_unit=0.01)

    expected = np.array([world_matrices(joints, row) for row in rows])
    np.testing.assert_allclose(motion.global_positions(), expected[..., :3, 3] / 100.0, rtol=0, atol=1e-9)
    turned = Rotation.from_quat(motion.global_rotations()).as_matrix()
    np.testing.assert_allclose(turned, expected[..., :3, :3], rtol=0, atol=1e-9)

    io.write(folder / "same.bvh", motion)
    assert (folder / "same.bvh").read_bytes() == (folder / "in.bvh").read_bytes()

    io.write(folder / "made.bvh", motion, unchanged_rows={})
    assert_same_poses(
        bvh_read.parse((folder / "made.bvh").read_bytes(), "made", metres_per_unit=0.01), motion, tolerance=2e-8
    )


def test_nesting_may_be_deep(save: Save) -> None:
    depth = 1500
    assert depth > sys.getrecursionlimit()
    joints = [(index - 1, ("Xrotation",), [0.0, 1.0, 0.0]) for index in range(depth)]
    motion = io.read(save(tree_text(joints, [["1.0"] * depth])))
    assert len(motion.skeleton) == depth


@pytest.mark.parametrize("data_set", ["lafan1", "100style", "bandai-namco-1", "bandai-namco-2"])
def test_real_files_are_in_centimetres_and_come_back_byte_for_byte(
    data_set: str, data_dir: Path, tmp_path: Path
) -> None:
    path = min((data_dir / data_set).glob("*.bvh"))
    motion = io.read(path)
    assert motion.layout.metres_per_unit == 0.01
    assert motion.rate == (60.0 if data_set == "100style" else 30.0)
    io.write(tmp_path / "again.bvh", motion)
    assert (tmp_path / "again.bvh").read_bytes() == path.read_bytes()
