from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose.data import database
from interpose.data.database import ClipArrays, ClipInfo
from interpose.errors import InputError
from interpose.skeleton import HUMANOID


def made(frames: int, seed: int) -> ClipArrays:
    rng = np.random.default_rng(seed)
    turned = rng.normal(size=(frames, len(HUMANOID), 4))
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    return ClipArrays(
        rng.normal(size=(frames, 3)).astype(np.float32),
        turned.astype(np.float32),
        rng.normal(size=(frames, 4)).astype(np.float32),
        rng.integers(0, 2, size=(frames, 4)).astype(np.uint8),
    )


def info(name: str, style: str = "walk") -> ClipInfo:
    return ClipInfo(name, f"{name}.bvh", style, "", "subject1", 60.0, 100, (10, 90), 0.0)


CLIPS = [(info("b", "walk"), 4), (info("a", "Angry"), 7), (info("c", "walk"), 1)]
ARRAYS = [made(4, 0), made(7, 1), made(1, 2)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    database.write(tmp_path / "db", CLIPS, ARRAYS, dataset="test", licence="none", skipped=[("x.bvh", "bad")])
    return tmp_path / "db"


def test_what_is_written_is_loaded(folder: Path) -> None:
    db = database.load(folder)
    assert [clip.name for clip in db.clips] == ["b", "a", "c"]
    assert db.clips[0] == CLIPS[0][0]
    assert db.ranges.tolist() == [[0, 4], [4, 11], [11, 12]]
    assert (db.dataset, db.licence, len(db), db.frames) == ("test", "none", 3, 12)
    assert db.styles == ("Angry", "walk")
    assert db.style_indices().tolist() == [1, 0, 1]
    assert db.skipped == (("x.bvh", "bad"),)
    for name in ("root_positions", "local_rotations", "root", "contacts"):
        np.testing.assert_array_equal(getattr(db, name), np.concatenate([getattr(a, name) for a in ARRAYS]))
    with pytest.raises(ValueError, match="read-only"):
        db.root[0] = 0.0


def test_a_clip_without_a_label_has_no_style(tmp_path: Path) -> None:
    clips = [(replace(info, style="" if info.name == "a" else info.style), count) for info, count in CLIPS]
    db = database.write(tmp_path / "db", clips, ARRAYS, dataset="test", licence="none")
    assert db.styles == ("walk",)
    assert db.style_indices().tolist() == [0, -1, 0]


def test_a_clip_is_a_motion_of_the_humanoid(folder: Path) -> None:
    motion = database.load(folder).clip(1)
    assert motion.skeleton == HUMANOID
    assert motion.rate == 30.0
    np.testing.assert_array_equal(motion.root_positions, ARRAYS[1].root_positions)
    np.testing.assert_allclose(motion.local_rotations, ARRAYS[1].local_rotations, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(motion.local_rotations, axis=-1), 1.0, atol=1e-12)


def test_meta_holds_what_the_design_names(folder: Path) -> None:
    meta = json.loads((folder / "meta.json").read_text())
    assert meta["joints"] == list(HUMANOID.names)
    assert meta["styles"] == ["Angry", "walk"]
    assert meta["rate"] == 30.0
    assert meta["clips"][1]["style"] == "Angry"
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        ["meta.json", *(f"{n}.npy" for n in ("root_positions", "local_rotations", "root", "contacts", "ranges"))]
    )


@pytest.mark.parametrize("changed", ["style", "name", "root_positions", "contacts", "order"])
def test_the_fingerprint_follows_labels_and_frames(folder: Path, tmp_path: Path, changed: str) -> None:
    clips, arrays = [*CLIPS], [*ARRAYS]
    if changed == "order":
        clips, arrays = clips[::-1], arrays[::-1]
    elif changed in ("style", "name"):
        clips[1] = (replace(clips[1][0], **{changed: "other"}), clips[1][1])
    else:
        array = getattr(arrays[1], changed).copy()
        array[3, 0] += 1
        arrays[1] = replace(arrays[1], **{changed: array})
    other = database.write(tmp_path / "other", clips, arrays, dataset="test", licence="none")
    assert other.fingerprint != database.load(folder).fingerprint


def test_the_fingerprint_ignores_source_files_and_last_bits(folder: Path, tmp_path: Path) -> None:
    clips = [(replace(info, file="elsewhere.bvh", source_rate=30.0, cut=(0, 5)), count) for info, count in CLIPS]
    nudged = [replace(one, root_positions=np.round(one.root_positions, 6)) for one in ARRAYS]
    other = database.write(tmp_path / "other", clips, nudged, dataset="test", licence="none", made_from="other files")
    assert other.fingerprint == database.load(folder).fingerprint


def test_a_missing_folder_or_one_without_meta_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="not a finished database"):
        database.load(folder / "nowhere")
    (folder / "meta.json").unlink()
    with pytest.raises(InputError, match="not a finished database"):
        database.load(folder)


@pytest.mark.parametrize("name", ["root_positions", "local_rotations", "root", "contacts", "ranges"])
def test_a_damaged_array_is_refused_by_name(folder: Path, name: str) -> None:
    file = folder / f"{name}.npy"
    whole = file.read_bytes()
    for damaged in (whole[:-2], whole[:20], b"", b"not an array at all"):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match=f"{name}.npy"):
            database.load(folder)
    np.save(file, np.zeros((12, 5)))
    with pytest.raises(InputError, match="expected"):
        database.load(folder)
    file.unlink()
    with pytest.raises(InputError, match=f"{name}.npy is missing"):
        database.load(folder)


def test_files_that_do_not_fit_together_are_refused(folder: Path) -> None:
    for name, array in (
        ("root", np.zeros((11, 4), np.float32)),
        ("ranges", np.array([[0, 4], [4, 11]])),
        ("ranges", np.array([[0, 4], [5, 11], [11, 12]])),
        ("ranges", np.array([[0, 4], [4, 4], [4, 12]])),
    ):
        kept = (folder / f"{name}.npy").read_bytes()
        np.save(folder / f"{name}.npy", array)
        with pytest.raises(InputError, match="do not fit together"):
            database.load(folder)
        (folder / f"{name}.npy").write_bytes(kept)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": 99}, "version 99"),
        ({"joints": ["Hips"]}, "22 joints"),
        ({"rate": 60.0}, "30 Hz"),
        ({"clips": None}, "not that of a database"),
        ({"clips": [{"name": "a"}]}, "not that of a database"),
    ],
)
def test_meta_of_another_kind_is_refused(folder: Path, change: dict[str, object], message: str) -> None:
    meta = json.loads((folder / "meta.json").read_text())
    (folder / "meta.json").write_text(json.dumps({**meta, **change}))
    with pytest.raises(InputError, match=message):
        database.load(folder)


@pytest.mark.parametrize("text", ["{", "[]", "\x00"])
def test_meta_that_is_not_json_is_refused(folder: Path, text: str) -> None:
    (folder / "meta.json").write_text(text)
    with pytest.raises(InputError, match=r"meta\.json"):
        database.load(folder)


def test_writing_that_fails_leaves_the_old_database_whole(folder: Path) -> None:
    def breaks():
        yield ARRAYS[0]
        raise InputError("no more")

    with pytest.raises(InputError, match="no more"):
        database.write(folder, CLIPS, breaks(), dataset="other", licence="none")
    assert database.load(folder).dataset == "test"
    assert not list(folder.glob(".*"))


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        database.write(tmp_path / "file" / "db", CLIPS, ARRAYS, dataset="test", licence="none")
