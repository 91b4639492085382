"""The layout of BVH files: the default one, rows of two files in one, and Euler angles that continue over rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interpose import io, rotation
from interpose.io import bvh_read, bvh_write
from interpose.io.grounding import UnitLayout
from interpose.motion import Motion, SourceLayout
from interpose.skeleton import HUMANOID, Skeleton


def test_rows_of_two_files_are_joined_where_their_channels_offsets_and_unit_agree(two_joints: str) -> None:
    first = bvh_read.parse(two_joints.encode(), "first").layout
    other = bvh_read.parse(two_joints.replace("11.0", "11.25").encode(), "other").layout
    assert isinstance(first, SourceLayout)
    joined, fits = first.joined(0, other, 1)
    assert fits
    assert [joined.row(i).split()[0] for i in range(len(joined.row_bounds))] == ["10.0", "11.25"]
    assert first.nbytes == len(two_joints.partition("0.033333")[2])
    for old, new in (("Zrotation Yrotation", "Yrotation Zrotation"), ("0.0 10.0 0.0", "0.0 10.5 0.0")):
        changed = bvh_read.parse(two_joints.replace(old, new).encode(), "changed").layout
        joined, fits = first.joined(1, changed, 0)
        assert not fits
        assert [joined.row(i).split()[0] for i in range(len(joined.row_bounds))] == ["11.0"]
    for changed in (None, UnitLayout(0.01), bvh_read.parse(two_joints.encode(), "inches", 0.0254).layout):
        assert not first.joined(0, changed, 0)[1]


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
        bvh_write.serialize(Motion(body, np.zeros((1, 3)), np.array([[[0.0, 0.0, 0.0, 1.0]]]), 30.0))


def turning(orders: list[str], angles: np.ndarray) -> tuple[Motion, np.ndarray]:
    """A motion with a layout of those rotation orders, one a joint in a chain, from degrees (frame, joint, axis)."""
    lines = ["HIERARCHY"]
    for joint, order in enumerate(orders):
        names = " ".join(f"{axis}rotation" for axis in order)
        lines += [f"{'JOINT' if joint else 'ROOT'} j{joint}", "{", "OFFSET 0 30 0", f"CHANNELS {len(order)} {names}"]
    rows = [" ".join(f"{x:.9f}" for x in frame.ravel()) for frame in angles]
    lines += ["}"] * len(orders) + ["MOTION", f"Frames: {len(angles)}", "Frame Time: 0.04", *rows, ""]
    return bvh_read.parse("\n".join(lines).encode(), "made"), angles.reshape(len(angles), -1)


def rows_written(motion: Motion, unchanged_rows: dict[int, int]) -> np.ndarray:
    """The numbers that are written for a motion, (frame, channel)."""
    _, _, body = bvh_write.serialize(motion, unchanged_rows).decode().partition("Frame Time")
    return np.array([row.split() for row in body.splitlines()[1:]], dtype=float)


ORDERS = ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"]


@pytest.mark.parametrize("order", ORDERS)
def test_angles_continue_through_both_branches_and_full_turns(order: str) -> None:
    # Every angle sweeps through more than a turn, the middle one beyond 90 degrees, where SciPy's triples jump.
    frames = np.arange(120)[:, None, None]
    angles = frames * np.array([7.0, 4.1, -5.3]) + np.array([100.0, -200.0, 30.0])
    motion, rows = turning([order], angles)
    np.testing.assert_allclose(rows_written(motion, {0: 0}), rows, atol=2e-6)


@pytest.mark.parametrize("order", ["X", "Y", "Z", "XY", "YX", "ZY", "YZ", "XZ", "ZX"])
def test_joints_of_one_or_two_rotation_channels(order: str) -> None:
    frames = np.arange(120)[:, None, None]
    angles = frames * np.array([7.0, 4.1])[: len(order)] + np.array([100.0, -200.0])[: len(order)]
    motion, rows = turning([order], angles)
    np.testing.assert_allclose(rows_written(motion, {0: 0}), rows, atol=2e-6)


def test_new_rows_continue_from_the_kept_row_before_them() -> None:
    angles = np.cumsum(np.full((20, 2, 3), 3.0), axis=0) + np.array([720.0, 170.0, -540.0])
    motion, rows = turning(["ZXY", "YZX"], angles)
    kept = {0: 0, 5: 5, 12: 12, 13: 13}
    np.testing.assert_allclose(rows_written(motion, kept), rows, atol=2e-6)
    # With no kept row before, they continue from the next one.
    np.testing.assert_allclose(rows_written(motion, {19: 19}), rows, atol=2e-6)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("middle", [90.0, -90.0])
@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-3])
def test_near_gimbal_lock_the_rotation_is_right(order: str, middle: float, off: float) -> None:
    angles = np.array([[[20.0, middle - off, 30.0]], [[-50.0, middle + off, 170.0]], [[0.0, middle, 0.0]]])
    motion, _ = turning([order], angles)
    again = bvh_read.parse(bvh_write.serialize(motion, {}), "again")
    difference = rotation.multiply(rotation.inverse(motion.local_rotations), again.local_rotations)
    assert rotation.angle(difference).max() < 3e-7


def test_what_a_joint_cannot_express_is_left_out() -> None:
    hinge, _ = turning(["X", "ZX"], np.zeros((1, 1, 3)))
    free = Rotation.from_euler("XYZ", [[30.0, 5.0, -4.0], [10.0, 3.0, 40.0]], degrees=True)
    written = rows_written(replace(hinge, local_rotations=free.as_quat()[None]), {})
    # The hinge keeps the rotation about X nearest to the whole; the other joint that of its ZXY triple.
    angle = np.rad2deg(2.0 * np.arctan2(free[0].as_quat()[0], free[0].as_quat()[3]))
    np.testing.assert_allclose(written[0], [angle, *free[1].as_euler("ZXY", degrees=True)[:2]], atol=1e-6)
