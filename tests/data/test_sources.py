from __future__ import annotations

import zipfile
from dataclasses import astuple
from pathlib import Path

import pytest

from interpose.data import sources
from interpose.errors import InputError


def touch(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("x")
    return folder


def labels(found: sources.SourceClips) -> dict[str, tuple[str, str, str]]:
    return {clip.name: astuple(clip.labels) for clip in found.clips}


LAFAN1 = ("walk1_subject1.bvh", "walk1_subject5.bvh", "fallAndGetUp2_subject3.bvh", "pushAndFall1_subject4.bvh")


def test_lafan1_names_carry_theme_and_subject(tmp_path: Path) -> None:
    found = sources.find("lafan1", [touch(tmp_path, *LAFAN1, "LICENSE", "notes.bvh")])
    assert labels(found) == {
        "fallAndGetUp2_subject3": ("fallAndGetUp", "", "subject3"),
        "pushAndFall1_subject4": ("pushAndFall", "", "subject4"),
        "walk1_subject1": ("walk", "", "subject1"),
        "walk1_subject5": ("walk", "", "subject5"),
    }
    assert [clip.name for clip in found.clips] == sorted(clip.name for clip in found.clips)
    assert [file for file, _ in found.skipped] == ["notes.bvh"]


def test_the_split_of_lafan1_is_by_the_fifth_subject(tmp_path: Path) -> None:
    touch(tmp_path, *LAFAN1)
    assert list(labels(sources.find("lafan1", [tmp_path], "test"))) == ["walk1_subject5"]
    train = sources.find("lafan1", [tmp_path], "train")
    assert len(train.clips) == 3
    assert all(clip.labels.subject != "subject5" for clip in train.clips)


def test_excerpts_join_the_takes_unless_the_whole_take_is_there(tmp_path: Path) -> None:
    whole = touch(tmp_path / "whole", *LAFAN1)
    excerpts = touch(tmp_path / "excerpts", "walk2_subject1_proud2.bvh", "walk1_subject1_turn.bvh")
    found = sources.find("lafan1", [whole, excerpts])
    assert labels(found)["walk2_subject1_proud2"] == ("walk", "proud", "subject1")
    assert "walk1_subject1_turn" not in labels(found)
    assert "excerpt" in dict(found.skipped)["walk1_subject1_turn.bvh"]


def test_a_zip_is_read_like_the_folder_that_it_holds(tmp_path: Path) -> None:
    archive = tmp_path / "lafan1.zip"
    with zipfile.ZipFile(archive, "w") as out:
        for name in LAFAN1:
            out.writestr(f"lafan1/{name}", f"content of {name}")
        out.writestr("__MACOSX/lafan1/._walk1_subject1.bvh", "x")
        out.writestr("lafan1/._walk1_subject1.bvh", "x")
    found = sources.find("lafan1", [archive])
    assert labels(found) == labels(sources.find("lafan1", [touch(tmp_path / "folder", *LAFAN1)]))
    assert found.clips[-1].source.read_bytes() == b"content of walk1_subject5.bvh"


def test_a_member_of_a_broken_zip_is_refused(tmp_path: Path) -> None:
    archive = tmp_path / "lafan1.zip"
    with zipfile.ZipFile(archive, "w") as out:
        out.writestr("walk1_subject1.bvh", "some text that is stored as it is")
    archive.write_bytes(archive.read_bytes().replace(b"stored", b"broken"))
    clip = sources.find("lafan1", [archive]).clips[0]
    with pytest.raises(InputError, match="cannot be read"):
        clip.source.read_bytes()
    archive.write_bytes(b"PK not a zip")
    with pytest.raises(InputError, match="cannot be read"):
        sources.find("lafan1", [archive])


@pytest.mark.parametrize("flat", [True, False])
def test_100style_has_its_cut_ranges(hundred_style: Path, flat: bool) -> None:
    if flat:
        for file in sorted(hundred_style.rglob("*.bvh")):
            file.rename(hundred_style / file.name)
    found = sources.find("100style", [hundred_style])
    assert labels(found) == {"Angry_FW": ("Angry", "FW", ""), "Neutral_FW": ("Neutral", "FW", "")}
    assert [clip.cut for clip in found.clips] == [(41, 160), (20, 9999)]
    assert [Path(file).name for file, _ in found.skipped] == ["Angry_BW.bvh"]


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (None, "has no Frame_Cuts.csv"),
        ("", "holds no range"),
        ("STYLE_NAME,FW_START,FW_STOP\nAngry,90,30\n", "line 2: the range 90 to 30"),
        ("a,b\n\x00,\xff\n", "holds no range"),
    ],
)
def test_100style_without_a_sound_table_is_refused(hundred_style: Path, table: str | None, message: str) -> None:
    file = hundred_style / "Frame_Cuts.csv"
    file.unlink() if table is None else file.write_bytes(table.encode("latin-1"))
    with pytest.raises(InputError, match=message):
        sources.find("100style", [hundred_style])


def test_bandai_names_carry_content_then_style(tmp_path: Path) -> None:
    one = touch(tmp_path / "1", "dataset-1_walk-back_not-confident_001.bvh")
    two = touch(tmp_path / "2", "data/dataset-2_walk-turn-left_active_028.bvh")
    assert labels(sources.find("bandai", [one, two])) == {
        "dataset-1_walk-back_not-confident_001": ("not-confident", "walk-back", ""),
        "dataset-2_walk-turn-left_active_028": ("active", "walk-turn-left", ""),
    }


@pytest.mark.parametrize("given", ["", "walk", "walk/walk1.bvh"])
def test_a_sub_folder_is_a_style_of_o3de(tmp_path: Path, given: str) -> None:
    folder = touch(tmp_path / "o3de-locomotion", "walk/walk1.bvh", "labels.csv", "README.txt")
    assert labels(sources.find("o3de", [folder / given])) == {"walk1": ("Walk", "", "")}


def test_clips_of_no_known_style_have_no_label(tmp_path: Path) -> None:
    folder = touch(tmp_path / "takes", "02_01.bvh", "dance/05_02.bvh", "other/07_01.bvh")
    found = labels(sources.find("cmu", [folder]))
    assert {name: style for name, (style, _, _) in found.items()} == {"02_01": "", "05_02": "Dance", "07_01": ""}


def labels_by_file(found: sources.SourceClips) -> dict[str, tuple[str, str]]:
    return {clip.source.name: (clip.labels.style, clip.labels.subject) for clip in found.clips}


AMASS = (
    "CMU/01/01_01_poses.npz",
    "CMU/01/shape.npz",
    "CMU/02/02_01_stageii.npz",
    "CMU/02/neutral_stagei.npz",
    "ACCAD/Male2Walking_c3d/B3 - walk1_poses.npz",
)


def test_amass_is_labelled_by_data_set_and_subject(tmp_path: Path) -> None:
    found = sources.find("amass", [touch(tmp_path / "AMASS", *AMASS, "CMU/LICENSE.txt")])
    assert labels_by_file(found) == {
        "ACCAD/Male2Walking_c3d/B3 - walk1_poses.npz": ("ACCAD", "Male2Walking_c3d"),
        "CMU/01/01_01_poses.npz": ("CMU", "01"),
        "CMU/02/02_01_stageii.npz": ("CMU", "02"),
    }
    assert [clip.name for clip in found.clips] == ["01_01_poses", "02_01_stageii", "B3 - walk1_poses"]
    assert dict(found.skipped) == {
        "CMU/01/shape.npz": "it holds a body's shape and no motion",
        "CMU/02/neutral_stagei.npz": "it holds a body's shape and no motion",
    }


@pytest.mark.parametrize(("part", "file"), [("CMU", "01/"), ("CMU/01", ""), ("CMU/01/01_01_poses.npz", "")])
def test_a_part_of_amass_has_the_same_labels(tmp_path: Path, part: str, file: str) -> None:
    touch(tmp_path / "AMASS", *AMASS)
    found = labels_by_file(sources.find("amass", [tmp_path / "AMASS" / part]))
    assert found[f"{file}01_01_poses.npz"] == ("CMU", "01")


def test_an_archive_counts_as_a_folder(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "CMU.zip", "w") as out:
        out.writestr("01/01_01_poses.npz", "x")
    with zipfile.ZipFile(tmp_path / "S6.zip", "w") as out:
        out.writestr("walking_1.txt", "x")
    assert labels_by_file(sources.find("amass", [tmp_path / "CMU.zip"])) == {"01/01_01_poses.npz": ("CMU", "01")}
    assert labels_by_file(sources.find("h36m", [tmp_path / "S6.zip"])) == {"walking_1.txt": ("walking", "S6")}


H36M = ("S1/walking_1.txt", "S5/walkingdog_2.txt", "S9/sittingdown_1.txt", "S11/walking_1.txt")


def test_h36m_is_labelled_by_action_and_subject(tmp_path: Path) -> None:
    folder = touch(tmp_path / "h3.6m" / "dataset", *H36M, "README.txt", "S1/notes.txt", "other/walking_1.txt")
    found = sources.find("h36m", [folder])
    assert labels_by_file(found) == {
        "S1/walking_1.txt": ("walking", "S1"),
        "S11/walking_1.txt": ("walking", "S11"),
        "S5/walkingdog_2.txt": ("walkingdog", "S5"),
        "S9/sittingdown_1.txt": ("sittingdown", "S9"),
    }
    assert [file for file, _ in found.skipped] == ["README.txt", "S1/notes.txt", "other/walking_1.txt"]
    assert {reason for _, reason in found.skipped} == {"its name is not of the form S1/walking_1.txt"}
    assert labels_by_file(sources.find("h36m", [folder / "S1"])) == {"walking_1.txt": ("walking", "S1")}


def test_the_split_of_h36m_is_by_subjects_9_and_11(tmp_path: Path) -> None:
    folder = touch(tmp_path, *H36M)
    tested = sources.find("h36m", [folder], "test")
    assert sorted(clip.labels.subject for clip in tested.clips) == ["S11", "S9"]
    trained = sources.find("h36m", [folder], "train")
    assert sorted(clip.labels.subject for clip in trained.clips) == ["S1", "S5"]


def test_models_trained_on_research_data_say_so() -> None:
    licence = pytest.importorskip("interpose.export").licence
    for kind in ("lafan1", "bandai", "amass", "h36m"):
        assert licence(sources.DATASETS[kind].licence).startswith(
            "non-commercial research only (trained on data under "
        )
    for kind in ("100style", "o3de", "cmu"):
        assert licence(sources.DATASETS[kind].licence).startswith("MIT; trained on data under ")


def test_any_folder_takes_its_styles_from_its_sub_folders(tmp_path: Path) -> None:
    touch(tmp_path, "a.bvh", "zombie/a.bvh", "zombie/b.BVH", ".hidden/c.bvh", "zombie/readme.txt")
    found = sources.find("bvh", [tmp_path])
    assert labels(found) == {"a": ("", "", ""), "b": ("zombie", "", ""), "zombie/a": ("zombie", "", "")}
    single = sources.find("bvh", [tmp_path / "zombie" / "b.BVH"])
    assert labels(single) == {"b": ("", "", "")}


def test_names_are_unique_over_several_sources(tmp_path: Path) -> None:
    one, two = touch(tmp_path / "1", "a.bvh"), touch(tmp_path / "2", "a.bvh")
    assert sorted(labels(sources.find("bvh", [one, two]))) == ["a", "a#2"]


def test_the_key_of_a_clip_follows_its_file_and_its_labels(tmp_path: Path) -> None:
    touch(tmp_path, "a.bvh")
    before = sources.find("bvh", [tmp_path]).clips[0].key()
    assert sources.find("bvh", [tmp_path]).clips[0].key() == before
    (tmp_path / "a.bvh").write_text("longer")
    assert sources.find("bvh", [tmp_path]).clips[0].key() != before


@pytest.mark.parametrize(
    ("kind", "split", "message"),
    [
        ("moves", "all", "unknown data set 'moves'"),
        ("lafan1", "validation", "unknown split"),
        ("bvh", "test", "only lafan1 and h36m have a split into train and test; use all for bvh"),
        ("amass", "test", "only lafan1 and h36m have"),
        ("amass", "all", r"holds no \.npz file"),
        ("h36m", "all", r"holds no \.txt file"),
        ("lafan1", "test", "no clip of lafan1 of split 'test'"),
        ("bandai", "all", "not of the form dataset-1_walk_angry_001.bvh"),
    ],
)
def test_what_cannot_be_served_is_refused(tmp_path: Path, kind: str, split: str, message: str) -> None:
    touch(tmp_path, "walk1_subject1.bvh")
    with pytest.raises(InputError, match=message):
        sources.find(kind, [tmp_path], split)


def test_sources_that_are_missing_or_empty_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        sources.find("bvh", [tmp_path / "nowhere"])
    with pytest.raises(InputError, match=r"holds no \.bvh file"):
        sources.find("bvh", [tmp_path])
    with pytest.raises(InputError, match="no source given"):
        sources.find("bvh", [])
