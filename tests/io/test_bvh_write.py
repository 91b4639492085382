"""Writing BVH: verbatim rows, Euler angles near the row before, default layouts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import motions

from interpose import io, rotation
from interpose.io import bvh
from interpose.io.layout import UnitLayout
from interpose.motion import Motion, concatenate, resample
from interpose.skeleton import HUMANOID, Skeleton

Save = Callable[[str | bytes], Path]


def rows_of(content: bytes) -> list[str]:
    """The row texts of a BVH file."""
    text = content.decode()
    return text[text.index("Frame Time") :].splitlines()[1:]


def turning(orders: list[str], angles: np.ndarray) -> tuple[Motion, np.ndarray]:
    """A motion with a layout of those rotation orders, one a joint in a chain, from degrees (frame, joint, axis)."""
    lines = ["HIERARCHY"]
    for joint, order in enumerate(orders):
        names = " ".join(f"{axis}rotation" for axis in order)
        lines += [f"{'JOINT' if joint else 'ROOT'} j{joint}", "{", "OFFSET 0 30 0", f"CHANNELS {len(order)} {names}"]
    rows = [" ".join(f"{x:.9f}" for x in frame.ravel()) for frame in angles]
    lines += ["}"] * len(orders) + ["MOTION", f"Frames: {len(angles)}", "Frame Time: 0.04", *rows, ""]
    return bvh.parse("\n".join(lines).encode(), "made"), angles.reshape(len(angles), -1)


def made_rows(motion: Motion, verbatim: dict[int, int]) -> np.ndarray:
    """The numbers that are written for a motion, (frame, channel)."""
    return np.array([row.split() for row in rows_of(bvh.serialize(motion, verbatim))], dtype=float)


def test_an_unchanged_motion_gives_the_same_bytes(two_joints: str) -> None:
    text = two_joints.replace("\n", "\r\n").replace("3.5\r", "3.5 \r").replace("4.5\r", "4.5 \r").encode()
    assert bvh.serialize(bvh.parse(text, "clip")) == text


def test_rows_of_one_pose_keep_their_own_digits(two_joints: str) -> None:
    head, (_, row) = two_joints[: two_joints.index("Frame Time")], rows_of(two_joints.encode())
    first, *rest = row.split()
    other = " ".join([f"{float(first):.9f}", *rest])  # the same pose in other digits
    text = f"{head}Frame Time: 0.04\n{other}\n{row}\n".encode()
    assert other != row
    assert bvh.serialize(bvh.parse(text, "clip")) == text


def test_cuts_and_joins_keep_the_rows_of_their_frames(humanoid_text: Callable[..., str]) -> None:
    text = humanoid_text(12)
    clip, rows = bvh.parse(text.encode(), "clip"), rows_of(text.encode())
    assert rows_of(bvh.serialize(clip[3:8])) == rows[3:8]
    assert rows_of(bvh.serialize(clip[::-2])) == rows[::-2]
    assert rows_of(bvh.serialize(concatenate(clip[7], clip[2:4]))) == [rows[7], *rows[2:4]]
    halved = rows_of(bvh.serialize(resample(clip, 15.0)))
    assert halved == rows[::2]


def test_a_pose_changed_in_place_is_not_mistaken_for_its_row(two_joints: str) -> None:
    clip = bvh.parse(two_joints.encode(), "clip")
    clip.local_rotations[1, 1] = rotation.IDENTITY
    rows = rows_of(bvh.serialize(clip))
    assert rows[0] == two_joints.splitlines()[-2]
    np.testing.assert_allclose(np.array(rows[1].split(), dtype=float)[6:], 0.0, atol=1e-6)


def test_verbatim_rows_keep_their_digits_and_others_are_made(humanoid_text: Callable[..., str]) -> None:
    text = humanoid_text(6)
    clip, rows = bvh.parse(text.encode(), "clip"), rows_of(text.encode())
    turned = replace(clip, local_rotations=rotation.continuous(clip.local_rotations) * 1.0)
    content = bvh.serialize(turned, unchanged_rows={0: 2, 4: 5})
    written = rows_of(content)
    assert (written[0], written[4]) == (rows[2], rows[5])
    assert len(written) == 6
    again = bvh.parse(content, "again")
    for frame in (1, 2, 3, 5):
        dots = np.abs(np.sum(again.local_rotations[frame] * clip.local_rotations[frame], axis=-1))
        np.testing.assert_allclose(dots, 1.0, atol=1e-14)


def test_verbatim_must_fit(humanoid_text: Callable[..., str]) -> None:
    clip = bvh.parse(humanoid_text(3).encode(), "clip")
    with pytest.raises(ValueError, match="outside the 3 written or the 3 read"):
        bvh.serialize(clip, unchanged_rows={3: 0})
    with pytest.raises(ValueError, match="outside the 3 written or the 3 read"):
        bvh.serialize(clip, unchanged_rows={0: -1})
    longer = replace(clip.skeleton, offsets=clip.skeleton.offsets * 2.0)
    with pytest.raises(ValueError, match="only while the motion has the skeleton"):
        bvh.serialize(replace(clip, skeleton=longer), unchanged_rows={0: 0})


def test_rows_of_a_motion_from_no_bvh_file_are_made(humanoid_text: Callable[..., str]) -> None:
    clip = bvh.parse(humanoid_text(3).encode(), "clip")
    for layout in (None, UnitLayout(1.0)):
        bare = replace(clip, layout=layout)
        assert bvh.serialize(bare, unchanged_rows={0: 0, 2: 1}) == bvh.serialize(bare)


def test_values_that_are_not_finite_are_refused(two_joints: str) -> None:
    clip = bvh.parse(two_joints.encode(), "clip")
    with pytest.raises(ValueError, match="not finite"):
        bvh.serialize(replace(clip, root_positions=clip.root_positions * np.nan))


ORDERS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]


@pytest.mark.parametrize("order", ORDERS)
def test_angles_go_on_through_both_branches_and_full_turns(order: str) -> None:
    # Every angle sweeps through more than a turn, the middle one beyond 90 degrees, where SciPy's triples jump.
    frames = np.arange(120)[:, None, None]
    angles = frames * np.array([7.0, 4.1, -5.3]) + np.array([100.0, -200.0, 30.0])
    motion, rows = turning([order], angles)
    np.testing.assert_allclose(made_rows(motion, {0: 0}), rows, atol=2e-6)


@pytest.mark.parametrize("order", ["X", "Y", "Z", "XY", "YX", "ZY", "YZ", "XZ", "ZX"])
def test_joints_of_one_or_two_rotation_channels(order: str) -> None:
    frames = np.arange(120)[:, None, None]
    angles = frames * np.array([7.0, 4.1])[: len(order)] + np.array([100.0, -200.0])[: len(order)]
    motion, rows = turning([order], angles)
    np.testing.assert_allclose(made_rows(motion, {0: 0}), rows, atol=2e-6)


def test_made_rows_go_on_from_the_kept_row_before_them() -> None:
    angles = np.cumsum(np.full((20, 2, 3), 3.0), axis=0) + np.array([720.0, 170.0, -540.0])
    motion, rows = turning(["ZXY", "YZX"], angles)
    kept = {0: 0, 5: 5, 12: 12, 13: 13}
    np.testing.assert_allclose(made_rows(motion, kept), rows, atol=2e-6)
    # With no kept row before, the next one is gone on from.
    np.testing.assert_allclose(made_rows(motion, {19: 19}), rows, atol=2e-6)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("middle", [90.0, -90.0])
@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-3])
def test_near_gimbal_lock_the_rotation_is_right(order: str, middle: float, off: float) -> None:
    angles = np.array([[[20.0, middle - off, 30.0]], [[-50.0, middle + off, 170.0]], [[0.0, middle, 0.0]]])
    motion, _ = turning([order], angles)
    again = bvh.parse(bvh.serialize(motion, {}), "again")
    difference = rotation.multiply(rotation.inverse(motion.local_rotations), again.local_rotations)
    assert rotation.angle(difference).max() < 3e-7


def test_what_a_joint_cannot_express_is_left_out() -> None:
    hinge, _ = turning(["X", "ZX"], np.zeros((1, 1, 3)))
    free = Rotation.from_euler("XYZ", [[30.0, 5.0, -4.0], [10.0, 3.0, 40.0]], degrees=True)
    written = made_rows(replace(hinge, local_rotations=free.as_quat()[None]), {})
    # The hinge keeps the rotation about X nearest to the whole; the other joint that of its ZXY triple.
    angle = np.rad2deg(2.0 * np.arctan2(free[0].as_quat()[0], free[0].as_quat()[3]))
    np.testing.assert_allclose(written[0], [angle, *free[1].as_euler("ZXY", degrees=True)[:2]], atol=1e-6)


@given(motions())
def test_motions_of_any_skeleton_come_back(motion: Motion) -> None:
    content = bvh.serialize(motion)
    again = bvh.parse(content, "again", metres_per_unit=0.01)
    order = [motion.skeleton.names.index(name) for name in again.skeleton.names]
    assert sorted(order) == list(range(len(motion.skeleton)))
    np.testing.assert_allclose(again.global_positions(), motion.global_positions()[:, order], atol=1e-6)
    turned = Rotation.from_quat(again.global_rotations()).as_matrix()
    expected = Rotation.from_quat(motion.global_rotations()[:, order]).as_matrix()
    np.testing.assert_allclose(turned, expected, atol=1e-6)
    assert (again.translations is None) == (motion.translations is None or len(motion.skeleton) == 1)
    # And what was written is kept digit for digit from then on.
    assert bvh.serialize(again) == content


@given(st.one_of(st.floats(0.02, 5000.0), st.sampled_from([24.0, 25.0, 30000 / 1001, 30.0, 50.0, 60.0, 120.0])))
def test_rates_come_back(rate: float) -> None:
    still = Motion(HUMANOID, np.zeros((1, 3)), np.tile(rotation.IDENTITY, (1, 22, 1)), rate)
    again = bvh.parse(bvh.serialize(still), "again").rate
    assert again == pytest.approx(rate, rel=2e-5 if rate < 1000 else 1e-3)
    if rate in (24.0, 25.0, 30000 / 1001, 30.0, 50.0, 60.0, 120.0):
        assert again == rate


def test_the_frame_time_of_the_file_is_kept_until_the_rate_changes(two_joints: str) -> None:
    clip = bvh.parse(two_joints.encode(), "clip")
    assert b"Frame Time: 0.033333\n" in bvh.serialize(clip)
    assert b"Frame Time: 0.0166666667\n" in bvh.serialize(replace(clip, rate=60.0))


def test_another_skeleton_gets_a_layout_of_its_own(two_joints: str) -> None:
    clip = bvh.parse(two_joints.encode(), "clip")
    renamed = Skeleton(("A", "B"), clip.skeleton.parents, clip.skeleton.offsets)
    again = bvh.parse(bvh.serialize(replace(clip, skeleton=renamed)), "again")
    assert again.skeleton.names == ("A", "B")
    longer = Skeleton(clip.skeleton.names, clip.skeleton.parents, clip.skeleton.offsets * 2.0)
    again = bvh.parse(bvh.serialize(replace(clip, skeleton=longer)), "again")
    np.testing.assert_allclose(again.skeleton.offsets, longer.offsets)


def test_the_default_layout_is_plain(tmp_path: Path) -> None:
    still = Motion(HUMANOID, np.array([[0.0, 0.9, 0.0]]), np.tile(rotation.IDENTITY, (1, 22, 1)), 30.0)
    io.write(tmp_path / "still.bvh", still)
    lines = (tmp_path / "still.bvh").read_text().splitlines()
    assert lines[:6] == [
        "HIERARCHY",
        "ROOT Hips",
        "{",
        "\tOFFSET 0.000000 0.000000 0.000000",
        "\tCHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation",
        "\tJOINT LeftUpLeg",
    ]
    assert sum("End Site" in line for line in lines) == 5
    assert lines[-1].startswith("0.000000 90.000000 0.000000 0.000000")
    again = io.read(tmp_path / "still.bvh").skeleton
    assert (again.names, again.parents) == (HUMANOID.names, HUMANOID.parents)
    np.testing.assert_allclose(again.offsets, HUMANOID.offsets, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", ["", " Hips", "a{b", "a\nb"])
def test_names_that_bvh_cannot_hold_are_refused(name: str) -> None:
    body = Skeleton((name,), (-1,), np.zeros((1, 3)))
    with pytest.raises(ValueError, match="BVH cannot hold the joint name"):
        bvh.serialize(Motion(body, np.zeros((1, 3)), np.array([[[0.0, 0.0, 0.0, 1.0]]]), 30.0))
