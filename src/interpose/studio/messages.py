"""Envelopes: a header in JSON and arrays of 32-bit floats in one piece of bytes, as `protocol` describes them.

What comes in is not trusted. Every length is checked against the bytes that are there before anything is made of it,
and whatever does not fit is refused in a sentence.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float32
from numpy import ndarray
from pydantic import BaseModel, ValidationError

from interpose.errors import InputError
from interpose.studio.validation_messages import said

Arrays = Mapping[str, ndarray]
Header = TypeVar("Header", covariant=True)

MOST_ARRAYS = 16
MOST_NUMBERS = 2**40
LARGEST_HEADER = 16 * 1024 * 1024
"""Bytes of a header that comes in, at most."""


@runtime_checkable
class Kind(Protocol[Header]):
    """What makes headers of one kind from JSON: pydantic's `TypeAdapter`."""

    def validate_json(self, data: bytes, /, *, strict: bool) -> Header: ...


def shapes(arrays: Arrays) -> dict[str, list[int]]:
    """What a header says of its arrays."""
    return {name: list(array.shape) for name, array in arrays.items()}


def pack(header: BaseModel, arrays: Arrays) -> bytes:
    """An envelope. The header's own `arrays` must be the :func:`shapes` of the arrays, in their order."""
    named = getattr(header, "arrays", {})
    if list(shapes(arrays).items()) != list(named.items()):
        raise ValueError(f"the header says {named} of arrays that are {shapes(arrays)}")
    text = header.model_dump_json().encode()
    text += b" " * (-len(text) % 4)
    floats = [np.ascontiguousarray(array, dtype="<f4").tobytes() for array in arrays.values()]
    return b"".join([struct.pack("<I", len(text)), text, *floats])


def unpack(
    data: bytes, kind: Kind[Header], largest: int = LARGEST_HEADER
) -> tuple[Header, dict[str, Float32[ndarray, "..."]]]:
    """The header, checked to be of that kind, and its arrays by name.

    Raises InputError where the bytes are no envelope, the header is no such header, the arrays that it names are not
    the bytes that follow, or a number is not finite.
    """
    if len(data) < 4:
        raise InputError(f"the message has {len(data)} bytes; an envelope begins with the four of its header's length")
    (length,) = struct.unpack_from("<I", data)
    if length > len(data) - 4:
        raise InputError(f"the header is said to have {length} bytes, but {len(data) - 4} follow; send it whole")
    if length > largest:
        raise InputError(f"the header has {length} bytes; it may have {largest}")
    if length % 4:
        raise InputError(f"the header has {length} bytes; pad it with spaces to a multiple of four")
    try:
        header = kind.validate_json(data[4 : 4 + length], strict=True)
    except ValidationError as error:
        raise InputError(f"the message's header is not as it should be: {said(error)}") from None
    return header, _arrays(getattr(header, "arrays", {}), data, 4 + length)


def _arrays(named: Mapping[str, list[int]], data: bytes, begin: int) -> dict[str, ndarray]:
    if len(named) > MOST_ARRAYS:
        raise InputError(f"the header names {len(named)} arrays; it may name {MOST_ARRAYS}")
    counts = {name: math.prod(shape) for name, shape in named.items()}
    needed, there = 4 * sum(counts.values()), len(data) - begin
    if needed != there:
        raise InputError(f"the arrays that the header names take {needed} bytes, but {there} follow it")
    out = {}
    for name, shape in named.items():
        if math.prod(max(1, count) for count in shape) > MOST_NUMBERS:  # an empty array of such a shape cannot be made
            raise InputError(f"the array '{name[:40]}' is said to have the shape {'x'.join(map(str, shape))}")
        array = np.frombuffer(data, "<f4", counts[name], begin).reshape(shape)
        if not np.isfinite(array).all():
            raise InputError(f"the array '{name[:40]}' holds numbers that are not finite (NaN or infinite)")
        out[name] = array
        begin += 4 * counts[name]
    return out
