"""A drawn line as a JSON file: what it gives, and that whatever is wrong in it is named with its place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interpose.drawn_path import path_file
from interpose.drawn_path.path_file import PathFile, read
from interpose.errors import InputError

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-10, 10**30) | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["points", "times", "facing", "gaps", "start", "target", "x"]), inner)
    ),
    max_leaves=12,
)


def written(folder: Path, held: Any) -> Path:
    path = folder / "way.json"
    path.write_text(held if isinstance(held, str) else json.dumps(held), encoding="utf-8")
    return path


def test_a_line_has_points_times_and_facings(tmp_path: Path) -> None:
    line = read(written(tmp_path, {"points": [[0, 1], [2.5, 3]], "times": [0, 1.5], "facing": [90, -10]})).whole
    assert line is not None
    np.testing.assert_array_equal(line.points, [[0.0, 1.0], [2.5, 3.0]])
    assert line.times is not None
    np.testing.assert_array_equal(line.times, [0.0, 1.5])
    assert line.facing is not None
    np.testing.assert_allclose(line.facing, np.radians([90.0, -10.0]))


def test_facings_are_directions_or_degrees_from_z_towards_x_without_whole_turns(tmp_path: Path) -> None:
    points = [[0, 0], [0, 1], [0, 2], [0, 3]]
    ways = read(written(tmp_path, {"points": points, "facing": [[0, 2], [1, 0], [0, -3], [-1, -1e-3]]})).whole
    degrees = read(written(tmp_path, {"points": points, "facing": [720, 90, 180, 270]})).whole
    assert ways is not None
    assert ways.facing is not None
    np.testing.assert_allclose(np.degrees(ways.facing), [0, 90, 180, 270], atol=0.1)
    assert degrees is not None
    assert degrees.facing is not None
    np.testing.assert_allclose(np.diff(np.degrees(degrees.facing)), 90)


def test_what_is_left_out_or_null_is_none(tmp_path: Path) -> None:
    for held in ({"points": [[0, 1]]}, {"points": [[0, 1]], "times": None, "facing": "path"}):
        line = read(written(tmp_path, held)).whole
        assert line is not None
        assert line.times is None
        assert line.facing is None


def test_a_line_scales_with_the_rig(tmp_path: Path) -> None:
    line = read(written(tmp_path, {"points": [[0, 1], [2, 3]], "times": [1, 2], "facing": [0, 90]})).whole
    assert line is not None
    larger = line.scaled(2.0)
    np.testing.assert_array_equal(larger.points, 2.0 * line.points)
    assert larger.times is line.times
    assert larger.facing is line.facing


def test_a_line_for_any_gap_and_lines_by_their_start_keys(tmp_path: Path) -> None:
    whole = read(written(tmp_path, {"points": [[0, 1]]}))
    assert whole.of(3, 9) is whole.whole
    whole.check([(3, 9)])
    several = read(
        written(
            tmp_path,
            {"gaps": [{"start": 0, "target": 45, "points": [[0, 1]]}, {"start": 90, "points": [[1, 1]]}]},
        )
    )
    assert several.whole is None
    assert several.of(0, 45) is several.gaps[0]
    assert several.of(45, 90) is None
    assert several.of(90, 200) is several.gaps[90]
    several.check([(0, 45), (45, 90), (90, 200)])


def test_gaps_that_do_not_fit_the_keys(tmp_path: Path) -> None:
    one = read(written(tmp_path, {"points": [[0, 1]]}))
    with pytest.raises(InputError, match="has one path, but there are 2 gaps"):
        one.check([(0, 45), (45, 90)])
    file = read(written(tmp_path, {"gaps": [{"start": 0, "target": 45, "points": [[0, 1]]}]}))
    with pytest.raises(
        InputError, match=r"way\.json: the gap that starts at key 0 has target 45, but the next key is 50"
    ):
        file.of(0, 50)
    with pytest.raises(InputError, match="no gap starts at frame 0; gaps start at 5, 45"):
        file.check([(5, 45), (45, 90)])
    assert PathFile(None, {}).of(0, 1) is None


def test_lines_from_python() -> None:
    for points in (np.array([[0.0, 1.0], [2.0, 3.0]]), [(0, 1), (2, 3)], list(np.float32([[0.0, 1.0], [2.0, 3.0]]))):
        line = path_file.of_points(points).whole
        assert line is not None
        np.testing.assert_array_equal(line.points, [[0.0, 1.0], [2.0, 3.0]])
    with pytest.raises(InputError, match=r"points\[0\]\[1\] is not finite"):
        path_file.of_points([[0.0, float("nan")]])


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ("", "is not JSON"),
        ("{points}", "is not JSON"),
        ("\x00\xff", "is not JSON"),
        ("[" * 100_000, "nested too deeply"),
        ('{"points": [[' + "9" * 5000 + ", 0]]}", "is not JSON"),
        ('{"points": [[0, 1]], "points": [[0, 2]]}', 'has the field "points" twice'),
        ("[]", "is []; give an object"),
        ("7", "is 7; give an object"),
        ("null", "is null; give an object"),
        ("{}", "there are no points"),
        ('{"points": [[NaN, 0]]}', "contains NaN"),
        ('{"points": [[0, -Infinity]]}', "contains -Infinity"),
        ('{"points": [[1e999, 0]]}', "points[0][0] is not finite"),
        ({"points": [[0, 1]], "speed": "fast"}, 'unknown field "speed"; the fields are points, times, facing'),
        ({"points": [[0, 1]], "start": 3}, 'unknown field "start"'),
        ({"points": None}, "there are no points"),
        ({"points": []}, "points is []"),
        ({"points": 3}, "points is 3"),
        ({"points": {"x": 1}}, "points is an object"),
        ({"points": [0, 1]}, "points[0] is 0; give two numbers, [x, z]"),
        ({"points": [[0, 1], [0, 1, 2]]}, "points[1] is [0, 1, 2]; give two numbers"),
        ({"points": [[0]]}, "points[0] is [0]"),
        ({"points": [[[0], 1]]}, "points[0][0] is [0]; give a number"),
        ({"points": [["0", 1]]}, 'points[0][0] is "0"; give a number'),
        ({"points": [[True, 1]]}, "points[0][0] is true; give a number"),
        ({"points": [[None, 1]]}, "points[0][0] is null"),
        ({"points": [[1e5, 1]]}, "points[0][0] is 100000.0; give a number of 10000 at most"),
        ({"points": [[10**400, 1]]}, "points[0][0] is 1000"),
        ({"points": [[0, 1], [0, 1]]}, "points[1] repeats the point before it, [0, 1]"),
        ({"points": [[i, 0] for i in range(10_001)]}, "points has 10001 points; give 10000 at most"),
        ({"points": [[0, 1]], "times": 3}, "times is 3; give a list"),
        ({"points": [[0, 1]], "times": []}, "times has 0 entries for 1 points"),
        ({"points": [[0, 1]], "times": [1, 2]}, "times has 2 entries for 1 points"),
        ({"points": [[0, 1]], "times": ["1"]}, 'times[0] is "1"; give a number'),
        ({"points": [[0, 1]], "times": [-1]}, "times[0] is -1, before the start key"),
        ({"points": [[0, 1], [0, 2]], "times": [1, 1]}, "times[1] is 1, not after 1 before it"),
        ({"points": [[0, 1], [0, 2], [0, 3]], "times": [1, 2, 0.5]}, "times[2] is 0.5, not after 2"),
        ({"points": [[0, 1]], "facing": "target"}, 'facing is "target"; give "path"'),
        ({"points": [[0, 1]], "facing": 90}, "facing is 90; give a list"),
        ({"points": [[0, 1]], "facing": [90, 90]}, "facing has 2 entries for 1 points"),
        ({"points": [[0, 1]], "facing": [[0, 0]]}, "facing[0] is [0, 0], which has no direction"),
        ({"points": [[0, 1], [0, 2]], "facing": [[0, 1], 90]}, "facing[1] is 90; give two numbers"),
        ({"points": [[0, 1], [0, 2]], "facing": [90, [0, 1]]}, "facing[1] is [0, 1]; give a number"),
        ({"points": [[0, 1]], "facing": [True]}, "facing[0] is true; give a number"),
        ({"gaps": [], "points": [[0, 1]]}, 'unknown field "points"; the fields are gaps'),
        ({"gaps": []}, "gaps is []; give a list of at least one gap"),
        ({"gaps": {}}, "gaps is an object"),
        ({"gaps": [3]}, "gaps[0] is 3; give an object"),
        ({"gaps": [{"points": [[0, 1]]}]}, "gaps[0] has no start"),
        ({"gaps": [{"start": 0.5, "points": [[0, 1]]}]}, "gaps[0].start is 0.5; give the number of a key frame"),
        ({"gaps": [{"start": True, "points": [[0, 1]]}]}, "gaps[0].start is true"),
        ({"gaps": [{"start": -1, "points": [[0, 1]]}]}, "gaps[0].start is -1"),
        ({"gaps": [{"start": 0, "target": "45", "points": [[0, 1]]}]}, 'gaps[0].target is "45"'),
        ({"gaps": [{"start": 9, "target": 9, "points": [[0, 1]]}]}, "target 9 does not come after start 9"),
        ({"gaps": [{"start": 0}]}, "gaps[0].there are no points"),
        ({"gaps": [{"start": 0, "points": [[0, 1]], "to": 4}]}, 'gaps[0].unknown field "to"'),
        ({"gaps": [{"start": 0, "points": [[0, 1]]}] * 2}, "gaps[1]: the gap that starts at key 0 is given twice"),
    ],
    ids=map(str, range(57)),
)
def test_what_is_wrong_is_named_with_file_and_place(tmp_path: Path, held: Any, said: str) -> None:
    path = written(tmp_path, held)
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert said in message
    assert message.startswith(str(path))
    assert "\n" not in message
    assert len(message) < len(str(path)) + 250


def test_files_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "none.json")
    with pytest.raises(InputError, match="is a folder"):
        read(tmp_path)
    monkeypatch.setattr(path_file, "LARGEST_FILE", 10)
    with pytest.raises(InputError, match="larger than"):
        read(written(tmp_path, {"points": [[0, 1]]}))
    path = tmp_path / "latin.json"
    path.write_bytes('{"é": 1}'.encode("latin-1"))
    monkeypatch.setattr(path_file, "LARGEST_FILE", 1000)
    with pytest.raises(InputError, match="is not JSON"):
        read(path)
    path.write_bytes(b"\xef\xbb\xbf" + b'{"points": [[0, 1]]}')  # as some editors begin a file
    assert read(path).whole is not None


@given(JSON)
def test_any_json_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, held: Any) -> None:
    path = tmp_path_factory.mktemp("any") / "way.json"
    path.write_text(json.dumps(held), encoding="utf-8")
    try:
        file = read(path)
    except InputError as error:
        well = str(error).encode().startswith(str(path).encode())
    else:
        lines = [line for line in (file.whole, *file.gaps.values()) if line is not None]
        well = len(lines) > 0 and all(np.isfinite(line.points).all() for line in lines)
    assert well


def test_a_line_of_parts_is_a_drawn_line_with_its_facing_in_radians() -> None:
    line = path_file.of_points([(0.0, 1.0), (0.5, 2.0)], [0.0, 1.5], [3.0, 4.0]).of(0, 10)
    assert line is not None
    assert line.times is not None
    assert line.facing is not None
    np.testing.assert_array_equal(line.points, [[0.0, 1.0], [0.5, 2.0]])
    np.testing.assert_array_equal(line.times, [0.0, 1.5])
    np.testing.assert_array_equal(line.facing, [3.0, 4.0])
    bare = path_file.of_points([[0.0, 1.0]]).whole
    assert bare is not None
    assert bare.times is None
    assert bare.facing is None


@pytest.mark.parametrize(
    ("points", "times", "facing", "said"),
    [
        ([], None, None, "there are no points|points is \\[\\]"),
        ([[0.0]], None, None, r"points\[0\]"),
        ([[0.0, 1.0], [0.0, 1.0]], None, None, r"points\[1\] repeats the point before it"),
        ([[0.0, float("nan")]], None, None, r"points\[0\]\[1\] is not finite"),
        ([[0.0, 1.0], [0.0, 2.0]], [0.0], None, "times has 1 entries for 2 points"),
        ([[0.0, 1.0], [0.0, 2.0]], [1.0, 1.0], None, r"times\[1\] is 1, not after 1 before it"),
        ([[0.0, 1.0], [0.0, 2.0]], None, [0.0], "facing has 1 entries for 2 points; give one a point"),
        ([[0.0, 1.0]], None, [float("inf")], r"facing\[0\] is not finite"),
        ([[0.0, 1.0]], None, [2e4], r"facing\[0\] is 20000.0; give a number of 10000 at most"),
    ],
)
def test_what_is_wrong_with_a_line_of_parts_is_named(points: Any, times: Any, facing: Any, said: str) -> None:
    with pytest.raises(InputError, match=said):
        path_file.of_points(points, times, facing)
