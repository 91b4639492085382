"""Every way in which a BVH file can be wrong is an InputError that names the file and, where there is one, the line."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from interpose import io
from interpose.errors import InputError

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
def test_says_what_is_wrong_and_where(case: str, newline: str, save: Save, two_joints: str) -> None:
    change, line, words = CASES[case]
    content = change(two_joints)
    if isinstance(content, str):
        content = content.replace("\n", newline)
    path = save(content)
    with pytest.raises(InputError) as raised:
        io.read(path)
    message = str(raised.value)
    assert message.startswith(f"{path}: " + (f"line {line}: " if line else ""))
    assert words in message
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
