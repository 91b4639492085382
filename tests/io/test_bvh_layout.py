"""The layout of BVH files: the default one, and rows of two files in one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import io, rotation
from interpose.io import bvh
from interpose.io.grounding import UnitLayout
from interpose.motion import Motion, SourceLayout
from interpose.skeleton import HUMANOID, Skeleton


def test_rows_of_two_files_are_joined_where_their_channels_offsets_and_unit_agree(two_joints: str) -> None:
    first = bvh.parse(two_joints.encode(), "first").layout
    other = bvh.parse(two_joints.replace("11.0", "11.25").encode(), "other").layout
    assert isinstance(first, SourceLayout)
    joined, fits = first.joined(0, other, 1)
    assert fits
    assert [joined.row(i).split()[0] for i in range(len(joined.row_bounds))] == ["10.0", "11.25"]
    assert first.nbytes == len(two_joints.partition("0.033333")[2])
    for old, new in (("Zrotation Yrotation", "Yrotation Zrotation"), ("0.0 10.0 0.0", "0.0 10.5 0.0")):
        changed = bvh.parse(two_joints.replace(old, new).encode(), "changed").layout
        joined, fits = first.joined(1, changed, 0)
        assert not fits
        assert [joined.row(i).split()[0] for i in range(len(joined.row_bounds))] == ["11.0"]
    for changed in (None, UnitLayout(0.01), bvh.parse(two_joints.encode(), "inches", 0.0254).layout):
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
        bvh.serialize(Motion(body, np.zeros((1, 3)), np.array([[[0.0, 0.0, 0.0, 1.0]]]), 30.0))
