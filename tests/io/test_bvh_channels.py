"""Rotation channels: Euler angles that continue from the previous row, for any order and number of channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interpose import rotation
from interpose.io import bvh
from interpose.motion import Motion


def turning(orders: list[str], angles: np.ndarray) -> tuple[Motion, np.ndarray]:
    """A motion with a layout of those rotation orders, one a joint in a chain, from degrees (frame, joint, axis)."""
    lines = ["HIERARCHY"]
    for joint, order in enumerate(orders):
        names = " ".join(f"{axis}rotation" for axis in order)
        lines += [f"{'JOINT' if joint else 'ROOT'} j{joint}", "{", "OFFSET 0 30 0", f"CHANNELS {len(order)} {names}"]
    rows = [" ".join(f"{x:.9f}" for x in frame.ravel()) for frame in angles]
    lines += ["}"] * len(orders) + ["MOTION", f"Frames: {len(angles)}", "Frame Time: 0.04", *rows, ""]
    return bvh.parse("\n".join(lines).encode(), "made"), angles.reshape(len(angles), -1)


def rows_written(motion: Motion, unchanged_rows: dict[int, int]) -> np.ndarray:
    """The numbers that are written for a motion, (frame, channel)."""
    _, _, body = bvh.serialize(motion, unchanged_rows).decode().partition("Frame Time")
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
    again = bvh.parse(bvh.serialize(motion, {}), "again")
    difference = rotation.multiply(rotation.inverse(motion.local_rotations), again.local_rotations)
    assert rotation.angle(difference).max() < 3e-7


def test_what_a_joint_cannot_express_is_left_out() -> None:
    hinge, _ = turning(["X", "ZX"], np.zeros((1, 1, 3)))
    free = Rotation.from_euler("XYZ", [[30.0, 5.0, -4.0], [10.0, 3.0, 40.0]], degrees=True)
    written = rows_written(replace(hinge, local_rotations=free.as_quat()[None]), {})
    # The hinge keeps the rotation about X nearest to the whole; the other joint that of its ZXY triple.
    angle = np.rad2deg(2.0 * np.arctan2(free[0].as_quat()[0], free[0].as_quat()[3]))
    np.testing.assert_allclose(written[0], [angle, *free[1].as_euler("ZXY", degrees=True)[:2]], atol=1e-6)
