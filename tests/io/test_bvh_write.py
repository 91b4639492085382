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

from interpose import rotation
from interpose.io import bvh_read, bvh_write
from interpose.io.grounding import UnitLayout
from interpose.motion import Motion, concatenate, resample
from interpose.skeleton import HUMANOID, Skeleton

Save = Callable[[str | bytes], Path]


def rows_of(content: bytes) -> list[str]:
    """The row texts of a BVH file."""
    text = content.decode()
    return text[text.index("Frame Time") :].splitlines()[1:]


def test_an_unchanged_motion_gives_the_same_bytes(two_joints: str) -> None:
    text = two_joints.replace("\n", "\r\n").replace("3.5\r", "3.5 \r").replace("4.5\r", "4.5 \r").encode()
    assert bvh_write.serialize(bvh_read.parse(text, "clip")) == text


def test_rows_of_one_pose_keep_their_own_digits(two_joints: str) -> None:
    head, (_, row) = two_joints[: two_joints.index("Frame Time")], rows_of(two_joints.encode())
    first, *rest = row.split()
    other = " ".join([f"{float(first):.9f}", *rest])  # the same pose in other digits
    text = f"{head}Frame Time: 0.04\n{other}\n{row}\n".encode()
    assert other != row
    assert bvh_write.serialize(bvh_read.parse(text, "clip")) == text


def test_cuts_and_joins_keep_the_rows_of_their_frames(humanoid_text: Callable[..., str]) -> None:
    text = humanoid_text(12)
    clip, rows = bvh_read.parse(text.encode(), "clip"), rows_of(text.encode())
    assert rows_of(bvh_write.serialize(clip[3:8])) == rows[3:8]
    assert rows_of(bvh_write.serialize(clip[::-2])) == rows[::-2]
    assert rows_of(bvh_write.serialize(concatenate(clip[7], clip[2:4]))) == [rows[7], *rows[2:4]]
    halved = rows_of(bvh_write.serialize(resample(clip, 15.0)))
    assert halved == rows[::2]


def test_a_pose_changed_in_place_is_not_mistaken_for_its_row(two_joints: str) -> None:
    clip = bvh_read.parse(two_joints.encode(), "clip")
    clip.local_rotations[1, 1] = rotation.IDENTITY
    rows = rows_of(bvh_write.serialize(clip))
    assert rows[0] == two_joints.splitlines()[-2]
    np.testing.assert_allclose(np.array(rows[1].split(), dtype=float)[6:], 0.0, atol=1e-6)


def test_verbatim_rows_keep_their_digits_and_others_are_made(humanoid_text: Callable[..., str]) -> None:
    text = humanoid_text(6)
    clip, rows = bvh_read.parse(text.encode(), "clip"), rows_of(text.encode())
    turned = replace(clip, local_rotations=rotation.continuous(clip.local_rotations) * 1.0)
    content = bvh_write.serialize(turned, unchanged_rows={0: 2, 4: 5})
    written = rows_of(content)
    assert (written[0], written[4]) == (rows[2], rows[5])
    assert len(written) == 6
    again = bvh_read.parse(content, "again")
    for frame in (1, 2, 3, 5):
        dots = np.abs(np.sum(again.local_rotations[frame] * clip.local_rotations[frame], axis=-1))
        np.testing.assert_allclose(dots, 1.0, atol=1e-14)


def test_verbatim_must_fit(humanoid_text: Callable[..., str]) -> None:
    clip = bvh_read.parse(humanoid_text(3).encode(), "clip")
    with pytest.raises(ValueError, match="outside the 3 written or the 3 read"):
        bvh_write.serialize(clip, unchanged_rows={3: 0})
    with pytest.raises(ValueError, match="outside the 3 written or the 3 read"):
        bvh_write.serialize(clip, unchanged_rows={0: -1})
    longer = replace(clip.skeleton, offsets=clip.skeleton.offsets * 2.0)
    with pytest.raises(ValueError, match="only while the motion has the skeleton"):
        bvh_write.serialize(replace(clip, skeleton=longer), unchanged_rows={0: 0})


def test_rows_of_a_motion_from_no_bvh_file_are_made(humanoid_text: Callable[..., str]) -> None:
    clip = bvh_read.parse(humanoid_text(3).encode(), "clip")
    for layout in (None, UnitLayout(1.0)):
        bare = replace(clip, layout=layout)
        assert bvh_write.serialize(bare, unchanged_rows={0: 0, 2: 1}) == bvh_write.serialize(bare)


def test_values_that_are_not_finite_are_refused(two_joints: str) -> None:
    clip = bvh_read.parse(two_joints.encode(), "clip")
    with pytest.raises(ValueError, match="not finite"):
        bvh_write.serialize(replace(clip, root_positions=clip.root_positions * np.nan))


@given(motions())
def test_motions_of_any_skeleton_come_back(motion: Motion) -> None:
    content = bvh_write.serialize(motion)
    again = bvh_read.parse(content, "again", metres_per_unit=0.01)
    order = [motion.skeleton.names.index(name) for name in again.skeleton.names]
    assert sorted(order) == list(range(len(motion.skeleton)))
    np.testing.assert_allclose(again.global_positions(), motion.global_positions()[:, order], atol=1e-6)
    turned = Rotation.from_quat(again.global_rotations()).as_matrix()
    expected = Rotation.from_quat(motion.global_rotations()[:, order]).as_matrix()
    np.testing.assert_allclose(turned, expected, atol=1e-6)
    assert (again.translations is None) == (motion.translations is None or len(motion.skeleton) == 1)
    # And what was written is kept digit for digit from then on.
    assert bvh_write.serialize(again) == content


@given(st.one_of(st.floats(0.02, 5000.0), st.sampled_from([24.0, 25.0, 30000 / 1001, 30.0, 50.0, 60.0, 120.0])))
def test_rates_come_back(rate: float) -> None:
    still = Motion(HUMANOID, np.zeros((1, 3)), np.tile(rotation.IDENTITY, (1, 22, 1)), rate)
    again = bvh_read.parse(bvh_write.serialize(still), "again").rate
    assert again == pytest.approx(rate, rel=2e-5 if rate < 1000 else 1e-3)
    if rate in (24.0, 25.0, 30000 / 1001, 30.0, 50.0, 60.0, 120.0):
        assert again == rate


def test_the_frame_time_of_the_file_is_kept_until_the_rate_changes(two_joints: str) -> None:
    clip = bvh_read.parse(two_joints.encode(), "clip")
    assert b"Frame Time: 0.033333\n" in bvh_write.serialize(clip)
    assert b"Frame Time: 0.0166666667\n" in bvh_write.serialize(replace(clip, rate=60.0))


def test_another_skeleton_gets_a_layout_of_its_own(two_joints: str) -> None:
    clip = bvh_read.parse(two_joints.encode(), "clip")
    renamed = Skeleton(("A", "B"), clip.skeleton.parents, clip.skeleton.offsets)
    again = bvh_read.parse(bvh_write.serialize(replace(clip, skeleton=renamed)), "again")
    assert again.skeleton.names == ("A", "B")
    longer = Skeleton(clip.skeleton.names, clip.skeleton.parents, clip.skeleton.offsets * 2.0)
    again = bvh_read.parse(bvh_write.serialize(replace(clip, skeleton=longer)), "again")
    np.testing.assert_allclose(again.skeleton.offsets, longer.offsets)
