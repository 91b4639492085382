"""The part of a BVH file before its numbers: the hierarchy, the frame count and the frame time."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from typing import NoReturn

from interpose.errors import InputError
from interpose.io.bvh_layout import CHANNELS

MAX_JOINTS = 2000
LARGEST = 1e9
"""Numbers beyond this are refused: no motion holds them and they overflow later."""

_TOKEN = re.compile(rb"[{}]|(?i:(?:ROOT|JOINT)\b[^\r\n{}]*|End[ \t]*Site\b[^\r\n{}]*)|[^\s{}]+")
_FRAMES = re.compile(rb"(?i)\s*Frames\b[ \t]*:?[ \t]*([^\s:]+)")
_FRAME_TIME = re.compile(rb"(?i)\s*Frame[ \t]*Time\b[ \t]*:?[ \t]*([^\s:]+)")
_NUMBER = re.compile(rb"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_CHANNEL_NAMES = {name.lower().encode(): name for name in CHANNELS}


@dataclass
class Hierarchy:
    """Joints in file order, depth first; offsets in the file's unit, None until they are read."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, ...] | None] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_sites: list[int] = field(default_factory=list)
    end_offsets: list[tuple[float, ...]] = field(default_factory=list)


@dataclass(frozen=True)
class Header:
    """The hierarchy, the declared frames and seconds a frame, and where their texts and the numbers lie in the file."""

    hierarchy: Hierarchy
    frames: int
    frame_time: float
    frames_span: tuple[int, int]
    frame_time_span: tuple[int, int]
    encoding: str


class Source:
    """A file's bytes with its name, to say where something is wrong."""

    def __init__(self, path: str | os.PathLike[str], data: bytes) -> None:
        self.path = path
        self.data = data
        self.newline = "\r" if b"\r" in data and b"\n" not in data else "\n"

    def fail(self, position: int, what: str) -> NoReturn:
        """Raises InputError with the line that ``position`` lies in."""
        line = self.data.count(self.newline.encode(), 0, position) + 1
        raise InputError(f"{self.path}: line {line}: {what}")


def shown(text: bytes) -> str:
    """A piece of the file, short and printable, for a message."""
    return repr(text[:40].decode("utf-8", "replace"))


def parse_header(source: Source) -> Header:
    """Reads up to the frame time. Raises InputError where the file departs from the format, with the line."""
    bom = source.data.startswith(b"\xef\xbb\xbf")
    hierarchy, end, encoding = _parse_hierarchy(source, 3 if bom else 0)
    if bom and encoding == "utf-8":
        encoding = "utf-8-sig"
    frames = _FRAMES.match(source.data, end)
    if frames is None:
        source.fail(end, "'Frames: COUNT' must follow MOTION")
    if not frames[1].isdigit() or len(frames[1]) > 18:
        source.fail(frames.start(1), f"the frame count {shown(frames[1])} is not a whole number")
    if int(frames[1]) == 0:
        source.fail(frames.start(1), "the file has no frames")
    time = _FRAME_TIME.match(source.data, frames.end())
    if time is None:
        source.fail(frames.end(), "'Frame Time: SECONDS' must follow the frame count")
    seconds = parse_number(source, time[1], time.start(1))
    if not 1e-5 <= seconds <= 100.0:
        source.fail(time.start(1), f"the frame time {shown(time[1])} must be from 0.00001 to 100 seconds")
    return Header(hierarchy, int(frames[1]), seconds, frames.span(1), time.span(1), encoding)


def _parse_hierarchy(source: Source, start: int) -> tuple[Hierarchy, int, str]:
    tokens = _TOKEN.finditer(source.data, start)
    position = start

    def take(expected: str) -> bytes:
        nonlocal position
        token = next(tokens, None)
        if token is None:
            source.fail(len(source.data.rstrip()), f"the file ends where {expected} must follow, it is cut short")
        position = token.start()
        return token[0]

    def numbers(keyword: str) -> tuple[float, ...]:
        return tuple(parse_number(source, take(f"{keyword}'s three numbers"), position) for _ in range(3))

    if (word := take("HIERARCHY")).upper() != b"HIERARCHY":
        source.fail(position, f"a BVH file starts with HIERARCHY, this one with {shown(word)}")
    out = Hierarchy()
    index: dict[bytes, int] = {}
    opened: list[int] = []
    while True:
        token = take("the hierarchy's next line" if opened or not out.names else "MOTION")
        word = token.split(maxsplit=1)[0].upper()
        if word in (b"ROOT", b"JOINT"):
            name = token[len(word) :].strip()
            _check_joint(source, position, word, name, index, opened)
            index[name] = len(index)
            out.names.append("")
            out.parents.append(opened[-1] if opened else -1)
            out.offsets.append(None)
            out.channels.append(())
            if take("'{'") != b"{":
                source.fail(position, f"'{{' must follow the joint's name {shown(name)}")
            opened.append(len(index) - 1)
        elif word == b"MOTION" and not opened and out.names:
            break
        elif not opened:
            source.fail(position, f"{'MOTION' if out.names else 'ROOT'} expected, found {shown(token)}")
        elif word == b"MOTION":
            source.fail(position, f"{len(opened)} '}}' missing before MOTION")
        elif word == b"}":
            if out.offsets[opened[-1]] is None:
                source.fail(position, f"joint {shown(list(index)[opened[-1]])} has no OFFSET")
            opened.pop()
        elif word == b"OFFSET":
            if out.offsets[opened[-1]] is not None:
                source.fail(position, f"a second OFFSET in joint {shown(list(index)[opened[-1]])}")
            out.offsets[opened[-1]] = numbers("OFFSET")
        elif word == b"CHANNELS":
            if out.channels[opened[-1]]:
                source.fail(position, f"a second CHANNELS in joint {shown(list(index)[opened[-1]])}")
            count = take("the number of channels")
            if not count.isdigit() or len(count) > 4 or int(count) > 6:
                source.fail(position, f"a joint has 0 to 6 channels, not {shown(count)}")
            names = []
            for _ in range(int(count)):
                channel = take("a channel name")
                names.append(_CHANNEL_NAMES.get(channel.lower(), ""))
                if not names[-1]:
                    source.fail(position, f"unknown channel {shown(channel)}, known are {', '.join(CHANNELS)}")
                if names[-1] in names[:-1]:
                    source.fail(position, f"channel {names[-1]} is given twice")
            out.channels[opened[-1]] = tuple(names)
        elif word in (b"END", b"ENDSITE"):
            if take("'{'") != b"{":
                source.fail(position, "'{' must follow 'End Site'")
            if take("OFFSET").upper() != b"OFFSET":
                source.fail(position, "an end site holds one OFFSET")
            out.end_sites.append(opened[-1])
            out.end_offsets.append(numbers("OFFSET"))
            if take("'}'") != b"}":
                source.fail(position, "'}' must follow the end site's OFFSET")
        else:
            source.fail(position, f"OFFSET, CHANNELS, JOINT, End Site or '}}' expected, found {shown(token)}")
    try:
        encoding = "utf-8"
        names = [name.decode(encoding) for name in index]
        source.data[:position].decode(encoding)
    except UnicodeDecodeError:
        encoding = "latin-1"
        names = [name.decode(encoding) for name in index]
    out.names[:] = names
    if not any(out.channels):
        source.fail(position, "no joint has a channel, so the file holds no motion")
    return out, position + len(b"MOTION"), encoding


def _check_joint(
    source: Source, position: int, word: bytes, name: bytes, index: dict[bytes, int], opened: list[int]
) -> None:
    if word == b"ROOT" and index:
        source.fail(position, f"a second ROOT {shown(name)}, a file must hold one skeleton")
    if word == b"JOINT" and not opened:
        source.fail(position, f"JOINT {shown(name)} lies in no joint, {'a } too many' if index else 'ROOT missing'}")
    if not name:
        source.fail(position, f"{word.decode()} without a name")
    if any(byte < 32 and byte != 9 for byte in name):
        source.fail(position, f"the joint name {shown(name)} holds control characters")
    if name in index:
        source.fail(position, f"a second joint named {shown(name)}, rename one of them")
    if len(index) == MAX_JOINTS:
        source.fail(position, f"more than {MAX_JOINTS} joints")


def parse_number(source: Source, text: bytes, position: int) -> float:
    """The number written as ``text`` at ``position``. Raises InputError for anything else and beyond ``LARGEST``."""
    if not _NUMBER.fullmatch(text):
        source.fail(position, f"{shown(text)} is not a number")
    value = float(text)
    if not abs(value) <= LARGEST:
        source.fail(position, f"{shown(text)} is out of range")
    return value
