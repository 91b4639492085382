"""`interpose prepare`, `train`, `export`, `evaluate`: they reach what does the work, and say what is missing."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from commandline import bvh_text, fails

from interpose.data import database
from interpose.skeleton import HUMANOID


@pytest.fixture
def clips(tmp_path):
    folder = tmp_path / "clips"
    folder.mkdir()
    for seed in range(2):
        (folder / f"walk{seed}.bvh").write_text(bvh_text(70, seed=seed))
    (folder / "bad.bvh").write_text("nothing")
    return folder


def test_prepare_makes_a_database_and_reports(tmp_path, run, clips):
    status, out, err = run("prepare", "bvh", clips, "-o", tmp_path / "db", "--workers", 1)
    assert status == 0, err
    assert "bad.bvh" in out
    meta = json.loads((tmp_path / "db" / "meta.json").read_text())
    assert len(meta["clips"]) == 2
    assert err.endswith(f"wrote {tmp_path / 'db'}\n")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("prepare", "bvh", "nowhere", "-o", "db"), "nowhere"),
        (("prepare", "bvh", "clips", "-o", "db", "--workers", "0"), "--workers must be 1 or more, got 0"),
        (("prepare", "bvh", "clips", "-o", "db", "--split", "train"), "only lafan1 and h36m have a split"),
        (("evaluate", "lafan1", "--data", "clips", "--methods", "magic", "-o", "out"), "magic"),
        (("evaluate", "lafan1", "--data", "clips", "--context", "0", "-o", "out"), "context"),
    ],
)
def test_what_cannot_be_served(tmp_path, run, clips, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    fails(run(*arguments), said, tmp_path, ["clips"])


def test_prepare_leaves_out_the_test_subject(tmp_path, run, clips):
    for subject in (1, 5):
        (clips / f"walk1_subject{subject}.bvh").write_text((clips / "walk0.bvh").read_text())
    for split, wanted in (("train", "walk1_subject1"), ("test", "walk1_subject5")):
        out = tmp_path / split
        status, _, err = run("prepare", "lafan1", clips, "-o", out, "--split", split, "--workers", 1)
        assert status == 0, err
        assert [clip["name"] for clip in json.loads((out / "meta.json").read_text())["clips"]] == [wanted]


def write_amass(file, frames=240, rate="mocap_framerate", width=156, **more):
    """A body in the T-pose that glides along AMASS's X at 1 m/s, 120 frames a second."""
    file.parent.mkdir(parents=True, exist_ok=True)
    poses = np.zeros((frames, width))
    poses[:, 0] = np.pi / 2
    trans = np.stack([np.arange(frames) / 120.0, np.full(frames, 3.0), np.full(frames, 0.9)], axis=1)
    np.savez(file, **{"poses": poses, "trans": trans, rate: 120.0, **more})


def test_prepare_reads_amass(tmp_path, run):
    source = tmp_path / "AMASS"
    write_amass(source / "CMU" / "01" / "01_01_poses.npz")
    write_amass(source / "SFU" / "0005" / "0005_Jogging001_stageii.npz", 120, "mocap_frame_rate", 165, gender="male")
    np.savez(source / "CMU" / "01" / "shape.npz", betas=np.zeros(16))
    np.savez(source / "CMU" / "01" / "01_02_poses.npz", betas=np.zeros(16))
    (source / "CMU" / "01" / "01_03_poses.npz").write_bytes(b"PK")
    status, out, err = run("prepare", "amass", source, "-o", tmp_path / "db", "--workers", 1)
    assert status == 0, err
    db = database.load(tmp_path / "db")
    assert [(clip.name, clip.style, clip.subject, clip.source_rate) for clip in db.clips] == [
        ("0005_Jogging001_stageii", "SFU", "0005", 120.0),
        ("01_01_poses", "CMU", "01", 120.0),
    ]
    assert (db.ranges[:, 1] - db.ranges[:, 0]).tolist() == [30, 60]
    assert re.search(r"\bNC\b", db.licence)
    skipped = dict(db.skipped)
    assert skipped["CMU/01/shape.npz"] == "it holds a body's shape and no motion"
    assert skipped["CMU/01/01_02_poses.npz"].startswith("CMU/01/01_02_poses.npz: has no 'poses', so no motion")
    assert "damaged" in skipped["CMU/01/01_03_poses.npz"]
    assert all(f"| {file} | {why} |" in out for file, why in db.skipped)
    walked = np.diff(db.root[30:, :2], axis=0) * 30.0
    facing = db.root[30:, 2:]
    scale = walked[0, 0]  # metres are the humanoid's, whose legs are longer than those of our body for AMASS
    assert 0.9 < scale < 1.2
    np.testing.assert_allclose(walked, np.tile([scale, 0.0], (59, 1)), atol=1e-4)
    np.testing.assert_allclose(facing, np.tile([0.0, 1.0], (60, 1)), atol=1e-4)
    toes = db.clip(1).global_positions()[:, HUMANOID.index("LeftToe"), 1]
    np.testing.assert_allclose(toes, 0.0, atol=0.02)


def write_h36m(file, frames=100):
    """A body with straight arms at its sides that glides ahead at 1 m/s, 50 frames a second."""
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = np.zeros((frames, 99))
    rows[1:, 2] = 20.0
    rows[:, 3 + 3 * 16 + 2], rows[:, 3 + 3 * 24 + 2] = np.pi / 2, -np.pi / 2
    rows[:, 3 + 3 * 17 + 2], rows[:, 3 + 3 * 25 + 2] = np.pi / 2, -np.pi / 2
    np.savetxt(file, rows, fmt="%.7f", delimiter=",")


def test_prepare_reads_human36m_and_splits_it(tmp_path, run):
    source = tmp_path / "dataset"
    for name in ("S1/walking_1", "S5/walkingdog_1", "S9/walking_1", "S11/eating_2"):
        write_h36m(source / f"{name}.txt")
    (source / "S1" / "eating_1.txt").write_text("1,2,3\n")
    (source / "README.txt").write_text("Please cite.\n")
    for split, styles in (("train", ["walking", "walkingdog"]), ("test", ["eating", "walking"])):
        out = tmp_path / split
        status, said, err = run("prepare", "h36m", source, "-o", out, "--split", split, "--workers", 1)
        assert status == 0, err
        db = database.load(out)
        assert sorted(clip.style for clip in db.clips) == styles
        assert {clip.subject in ("S9", "S11") for clip in db.clips} == {split == "test"}
        assert re.search(r"\bNC\b", db.licence)
        assert ("S1/eating_1.txt" in said) == (split == "train")
        assert "README.txt" in said
    assert (db.ranges[:, 1] - db.ranges[:, 0]).tolist() == [60, 60]
    assert db.clips[0].source_rate == 50.0
    np.testing.assert_allclose(db.root[:60, 2:], np.tile([0.0, 1.0], (60, 1)), atol=1e-4)
    walked = np.diff(db.root[:60, :2], axis=0) * 30.0
    assert 0.9 < walked[0, 1] < 1.1
    np.testing.assert_allclose(walked, np.tile(walked[0], (59, 1)), atol=1e-4)
    points = db.clip(0).global_positions()[0]
    assert points[HUMANOID.index("LeftHand"), 1] < points[HUMANOID.index("Hips"), 1]


@pytest.mark.parametrize(("kind", "file"), [("amass", "01_01_poses.npz"), ("h36m", "walking_1.txt")])
def test_where_no_file_is_sound_one_line_says_why(tmp_path, run, kind, file):
    folder = tmp_path / "S1"
    folder.mkdir()
    (folder / file).write_bytes(b"nothing")
    status, out, err = run("prepare", kind, folder, "-o", tmp_path / "db", "--workers", 1)
    assert (status, out) == (1, "")
    assert err.splitlines()[-1].startswith(f"interpose: none of the 1 files could be used; the first, {file}: {file}")
    assert "Traceback" not in err


def test_evaluating_what_is_not_there(tmp_path, run):
    status, out, err = run("evaluate", "lafan1", "--data", tmp_path / "nowhere", "-o", tmp_path / "out")
    progress, told = err.splitlines()
    assert (status, out) == (1, "")
    assert progress == f"reading {tmp_path / 'nowhere'}"
    assert told.startswith(f"interpose: {tmp_path / 'nowhere'} is not a folder")


@pytest.mark.parametrize(
    ("arguments", "missing"),
    [
        (("train", "pae", "--data", "db", "-o", "run"), "torch"),
        (("train", "plan", "--data", "db", "-o", "run"), "torch"),
        (("train", "dcmoe", "--data", "db", "-o", "run"), "torch"),
        (("train", "stitch", "--data", "db", "-o", "run"), "torch"),
        (("export", "run", "-o", "model"), "torch"),
        (("labels", "db"), "torch"),
        (("evaluate", "style", "--data", "db", "-o", "out"), "torch"),
    ],
)
def test_without_the_extra_for_training(arguments, missing):
    code = f"""
import sys
from interpose.cli import main

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name in ("torch", "onnx", "matplotlib"):
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Missing())
sys.exit(main({list(arguments)}))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("interpose: ")
    assert done.stderr.count("\n") == 1
    assert "is not installed; install it with pip install 'interpose[train]'" in done.stderr
    assert missing in done.stderr


def test_judging_labels_and_styles_is_reached(tmp_path, run):
    pytest.importorskip("torch")
    fails(run("labels", tmp_path / "none"), "none")
    asked = "evaluate", "style", "--data", tmp_path / "none", "-o", tmp_path / "out"
    fails(run(*asked), "none")
    fails(run(*asked, "--strength", "much"), "--strength takes numbers separated by commas, got 'much'")


def test_only_plan_and_dcmoe_train_on_several_processes(tmp_path, run, monkeypatch):
    pytest.importorskip("torch")
    monkeypatch.setenv("WORLD_SIZE", "2")
    said = "pae trains on one process; torchrun is for plan and dcmoe"
    fails(run("train", "pae", "--data", tmp_path / "none", "-o", tmp_path / "run"), said)


def test_training_is_reached(tmp_path, run, clips):
    pytest.importorskip("torch")
    fails(run("train", "dcmoe", "--data", tmp_path / "none", "-o", tmp_path / "run"), "none")
    fails(run("train", "pae", "--data", tmp_path / "none", "-o", tmp_path / "run"), "none")
    fails(
        run("train", "dcmoe", "--data", tmp_path / "none", "-o", tmp_path / "run", "--preset", "huge"),
        "huge",
    )
    fails(
        run("train", "pae", "--data", tmp_path / "none", "-o", tmp_path / "run", "--phases", "p.npy"),
        "--phases is for dcmoe; it is not valid for pae",
    )
    none = "--data", tmp_path / "none", "-o", tmp_path / "run"
    fails(run("train", "stitch", *none), "give --plan RUN, a run of 'interpose train plan'")
    fails(run("train", "stitch", *none, "--without", "w/o nothing"), "no ablation 'w/o nothing'")
    fails(run("train", "dcmoe", *none, "--without", "w/o BS"), "--without is for stitch")
    fails(run("train", "detail", *none), "give a finished run of 'interpose train stitch' to refine")
    fails(run("train", "stitch", *none, "--refines", "r"), "--refines is for detail")
    fails(run("train", "pae", *none, "--backward"), "--backward is for dcmoe")
    fails(run("train", "pae", *none, "--plan", "r"), "--plan is for dcmoe and stitch; it is not valid for pae")
    fails(run("train", "plan", *none, "--plan", "r"), "--plan is for dcmoe and stitch; it is not valid for plan")
    fails(run("train", "plan", *none), "none")
    fails(run("train", "pae", *none, "--config", tmp_path / "no.json"), "no.json")
    fails(run("train", "stitch", *none, "--compile"), "--compile is for dcmoe")
    fails(run("export", tmp_path / "none", "-o", tmp_path / "model"), "none")
