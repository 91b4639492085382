"""Key frames: from text such as "0,45,90-99" to frame numbers, and from keys to gaps.

Frames count from 0, negative numbers from the end (-1 is the last frame). A range includes both of its ends.
"""

from __future__ import annotations

import re
from itertools import pairwise

from interpose.errors import InputError

_ITEM = re.compile(r"(-?\d{1,12})(?:-(-?\d{1,12}))?")


def parse_keys(text: str, frames: int) -> tuple[int, ...]:
    """The keys named by ``text`` in a clip of ``frames`` frames, ascending.

    Raises InputError, with the value and the clip's frames, for anything but a comma-separated list of at least two
    ascending frames of the clip, each a number or a range.
    """
    clip = f"the clip has frames 0 to {frames - 1}"
    given = f"--keys {_shown(text)}"
    if not text.strip():
        raise InputError(f"--keys is empty; give at least two frames, as in 0,45,90-99 ({clip})")
    keys: list[int] = []
    for item in text.split(","):
        match = _ITEM.fullmatch(item.strip())
        if match is None:
            raise InputError(
                f"{given}: '{_shown(item.strip())}' is neither a frame nor a range of frames, as in 0,45,90-99 ({clip})"
            )
        first, last = (_in_clip(number, given, frames) for number in (match[1], match[2] or match[1]))
        if last < first:
            raise InputError(f"{given}: the range '{item.strip()}' runs backward ({clip})")
        if keys and first == keys[-1]:
            raise InputError(f"{given}: frame {first} is named twice ({clip})")
        if keys and first < keys[-1]:
            raise InputError(f"{given}: frame {first} comes after {keys[-1]}; give the keys in order ({clip})")
        keys.extend(range(first, last + 1))
    if len(keys) == 1:
        raise InputError(f"{given} is a single key; in-betweening needs at least two ({clip})")
    return tuple(keys)


def gaps(keys: tuple[int, ...]) -> list[tuple[int, int]]:
    """The (start, target) pairs of neighbouring keys with frames between them."""
    return [(a, b) for a, b in pairwise(keys) if b - a > 1]


def parse_pose(text: str) -> tuple[str, int | None]:
    """Splits FILE or FILE:FRAME into the file's name and the frame; None where no frame is given."""
    name, colon, frame = text.rpartition(":")
    if colon and name and re.fullmatch(r"-?\d{1,12}", frame):
        return name, int(frame)
    return text, None


def frame_in_clip(frame: int, frames: int, name: str) -> int:
    """``frame`` counted from the start of a clip of ``frames`` frames. Raises InputError where it has no such frame."""
    if not -frames <= frame < frames:
        raise InputError(f"{name}:{frame}: there is no such frame; the clip has frames 0 to {frames - 1}")
    return frame % frames


def _in_clip(number: str, given: str, frames: int) -> int:
    frame = int(number)
    if not -frames <= frame < frames:
        raise InputError(f"{given}: frame {frame} is outside the clip, which has frames 0 to {frames - 1}")
    return frame % frames


def _shown(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:59]}…"
