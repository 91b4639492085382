"""The example programs run as they stand, with a model whose network is the interpolation base alone."""

from __future__ import annotations

import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from commandline import bvh_text

import interpose
from interpose.features import state_shapes
from interpose.gallery.store import save
from interpose.rotation import IDENTITY, from_rotation_vector
from interpose.runtime.backends.dcmoe import BACKEND
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.model_folder import Session, installed, load

EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    """Run an example in an empty folder: what it printed."""

    def step(self, feed):
        said = {f"next_{name}": feed[name] for name in state_shapes()}
        said |= {"next_hips": feed["base_next"][:, :3], "next_rotations": feed["base_next"][:, 3:].reshape(-1, 22, 6)}
        return said | {"contacts": np.zeros((len(feed["hips"]), 4), np.float32), "next_path": feed["path"]}

    folder = tmp_path / "model"
    folder.mkdir()
    info = {"format": 2, "name": "plain", "method": "dcmoe", "styles": ["Angry"], "licence": "MIT"}
    (folder / "model.json").write_text(json.dumps(info))
    monkeypatch.setattr(Session, "step", step)
    monkeypatch.chdir(tmp_path)

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [name, "--model", str(folder), *arguments])
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")
        return capsys.readouterr().out

    return run


def test_two_poses(run, tmp_path):
    assert "59 frames by dcmoe" in run("01_two_poses.py")
    assert len(interpose.read(tmp_path / "two_poses.bvh")) == 61


def test_two_poses_of_a_clip(run, tmp_path):
    (tmp_path / "walk.bvh").write_text(bvh_text(40))
    run("01_two_poses.py", "walk.bvh", "0", "30", "--frames", "29", "--style", "Angry", "-o", "made.bvh")
    clip, made = interpose.read(tmp_path / "walk.bvh"), interpose.read(tmp_path / "made.bvh")
    assert len(made) == 31
    np.testing.assert_array_equal(made.root_positions[[0, -1]], clip.root_positions[[0, 30]])


def test_styles_and_variants(run, tmp_path):
    said = run("02_styles_and_variants.py", "--variants", "2")
    assert [line.split()[0] for line in said.splitlines()[:4]] == ["Angry", "Angry", "free", "free"]
    assert (tmp_path / "styles.png").stat().st_size > 10_000


def test_onnx_alone_agrees_with_the_package(tmp_path, monkeypatch):
    if not installed():
        pytest.skip("needs an installed model, and there is none in the package")
    folder, out = installed()[0], tmp_path / "made.npz"
    monkeypatch.setattr(sys, "argv", ["04_onnx_alone.py", str(folder), "--frames", "20", "-o", str(out)])
    runpy.run_path(str(EXAMPLES / "04_onnx_alone.py"), run_name="__main__")
    places = np.array([[[0.0, 0.93, 0.0]], [[0.0, 0.93, 2.0]]])
    local = np.tile(IDENTITY, (2, 1, 22, 1))
    local[1, 0, 0] = from_rotation_vector(np.array([0.0, np.pi / 2.0, 0.0]))
    keys = [(places[i : i + 1], local[i : i + 1]) for i in (0, 1)]
    whole = BACKEND.generate(load(folder), batch_of(*keys, 20))
    with np.load(out) as made:
        np.testing.assert_allclose(made["hips"], whole.root[0], atol=1e-4)
        np.testing.assert_allclose(made["contacts"], whole.contacts[0], atol=1e-3)


def test_game_loop(run, tmp_path):
    assert "121 poses" in run("03_game_loop.py")
    walked = interpose.read(tmp_path / "loop.bvh")
    np.testing.assert_allclose(walked.root_positions[-1, ::2], [2.2, 2.0], atol=1e-3)


def test_paths_and_speeds(run, tmp_path):
    if not (installed() and load(None).gallery):
        pytest.skip("needs an installed model with a gallery, and there is none in the package")
    gallery = tmp_path / "gallery"
    save(load(None).gallery, gallery)
    said = run("05_paths_and_speeds.py", "--gallery", str(gallery)).splitlines()
    assert "frames suggested" in said[0]
    frames = {line.split(":")[0]: int(line.split(": ")[1].split()[0]) for line in said[1:]}
    assert frames["fast"] < frames["slow"]
    assert frames["an S"] > frames["straight on"]
    assert (tmp_path / "paths.png").stat().st_size > 10_000
