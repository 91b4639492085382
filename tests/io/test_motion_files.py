"""Motions from and to files, whatever their format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose import io
from interpose.errors import InputError
from interpose.io import files, motion_files

Save = Callable[[str | bytes], Path]


def test_a_motion_is_written_by_its_extension_and_read_by_its_contents(
    save: Save, two_joints: str, tmp_path: Path
) -> None:
    motion = interpose.read(save(two_joints))
    interpose.write(tmp_path / "out.BVH", motion)
    (tmp_path / "out.BVH").rename(tmp_path / "out.txt")
    assert (tmp_path / "out.txt").read_text() == two_joints
    np.testing.assert_array_equal(interpose.read(tmp_path / "out.txt").root_positions, motion.root_positions)
    assert io.serialize(motion, "any.bvh").decode() == two_joints


def test_nothing_is_written_under_an_unknown_extension(save: Save, two_joints: str, tmp_path: Path) -> None:
    motion = io.read(save(two_joints))
    with pytest.raises(InputError, match=r"out\.fbx: the output's name must end in \.bvh or \.glb"):
        io.write(tmp_path / "out.fbx", motion)
    assert [path.name for path in tmp_path.iterdir()] == ["clip.bvh"]


def test_unchanged_rows_do_not_matter_to_formats_without_text(save: Save, two_joints: str) -> None:
    motion = io.read(save(two_joints))
    assert io.serialize(motion, "out.glb", {0: 1}) == io.serialize(motion, "out.glb")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"absent\.fbx: no such file"):
        io.read(tmp_path / "absent.fbx")
    with pytest.raises(InputError, match="is a folder"):
        io.read(tmp_path)
    with pytest.raises(InputError, match="cannot be read"):
        io.read("a\0b.bvh")


def test_large_files_are_refused(save: Save, two_joints: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save(two_joints)
    monkeypatch.setattr(motion_files, "read_whole", lambda path: files.read_whole(path, limit=2**8))
    with pytest.raises(InputError, match="larger than 0 MB; cut it"):
        io.read(path)


def test_the_package_has_no_other_names() -> None:
    with pytest.raises(AttributeError, match="no attribute 'bvh_writer'"):
        _ = io.bvh_writer
