"""Envelopes: what is packed comes out again, and whatever does not fit is refused in one sentence."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy import ndarray
from studio_rigs import envelope

from interpose.errors import InputError
from interpose.studio import messages
from interpose.studio.protocol import CLIENT_MESSAGE, SERVER_MESSAGE, Library, Mirror, MirroredPose

ARRAYS = st.dictionaries(
    st.text(max_size=12),
    hnp.arrays(
        np.float32,
        hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=4),
        elements=st.floats(width=32, allow_nan=False, allow_infinity=False),
    ),
    max_size=5,
)
MIRROR: dict[str, Any] = {"type": "mirror", "id": 1, "rig": "a", "arrays": {"pose": [1, 3]}}
POSE = np.arange(3.0, dtype=np.float32)


def refused(data: bytes, **given: int) -> str:
    with pytest.raises(InputError) as caught:
        messages.unpack(data, CLIENT_MESSAGE, **given)
    expected = str(caught.value)
    assert "\n" not in expected
    assert len(expected) < 300
    return expected


@given(ARRAYS, st.text(min_size=1, max_size=64))
def test_what_is_packed_comes_out_again(arrays: dict[str, ndarray], rig: str) -> None:
    header = Mirror(type="mirror", id=7, rig=rig, arrays=messages.shapes(arrays))
    data = messages.pack(header, arrays)
    (length,) = struct.unpack_from("<I", data)
    assert length % 4 == 0
    assert len(data) == 4 + length + 4 * sum(array.size for array in arrays.values())
    again, held = messages.unpack(data, CLIENT_MESSAGE)
    assert again == header
    assert list(held) == list(arrays)
    for name, array in arrays.items():
        assert held[name].shape == array.shape
        assert held[name].tobytes() == array.tobytes()


def test_numbers_lie_in_order_as_little_endian_floats_of_32_bits() -> None:
    arrays = {"b": np.array([[1.0, 2.0]]), "a": np.array([3.0])}
    data = messages.pack(MirroredPose(type="mirrored", id=1, arrays=messages.shapes(arrays)), arrays)
    assert data[-12:] == struct.pack("<3f", 1.0, 2.0, 3.0)
    wide = {"pose": np.arange(6.0).reshape(2, 3).T}  # neither in C's order nor of 32 bits
    data = messages.pack(MirroredPose(type="mirrored", id=1, arrays=messages.shapes(wide)), wide)
    np.testing.assert_array_equal(messages.unpack(data, SERVER_MESSAGE)[1]["pose"], wide["pose"])


def test_a_header_that_says_something_else_of_its_arrays_is_a_bug() -> None:
    with pytest.raises(ValueError, match="the header describes"):
        messages.pack(MirroredPose(type="mirrored", id=1, arrays={"pose": [2]}), {"pose": POSE})
    two = {"a": POSE, "b": POSE}
    with pytest.raises(ValueError, match="the header describes"):
        messages.pack(MirroredPose(type="mirrored", id=1, arrays={"b": [3], "a": [3]}), two)


def test_every_truncation_and_every_byte_more_is_refused() -> None:
    data = envelope(MIRROR, POSE)
    assert messages.unpack(data, CLIENT_MESSAGE)[0].id == 1
    for length in range(len(data)):
        refused(data[:length])
    assert "take 12 bytes, but 13 follow" in refused(data + b"\0")
    assert "has 3 bytes; an envelope starts with the four" in refused(b"\0\0\0")


def test_a_header_of_4_gb_is_not_waited_for() -> None:
    expected = refused(struct.pack("<I", 2**32 - 1) + b"{}  ")
    assert expected == "the header should have 4294967295 bytes, but 4 follow; send all of it"


def test_a_header_may_be_so_long_and_no_longer() -> None:
    data = envelope(MIRROR, POSE)
    (length,) = struct.unpack_from("<I", data)
    messages.unpack(data, CLIENT_MESSAGE, length)
    assert refused(data, largest=length - 4) == f"the header has {length} bytes; the limit is {length - 4}"


def test_a_header_is_padded() -> None:
    text = json.dumps({"type": "library", "id": 1, "rig": "aaa"}).encode()
    assert len(text) % 4
    assert "pad it with spaces" in refused(struct.pack("<I", len(text)) + text)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_are_finite(bad: float) -> None:
    expected = refused(envelope(MIRROR, np.array([0.0, 1.0, bad])))
    assert expected == "the array 'pose' contains NaN or infinite numbers"


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({"pose": [4]}, "take 16 bytes, but 12 follow"),
        ({"pose": [2]}, "take 8 bytes, but 12 follow"),
        ({"pose": [3], "more": [1]}, "take 16 bytes, but 12 follow"),
        ({}, "take 0 bytes, but 12 follow"),
        ({"pose": [2**31 - 1] * 4}, "but 12 follow"),
        ({"pose": [-3, -1]}, "is -3; it must be 0 or more"),
        ({"pose": [3.5]}, "must be a whole number"),
        ({"pose": ["3"]}, "must be a whole number"),
        ({"pose": [True]}, "must be a whole number"),
        ({"pose": [1, 1, 1, 1, 3]}, "too long"),
        ({"pose": 3}, "must be a list"),
        ({"pose": None}, "is null; it must be a list"),
        ([3], "must be an object"),
        ({"pose": [10**30]}, "it must be 2147483647 or less"),
        ({"pose": [3], **{f"a{i}": [0] for i in range(16)}}, "names 17 arrays; the limit is 16"),
        ({"pose": [3], "none": [0, *[2**31 - 1] * 3]}, "'none' has the impossible shape 0x2147483647x"),
    ],
)
def test_shapes_fit_what_follows(arrays: Any, expected: str) -> None:
    assert expected in refused(envelope({**MIRROR, "arrays": arrays}, POSE))


def test_shapes_of_thousands_of_digits_are_refused_in_few_words() -> None:
    huge = "9" * 4200
    shape = ",".join([huge] * 4)
    refused(envelope('{"type":"mirror","id":1,"rig":"a","arrays":{"pose":[' + shape + "]}}"))
    assert "id is" in refused(envelope(f'{{"type":"library","id":{huge},"rig":"a"}}'))


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("", "it is not valid JSON"),
        ("{", "it is not valid JSON"),
        ("\u00ff", "it is not valid JSON"),
        ("[" * 100_000, "it is not valid JSON (recursion limit exceeded"),
        ('{"a":' * 50_000 + "1" + "}" * 50_000, "it is not valid JSON (recursion limit exceeded"),
        ("[]", "the value is a list of 0; it must be an object"),
        ("null", "must be an object"),
        ("3", "the value is 3; it must be an object"),
        ({}, "type is missing"),
        ({"type": None}, "type"),
        ({"type": "x" * 5000}, "type must be one of generate, cancel, suggest, paths, mirror, library"),
        ({"type": "welcome", "version": "1", "methods": []}, "type must be one of"),
        ({"type": "library", "id": 1}, "rig is missing"),
        ({"type": "library", "id": 1, "rig": ""}, "rig is too short"),
        ({"type": "library", "id": 1, "rig": "a" * 65}, "rig is too long"),
        ({"type": "library", "id": "1", "rig": "a"}, "id is '1'; it must be a whole number"),
        ({"type": "library", "id": 1.0, "rig": "a"}, "id is 1.0; it must be a whole number"),
        ({"type": "library", "id": -1, "rig": "a"}, "id is -1; it must be 0 or more"),
        ({"type": "library", "id": 2**53, "rig": "a"}, "it must be 9007199254740991 or less"),
        ({"type": "library", "id": 1, "rig": "a", "x": 1}, "x is not a known field; remove it"),
        ({"type": "library", "id": 1, "rig": "a", "line": 1}, "line is not a known field; remove it"),
        ({"type": "library", "id": 1, "rig": "a", "a b": 1}, "a b is not a known field; remove it"),
        ({"type": "library", "id": 1, "rig": "a", "x" * 9999: 1}, "x is not a known field; remove it"),
        ('{"type": "library", "id": 1, "rig": "\\ud800"}', "it is not valid JSON"),
    ],
)
def test_a_header_is_one_that_is_known(header: Any, expected: str) -> None:
    assert expected in refused(envelope(header))


GENERATE: dict[str, Any] = {
    "type": "generate",
    "id": 1,
    "rig": "a",
    "arrays": {},
    "gap": "g",
    "frames": 10,
    "settings": {"method": "dcmoe"},
}


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"frames": 0}, "frames is 0; it must be 1 or more"),
        ({"frames": 6001}, "frames is 6001; it must be 6000 or less"),
        ({"variants": 17}, "variants is 17; it must be 16 or less"),
        ({"method": "m" * 500}, "settings.method is too long"),
        ({"style_strength": 3.5}, "settings.style_strength is 3.5; it must be 3 or less"),
        ({"path_control": -0.1}, "settings.path_control is -0.1; it must be 0 or more"),
        ({"seed": 2**31}, "seed is 2147483648; it must be 2147483647 or less"),
        ({"live": 1}, "live is 1; it must be true or false"),
        ({"style": 3}, "style is 3; it must be a string"),
        ({"gap": None}, "gap is null; it must be a string"),
        ({"path": {"kind": "magic"}}, "path.kind must be one of auto, gallery, straight, none, waypoints"),
        ({"path": {}}, "path.kind is missing"),
        ({"path": "auto"}, "path is 'auto'; it must be an object"),
        ({"path": {"kind": "waypoints", "points": []}}, "path.points is too short"),
        ({"path": {"kind": "waypoints", "points": [[0, 0]] * 2001}}, "path.points is too long; the limit is 2000"),
        ({"path": {"kind": "waypoints", "points": [[0, 0], [0, 0, 0]]}}, "path.points[1]"),
        (
            {"path": {"kind": "waypoints", "points": [[0, 0], [0, "1"]]}},
            "path.points[1][1] is '1'; it must be a",
        ),
        (
            {"path": {"kind": "waypoints", "points": [[0, 2e6]]}},
            "path.points[0][1] is 2000000.0; it must be",
        ),
        ({"path": {"kind": "waypoints", "points": [[0, 0]], "x": 1}}, "path.x is not a known field"),
        ({"path": {"kind": "auto", "points": []}}, "path.points is not a known field"),
        ({"style": "A", "blend": {"style": "B", "share": 1.5}}, "blend.share is 1.5; it must be 1 or less"),
    ],
)
def test_fields_are_within_their_bounds_and_faults_are_named_with_their_place(fields: Any, expected: str) -> None:
    messages.unpack(envelope(GENERATE), CLIENT_MESSAGE)
    outer = {name: value for name, value in fields.items() if name in (*GENERATE, "live")}
    inner = {name: value for name, value in fields.items() if name not in outer}
    assert expected in refused(envelope(GENERATE | outer | {"settings": {"method": "dcmoe", **inner}}))


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_of_the_header_are_finite(number: str) -> None:
    path, blend = {"kind": "waypoints", "points": [[0, 7.5]]}, {"style": "B", "share": 7.5}
    for fields, place in (({"path": path}, "path.points[0][1]"), ({"blend": blend}, "blend.share is")):
        text = json.dumps(GENERATE | {"settings": {"method": "dcmoe", **fields}}).replace("7.5", number)
        assert place in refused(envelope(text))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-10, 10**30) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*GENERATE, "kind", "x"]), inner),
    max_leaves=12,
)


@given(st.binary(max_size=200))
def test_any_bytes_are_refused(data: bytes) -> None:
    refused(data)


@given(st.sampled_from(sorted(GENERATE)), JSON, st.binary(max_size=40))
def test_any_value_of_any_field_is_taken_or_refused_in_words(field: str, value: Any, tail: bytes) -> None:
    data = envelope({**GENERATE, field: value}) + tail
    try:
        header, arrays = messages.unpack(data, CLIENT_MESSAGE)
    except InputError as error:
        assert len(str(error)) < 300  # noqa: PT017
    else:
        assert getattr(header, field) is not None
        assert sum(array.size for array in arrays.values()) * 4 == len(tail)


def test_defaults_are_taken() -> None:
    header, arrays = messages.unpack(envelope({"type": "library", "id": 1, "rig": "a"}), CLIENT_MESSAGE)
    assert header == Library(type="library", id=1, rig="a")
    assert arrays == {}
