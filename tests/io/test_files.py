"""Output files are whole or absent, whatever goes wrong."""

from __future__ import annotations

import errno
import io
import os
from pathlib import Path

import pytest

from interpose.errors import InputError
from interpose.io import files


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "out.bvh"
    files.write_whole(path, b"old")
    files.write_whole(path, b"new")
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["out.bvh"]


def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "link.bvh").symlink_to(tmp_path / "real.bvh")
    files.write_whole(tmp_path / "link.bvh", b"new")
    assert (tmp_path / "link.bvh").is_symlink()
    assert (tmp_path / "real.bvh").read_bytes() == b"new"


def test_a_device_is_written_to_and_stays() -> None:
    files.write_whole("/dev/null", b"new")
    assert Path("/dev/null").is_char_device()


def test_what_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(InputError, match="is a folder; give a file name"):
        files.write_whole(tmp_path, b"new")
    with pytest.raises(InputError, match=r"the folder .*absent does not exist"):
        files.write_whole(tmp_path / "absent" / "out.bvh", b"new")
    with pytest.raises(InputError, match="cannot be written"):
        files.write_whole(tmp_path / "file" / "out.bvh", b"new")
    with pytest.raises(InputError, match="cannot be written"):
        files.write_whole(tmp_path / ("n" * 300), b"new")
    with pytest.raises(InputError, match="cannot be written"):
        files.write_whole("out\0.bvh", b"new")
    assert os.listdir(tmp_path) == ["file"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EACCES, errno.EROFS, errno.EDQUOT])
@pytest.mark.parametrize("step", ["open", "write", "replace"])
def test_a_failing_disk_leaves_the_old_file(
    code: int, step: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "out.bvh"
    path.write_bytes(b"old")

    def fail(*_: object, **__: object) -> None:
        raise OSError(code, os.strerror(code))

    class Full(io.FileIO):
        def write(self, data: object) -> int:
            super().write(b"n")
            raise OSError(code, os.strerror(code))

    if step == "replace":
        monkeypatch.setattr(os, "replace", fail)
    else:
        monkeypatch.setattr(files, "open", fail if step == "open" else Full, raising=False)
    with pytest.raises(InputError, match=f"out.bvh: cannot be written: {os.strerror(code).lower()}"):
        files.write_whole(path, b"new")
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["out.bvh"]


def test_an_interrupt_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        files.write_whole(tmp_path / "out.bvh", b"new")
    assert os.listdir(tmp_path) == []


def test_reading_stops_at_the_limit(tmp_path: Path) -> None:
    path = tmp_path / "in.bvh"
    path.write_bytes(b"12345678")
    assert files.read_whole(path, limit=8) == b"12345678"
    with pytest.raises(InputError, match="larger than 0 MB"):
        files.read_whole(path, limit=7)


@pytest.mark.parametrize(
    ("data", "encoding"),
    [(b"", "utf-8"), ("Hüfte".encode(), "utf-8"), (b"\xef\xbb\xbfHips", "utf-8-sig"), (b"H\xfcfte", "latin-1")],
)
def test_text_is_utf8_where_it_can_be(data: bytes, encoding: str) -> None:
    assert files.encoding_of(data) == encoding
