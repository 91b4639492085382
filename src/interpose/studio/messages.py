"""Packs and unpacks envelopes: a JSON header and arrays of 32-bit floats, as described in `protocol`.

Incoming bytes are not trusted: every length is checked against the bytes that are there before it is used.
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
from interpose.studio.validation_messages import first_error

Arrays = Mapping[str, ndarray]
Header = TypeVar("Header", covariant=True)

MOST_ARRAYS = 16
MOST_NUMBERS = 2**40
LARGEST_HEADER = 16 * 1024 * 1024
"""Largest incoming header in bytes."""


@runtime_checkable
class HeaderType(Protocol[Header]):
    """Parses headers of one type from JSON, as pydantic's `TypeAdapter` does."""

    def validate_json(self, data: bytes, /, *, strict: bool) -> Header: ...


def shapes(arrays: Arrays) -> dict[str, list[int]]:
    """The `arrays` of a header for these arrays."""
    return {name: list(array.shape) for name, array in arrays.items()}


def pack(header: BaseModel, arrays: Arrays) -> bytes:
    """An envelope. The header's own `arrays` must be the :func:`shapes` of the arrays, in their order."""
    named = getattr(header, "arrays", {})
    if list(shapes(arrays).items()) != list(named.items()):
        raise ValueError(f"the header describes {named}, but the arrays are {shapes(arrays)}")
    text = header.model_dump_json().encode()
    text += b" " * (-len(text) % 4)
    floats = [np.ascontiguousarray(array, dtype="<f4").tobytes() for array in arrays.values()]
    return b"".join([struct.pack("<I", len(text)), text, *floats])


def unpack(
    data: bytes, header_type: HeaderType[Header], largest: int = LARGEST_HEADER
) -> tuple[Header, dict[str, Float32[ndarray, "..."]]]:
    """The header, checked against its type, and its arrays by name.

    Raises InputError if the bytes are not an envelope, the header does not validate, its arrays do not match the bytes
    that follow, or a number is not finite.
    """
    if len(data) < 4:
        raise InputError(f"the message has {len(data)} bytes; an envelope starts with the four of its header's length")
    (length,) = struct.unpack_from("<I", data)
    if length > len(data) - 4:
        raise InputError(f"the header should have {length} bytes, but {len(data) - 4} follow; send all of it")
    if length > largest:
        raise InputError(f"the header has {length} bytes; the limit is {largest}")
    if length % 4:
        raise InputError(f"the header has {length} bytes; pad it with spaces to a multiple of four")
    try:
        header = header_type.validate_json(data[4 : 4 + length], strict=True)
    except ValidationError as error:
        raise InputError(f"the header of the message is invalid: {first_error(error)}") from None
    return header, _arrays(getattr(header, "arrays", {}), data, 4 + length)


def _arrays(named: Mapping[str, list[int]], data: bytes, begin: int) -> dict[str, ndarray]:
    if len(named) > MOST_ARRAYS:
        raise InputError(f"the header names {len(named)} arrays; the limit is {MOST_ARRAYS}")
    counts = {name: math.prod(shape) for name, shape in named.items()}
    needed, there = 4 * sum(counts.values()), len(data) - begin
    if needed != there:
        raise InputError(f"the arrays of the header take {needed} bytes, but {there} follow it")
    out = {}
    for name, shape in named.items():
        if math.prod(max(1, count) for count in shape) > MOST_NUMBERS:  # an empty array of such a shape cannot be made
            raise InputError(f"the array '{name[:40]}' has the impossible shape {'x'.join(map(str, shape))}")
        array = np.frombuffer(data, "<f4", counts[name], begin).reshape(shape)
        if not np.isfinite(array).all():
            raise InputError(f"the array '{name[:40]}' contains NaN or infinite numbers")
        out[name] = array
        begin += 4 * counts[name]
    return out
