"""A clip, a model, and a way to run commands in this process."""

from __future__ import annotations

import json

import numpy as np
import pytest
from commandline import bvh_text

from interpose.cli import main
from interpose.features import state_shapes
from interpose.runtime.model_folder import Session


@pytest.fixture
def clip(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(bvh_text(100))
    return path


@pytest.fixture
def run(capsys):
    """Run a command in this process: (exit status, standard output, standard error)."""

    def run(*arguments):
        status = main([str(a) for a in arguments])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


@pytest.fixture
def model(tmp_path_factory, monkeypatch):
    """The folder of a model whose network is a few lines: the interpolation base, swayed by the phases of the start."""

    def step(self, feed):
        left = feed["frames_left"]
        pose = np.concatenate([feed["hips"], feed["rotations"].reshape(len(left), -1)], axis=-1)
        after = feed["base_next"] + (left - 1) / left * (pose - feed["base"])
        after[:, :1] += 0.001 * feed["phase_past"][:, -1, :1, 0] * (left > 1)
        said = {f"next_{name}": feed[name] for name in state_shapes()}
        said |= {"next_hips": after[:, :3], "next_rotations": after[:, 3:].reshape(-1, 22, 6)}
        return said | {"contacts": np.zeros((len(left), 4), np.float32), "next_path": feed["path"]}

    folder = tmp_path_factory.mktemp("models") / "swaying"
    folder.mkdir()
    styles = ["Angry", "Old"]
    info = {
        "format": 2,
        "name": "swaying",
        "method": "dcmoe",
        "styles": styles,
        "licence": "MIT",
        "training_data": ["walks"],
    }
    (folder / "model.json").write_text(json.dumps(info))
    np.save(folder / "phases.npy", np.random.default_rng(0).normal(size=(8, 13, 10, 2)))
    monkeypatch.setattr(Session, "step", step)
    return folder
