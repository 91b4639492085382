"""Galleries on disk: kept as they are, whole or not at all, and refused in a sentence where they are damaged."""

import io
import json
import shutil
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from gallery.walks import RATE, ahead, even, motion_along, tracks_of, wander
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from interpose.data import database
from interpose.data.database import ClipArrays, ClipInfo
from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.gallery import index as indexing
from interpose.gallery import store
from interpose.gallery.matching import direct
from interpose.gallery.windows import WindowQuery

TRACKS = ("root", "posture", "ranges", "clip_styles")
INDEX = ("start", "steps", "distance", "facing", "cells")
INFO = {"made_from": "walks", "licence": "CC0"}


@pytest.fixture(scope="module")
def small():
    return store.of_tracks(tracks_of([even(60), wander(70, 1)], ["Old", "Jüngling"]), INFO)


@pytest.fixture
def folder(small, tmp_path):
    store.save(small, tmp_path / "gallery")
    return tmp_path / "gallery"


@pytest.fixture
def npz(small, tmp_path):
    store.save_small(small.tracks, small.info, tmp_path / "gallery.npz")
    return tmp_path / "gallery.npz"


def write_database(folder, lengths, styles=("Old", "Young")):
    """Clips of those lengths, styles by turns."""
    motions = [motion_along(wander(count, count), i) for i, count in enumerate(lengths)]
    infos = [
        (ClipInfo(f"{i}", "", styles[i % len(styles)], "", "", RATE, 1, (0, 1), 0.0), n) for i, n in enumerate(lengths)
    ]
    arrays = [
        ClipArrays(
            motion.root_positions.astype(np.float32),
            motion.local_rotations.astype(np.float32),
            np.zeros((len(motion), 4), np.float32),
            np.zeros((len(motion), 4), np.uint8),
        )
        for motion in motions
    ]
    return database.write(folder, infos, arrays, dataset="walks", licence="CC0")


def assert_same(a, b):
    """Equal arrays, styles and answers."""
    for name in TRACKS:
        np.testing.assert_array_equal(getattr(a.tracks, name), getattr(b.tracks, name))
    for name in INDEX:
        np.testing.assert_array_equal(getattr(a.index, name), getattr(b.index, name))
    assert a.styles == b.styles
    assert direct(a.search, ahead(1.0), 20) == direct(b.search, ahead(1.0), 20)
    np.testing.assert_array_equal(a.distances, b.distances)


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


# Kept as they are.


def test_a_folder_gives_the_gallery_again(small, folder):
    loaded = store.load(folder)
    assert_same(loaded, small)
    assert loaded.info["windows"] == len(small.index)
    assert loaded.info["frames"] == 130
    assert loaded.info["styles"] == ["Jüngling", "Old"]
    assert loaded.info.items() >= INFO.items()
    assert sorted(contents(folder)) == sorted(["meta.json", *(f"{name}.npy" for name in (*TRACKS, *INDEX))])


def test_the_arrays_of_a_folder_are_mapped_and_cannot_be_written(folder):
    loaded = store.load(folder)
    for array in (loaded.tracks.root, loaded.index.facing):
        assert isinstance(array.base, np.memmap)
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_the_small_form_gives_the_gallery_again(small, npz):
    loaded = store.load(npz)
    assert_same(loaded, small)
    assert loaded.info.items() >= INFO.items()
    with np.load(npz) as held:
        assert sorted(held) == sorted(["meta", *TRACKS])


def test_a_loaded_gallery_is_saved_as_well(small, folder, tmp_path):
    store.save(store.load(folder), tmp_path / "again")
    assert contents(tmp_path / "again") == contents(folder)
    store.save(store.load(folder), folder)
    assert_same(store.load(folder), small)
    assert not list(tmp_path.glob(".*"))


def test_styles_are_asked_for_by_name(small):
    assert small.styles == ("Jüngling", "Old")
    assert small.style_indices(None) is None
    assert small.style_indices("Old") == (1,)
    with pytest.raises(InputError, match="no trajectory in style 'Young'; it has Jüngling, Old"):
        small.style_indices("Young")


def test_distances_are_the_quantiles_of_the_windows_lengths(small):
    assert (np.diff(small.distances) >= 0.0).all()
    assert small.distances[0] == small.index.distance.min()
    assert small.distances[-1] == small.index.distance.max()
    assert np.median(small.distances) == pytest.approx(float(np.median(small.index.distance)), abs=0.01)


def test_the_fastest_way_is_that_of_the_fastest_walk():
    gallery = store.of_tracks(tracks_of([even(200, pace=1.0), even(200, pace=3.0), even(200, pace=0.2)]))
    assert gallery.fastest == pytest.approx(3.0 / RATE, rel=1e-4)
    assert store.of_tracks(tracks_of([even(20, pace=1.5)])).fastest == pytest.approx(1.5 / RATE, rel=1e-4)


# Made of a database.


def test_a_database_is_built_into_a_folder(tmp_path):
    data = write_database(tmp_path / "db", (60, 40, 10))
    told = []
    gallery = store.build(data, tmp_path / "made" / "gallery", progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (len(gallery.index), len(gallery.index))
    assert len(gallery.tracks) == 110
    assert gallery.styles == ("Old", "Young")
    assert gallery.info["licence"] == "CC0"
    assert gallery.info["made_from"] == f"root tracks of walks {data.fingerprint[:12]}, all"
    assert_same(gallery, store.load(tmp_path / "made" / "gallery"))
    rebuilt = store.build(write_database(tmp_path / "other", (50,)), tmp_path / "made" / "gallery")
    assert len(rebuilt.tracks) == len(store.load(tmp_path / "made" / "gallery").tracks) == 50


def test_the_part_for_training_leaves_out_what_is_held_out(tmp_path):
    data = write_database(tmp_path / "db", (1040, 300))
    every, training = (store.build(data, tmp_path / part, part) for part in ("all", "train"))
    assert every.tracks.ranges.tolist() == [[0, 1040], [1040, 1340]]
    assert training_ranges(data)[0] == [(0, 910), (1040, 1340)]
    assert training.tracks.ranges.tolist() == [[0, 910], [910, 1210]]
    np.testing.assert_array_equal(training.tracks.posture[:910], every.tracks.posture[:910])
    np.testing.assert_array_equal(training.tracks.posture[910:], every.tracks.posture[1040:])
    assert training.info["made_from"].endswith(", train")
    with pytest.raises(InputError, match="unknown part 'valid' of a database; use all or train"):
        store.build(data, tmp_path / "valid", "valid")


@pytest.mark.parametrize("part", ["all", "train"])
@pytest.mark.parametrize("lengths", [(15, 15), (1, 1)])
def test_a_database_of_short_clips_makes_no_gallery(tmp_path, lengths, part):
    data = write_database(tmp_path / "db", lengths)
    with pytest.raises(InputError, match="no clip"):
        store.build(data, tmp_path / "gallery", part)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["db"]


def test_what_is_no_gallery_is_not_overwritten(tmp_path):
    data = write_database(tmp_path / "db", (60,))
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "thesis.txt").write_text("years")
    (tmp_path / "file").write_text("in the way")
    before = contents(tmp_path / "db")
    gallery = store.of_tracks(tracks_of([even(40)]))
    for out in (mine, tmp_path / "file", tmp_path / "db"):
        with pytest.raises(InputError, match=f"{out.name} exists but is not a gallery"):
            store.build(data, out)
        with pytest.raises(InputError, match=f"{out.name} exists but is not a gallery"):
            store.save(gallery, out)
    assert (mine / "thesis.txt").read_text() == "years"
    assert contents(tmp_path / "db") == before
    assert database.load(tmp_path / "db").frames == 60


def test_a_folder_that_cannot_be_made_is_refused(small, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        store.save(small, tmp_path / "file" / "gallery")
    with pytest.raises(InputError, match="does not exist"):
        store.save_small(small.tracks, {}, tmp_path / "nowhere" / "gallery.npz")


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("after", [0, 5])
def test_saving_that_is_interrupted_leaves_the_old_gallery_whole(small, folder, monkeypatch, error, after):
    before, saved, save = contents(folder), [], np.save

    def breaks(file, array):
        if len(saved) == after:
            raise error
        saved.append(file)
        save(file, array)

    other = store.of_tracks(tracks_of([even(40)]))
    monkeypatch.setattr(np, "save", breaks)
    with pytest.raises(InputError if isinstance(error, OSError) else KeyboardInterrupt):
        store.save(other, folder)
    monkeypatch.undo()
    assert contents(folder) == before
    assert [file.name for file in folder.parent.iterdir()] == ["gallery"]
    assert_same(store.load(folder), small)
    store.save(other, folder)
    assert len(store.load(folder).tracks) == 40


@pytest.mark.parametrize("error", [OSError(5, "Input/output error"), KeyboardInterrupt()])
def test_a_new_gallery_that_cannot_take_its_place_leaves_the_old_one_there(small, folder, monkeypatch, error):
    before, rename = contents(folder), Path.rename

    def breaks(self, target):
        if self != folder and target == folder and not self.name.endswith(".before"):
            raise error
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", breaks)
    with pytest.raises(InputError if isinstance(error, OSError) else KeyboardInterrupt):
        store.save(store.of_tracks(tracks_of([even(40)])), folder)
    monkeypatch.undo()
    assert contents(folder) == before
    assert [file.name for file in folder.parent.iterdir()] == ["gallery"]


# Damaged.


def test_what_is_no_gallery_is_not_loaded(tmp_path):
    with pytest.raises(InputError, match=r"nowhere is not a gallery: it has no meta.json; use"):
        store.load(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no such gallery"):
        store.load(tmp_path / "nowhere.npz")
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="is not a gallery"):
        store.load(tmp_path / "file")
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(InputError, match="is not a gallery"):
        store.load(tmp_path / "folder.npz")
    write_database(tmp_path / "db", (60,))
    with pytest.raises(InputError, match="db"):
        store.load(tmp_path / "db")


@pytest.mark.parametrize("name", [*TRACKS, *INDEX])
def test_a_damaged_array_is_refused_by_name(folder, name):
    file = folder / f"{name}.npy"
    whole = file.read_bytes()
    packed = io.BytesIO()
    np.savez(packed, root=np.zeros(3))
    objects = io.BytesIO()
    np.save(objects, np.array([None, "x"], dtype=object), allow_pickle=True)
    for damaged in (whole[:-2], whole[:20], b"", b"not an array at all", packed.getvalue(), objects.getvalue()):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match=rf"{name}\.npy .*build the gallery again"):
            store.load(folder)
    file.write_bytes(whole)
    other_kind = np.load(file).astype(np.float64)
    for other in (
        other_kind,
        np.zeros((12, 5)),
        np.zeros((0, 3)),
        np.float32(1.0),
        np.uint32(7),
        np.zeros((3, 2), "S3"),
    ):
        np.save(file, other)
        with pytest.raises(InputError, match="build"):
            store.load(folder)
    file.unlink()
    with pytest.raises(InputError, match=rf"{name}\.npy is missing; build the gallery again"):
        store.load(folder)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("root", lambda a: a[:-1]),
        ("root", lambda a: np.where(np.arange(len(a))[:, None] == 7, np.float32(np.nan), a)),
        ("posture", lambda a: a[:-1]),
        ("ranges", lambda a: a[:-1]),
        ("ranges", lambda a: a + 1),
        ("ranges", lambda a: a - [[0, 0], [1, 0]]),
        ("ranges", lambda a: np.array([[0, 140], [140, 130]])),
        ("ranges", lambda a: a[:0]),
        ("clip_styles", lambda a: a[:-1]),
        ("clip_styles", lambda a: a + 1),
        ("clip_styles", lambda a: a - 1),
        ("start", lambda a: a[:-1]),
        ("steps", lambda a: a[:-1]),
        ("distance", lambda a: a[:-1]),
        ("facing", lambda a: a[:-1]),
        ("cells", lambda a: a[:-1]),
        ("cells", lambda a: a + np.uint32(1)),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(folder, name, change):
    array = np.load(folder / f"{name}.npy")
    np.save(folder / f"{name}.npy", change(array).astype(array.dtype))
    with pytest.raises(InputError, match="do not fit together; build it again"):
        store.load(folder)


@pytest.mark.parametrize("name", TRACKS)
def test_a_small_form_that_does_not_fit_together_is_refused(small, npz, name):
    with np.load(npz) as held:
        arrays = dict(held)
    for other in (arrays[name][:-1], arrays[name][:0]):
        np.savez(npz, **{**arrays, name: other})
        with pytest.raises(InputError, match="do not fit together"):
            store.load(npz)
    for other in (
        arrays[name].astype(np.float64),
        np.float32(1.0),
        np.int64(1),
        np.zeros((3, 9)),
        np.array(["x", None], dtype=object),
    ):
        np.savez(npz, **{**arrays, name: other})
        with pytest.raises(InputError, match=r"gallery\.npz"):
            store.load(npz)
    del arrays[name]
    np.savez(npz, **arrays)
    with pytest.raises(InputError, match=rf"gallery\.npz is not a gallery .*{name}"):
        store.load(npz)


META = [
    ({"version": 99}, "version 99, this program needs 1"),
    ({"version": None}, "version None"),
    ({"styles": None}, "gallery"),
    ({"styles": ["Old"]}, "do not fit together"),
    ({"styles": 3}, "gallery"),
]


@pytest.mark.parametrize(("change", "message"), META)
def test_facts_of_another_kind_are_refused(folder, npz, change, message):
    meta = json.loads((folder / "meta.json").read_text(encoding="utf-8"))
    (folder / "meta.json").write_text(json.dumps({**meta, **change}))
    with np.load(npz) as held:
        np.savez(npz, **{**held, "meta": np.array(json.dumps({**json.loads(str(held["meta"])), **change}))})
    for path in (folder, npz):
        with pytest.raises(InputError, match=message):
            store.load(path)


@pytest.mark.parametrize("text", ["{", "[]", "null", "7", "\x00", "{}", '{"version": 1}', "\udcff"])
def test_facts_that_are_none_are_refused(folder, npz, text):
    (folder / "meta.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=r"meta\.json"):
        store.load(folder)
    with np.load(npz) as held:
        np.savez(npz, **{**held, "meta": np.array(text)})
    with pytest.raises(InputError, match=r"gallery\.npz is not a gallery"):
        store.load(npz)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_small_form_with_any_bytes_changed_is_loaded_or_refused(npz, data):
    whole = bytearray(npz.read_bytes())
    kept = bytes(whole)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(
            st.integers(0, len(whole) - 1) | st.integers(0, 200) | st.integers(len(whole) - 200, len(whole) - 1)
        )
        whole[at] = data.draw(st.integers(0, 255))
    npz.write_bytes(whole[: data.draw(st.just(len(whole)) | st.integers(0, len(whole)))])
    with suppress(InputError):
        store.load(npz)
    npz.write_bytes(kept)


def test_files_that_are_no_small_form_are_refused(npz, tmp_path):
    np.save(tmp_path / "one.npy", np.zeros(3))
    shutil.move(tmp_path / "one.npy", npz)
    with pytest.raises(InputError, match="is not a gallery"):
        store.load(npz)
    with zipfile.ZipFile(npz, "w") as file:
        file.writestr("meta.npy", "no array")
    with pytest.raises(InputError, match="is not a gallery"):
        store.load(npz)
    for content in (b"", b"PK", b"PK\x03\x04" + bytes(50), b"\x93NUMPY", b"GIF89a"):
        npz.write_bytes(content)
        with pytest.raises(InputError, match="is not a gallery"):
            store.load(npz)


def test_a_small_form_whose_clips_are_short_is_refused(tmp_path):
    store.save_small(tracks_of([even(10)]), INFO, tmp_path / "short.npz")
    with pytest.raises(InputError, match="no clip is longer"):
        store.load(tmp_path / "short.npz")


def test_a_style_without_any_clip_is_loaded(small, tmp_path):
    """As where all clips of a style jump, or are too short."""
    tracks = tracks_of([even(40), even(5)], ["Old", "Young"])
    store.save_small(tracks, INFO, tmp_path / "small.npz")
    loaded = store.load(tmp_path / "small.npz")
    assert len(indexing.best(loaded.index, WindowQuery((0.0, 9.0), (0.0, 0.0), styles=(1,)), 9)) == 0
