"""Parses the numbers of a BVH file, at the speed of NumPy or better."""

from __future__ import annotations

import io
import re
from typing import NoReturn

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.io.bvh_header import LARGEST_NUMBER, BvhHeader, BvhText, parse_number

_NUMBER_BYTES = b"0123456789+-.eE \t\r\n\v\f"
_BLANK = 32
_DOT = ord(".")


def parse_rows(source: BvhText, header: BvhHeader) -> Float[ndarray, "frame channel"]:
    """The rows after the header, which may be wrapped over lines.

    Raises InputError for anything that is not a number, with its line, and where there are not as many as declared.
    """
    start = header.frame_time_span[1]
    block = source.data[start:]
    count = sum(map(len, header.hierarchy.channels))
    if not block or block.isspace():
        raise InputError(f"{source.name}: no rows follow the frame time, {header.frames} frames are declared")
    if block.translate(None, _NUMBER_BYTES):
        _fail_on_number(source, start)
    try:
        values = parse_numbers(block)
    except ValueError:
        _fail_on_number(source, start)
    if not np.abs(values).max() <= LARGEST_NUMBER:
        _fail_on_number(source, start)
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
    printed = text > _BLANK
    ends = np.flatnonzero(printed[:-1] > printed[1:])
    points = np.flatnonzero(text == _DOT)
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


def _fail_on_number(source: BvhText, start: int) -> NoReturn:
    for token in re.compile(rb"\S+").finditer(source.data, start):
        parse_number(source, token[0], token.start())
    raise AssertionError("a valid number was refused")


def _fail_on_count(source: BvhText, start: int, frames: int, numbers: int, count: int) -> NoReturn:
    position = start
    for line in source.data[start:].split(source.newline.encode()):
        if (found := len(line.split())) not in (0, count):
            source.fail(position, f"{found} numbers in a row, {count} channels are declared")
        position += len(line) + 1
    raise InputError(f"{source.name}: {frames} frames are declared, {numbers // count} rows follow")
