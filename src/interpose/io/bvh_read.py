"""Reads BVH (Biovision hierarchy) files.

The file does not hold its unit. The longest path along the bones (such as from a hand to a foot) is about 2.3 m in an
adult, so 0.8 to 6 units mean metres. Otherwise a skeleton with at least five chains is assumed to be a humanoid in
millimetres, centimetres, inches or CMU's unit (an inch / 0.45), whichever brings it closest to 2.3 m, and any other
skeleton to be in centimetres.
"""

from __future__ import annotations

import re
from decimal import Decimal

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.io.bvh_layout import BvhLayout, decode
from interpose.io.bvh_text import BvhHeader, BvhText, parse_header, parse_rows
from interpose.motion import Motion
from interpose.skeleton import Skeleton

_COMMON_RATES = (30, 60, 120, 24, 25, 50, 48, 90, 100, 15, 10, 12, 20, 72, 75, 144, 200, 240, 250, 300, 480, 500, 1000)
_NTSC_RATES = tuple(rate * 1000 / 1001 for rate in (30, 60, 24, 120))
_UNITS = (0.001, 0.01, 0.0254, 0.0254 / 0.45)
_ADULT_SPAN = 2.3
_START = re.compile(rb"(?:\xef\xbb\xbf)?\s*HIERARCHY\b", re.IGNORECASE)


def recognises(data: bytes) -> bool:
    """Whether the file starts with HIERARCHY."""
    return _START.match(data) is not None


def parse(data: bytes, name: str, metres_per_unit: float | None = None) -> Motion:
    """The motion in a BVH file, in metres, with its :class:`BvhLayout`; ``name`` stands for the path in messages.

    ``metres_per_unit`` overrides the unit found from the skeleton's size. The root's offset is zero in the skeleton;
    where no position channel replaces it, it is in ``root_positions``. Raises InputError, with the line if there is
    one, for a file without a complete motion.
    """
    if not data or data.isspace():
        raise InputError(f"{name}: the file is empty")
    if b"\0" in data:
        raise InputError(f"{name}: not a BVH file, it holds binary data (or UTF-16 text: save it as UTF-8)")
    source = BvhText(name, data)
    header = parse_header(source)
    layout = _layout(source, header, metres_per_unit)
    root, rotations, translations = decode(layout, parse_rows(source, header))
    return Motion(layout.skeleton, root, rotations, rate_of(layout.frame_time), translations, layout)


def rate_of(frame_time: str) -> float:
    """Frames a second from the text of a frame time: the common rate that rounds to it, or else its inverse.

    ``0.033333`` and ``0.0333`` are 30, ``0.0333667`` is 29.97 (30000 / 1001), ``0.03`` is 33.3.
    """
    seconds = float(frame_time)
    last_digit = 10.0 ** int(Decimal(frame_time).as_tuple().exponent)
    for rates in (_COMMON_RATES, _NTSC_RATES):
        rate = min(rates, key=lambda rate: abs(1.0 / rate - seconds))
        if abs(1.0 / rate - seconds) <= max(2e-5 * seconds, min(0.5001 * last_digit, 0.025 * seconds)):
            return float(rate)
    return 1.0 / seconds


def detect_unit(parents: list[int], offsets: Float[ndarray, "joint 3"]) -> float:
    """Metres per unit, estimated from the size of the skeleton by the rule at the top of this file."""
    children = np.bincount(np.array(parents[1:], dtype=int), minlength=len(parents))
    # Joints are depth first. A chain from the root to the first fork positions the body and is not part of it.
    first = 0
    while children[first] == 1:
        first += 1
    bones = np.linalg.norm(offsets, axis=-1)
    reach = np.zeros(len(parents))
    longest = 0.0
    for joint in range(len(parents) - 1, first, -1):
        parent, branch = parents[joint], reach[joint] + bones[joint]
        longest = max(longest, reach[parent] + branch)
        reach[parent] = max(reach[parent], branch)
    if 0.8 <= longest <= 6.0:
        return 1.0
    if np.count_nonzero(children == 0) < 5 or longest == 0.0:
        return 0.01
    return min(_UNITS, key=lambda unit: abs(np.log(longest * unit / _ADULT_SPAN)))


def _layout(source: BvhText, header: BvhHeader, metres_per_unit: float | None) -> BvhLayout:
    data = source.data
    offsets = np.array(header.offsets, dtype=float)
    unit = detect_unit(header.parents, offsets) if metres_per_unit is None else float(metres_per_unit)
    (begin, end), (time_begin, time_end) = header.frames_span, header.frame_time_span
    rest = offsets * unit
    bones = np.concatenate([np.zeros((1, 3)), rest[1:]])
    rows = data[time_end:]
    first_row = rows[: 2**20].lstrip().partition(source.newline.encode())[0].rstrip(b"\r")
    numbers = first_row.rstrip()
    plain = [token for token in numbers.lower().split() if b"e" not in token]
    return BvhLayout(
        skeleton=Skeleton(tuple(header.names), tuple(header.parents), bones),
        offsets=rest,
        channels=tuple(header.channels),
        end_sites=tuple(header.end_sites),
        end_offsets=np.array(header.end_offsets, dtype=float).reshape(-1, 3) * unit,
        metres_per_unit=unit,
        head=(data[:begin].decode(header.encoding), data[end:time_begin].decode("ascii")),
        frame_time=data[time_begin:time_end].decode("ascii"),
        encoding=header.encoding,
        newline="\r\n" if b"\r\n" in data[:begin] else source.newline,
        row_end=first_row[len(numbers) :].decode("ascii", "replace"),
        decimals=min(max([6, *(len(token.partition(b".")[2]) for token in plain)]), 9),
        rows=rows,
    )
