"""`interpose prepare`, `train`, `export`, `evaluate`: they reach what does the work, and say what is missing."""

import json
import subprocess
import sys

import pytest
from commandline import bvh_text, fails


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
        (("prepare", "bvh", "clips", "-o", "db", "--split", "train"), "only lafan1 has a split"),
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
        (("train", "dcmoe", "--data", "db", "-o", "run"), "torch"),
        (("export", "run", "-o", "model"), "onnx"),
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
    assert "is not installed; pip install 'interpose[train]' brings it" in done.stderr
    assert missing in done.stderr


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
        "--phases are for dcmoe",
    )
    fails(
        run("train", "pae", "--data", tmp_path / "none", "-o", tmp_path / "run", "--foreign-keys", "0.4"),
        "--foreign-keys are for dcmoe",
    )
    fails(
        run("train", "dcmoe", "--data", tmp_path / "none", "-o", tmp_path / "run", "--foreign-keys", "4"),
        "must be 0 to 1, got 4.0",
    )
    fails(run("export", tmp_path / "none", "-o", tmp_path / "model"), "none")
