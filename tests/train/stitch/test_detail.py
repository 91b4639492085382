"""The detail transformer's training: it refines a stitching run, resumes exactly, and refuses what it cannot refine."""

import json
from dataclasses import replace

import learning
import numpy as np
import pytest
import stitch_learning
import torch

from interpose import export as exporting
from interpose.errors import InputError
from interpose.export import onnx_file
from interpose.train.common import checkpoint
from interpose.train.stitch import detail
from interpose.train.stitch.config import StitchConfig
from interpose.train.stitch.detail import PRESETS


@pytest.fixture(scope="module")
def rough_run(stitch_network, tmp_path_factory):
    """A run of `interpose train stitch`."""
    return stitch_learning.write_run(tmp_path_factory.mktemp("rough") / "stitching", stitch_network)


def test_a_training_resumes_exactly_and_keeps_what_it_refines(database, rough_run, tmp_path):
    def train(folder, **more):
        return detail.train([database.path], tmp_path / folder, "tiny", refines=rough_run, **more)

    assert train("whole") == "finished"
    for _ in range(2):
        assert train("cut", max_minutes=0.0) == "out of time"
    assert train("cut") == "finished"
    one, other = checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "cut")
    for name, value in one["ema"].items():
        assert torch.equal(other["ema"][name], value), name
    config = one["config"]
    assert (config["refines"], config["styles"]) == ("stitching", list(learning.STYLES))
    assert config["stitch"] == checkpoint.load(rough_run)["config"]
    logged = json.loads((tmp_path / "whole" / "metrics.jsonl").read_text().splitlines()[-1])
    assert np.isfinite(logged["refined/10"])


def test_whole_transitions_have_both_keys_and_the_truth(stitch_network, frames):
    config: StitchConfig = stitch_learning.CONFIG
    made, true = detail.transitions(stitch_network, frames, config, 9, 5, torch.Generator().manual_seed(0))
    hips, rotations, contacts = made
    assert hips.shape == (5, 10, 3)
    assert torch.equal(rotations[:, [0, -1]], true[0][:, [0, -1]])
    assert ((contacts >= 0.0) & (contacts <= 1.0)).all()
    assert float((rotations - true[0]).abs().mean()) > 0.01


def test_what_cannot_be_refined(database, frames, tmp_path):
    def fails(message, refines):
        with pytest.raises(InputError, match=message):
            detail.train([database.path], tmp_path / "run", "tiny", refines=refines)
        assert not (tmp_path / "run").exists()

    fails("--refines: give a finished run of 'interpose train stitch' to refine", None)
    plan = learning.write_run(tmp_path / "plan", learning.planner_for(frames), learning.PLANNER)
    fails("plan: give a finished run of 'interpose train stitch' to refine", plan)
    paper = stitch_learning.network_for(frames, stitch_learning.PAPER)
    run = stitch_learning.write_run(tmp_path / "paper", paper, stitch_learning.PAPER)
    fails("paper: the paper's own form is not refined", run)


def test_its_export_keeps_its_config_in_the_model(stitch_folder, tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_file, "write", lambda network, path, *rest, **more: path.write_bytes(b"new") and {})
    config = replace(PRESETS["tiny"], refines="stitching", seed=6)
    run = learning.write_run(tmp_path / "run", detail.DetailTransformer(config.size), config)
    made = exporting.export(run, tmp_path / "both", onto=stitch_folder)
    info = json.loads((made / "model.json").read_text())
    assert (info["detail"]["refines"], info["detail"]["training"]["seed"]) == ("stitching", 6)
    assert info["training"] == json.loads((stitch_folder / "model.json").read_text())["training"]
