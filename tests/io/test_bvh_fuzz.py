"""Thousands of damaged BVH files: each gives a motion or an InputError, and none takes long."""

from __future__ import annotations

import faulthandler
import random
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.io import bvh

FILES = 3200
SECONDS = 60
TOKENS = [
    *(
        "HIERARCHY",
        "MOTION",
        "ROOT",
        "JOINT",
        "End Site",
        "OFFSET",
        "CHANNELS",
        "Frames:",
        "Frame Time:",
        "{",
        "}",
        ":",
    ),
    *(
        "Xposition",
        "Yrotation",
        "zROTATION",
        "Hips",
        "Spine",
        "",
        " ",
        "\t",
        "\n",
        "\r",
        "\r\n",
        "\0",
        "\v",
        "\x85",
        "é",
    ),
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
            words = bytes(data).split(b" ")
            words[draw.randrange(len(words))] = draw.choice(TOKENS).encode()
            data = bytearray(b" ".join(words))
        case _:
            # A digit or a blank becomes another, so that many files stay whole.
            kind = draw.choice([b"0123456789", b" \t"])
            if places := [i for i, byte in enumerate(data) if byte in kind]:
                data[draw.choice(places)] = draw.choice(kind)
    return bytes(data)


def damaged(seeds: list[bytes]) -> Iterator[bytes]:
    """The same damaged files on every run: one to four changes each."""
    draw = random.Random(20240)
    for number in range(FILES):
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
    faulthandler.dump_traceback_later(SECONDS, exit=True)
    try:
        for content in damaged(seeds):
            try:
                motion = bvh.parse(content, "clip.bvh")
            except InputError as error:
                messages.append(str(error))
                continue
            good += 1
            assert np.isfinite(motion.global_positions()).all()
            again = bvh.parse(bvh.serialize(motion), "again.bvh", motion.layout.metres_per_unit)
            np.testing.assert_array_equal(again.local_rotations, motion.local_rotations)
            np.testing.assert_array_equal(again.root_positions, motion.root_positions)
    finally:
        faulthandler.cancel_dump_traceback_later()
    # Both kinds must be common, or the damage is too heavy or too light to test much.
    assert good > FILES // 10
    assert len(messages) > FILES // 3
    assert all(text.startswith("clip.bvh: ") and "\n" not in text for text in messages)


def test_the_files_are_valid_before_they_are_damaged(seeds: list[bytes]) -> None:
    assert all(len(bvh.parse(content, "clip.bvh")) == 2 for content in seeds)
