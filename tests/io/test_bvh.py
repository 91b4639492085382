"""BVH from bytes to motion: damaged files, and agreement with an independent implementation, upc-pymotion."""

from __future__ import annotations

import faulthandler
import random
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from pymotion.io.bvh import BVH
from pymotion.ops.skeleton import fk
from scipy.spatial.transform import Rotation

from interpose import io
from interpose.errors import InputError
from interpose.io import bvh_read, bvh_write

Save = Callable[[str | bytes], Path]
Change = Callable[[str], str | bytes]


def swap(old: str, new: str) -> Change:
    """Replaces the first ``old``, which must be there."""

    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


ROW = "10.0 90.0 -5.0 10.0 20.0 30.0 1.5 -2.5 3.5"

CASES: dict[str, tuple[Change, int | None, str]] = {
    "empty": (lambda text: "", None, "the file is empty"),
    "blank": (lambda text: "\n \n", None, "the file is empty"),
    "binary": (lambda text: b"\x89PNG\r\n\x1a\n\0\0", None, "binary data"),
    "utf-16": (lambda text: text.encode("utf-16"), None, "save it as UTF-8"),
    "other text": (lambda text: "<xml>", 1, "starts with HIERARCHY"),
    "no HIERARCHY": (swap("HIERARCHY\n", ""), 1, "starts with HIERARCHY"),
    "cut in the hierarchy": (lambda text: text[: text.index("End")], 9, "cut short"),
    "cut after the name": (lambda text: text[: text.index("Hips")] + "Hips", 2, "cut short"),
    "cut before MOTION": (lambda text: text[: text.index("MOTION")], 15, "cut short"),
    "cut after MOTION": (lambda text: text[: text.index("Frames")], 16, "'Frames: COUNT' must follow"),
    "cut before the rows": (lambda text: text[: text.index("10.0 90")], None, "no rows follow"),
    "cut in a row": (lambda text: text[: text.index("-3.5 4.5")], 20, "7 numbers in a row, 9 channels"),
    "no ROOT": (swap("ROOT Hips", "Hips"), 2, "ROOT expected, found 'Hips'"),
    "JOINT for ROOT": (swap("ROOT", "JOINT"), 2, "ROOT missing"),
    "no joints": (lambda text: "HIERARCHY\n" + text[text.index("MOTION") :], 2, "ROOT expected, found 'MOTION'"),
    "two roots": (swap("MOTION", "ROOT Other\n{\n}\nMOTION"), 16, "a second ROOT 'Other'"),
    "a root in a joint": (swap("JOINT", "ROOT"), 6, "a second ROOT 'Spine'"),
    "duplicate joint": (swap("Spine", "Hips"), 6, "a second joint named 'Hips'"),
    "joint inside itself": (swap("End Site", "JOINT Spine"), 10, "a second joint named 'Spine'"),
    "no name": (swap("JOINT Spine", "JOINT"), 6, "JOINT without a name"),
    "control characters": (swap("Spine", "Sp\x1bine"), 6, "control characters"),
    "no opening brace": (swap("Hips\n{", "Hips\n"), 4, "'{' must follow the joint's name"),
    "no closing brace": (swap("}\nMOTION", "MOTION"), 15, "1 '}' missing before MOTION"),
    "two closing braces missing": (swap("  }\n}\nMOTION", "MOTION"), 14, "2 '}' missing"),
    "a closing brace too many": (swap("MOTION", "}\nMOTION"), 16, "MOTION expected, found '}'"),
    "joint outside": (swap("MOTION", "JOINT Other\n{"), 16, "a } too many"),
    "no OFFSET": (swap("  OFFSET 1.0 2.0 3.0\n", ""), 14, "joint 'Hips' has no OFFSET"),
    "two OFFSETs": (swap("    End", "OFFSET 0 0 0\n    End"), 10, "a second OFFSET in joint 'Spine'"),
    "short OFFSET": (swap("1.0 2.0 3.0", "1.0 2.0"), 5, "'CHANNELS' is not a number"),
    "OFFSET of nan": (swap("OFFSET 1.0", "OFFSET nan"), 4, "'nan' is not a number"),
    "OFFSET with a comma": (swap("OFFSET 1.0", "OFFSET 1,0"), 4, "'1,0' is not a number"),
    "OFFSET out of range": (swap("OFFSET 1.0", "OFFSET 1e99"), 4, "'1e99' is out of range"),
    "unknown keyword": (swap("    End Site", "    SCALE 1"), 10, "expected, found 'SCALE'"),
    "unknown channel": (swap("Zposition", "Wposition"), 5, "unknown channel 'Wposition'"),
    "duplicate channel": (swap("Zposition", "Xposition"), 5, "channel Xposition is given twice"),
    "too few channel names": (swap("CHANNELS 3", "CHANNELS 4"), 10, "unknown channel 'End Site'"),
    "too many channel names": (swap("CHANNELS 3", "CHANNELS 2"), 9, "found 'Xrotation'"),
    "too many channels": (swap("CHANNELS 6", "CHANNELS 7"), 5, "0 to 6 channels, not '7'"),
    "channels not counted": (swap("CHANNELS 3", "CHANNELS"), 9, "0 to 6 channels, not 'Zrotation'"),
    "two CHANNELS": (swap("    End", "CHANNELS 1 Xposition\n    End"), 10, "a second CHANNELS in joint 'Spine'"),
    "no channels": (lambda text: re.sub("CHANNELS.*", "", text), 16, "no joint has a channel"),
    "end site without OFFSET": (swap("OFFSET 0.0 5.0 0.0", ""), 13, "an end site holds one OFFSET"),
    "end site with a joint": (swap("5.0 0.0\n", "5.0 0.0 JOINT x {\n"), 12, "'}' must follow the end site"),
    "end site unopened": (swap("End Site\n    {", "End Site\n"), 12, "'{' must follow 'End Site'"),
    "no MOTION": (swap("MOTION\n", ""), 16, "MOTION expected, found 'Frames:'"),
    "no Frames": (swap("Frames: 2\n", ""), 16, "'Frames: COUNT' must follow"),
    "no frames": (swap("Frames: 2", "Frames: 0"), 17, "no frames"),
    "negative frames": (swap("Frames: 2", "Frames: -2"), 17, "'-2' is not a whole number"),
    "fractional frames": (swap("Frames: 2", "Frames: 2.5"), 17, "'2.5' is not a whole number"),
    "no Frame Time": (swap("Frame Time: 0.033333\n", ""), 17, "'Frame Time: SECONDS' must follow"),
    "frame time zero": (swap("0.033333", "0.0"), 18, "'0.0' must be from"),
    "frame time negative": (swap("0.033333", "-0.033333"), 18, "must be from"),
    "frame time nan": (swap("0.033333", "nan"), 18, "'nan' is not a number"),
    "frame time too short": (swap("0.033333", "1e-300"), 18, "must be from"),
    "fewer rows": (swap("Frames: 2", "Frames: 3"), None, "3 frames are declared, 2 rows follow"),
    "more rows": (swap("Frames: 2", "Frames: 1"), None, "1 frames are declared, 2 rows follow"),
    "huge frame count": (swap("Frames: 2", "Frames: 99999999999999999"), None, "99999999999999999 frames are declared"),
    "huger frame count": (swap("Frames: 2", "Frames: " + "9" * 5000), 17, "is not a whole number"),
    "a number missing": (swap("1.5 -2.5", "1.5"), 19, "8 numbers in a row, 9 channels"),
    "a number too many": (swap("2.5 -3.5", "2.5 0.0 -3.5"), 20, "10 numbers in a row, 9 channels"),
    "a word in a row": (swap("-3.5 4.5", "-3.5 oops"), 20, "'oops' is not a number"),
    "nan in a row": (swap("-3.5 4.5", "nan 4.5"), 20, "'nan' is not a number"),
    "infinity in a row": (swap("-3.5 4.5", "-inf 4.5"), 20, "'-inf' is not a number"),
    "overflow in a row": (swap("-3.5 4.5", "-3.5 1e400"), 20, "'1e400' is out of range"),
    "out of range in a row": (swap("-3.5 4.5", "-3.5 4000000000.5"), 20, "is out of range"),
    "two points": (swap("-3.5 4.5", "-3.5 4.5.6"), 20, "'4.5.6' is not a number"),
    "glued numbers": (swap("-3.5 4.5", "-3.5-4.5"), 20, "'-3.5-4.5' is not a number"),
    "underscores": (swap("-3.5 4.5", "-3.5 4_0.5"), 20, "'4_0.5' is not a number"),
    "decimal commas": (lambda text: text.replace("1.5", "1,5"), 19, "'1,5' is not a number"),
    "not ASCII digits": (swap("-3.5 4.5", "-3.5 ٤.٥"), 20, "is not a number"),
    "long garbage": (swap("-3.5 4.5", "-3.5 " + "1" * 100_000 + "x"), 20, "is not a number"),
    "text after the rows": (lambda text: text + "HIERARCHY\n", 21, "'HIERARCHY' is not a number"),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_a_broken_file_is_refused_with_its_line(case: str, newline: str, save: Save, two_joints: str) -> None:
    change, line, problem = CASES[case]
    content = change(two_joints)
    if isinstance(content, str):
        content = content.replace("\n", newline)
    path = save(content)
    with pytest.raises(InputError) as raised:
        io.read(path)
    message = str(raised.value)
    assert message.startswith(f"{path}: " + (f"line {line}: " if line else ""))
    assert problem in message
    assert "\n" not in message
    assert len(message) < len(str(path)) + 200


def test_the_row_of_the_cases_is_line_19(two_joints: str) -> None:
    assert two_joints.splitlines()[18] == ROW


def test_too_many_joints_are_refused_however_deep(save: Save) -> None:
    text = "HIERARCHY\n" + "".join(
        f"{'JOINT' if i else 'ROOT'} j{i}\n{{\nOFFSET 0 1 0\nCHANNELS 1 Xrotation\n" for i in range(100_000)
    )
    with pytest.raises(InputError, match=r"line 8002: more than 2000 joints"):
        io.read(save(text))


@pytest.mark.parametrize("blanks", [" ", "\t", "\n", "\r\n"])
@pytest.mark.parametrize("place", ["ROOT", "OFFSET", "MOTION", "Frames", "Frame Time", "11.0"])
def test_a_million_blanks_anywhere_do_no_harm(blanks: str, place: str, save: Save, two_joints: str) -> None:
    motion = io.read(save(two_joints.replace(place, blanks * 1_000_000 + place, 1)))
    assert len(motion) == 2


DAMAGED_FILES = 3200
LONGEST_SECONDS = 60
TOKENS = [
    *("HIERARCHY", "MOTION", "ROOT", "JOINT", "End Site", "OFFSET", "CHANNELS", "Frames:", "Frame Time:"),
    *("{", "}", ":", "Xposition", "Yrotation", "zROTATION", "Hips", "Spine", "é"),
    *("", " ", "\t", "\n", "\r", "\r\n", "\0", "\v", "\x85"),
    *("0", "1", "2", "3", "6", "7", "9", "-1", "1e5", "1e400", "1e-400", "nan", "inf", "-inf", "0x10", "1_0", "1,5"),
    *(".", "-", "+", "e", "1.2.3", "1-2", "--1", "99999999999999999999", "9" * 400, "0." + "0" * 400 + "1", "٣"),
]


def _change(content: bytes, draw: random.Random) -> bytes:
    data = bytearray(content)
    at, to = sorted((draw.randrange(len(data) + 1), draw.randrange(len(data) + 1)))
    short = min(to, at + draw.randrange(1, 30))
    match draw.randrange(10):
        case 0 if data:
            data[min(at, len(data) - 1)] = draw.randrange(256)
        case 1 if data:
            data[min(at, len(data) - 1)] ^= 1 << draw.randrange(8)
        case 2:
            del data[at:short]
        case 3:
            data[at:at] = data[at:short] * draw.randrange(1, 4)
        case 4:
            del data[at if draw.random() < 0.5 else to :]
        case 5:
            lines = bytes(data).split(b"\n")
            i, j = draw.randrange(len(lines)), draw.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            data = bytearray(b"\n".join(lines))
        case 6:
            lines = bytes(data).split(b"\n")
            i = draw.randrange(len(lines))
            lines[i : i + 1] = [lines[i]] * draw.choice([0, 2, 3])
            data = bytearray(b"\n".join(lines))
        case 7:
            tokens = bytes(data).split(b" ")
            tokens[draw.randrange(len(tokens))] = draw.choice(TOKENS).encode()
            data = bytearray(b" ".join(tokens))
        case _:
            # A digit or a blank becomes another, so that many files stay whole.
            kind = draw.choice([b"0123456789", b" \t"])
            if places := [i for i, byte in enumerate(data) if byte in kind]:
                data[draw.choice(places)] = draw.choice(kind)
    return bytes(data)


def damaged(seeds: list[bytes]) -> Iterator[bytes]:
    """The same damaged files on every run: one to four changes each."""
    draw = random.Random(20240)
    for number in range(DAMAGED_FILES):
        content = seeds[number % len(seeds)]
        for _ in range(draw.choice([1, 1, 2, 4])):
            content = _change(content, draw)
        yield content


@pytest.fixture
def seeds(two_joints: str, humanoid_text: Callable[..., str]) -> list[bytes]:
    """Valid files of several dialects."""
    moving = two_joints.replace("CHANNELS 3 Z", "CHANNELS 4 Yposition Z").replace(".5\n", ".5 0\n")
    wrapped = two_joints.replace(" 20.0", "\n20.0\n").replace("Frames: 2", "Frames:2")
    fixed = two_joints.replace(".0 ", ".000000 ").replace(".5", ".500000").replace(".0\n", ".000000\n")
    return [
        two_joints.encode(),
        two_joints.replace("\n", "\r\n").encode(),
        two_joints.replace("\n", "\r").encode(),
        b"\xef\xbb\xbf" + moving.encode(),
        wrapped.encode(),
        fixed.encode(),
        two_joints.replace("10.0 90.0", "1e1 9.0E1").replace(" ", "\t ").lower().encode(),
        humanoid_text(2).encode(),
    ]


def test_damaged_files_give_a_motion_or_an_input_error(seeds: list[bytes]) -> None:
    good, messages = 0, []
    faulthandler.dump_traceback_later(LONGEST_SECONDS, exit=True)
    try:
        for content in damaged(seeds):
            try:
                motion = bvh_read.parse(content, "clip.bvh")
            except InputError as error:
                messages.append(str(error))
                continue
            good += 1
            assert np.isfinite(motion.global_positions()).all()
            again = bvh_read.parse(bvh_write.serialize(motion), "again.bvh", motion.layout.metres_per_unit)
            np.testing.assert_array_equal(again.local_rotations, motion.local_rotations)
            np.testing.assert_array_equal(again.root_positions, motion.root_positions)
    finally:
        faulthandler.cancel_dump_traceback_later()
    # Both kinds must be common, or the damage is too heavy or too light to test much.
    assert good > DAMAGED_FILES // 10
    assert len(messages) > DAMAGED_FILES // 3
    assert all(text.startswith("clip.bvh: ") and "\n" not in text for text in messages)


def test_the_files_are_valid_before_they_are_damaged(seeds: list[bytes]) -> None:
    assert all(len(bvh_read.parse(content, "clip.bvh")) == 2 for content in seeds)


def assert_same_as_pymotion(path: Path) -> None:
    """Same names, parents, world positions and rotations of every joint; pymotion computes in single precision."""
    motion = io.read(path)
    other = BVH()
    other.load(str(path))
    turned, positions, parents, offsets, _, _ = other.get_data()
    assert tuple(other.data["names"]) == motion.skeleton.names
    assert tuple(parents[1:]) == motion.skeleton.parents[1:]
    assert other.data["frame_time"] == pytest.approx(1.0 / motion.rate, abs=1e-6)
    if motion.translations is None:
        expected, matrices = fk(turned, positions[:, 0], np.concatenate([np.zeros((1, 3)), offsets[1:]]), parents)
        np.testing.assert_allclose(
            motion.global_positions() / motion.layout.metres_per_unit, expected, rtol=0, atol=5e-5
        )
        ours = Rotation.from_quat(motion.global_rotations()).as_matrix()
        np.testing.assert_allclose(ours, matrices, rtol=0, atol=1e-6)
    else:
        # Their forward kinematics has fixed offsets, so files that animate joint positions are compared locally.
        np.testing.assert_allclose(motion.translations / motion.layout.metres_per_unit, positions, rtol=0, atol=1e-9)
        ours = Rotation.from_quat(motion.local_rotations).as_matrix()
        theirs = Rotation.from_quat(turned[..., [1, 2, 3, 0]]).as_matrix()
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6)


def test_a_generated_file_means_the_same_to_pymotion(tmp_path: Path, humanoid_text: Callable[..., str]) -> None:
    (tmp_path / "clip.bvh").write_text(humanoid_text(20))
    assert_same_as_pymotion(tmp_path / "clip.bvh")


def test_generated_rows_mean_the_same_to_pymotion(tmp_path: Path, humanoid_text: Callable[..., str]) -> None:
    motion = bvh_read.parse(humanoid_text(20).encode(), "clip")
    io.write(tmp_path / "made.bvh", motion, unchanged_rows={})
    assert_same_as_pymotion(tmp_path / "made.bvh")


@pytest.mark.parametrize("data_set", ["lafan1", "lafan1-excerpts", "100style", "bandai-namco-1", "bandai-namco-2"])
def test_a_real_file_means_the_same_to_pymotion(data_set: str, data_dir: Path) -> None:
    files = sorted((data_dir / data_set).glob("*.bvh"), key=lambda path: (path.stat().st_size, path))
    if not files:
        pytest.skip(f"INTERPOSE_DATA holds no {data_set}")
    assert_same_as_pymotion(files[0])
