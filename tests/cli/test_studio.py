"""`interpose studio`: what is opened is read before any server starts, and whatever is wrong is one line."""

from __future__ import annotations

import json
import os
import socket
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from commandline import bvh_text, command, fails

from interpose import io
from interpose.cli import studio
from interpose.errors import InputError
from interpose.studio.protocol import Opened
from interpose.studio.sample import sample


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    """With what the server was started."""
    seen: list[Any] = []
    monkeypatch.setattr(studio.front, "find", lambda: tmp_path)
    monkeypatch.setattr(studio, "serve", lambda *given, browse, offer: seen.append((*given, browse, offer)) or 0)
    return seen


def test_nothing_is_needed(run: Any, served: list[Any], tmp_path: Path) -> None:
    assert run("studio") == (0, "", "")
    ((*given, offer),) = served
    assert given == [Opened(source=None, project=None), tmp_path, None, True]
    assert (offer.gallery, offer.gallery_name) == (None, None)


def test_a_clip_goes_to_the_browser_as_it_is(run: Any, served: list[Any], clip: Path) -> None:
    assert run("studio", clip, "--port", 9000, "--no-browser")[0] == 0
    (opened, _, port, browse, _) = served[0]
    assert (opened.source.name, opened.source.text, opened.project) == ("walk.bvh", clip.read_text(), None)
    assert (port, browse) == (9000, False)


def test_a_gallery_is_opened_before_the_server_starts(run: Any, served: list[Any], tmp_path: Path) -> None:
    code, _, error = run("studio", "--gallery", tmp_path / "none")
    assert code == 1
    assert "none is no gallery" in error or "no model" in error
    assert served == []
    assert run("studio", "--gallery", "stitch")[0] == 0
    offer = served[0][-1]
    assert offer.gallery is not None
    assert offer.gallery_name == "stitch"


def test_suffixes_are_known_in_capitals(served: list[Any], tmp_path: Path) -> None:
    path = tmp_path / "WALK.BVH"
    path.write_text(bvh_text(2))
    source = studio.read(str(path)).source
    assert source is not None
    assert source.name == "WALK.BVH"


def test_a_project_goes_to_the_browser_checked(run: Any, served: list[Any], tmp_path: Path) -> None:
    path = tmp_path / "mine.interpose"
    path.write_text(sample().model_dump_json())
    assert run("studio", path)[0] == 0
    assert served[0][0] == Opened(source=None, project=sample())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_a_clip_in_another_encoding_is_the_same_rig(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "walk.bvh"
    text = bvh_text(3).replace("JOINT Spine1\n", "JOINT Rücken\n")
    path.write_bytes(text.encode(encoding))
    source = studio.read(str(path)).source
    assert source is not None
    again = io.parse(source.text.encode(), "again")
    assert again.skeleton == io.read(path).skeleton
    assert "Rücken" in again.skeleton.names


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are any bytes on Linux only")
def test_a_name_that_is_no_text_is_made_one(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"w\xe4lk.bvh")
    path.write_text(bvh_text(2))
    source = studio.read(str(path)).source
    assert source is not None
    assert source.name == "w?lk.bvh"


def test_a_long_name_is_cut(tmp_path: Path) -> None:
    path = tmp_path / ("w" * 200 + ".bvh")
    path.write_text(bvh_text(2))
    source = studio.read(str(path)).source
    assert source is not None
    assert source.name == "w" * 120


def test_what_cannot_be_opened_is_told_before_a_server_starts(run: Any, served: list[Any], tmp_path: Path) -> None:
    fails(run("studio", tmp_path / "none.bvh"), "no such file")
    fails(run("studio", tmp_path / "walk.fbx"), "the studio opens .bvh and .interpose files")
    fails(run("studio", tmp_path), "the studio opens .bvh and .interpose files")
    folder = tmp_path / "folder.bvh"
    folder.mkdir()
    fails(run("studio", folder), "is a folder")
    broken = tmp_path / "broken.bvh"
    broken.write_text(bvh_text(3)[:500])
    fails(run("studio", broken), str(broken))
    held = json.loads(sample().model_dump_json())
    held["keys"][1]["frame"] = 0
    project = tmp_path / "mine.interpose"
    project.write_text(json.dumps(held))
    fails(run("studio", project), f"{project} cannot be opened: keys[1].frame is 0, not after 0 of the previous key")
    project.write_bytes(b"\xff\xff")
    fails(run("studio", project), "it is not valid JSON")
    assert served == []


def test_a_clip_that_is_too_large_is_told(run: Any, served: list[Any], clip: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(studio, "LARGEST_UPLOAD", 100)
    fails(run("studio", clip), "larger than")
    assert served == []


def test_a_busy_port_is_told(run: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(studio.front, "find", lambda: tmp_path)
    with closing(socket.socket()) as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        fails(run("studio", "--port", port, "--no-browser"), f"port {port} is not available")
    fails(run("studio", "--port", 65536), "--port must be 0 to 65535, got 65536")


def test_a_front_end_that_is_missing_is_told(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def find() -> Path:
        raise InputError("the studio's front end is missing from this installation")

    monkeypatch.setattr(studio.front, "find", find)
    fails(run("studio"), "the studio's front end is missing")


def test_the_command_itself_ends_with_1(tmp_path: Path) -> None:
    done = command("studio", tmp_path / "none.bvh")
    fails((done.returncode, done.stdout, done.stderr), "no such file", tmp_path)
    assert command("studio", "--port", "x").returncode == 2
