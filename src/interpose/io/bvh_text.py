"""Parses the text of a BVH file: the hierarchy, the frame count, the frame time, and the numbers at NumPy's speed."""

from __future__ import annotations

import codecs
import io
import re
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.io.bvh_layout import CHANNEL_NAMES
from interpose.io.files import encoding_of

MAX_JOINTS = 2000
LARGEST_NUMBER = 1e9
"""Larger numbers are refused: they are in no motion, and overflow later."""

_TOKEN = re.compile(rb"[{}]|(?i:(?:ROOT|JOINT)\b[^\r\n{}]*|End[ \t]*Site\b[^\r\n{}]*)|[^\s{}]+")
_FRAMES = re.compile(rb"(?i)\s*Frames\b[ \t]*:?[ \t]*([^\s:]+)")
_FRAME_TIME = re.compile(rb"(?i)\s*Frame[ \t]*Time\b[ \t]*:?[ \t]*([^\s:]+)")
_NUMBER = re.compile(rb"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?")
_NUMBER_BYTES = b"0123456789+-.eE \t\r\n\v\f"
_CHANNEL_OF = {name.lower().encode(): name for name in CHANNEL_NAMES}


@dataclass
class BvhHeader:
    """What is before the rows, in file order: joints depth first, and end sites by their parent joint.

    Offsets are in the file's unit, None until they are read. The spans are where the text of the frame count and of
    the frame time starts and ends.
    """

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, ...] | None] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_sites: list[int] = field(default_factory=list)
    end_offsets: list[tuple[float, ...]] = field(default_factory=list)
    encoding: str = "utf-8"
    frames: int = 0
    frames_span: tuple[int, int] = (0, 0)
    frame_time_span: tuple[int, int] = (0, 0)


class BvhText:
    """A file's bytes and the tokens of its hierarchy: keywords, numbers, braces, and a joint's keyword with its name.

    name: of the file, for messages that say where something is wrong. position: where the last token starts.
    """

    def __init__(self, name: str, data: bytes) -> None:
        self.name = name
        self.data = data
        self.newline = "\r" if b"\r" in data and b"\n" not in data else "\n"
        self.position = len(codecs.BOM_UTF8) if data.startswith(codecs.BOM_UTF8) else 0
        self._matches = _TOKEN.finditer(data, self.position)

    def fail(self, what: str, position: int | None = None) -> NoReturn:
        """Raises InputError with the line that contains ``position``, by default that of the last token."""
        end = self.position if position is None else position
        line = self.data.count(self.newline.encode(), 0, end) + 1
        raise InputError(f"{self.name}: line {line}: {what}")

    def take(self, expected: str) -> bytes:
        """The next token."""
        match = next(self._matches, None)
        if match is None:
            self.fail(f"the file is cut short, {expected} must follow", len(self.data.rstrip()))
        self.position = match.start()
        return match[0]

    def expect(self, token: bytes, complaint: str) -> None:
        """Takes ``token``, in any case."""
        if self.take(shown(token)).upper() != token:
            self.fail(complaint)

    def vector(self) -> tuple[float, ...]:
        """The three numbers of an OFFSET."""
        return tuple(self.number(self.take("OFFSET's three numbers")) for _ in range(3))

    def number(self, text: bytes, position: int | None = None) -> float:
        """The number in ``text``. Raises InputError if it is none or beyond LARGEST_NUMBER."""
        if not _NUMBER.fullmatch(text):
            self.fail(f"{shown(text)} is not a number", position)
        value = float(text)
        if not abs(value) <= LARGEST_NUMBER:
            self.fail(f"{shown(text)} is out of range", position)
        return value


def shown(text: bytes) -> str:
    """Part of the file, short and printable, for a message."""
    return repr(text[:40].decode("utf-8", "replace"))


def parse_header(source: BvhText) -> BvhHeader:
    """Reads up to the frame time. Raises InputError, with the line, where the file violates the format."""
    out = _parse_hierarchy(source)
    end = source.position + len(b"MOTION")
    frames = _FRAMES.match(source.data, end)
    if frames is None:
        source.fail("'Frames: COUNT' must follow MOTION", end)
    if not frames[1].isdigit() or len(frames[1]) > 18:
        source.fail(f"the frame count {shown(frames[1])} is not a whole number", frames.start(1))
    if int(frames[1]) == 0:
        source.fail("the file has no frames", frames.start(1))
    time = _FRAME_TIME.match(source.data, frames.end())
    if time is None:
        source.fail("'Frame Time: SECONDS' must follow the frame count", frames.end())
    if not 1e-5 <= source.number(time[1], time.start(1)) <= 100.0:
        source.fail(f"the frame time {shown(time[1])} must be from 0.00001 to 100 seconds", time.start(1))
    out.frames, out.frames_span, out.frame_time_span = int(frames[1]), frames.span(1), time.span(1)
    return out


def _parse_hierarchy(source: BvhText) -> BvhHeader:
    if (first := source.take("HIERARCHY")).upper() != b"HIERARCHY":
        source.fail(f"a BVH file starts with HIERARCHY, this one with {shown(first)}")
    out = BvhHeader()
    index: dict[bytes, int] = {}
    opened: list[int] = []
    while True:
        token = source.take("the hierarchy's next line" if opened or not index else "MOTION")
        word = token.split(maxsplit=1)[0].upper()
        if word in (b"ROOT", b"JOINT"):
            name = token[len(word) :].strip()
            _check_joint(source, word, name, index, opened)
            source.expect(b"{", f"'{{' must follow the joint's name {shown(name)}")
            out.parents.append(opened[-1] if opened else -1)
            out.offsets.append(None)
            out.channels.append(())
            opened.append(len(index))
            index[name] = len(index)
        elif word == b"MOTION" and index and not opened:
            break
        elif not opened:
            source.fail(f"{'MOTION' if index else 'ROOT'} expected, found {shown(token)}")
        elif word == b"MOTION":
            source.fail(f"{len(opened)} '}}' missing before MOTION")
        elif word == b"}":
            joint = opened.pop()
            if out.offsets[joint] is None:
                source.fail(f"joint {shown(list(index)[joint])} has no OFFSET")
        elif word == b"OFFSET":
            if out.offsets[opened[-1]] is not None:
                source.fail(f"a second OFFSET in joint {shown(list(index)[opened[-1]])}")
            out.offsets[opened[-1]] = source.vector()
        elif word == b"CHANNELS":
            if out.channels[opened[-1]]:
                source.fail(f"a second CHANNELS in joint {shown(list(index)[opened[-1]])}")
            out.channels[opened[-1]] = _parse_channels(source)
        elif word in (b"END", b"ENDSITE"):
            source.expect(b"{", "'{' must follow 'End Site'")
            source.expect(b"OFFSET", "an end site holds one OFFSET")
            out.end_sites.append(opened[-1])
            out.end_offsets.append(source.vector())
            source.expect(b"}", "'}' must follow the end site's OFFSET")
        else:
            source.fail(f"OFFSET, CHANNELS, JOINT, End Site or '}}' expected, found {shown(token)}")
    if not any(out.channels):
        source.fail("no joint has a channel, so the file holds no motion")
    out.encoding = encoding_of(source.data[: source.position])
    out.names = [name.decode(out.encoding) for name in index]
    return out


def _check_joint(source: BvhText, word: bytes, name: bytes, index: dict[bytes, int], opened: list[int]) -> None:
    if word == b"ROOT" and index:
        source.fail(f"a second ROOT {shown(name)}, a file must hold one skeleton")
    if word == b"JOINT" and not opened:
        source.fail(f"JOINT {shown(name)} is outside the hierarchy, {'a } too many' if index else 'ROOT missing'}")
    if not name:
        source.fail(f"{word.decode()} without a name")
    if any(byte < 32 and byte != 9 for byte in name):
        source.fail(f"the joint name {shown(name)} holds control characters")
    if name in index:
        source.fail(f"a second joint named {shown(name)}, rename one of them")
    if len(index) == MAX_JOINTS:
        source.fail(f"more than {MAX_JOINTS} joints")


def _parse_channels(source: BvhText) -> tuple[str, ...]:
    count = source.take("the number of channels")
    if not count.isdigit() or len(count) > 4 or int(count) > len(CHANNEL_NAMES):
        source.fail(f"a joint has 0 to 6 channels, not {shown(count)}")
    names: list[str] = []
    for _ in range(int(count)):
        token = source.take("a channel name")
        name = _CHANNEL_OF.get(token.lower())
        if name is None:
            source.fail(f"unknown channel {shown(token)}, expected one of {', '.join(CHANNEL_NAMES)}")
        if name in names:
            source.fail(f"channel {name} is given twice")
        names.append(name)
    return tuple(names)


def parse_rows(source: BvhText, header: BvhHeader) -> Float[ndarray, "frame channel"]:
    """The rows after the header, which may be wrapped over lines.

    Raises InputError for anything that is not a number, with its line, and where there are not as many as declared.
    """
    start = header.frame_time_span[1]
    block = source.data[start:]
    count = sum(map(len, header.channels))
    if not block or block.isspace():
        raise InputError(f"{source.name}: no rows follow the frame time, {header.frames} frames are declared")
    try:
        values = None if block.translate(None, _NUMBER_BYTES) else parse_numbers(block)
    except ValueError:
        values = None
    if values is None or not np.abs(values).max() <= LARGEST_NUMBER:
        for token in re.compile(rb"\S+").finditer(source.data, start):
            source.number(token[0], token.start())
        raise AssertionError("a valid number was refused")
    if values.size != header.frames * count:
        _fail_on_count(source, start, header.frames, values.size, count)
    return values.reshape(header.frames, count)


def parse_numbers(block: bytes) -> Float[ndarray, "*shape"]:
    """The numbers of a text: (line, number) where all lines have the same count, else flat. Raises ValueError."""
    if b"\n" not in block:
        block = block.replace(b"\r", b"\n")
    values = _parse_fixed_point(block)
    if values is not None:
        return values
    try:
        return np.loadtxt(io.BytesIO(block), comments=None, ndmin=2)
    except ValueError:
        return np.array(block.split(), dtype=float)


def _parse_fixed_point(block: bytes) -> Float[ndarray, "line number"] | None:
    # Most files print every number with the same number of decimals. Without its points the text is then a table of
    # integers, which parses five times as fast; below 2**53 the quotient is the correctly rounded decimal.
    if b"e" in block or b"E" in block:
        return None
    text = np.frombuffer(block + b" ", np.uint8)
    printed = text > ord(" ")
    ends = np.flatnonzero(printed[:-1] > printed[1:])
    points = np.flatnonzero(text == ord("."))
    if len(points) != len(ends):
        return None
    decimals = int(ends[0] - points[0])
    one_point_each = (ends - points == decimals).all() and (points[1:] > ends[:-1]).all()
    if not (1 <= decimals <= 15 and one_point_each and (text[points + 1] >= ord("0")).all()):
        return None
    try:
        scaled = np.loadtxt(io.BytesIO(block.translate(None, b".")), dtype=np.int64, comments=None, ndmin=2)
    except ValueError:
        return None
    return scaled / 10.0**decimals if np.abs(scaled).max() < 2**53 else None


def _fail_on_count(source: BvhText, start: int, frames: int, numbers: int, count: int) -> NoReturn:
    position = start
    for line in source.data[start:].split(source.newline.encode()):
        if (found := len(line.split())) not in (0, count):
            source.fail(f"{found} numbers in a row, {count} channels are declared", position)
        position += len(line) + 1
    raise InputError(f"{source.name}: {frames} frames are declared, {numbers // count} rows follow")
