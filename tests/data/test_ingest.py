from __future__ import annotations

import os
import shutil
import zipfile
from pathlib import Path
from unittest import mock

import numpy as np
import pytest

from interpose import io
from interpose.data import contacts, database, ingest, sources
from interpose.data.database import Database
from interpose.errors import InputError
from interpose.skeleton import HUMANOID

from .conftest import BvhText


def prepare(dataset: str, source: Path | list[Path], out: Path, **options: object) -> ingest.Report:
    listed = source if isinstance(source, list) else [source]
    return ingest.prepare(dataset, listed, out, **{"workers": 1, "progress": False, **options})  # type: ignore[arg-type]


@pytest.fixture
def folder(tmp_path: Path, bvh: BvhText) -> Path:
    """Three clips of a plain folder: still, a walk, a walk that turns."""
    clips = tmp_path / "clips"
    (clips / "slow").mkdir(parents=True)
    (clips / "still.bvh").write_text(bvh(frames=40, speed=0.0))
    (clips / "slow" / "straight.bvh").write_text(bvh(frames=60, speed=1.0))
    (clips / "slow" / "turning.bvh").write_text(bvh(frames=90, speed=1.0, turn=1.0))
    return clips


def standing(height: float, frames: int = 60) -> np.ndarray:
    positions = np.zeros((frames, len(HUMANOID), 3))
    positions[:, contacts.CONTACT_INDICES, 1] = contacts.REST_HEIGHTS + height
    return positions


def same(a: Database, b: Database) -> None:
    for name in ("root_positions", "local_rotations", "root", "contacts", "ranges"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert a.clips == b.clips


def test_a_folder_becomes_a_database(folder: Path, tmp_path: Path) -> None:
    report = prepare("bvh", folder, tmp_path / "db")
    db = database.load(tmp_path / "db")
    assert [clip.name for clip in db.clips] == ["still", "straight", "turning"]
    assert [clip.style for clip in db.clips] == ["", "slow", "slow"]
    assert (db.ranges[:, 1] - db.ranges[:, 0]).tolist() == [40, 60, 90]
    assert db.clips[0].source_frames == 40
    assert (report.read, db.skipped) == (3, ())
    assert sorted(p.name for p in (tmp_path / "db").iterdir()) == [
        "contacts.npy",
        "local_rotations.npy",
        "meta.json",
        "ranges.npy",
        "report.md",
        "root.npy",
        "root_positions.npy",
    ]


def test_roots_follow_the_walk(folder: Path, tmp_path: Path) -> None:
    db = prepare("bvh", folder, tmp_path / "db").database
    time = np.arange(90) / 30.0
    start, stop = db.ranges[2]
    facing = np.stack([np.sin(time), np.cos(time)], axis=-1)
    np.testing.assert_allclose(db.root[start:stop, 2:], facing, atol=2e-3)
    travelled = np.diff(db.root[start:stop, :2], axis=0)
    travelled /= np.linalg.norm(travelled, axis=-1, keepdims=True)
    assert np.all(np.sum(travelled * facing[1:], axis=-1) > 0.99)
    np.testing.assert_allclose(db.root_positions[:, [0, 2]], db.root[:, :2])


def test_only_the_feet_that_stand_are_in_contact(folder: Path, tmp_path: Path) -> None:
    db = prepare("bvh", folder, tmp_path / "db").database
    assert db.contacts[:40].all()
    assert not db.contacts[40:100].any()


def test_a_motion_read_back_is_the_one_in_the_file(folder: Path, tmp_path: Path) -> None:
    db = prepare("bvh", folder, tmp_path / "db").database
    original = io.read(folder / "slow" / "turning.bvh")
    assert original.skeleton.names == HUMANOID.names
    np.testing.assert_allclose(db.clip(2).global_positions(), original.global_positions(), atol=1e-3)


@pytest.mark.parametrize(("rate", "frames"), [(60.0, 101), (59.9988, 101), (120.0, 202), (30.0, 51), (29.97, 51)])
def test_rates_that_are_multiples_keep_every_nth_frame(bvh: BvhText, tmp_path: Path, rate: float, frames: int) -> None:
    (tmp_path / "clip.bvh").write_text(bvh(frames=frames, rate=rate, turn=2.0))
    motion = io.read(tmp_path / "clip.bvh")
    out = ingest.at_rate(motion)
    assert out.rate == 30.0
    assert len(out) == 51
    np.testing.assert_array_equal(out.local_rotations, motion.local_rotations[:: round(rate / 30.0)])


def test_other_rates_are_interpolated(bvh: BvhText, tmp_path: Path) -> None:
    (tmp_path / "clip.bvh").write_text(bvh(frames=50, rate=24.0, turn=1.0))
    out = ingest.at_rate(io.read(tmp_path / "clip.bvh"))
    yaw = np.arange(len(out)) / 30.0
    np.testing.assert_allclose(out.global_rotations()[:, 0, 1], np.sin(yaw / 2.0), atol=1e-4)
    assert abs(out.duration - 49 / 24.0) < 1 / 30.0


def test_100style_is_cut_at_its_own_rate(hundred_style: Path, tmp_path: Path) -> None:
    db = prepare("100style", hundred_style, tmp_path / "db").database
    assert [(clip.name, clip.style, clip.content, clip.cut) for clip in db.clips] == [
        ("Angry_FW", "Angry", "FW", (41, 160)),
        ("Neutral_FW", "Neutral", "FW", (20, 200)),
    ]
    assert (db.ranges[:, 1] - db.ranges[:, 0]).tolist() == [60, 90]
    assert [Path(file).name for file, _ in db.skipped] == ["Angry_BW.bvh"]
    np.testing.assert_allclose(db.root_positions[0, 2], 41 / 60.0, atol=1e-3)
    np.testing.assert_allclose(np.diff(db.root_positions[:60, 2]), 1 / 30.0, atol=1e-4)


def test_a_zip_gives_the_same_database(folder: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "clips.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.rglob("*.bvh")):
            archive.write(file, file.relative_to(folder).as_posix())
        archive.writestr("slow/bad.bvh", "HIERARCHY\nnonsense\n")
    zipped = prepare("bvh", tmp_path / "clips.zip", tmp_path / "zipped").database
    same(zipped, prepare("bvh", folder, tmp_path / "plain").database)
    assert zipped.skipped[0][0] == "slow/bad.bvh"
    assert "/tmp" not in zipped.skipped[0][1]


def test_a_bad_file_is_skipped_and_reported(folder: Path, tmp_path: Path) -> None:
    (folder / "slow" / "bad.bvh").write_text((folder / "still.bvh").read_text()[:-40] + " nan\n")
    (folder / "empty.bvh").write_text("")
    report = prepare("bvh", folder, tmp_path / "db")
    assert len(report.database) == 3
    assert [file for file, _ in report.database.skipped] == ["empty.bvh", "slow/bad.bvh"]
    assert all(reason for _, reason in report.database.skipped)
    text = (tmp_path / "db" / "report.md").read_text()
    assert text == report.markdown()
    assert "| slow | 2 | 150 |" in text
    assert "| slow/bad.bvh |" in text


def test_where_nothing_can_be_used_nothing_is_made(tmp_path: Path, bvh: BvhText) -> None:
    clips = tmp_path / "clips"
    clips.mkdir()
    (clips / "empty.bvh").write_text("")
    (clips / "short.bvh").write_text(bvh(frames=1))
    with pytest.raises(InputError, match="none of the 2 files could be used"):
        prepare("bvh", clips, tmp_path / "db")
    with pytest.raises(InputError, match="not a finished database"):
        database.load(tmp_path / "db")


def test_several_processes_give_the_same_database(folder: Path, tmp_path: Path) -> None:
    parallel = prepare("bvh", folder, tmp_path / "parallel", workers=2).database
    same(parallel, prepare("bvh", folder, tmp_path / "single").database)


def test_the_fingerprint_is_of_the_contents(folder: Path, tmp_path: Path, bvh: BvhText) -> None:
    first = prepare("bvh", folder, tmp_path / "first").database
    copied = Path(shutil.copytree(folder, tmp_path / "elsewhere" / "copied"))
    for file in copied.rglob("*.bvh"):
        os.utime(file, (1e9, 1e9))
    again = prepare("bvh", copied, tmp_path / "again", workers=2).database
    assert again.fingerprint == first.fingerprint
    assert again.made_from != first.made_from

    (copied / "slow").rename(copied / "fast")
    relabelled = prepare("bvh", copied, tmp_path / "relabelled").database
    (copied / "fast").rename(copied / "slow")
    (copied / "still.bvh").write_text(bvh(frames=40, speed=0.0, lift=0.02))
    moved = prepare("bvh", copied, tmp_path / "moved").database
    assert len({db.fingerprint for db in (first, relabelled, moved)}) == 3


def test_the_fingerprint_does_not_depend_on_the_order_of_the_sources(tmp_path: Path, bvh: BvhText) -> None:
    for name, frames in (("one", 20), ("two", 30)):
        (tmp_path / name / "walk").mkdir(parents=True)
        (tmp_path / name / "walk" / "clip.bvh").write_text(bvh(frames=frames))
    ordered = [tmp_path / "one", tmp_path / "two"]
    here = prepare("bvh", ordered, tmp_path / "here").database
    there = prepare("bvh", ordered[::-1], tmp_path / "there").database
    assert here.fingerprint == there.fingerprint
    same(here, there)


def killed_after(count: int) -> object:
    """Stands for the process being killed when ``count`` clips are done."""
    make, done = ingest._make_part, []

    def make_or_die(clip: sources.SourceClip, part: Path) -> str | None:
        if len(done) == count:
            raise KeyboardInterrupt
        done.append(clip.name)
        return make(clip, part)

    return mock.patch.object(ingest, "_make_part", make_or_die)


def test_a_run_that_was_killed_goes_on(folder: Path, tmp_path: Path) -> None:
    with killed_after(2), pytest.raises(KeyboardInterrupt):  # type: ignore[attr-defined]
        prepare("bvh", folder, tmp_path / "db")
    assert len(list((tmp_path / "db" / ".parts").iterdir())) == 2
    with pytest.raises(InputError, match="not a finished database"):
        database.load(tmp_path / "db")
    resumed = prepare("bvh", folder, tmp_path / "db")
    assert resumed.read == 1
    assert not (tmp_path / "db" / ".parts").exists()
    same(resumed.database, prepare("bvh", folder, tmp_path / "whole").database)


def test_a_part_that_is_damaged_or_out_of_date_is_made_again(folder: Path, tmp_path: Path, bvh: BvhText) -> None:
    with killed_after(2), pytest.raises(KeyboardInterrupt):  # type: ignore[attr-defined]
        prepare("bvh", folder, tmp_path / "db")
    for part in (tmp_path / "db" / ".parts").iterdir():
        part.write_bytes(part.read_bytes()[:100])
        break
    (folder / "slow" / "turning.bvh").write_text(bvh(frames=33))
    resumed = prepare("bvh", folder, tmp_path / "db")
    assert resumed.read >= 2
    assert (resumed.database.ranges[:, 1] - resumed.database.ranges[:, 0]).tolist() == [40, 60, 33]


def test_a_database_that_is_up_to_date_is_left_alone(folder: Path, tmp_path: Path, bvh: BvhText) -> None:
    prepare("bvh", folder, tmp_path / "db")
    before = (tmp_path / "db" / "meta.json").stat().st_mtime_ns
    again = prepare("bvh", folder, tmp_path / "db")
    assert again.read == 0
    assert (tmp_path / "db" / "meta.json").stat().st_mtime_ns == before
    (folder / "new.bvh").write_text(bvh(frames=20))
    assert len(prepare("bvh", folder, tmp_path / "db").database) == 4


def test_an_output_that_cannot_be_written_is_refused(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be written"):
        prepare("bvh", folder, tmp_path / "file")


def test_a_full_disk_stops_the_run_and_keeps_what_is_done(folder: Path, tmp_path: Path) -> None:
    full = mock.Mock(side_effect=InputError("part: cannot be written: no space left on device"))
    with mock.patch.object(ingest, "write_whole", full), pytest.raises(InputError, match="no space left"):
        prepare("bvh", folder, tmp_path / "db")
    assert not (tmp_path / "db" / "meta.json").exists()


def test_a_character_that_hovers_is_put_on_the_floor(tmp_path: Path, bvh: BvhText) -> None:
    clips = tmp_path / "clips"
    clips.mkdir()
    (clips / "hovering.bvh").write_text(bvh(frames=40, speed=0.0, lift=0.10))
    (clips / "standing.bvh").write_text(bvh(frames=40, speed=0.0))
    db = prepare("bvh", clips, tmp_path / "db").database
    hovering, standing = db.clip(0).global_positions(), db.clip(1).global_positions()
    assert abs(hovering[..., 1] - standing[..., 1]).max() < 0.03
    assert db.contacts.all()
    assert db.clips[1].raised == 0.0
    assert -0.13 < db.clips[0].raised < -0.07
    assert "| hovering | -" in (tmp_path / "db" / "report.md").read_text()


def test_the_floor_is_where_feet_rest_and_not_where_they_are_held() -> None:
    positions = standing(0.25)
    positions[20:, contacts.CONTACT_INDICES, 1] += 0.4
    assert ingest.floor_height(positions, 30.0) == pytest.approx(0.25)


def test_a_foot_that_rests_on_its_toes_does_not_move_the_floor() -> None:
    positions = standing(0.0)
    positions[:, contacts.CONTACT_INDICES[::2], 1] += 0.1
    assert ingest.floor_height(positions, 30.0) == pytest.approx(0.0)


def test_feet_that_never_rest_do_not_move_the_floor() -> None:
    positions = standing(0.5)
    positions[:, contacts.CONTACT_INDICES, 2] = np.arange(60)[:, None] / 30.0
    assert ingest.floor_height(positions, 30.0) == 0.0


@pytest.mark.skipif(
    "INTERPOSE_DATA" not in os.environ, reason="INTERPOSE_DATA, the folder of the data sets, is not set"
)
@pytest.mark.parametrize(
    ("kind", "file", "along"),
    [
        ("lafan1", "lafan1-excerpts/walk3_subject1_walk.bvh", 1.0),
        ("100style", "100style", 1.0),
        ("o3de", "o3de-locomotion/walk/walkturns1.bvh", 1.0),
        ("cmu", "cmu/walk/walking_extra_19_test.bvh", 1.0),
        ("bandai", "bandai-namco-2/dataset-2_walk_normal_001.bvh", 1.0),
        ("bandai", "bandai-namco-1/dataset-1_walk-back_normal_001.bvh", -1.0),
    ],
)
def test_real_walks_face_where_they_go_and_touch_the_floor(kind: str, file: str, along: float, tmp_path: Path) -> None:
    source = Path(os.environ["INTERPOSE_DATA"]) / file
    if kind == "100style":
        (tmp_path / "one").mkdir()
        for name in ("Angry_FW.bvh", "Frame_Cuts.csv"):
            (tmp_path / "one" / name).symlink_to(source / name)
        source = tmp_path / "one"
    db = prepare(kind, source, tmp_path / "db").database
    velocity = np.diff(db.root[:, :2], axis=0) * 30.0
    speed = np.linalg.norm(velocity, axis=-1)
    cosine = np.sum(velocity * db.root[1:, 2:], axis=-1)[speed > 0.5] / speed[speed > 0.5]
    assert np.median(along * cosine) > 0.95
    toes = db.clip(0).global_positions()[:, [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")], 1]
    assert -0.03 < np.percentile(toes, 1) < 0.03
    assert np.all((db.contacts[:, 1::2].mean(axis=0) > 0.25) & (db.contacts[:, 1::2].mean(axis=0) < 0.8))
