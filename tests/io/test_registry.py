"""The table of formats: which one a file is of, and that one module and one entry add another."""

from __future__ import annotations

import re
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose.cli import main
from interpose.cli.generate import output_paths
from interpose.errors import InputError
from interpose.io import registry
from interpose.io.registry import WRITERS, Format, listed, readable, reader_of, writer_of

EXPONENTIAL_MAPS = ",".join(["0.5"] * 99) + "\n"


def npz(**arrays: object) -> bytes:
    out = BytesIO()
    np.savez(out, **{name: np.asarray(value) for name, value in arrays.items()})
    return out.getvalue()


CONTENTS: dict[str, tuple[bytes, str]] = {
    "bvh": (b"HIERARCHY\nROOT", "BVH"),
    "bvh after blanks and a mark": (b"\xef\xbb\xbf\r\n \tHierarchy ROOT", "BVH"),
    "smpl": (npz(poses=0.0, trans=0.0), "AMASS"),
    "smpl-x": (npz(root_orient=0.0, pose_body=0.0), "AMASS"),
    "exponential maps": (EXPONENTIAL_MAPS.encode(), "Human3.6M exponential maps"),
    "exponential maps after blanks": (b"\r\n" + EXPONENTIAL_MAPS.encode()[:-1] + b"\r", "Human3.6M exponential maps"),
}


@pytest.mark.parametrize("case", CONTENTS)
@pytest.mark.parametrize("name", ["clip", "clip.dat", "clip.bvh", "clip.NPZ", "folder.npz/clip.txt"])
def test_contents_decide_whatever_the_name(case: str, name: str) -> None:
    data, expected = CONTENTS[case]
    assert reader_of(data, name).name == expected


UNKNOWN = {
    "nothing": b"",
    "text": b"HIERARCHYROOT\n",
    "98 numbers": EXPONENTIAL_MAPS.replace("0.5,", "", 1).encode(),
    "99 words": EXPONENTIAL_MAPS.replace("0.5", "x").encode(),
    "an archive of a shape": npz(betas=0.0),
    "half an archive": npz(poses=0.0)[:-9],
    "not quite an archive": b"PK\x03\x04PK\x05\x06" + b"\xff" * 30,
}


@pytest.mark.parametrize("case", UNKNOWN)
def test_the_extension_decides_where_the_contents_are_unknown(case: str) -> None:
    assert reader_of(UNKNOWN[case], "a.b/clip.BVH").name == "BVH"
    with pytest.raises(InputError) as refused:
        reader_of(UNKNOWN[case], "clip.dat")
    assert str(refused.value) == f"clip.dat: not a motion file of a known format; {readable()} can be read"


def test_the_extension_says_what_is_written() -> None:
    assert (writer_of("out.BVH").name, writer_of("a.bvh/out.glb").name) == ("BVH", "binary glTF")
    for name in ("out", "out.fbx", ".bvh"):
        with pytest.raises(InputError, match=re.escape(f"must end in {listed(WRITERS)}")):
            writer_of(name)


TOY = """
from interpose.motion import Motion
from interpose.skeleton import Skeleton
import numpy as np

def recognises(data):
    return data.startswith(b"TOY")

def parse(data, name):
    height = float(data.split()[1])
    body = Skeleton(("Root",), (-1,), np.zeros((1, 3)))
    return Motion(body, np.array([[0.0, height, 0.0]]), np.array([[[0.0, 0.0, 0.0, 1.0]]]), 30.0)

def serialize(motion, unchanged_rows, name):
    return f"TOY {motion.root_positions[0, 1]} {name}".encode()
"""


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A format that is one file and one entry in the table."""
    (tmp_path / "toy_format.py").write_text(TOY)
    monkeypatch.syspath_prepend(tmp_path)
    entry = Format("Toy", "toy_format", reads=(".toy",), writes=(".toy",))
    for table in (registry.READERS, registry.WRITERS):
        monkeypatch.setitem(table, ".toy", entry)


@pytest.mark.usefixtures("toy")
def test_one_module_and_one_entry_add_a_format(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in.dat").write_text("TOY 1.5")
    motion = interpose.read(tmp_path / "in.dat")
    assert motion.root_positions[0, 1] == 1.5
    interpose.write(tmp_path / "out.toy", motion, name="walk")
    assert (tmp_path / "out.toy").read_text() == "TOY 1.5 walk"
    assert output_paths(str(tmp_path / "next.toy"), 1) == [tmp_path / "next.toy"]

    assert main(["info", str(tmp_path / "out.toy"), "--json"]) == 0
    (tmp_path / "other.dat").write_text("nothing known")
    assert main(["info", str(tmp_path / "other.dat")]) == 1
    assert "or Toy (.toy) can be read" in capsys.readouterr().err
    status = main(["fill", str(tmp_path / "out.toy"), "--keys", "0", "-o", str(tmp_path / "out.fbx")])
    assert (status, capsys.readouterr().err) == (
        1,
        f"interpose: {tmp_path / 'out.fbx'}: the output's name must end in {listed(WRITERS)}\n",
    )
