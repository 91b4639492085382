"""Project files: a good one is opened, and of a bad one the first fault is told with its place."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from studio_rigs import STAND, moved, walk

from interpose import io
from interpose.errors import InputError
from interpose.studio import pose_rows, projects
from interpose.studio.project_format import Project
from interpose.studio.rigs import RigStore

TEXT = io.serialize(walk(), "clip.bvh").decode()
ROW = pose_rows.of_motion(walk())


def coded(array: Any) -> str:
    return base64.b64encode(np.asarray(array, "<f4").tobytes()).decode()


def key(number: int, **fields: Any) -> dict[str, Any]:
    return {
        "id": f"k{number}", "frame": 10 * number, "pose": None, "source": number, "after": {"method": "dcmoe"}, **fields
    }  # fmt: skip


def project(*keys: dict[str, Any], **fields: Any) -> dict[str, Any]:
    source = {"name": "walk.bvh", "text": TEXT}
    return {"format": 1, "name": "Mine", "source": source, "keys": list(keys), **fields}


def read(held: Any, store: RigStore | None = None) -> Project:
    data = held if isinstance(held, bytes) else json.dumps(held).encode()
    return projects.read(data, RigStore() if store is None else store, "mine.interpose")


def refused(held: Any) -> str:
    with pytest.raises(InputError) as caught:
        read(held)
    expected = str(caught.value)
    assert expected.startswith("mine.interpose cannot be opened: ")
    assert "\n" not in expected
    assert len(expected) < 350
    return expected


PATH = {
    "kind": "waypoints",
    "points": [[0.0, 0.0], [0.0, 1.0]],
    "times": [0.0, 1.0],
    "facing": [0.0, 0.5],
    "drawn": False,
}
FULL = {
    "method": "dcmoe",
    "style": "Angry",
    "blend": {"style": "Drunk", "share": 0.25},
    "path": PATH,
    "variants": 8,
    "seed": 7,
    "speed": "slow",
    "chosen": 3,
    "locked": True,
}


def test_a_project_with_everything_in_it_is_opened_and_its_source_is_on_the_shelf() -> None:
    store = RigStore()
    held = project(
        key(0, pose=coded(ROW[0]), after=FULL, motion=coded(np.tile(ROW[0], (9, 1)))),
        key(1, pose=coded(ROW[1]), source=None, after={"method": "clip"} | {"method": "interp"}),
        key(2, after={"method": "clip"}),
        key(3, frame=21, after={"method": "stitch"}),
    )
    made = read(held, store)
    assert made.keys[0].after.blend is not None
    assert made.keys[0].after.blend.share == 0.25
    assert made.keys[3].after.variants == 4
    assert len(store.get(store.open(TEXT.encode(), "x").id).motion) == 4
    assert read(made.model_dump_json().encode()) == made


def test_a_path_of_an_earlier_version_opens() -> None:
    old = read(project(key(0, after=FULL | {"path": PATH | {"kind": "line"}}), key(1)), RigStore())
    assert old.keys[0].after.path == read(project(key(0, after=FULL), key(1)), RigStore()).keys[0].after.path


def test_keys_that_follow_one_another_have_no_frames_between_them() -> None:
    read(project(key(0, motion=""), key(1, frame=1)))


@pytest.mark.parametrize(
    ("held", "expected"),
    [
        (b"", "it is not valid JSON"),
        (b"\xff\xfe", "it is not valid JSON"),
        (b"[" * 5000, "it is not valid JSON"),
        ([], "the value is a list of 0; it must be an object"),
        ({}, "format is missing"),
        (project(key(0), format=2), "format is 2; it must be 1"),
        (project(key(0), format="1"), "format is '1'; it must be 1"),
        (project(key(0), name=""), "name is too short"),
        (project(key(0), name="n" * 121), "name is too long"),
        (project(key(0), more=1), "more is not a known field"),
        (project(key(0), source=None), "source is null; it must be an object"),
        (project(key(0), source={"name": "a.bvh", "text": ""}), "a.bvh: the file is empty"),
        (project(key(0), source={"name": "a.bvh", "text": "HIERARCHY"}), "a.bvh"),
        (project(key(0), source={"name": "a.bvh", "text": 3}), "source.text is 3; it must be a string"),
        (project(), "keys is empty; a project needs at least one key"),
        (project(keys={}), "keys is an object; it must be a list"),
        (project(3), "keys[0] is 3; it must be an object"),  # type: ignore[arg-type]
        (project(key(0), {}), "keys[1].id is missing"),
        (project(key(0), key(1, frame=0)), "keys[1].frame is 0, not after 0 of the previous key"),
        (project(key(0, frame=12), key(1)), "keys[1].frame is 10, not after 12 of the previous key"),
        (project(key(0, frame=-1)), "keys[0].frame is -1; it must be 0 or more"),
        (project(key(0, frame=1.5)), "keys[0].frame is 1.5; it must be a whole number"),
        (project(key(0, frame=2_000_000)), "keys[0].frame is 2000000; it must be 1000000 or less"),
        (project(key(0), key(1, id="k0")), "keys[1].id is also the id of keys[0]"),
        (
            project(key(0), key(1), key(2, source=4)),
            "keys[2].source is frame 4, but the source has 4 frames",
        ),
        (project(key(0, source=None)), "keys[0] has neither a pose nor a source frame"),
        (project(key(0, pose="?")), "keys[0].pose is not base64"),
        (project(key(0, pose="é")), "keys[0].pose is not base64"),
        (project(key(0, pose="")), "keys[0].pose has 0 poses; a key has one"),
        (project(key(0, pose=coded(ROW[:2]))), "keys[0].pose has 2 poses; a key has one"),
        (
            project(key(0, pose=coded(ROW[0, 1:]))),
            "keys[0].pose has 360 bytes, not a multiple of the 364",
        ),
        (project(key(0, pose=coded(np.full(91, np.nan)))), "keys[0].pose contains NaN or infinite numbers"),
        (project(key(0, pose=coded(np.zeros(91)))), "keys[0].pose: the rotation of Hips in frame 0 has the length 0"),
        (project(key(0, motion="")), "keys[0].motion has frames, but no gap follows the last key"),
        (project(key(0, motion=coded(ROW)), key(1)), "keys[0].motion has 4 frames, but the gap to the next key has 9"),
        (project(key(0, motion=coded(np.zeros((9, 91)))), key(1)), "keys[0].motion: the rotation of Hips in frame 0"),
        (project(key(0, after={})), "keys[0].after.method is missing"),
        (project(key(0, after={"method": "x"})), "keys[0].after.method: unknown method 'x'; choose one of"),
        (project(key(0, after={"method": "dcmoe", "speed": "warp"})), "keys[0].after.speed is 'warp'; it must be"),
        (project(key(0, after={"method": "dcmoe", "variants": 0})), "keys[0].after.variants is 0; it must be 1 or"),
        (project(key(0, after={"method": "dcmoe", "chosen": 16})), "chosen is 16; it must be less than 16"),
        (project(key(0, after={"method": "dcmoe", "locked": "yes"})), "locked is 'yes'; it must be true or false"),
        (
            project(key(0, after={**FULL, "style": None})),
            "keys[0].after.blend needs a style to blend with",
        ),
        (project(key(0, after={**FULL, "path": {"kind": "x"}})), "keys[0].after.path.kind must be one of"),
        (
            project(key(0, after={**FULL, "path": {**PATH, "times": [0.0]}})),
            "keys[0].after.path.times has 1 entries for 2 points",
        ),
        (
            project(key(0, after={**FULL, "path": {**PATH, "facing": []}})),
            "keys[0].after.path.facing has 0 entries for 2 points",
        ),
        (project(key(0, after={"method": "clip"}), key(1, source=0)), "keys[0].after.method is clip, but this key and"),
        (
            project(key(0, after={"method": "clip"}), key(1, source=None, pose=coded(ROW[0]))),
            "keys[0].after.method is clip",
        ),
    ],
)
def test_the_first_fault_is_told_with_its_place(held: Any, expected: str) -> None:
    assert expected in refused(held)


def test_the_last_keys_gap_is_for_nobody() -> None:
    read(project(key(0, source=None, pose=coded(ROW[0]), after={"method": "clip"})))


def test_poses_are_those_of_the_sources_rig() -> None:
    other = {"name": "moved.bvh", "text": io.serialize(moved(walk()), "clip.bvh").decode()}
    assert "not a multiple of the 628 bytes" in refused(project(key(0, pose=coded(ROW[0])), source=other))
    read(project(key(0, pose=coded(pose_rows.of_motion(moved(STAND)))), source=other))


FIELDS = ["id", "frame", "pose", "source", "after", "motion", "method", "path", "kind", "points", "format", "keys", "x"]
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-10, 10**30) | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(FIELDS), inner),
    max_leaves=12,
)


@given(JSON, st.sampled_from(sorted(project())), st.sampled_from(sorted(key(0, motion=None))))
def test_anything_anywhere_is_opened_or_refused_in_words(value: Any, field: str, inner: str) -> None:
    for held in (value, project(key(0), **{field: value}), project(key(0, **{inner: value}), key(1))):
        try:
            made = read(held)
        except InputError as error:
            assert "\n" not in str(error)  # noqa: PT017
        else:
            assert made.keys
