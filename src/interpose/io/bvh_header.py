"""Parses a BVH file up to its numbers: the hierarchy, the frame count and the frame time."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from typing import NoReturn

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
_CHANNEL_OF = {name.lower().encode(): name for name in CHANNEL_NAMES}


@dataclass
class BvhHierarchy:
    """Joints in file order, depth first; offsets in the file's unit, None until they are read."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[tuple[float, ...] | None] = field(default_factory=list)
    channels: list[tuple[str, ...]] = field(default_factory=list)
    end_sites: list[int] = field(default_factory=list)
    end_offsets: list[tuple[float, ...]] = field(default_factory=list)


@dataclass(frozen=True)
class BvhHeader:
    """The hierarchy, the declared number of frames, and where that number and the frame time are in the file."""

    hierarchy: BvhHierarchy
    frames: int
    frames_span: tuple[int, int]
    frame_time_span: tuple[int, int]
    encoding: str


class BvhText:
    """A file's bytes with its name, for messages that say where something is wrong."""

    def __init__(self, name: str, data: bytes) -> None:
        self.name = name
        self.data = data
        self.newline = "\r" if b"\r" in data and b"\n" not in data else "\n"

    def fail(self, position: int, what: str) -> NoReturn:
        """Raises InputError with the line that contains ``position``."""
        line = self.data.count(self.newline.encode(), 0, position) + 1
        raise InputError(f"{self.name}: line {line}: {what}")


def shown(text: bytes) -> str:
    """Part of the file, short and printable, for a message."""
    return repr(text[:40].decode("utf-8", "replace"))


def parse_header(source: BvhText) -> BvhHeader:
    """Reads up to the frame time. Raises InputError, with the line, where the file violates the format."""
    start = len(codecs.BOM_UTF8) if source.data.startswith(codecs.BOM_UTF8) else 0
    hierarchy, end, encoding = _parse_hierarchy(source, start)
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
    return BvhHeader(hierarchy, int(frames[1]), frames.span(1), time.span(1), encoding)


class _Tokens:
    """The hierarchy's tokens: keywords, numbers and braces, and a joint's keyword together with its name."""

    def __init__(self, source: BvhText, start: int) -> None:
        self._source = source
        self.position = start
        self._matches = _TOKEN.finditer(source.data, start)

    def take(self, expected: str) -> bytes:
        """The next token; ``position`` is then where it starts."""
        match = next(self._matches, None)
        if match is None:
            end = len(self._source.data.rstrip())
            self._source.fail(end, f"the file is cut short, {expected} must follow")
        self.position = match.start()
        return match[0]

    def expect(self, token: bytes, complaint: str) -> None:
        """Takes ``token``, in any case."""
        if self.take(shown(token)).upper() != token:
            self.fail(complaint)

    def vector(self) -> tuple[float, ...]:
        """The three numbers of an OFFSET."""
        return tuple(parse_number(self._source, self.take("OFFSET's three numbers"), self.position) for _ in range(3))

    def fail(self, what: str) -> NoReturn:
        """Raises InputError at the token taken last."""
        self._source.fail(self.position, what)


def _parse_hierarchy(source: BvhText, start: int) -> tuple[BvhHierarchy, int, str]:
    # Also returns the position after MOTION and the encoding.
    tokens = _Tokens(source, start)
    if (first := tokens.take("HIERARCHY")).upper() != b"HIERARCHY":
        tokens.fail(f"a BVH file starts with HIERARCHY, this one with {shown(first)}")
    out = BvhHierarchy()
    index: dict[bytes, int] = {}
    opened: list[int] = []
    while True:
        token = tokens.take("the hierarchy's next line" if opened or not index else "MOTION")
        word = token.split(maxsplit=1)[0].upper()
        if word in (b"ROOT", b"JOINT"):
            name = token[len(word) :].strip()
            _check_joint(tokens, word, name, index, opened)
            tokens.expect(b"{", f"'{{' must follow the joint's name {shown(name)}")
            out.parents.append(opened[-1] if opened else -1)
            out.offsets.append(None)
            out.channels.append(())
            opened.append(len(index))
            index[name] = len(index)
        elif word == b"MOTION" and index and not opened:
            break
        elif not opened:
            tokens.fail(f"{'MOTION' if index else 'ROOT'} expected, found {shown(token)}")
        elif word == b"MOTION":
            tokens.fail(f"{len(opened)} '}}' missing before MOTION")
        elif word == b"}":
            joint = opened.pop()
            if out.offsets[joint] is None:
                tokens.fail(f"joint {shown(list(index)[joint])} has no OFFSET")
        elif word == b"OFFSET":
            if out.offsets[opened[-1]] is not None:
                tokens.fail(f"a second OFFSET in joint {shown(list(index)[opened[-1]])}")
            out.offsets[opened[-1]] = tokens.vector()
        elif word == b"CHANNELS":
            if out.channels[opened[-1]]:
                tokens.fail(f"a second CHANNELS in joint {shown(list(index)[opened[-1]])}")
            out.channels[opened[-1]] = _parse_channels(tokens)
        elif word in (b"END", b"ENDSITE"):
            tokens.expect(b"{", "'{' must follow 'End Site'")
            tokens.expect(b"OFFSET", "an end site holds one OFFSET")
            out.end_sites.append(opened[-1])
            out.end_offsets.append(tokens.vector())
            tokens.expect(b"}", "'}' must follow the end site's OFFSET")
        else:
            tokens.fail(f"OFFSET, CHANNELS, JOINT, End Site or '}}' expected, found {shown(token)}")
    if not any(out.channels):
        tokens.fail("no joint has a channel, so the file holds no motion")
    encoding = encoding_of(source.data[: tokens.position])
    out.names.extend(name.decode(encoding) for name in index)
    return out, tokens.position + len(b"MOTION"), encoding


def _check_joint(tokens: _Tokens, word: bytes, name: bytes, index: dict[bytes, int], opened: list[int]) -> None:
    if word == b"ROOT" and index:
        tokens.fail(f"a second ROOT {shown(name)}, a file must hold one skeleton")
    if word == b"JOINT" and not opened:
        tokens.fail(f"JOINT {shown(name)} is outside the hierarchy, {'a } too many' if index else 'ROOT missing'}")
    if not name:
        tokens.fail(f"{word.decode()} without a name")
    if any(byte < 32 and byte != 9 for byte in name):
        tokens.fail(f"the joint name {shown(name)} holds control characters")
    if name in index:
        tokens.fail(f"a second joint named {shown(name)}, rename one of them")
    if len(index) == MAX_JOINTS:
        tokens.fail(f"more than {MAX_JOINTS} joints")


def _parse_channels(tokens: _Tokens) -> tuple[str, ...]:
    count = tokens.take("the number of channels")
    if not count.isdigit() or len(count) > 4 or int(count) > len(CHANNEL_NAMES):
        tokens.fail(f"a joint has 0 to 6 channels, not {shown(count)}")
    names: list[str] = []
    for _ in range(int(count)):
        token = tokens.take("a channel name")
        name = _CHANNEL_OF.get(token.lower())
        if name is None:
            tokens.fail(f"unknown channel {shown(token)}, expected one of {', '.join(CHANNEL_NAMES)}")
        if name in names:
            tokens.fail(f"channel {name} is given twice")
        names.append(name)
    return tuple(names)


def parse_number(source: BvhText, text: bytes, position: int) -> float:
    """The number in ``text``, which is at ``position``. Raises InputError if it is none or beyond LARGEST_NUMBER."""
    if not _NUMBER.fullmatch(text):
        source.fail(position, f"{shown(text)} is not a number")
    value = float(text)
    if not abs(value) <= LARGEST_NUMBER:
        source.fail(position, f"{shown(text)} is out of range")
    return value
