"""The planner's training: it learns, resumes exactly, and refuses what it cannot do."""

import json
from dataclasses import replace
from functools import partial

import learning
import numpy as np
import pytest
import torch

from interpose.errors import InputError
from interpose.train.common import checkpoint
from interpose.train.planner import objective, recipe
from interpose.train.planner.config import PRESETS

SHORT = replace(PRESETS["tiny"], steps=4, rows=8)


@pytest.fixture(autouse=True)
def _quick_statistics(monkeypatch):
    monkeypatch.setattr(objective, "set_statistics", partial(objective.set_statistics, count=256))


@pytest.fixture
def losses(monkeypatch):
    """The loss of every update, exactly."""
    seen = []
    real = objective.loss

    def listened(*args):
        total, each = real(*args)
        seen.append(float(total.detach()))
        return total, each

    monkeypatch.setattr(objective, "loss", listened)
    return seen


def test_tiny_learns_and_logs(database, losses, tmp_path):
    config = replace(PRESETS["tiny"], steps=60, rows=16, learning_rate=1e-2)
    assert recipe.train([database.path], tmp_path / "run", config=config) == "finished"
    assert np.mean(losses[-10:]) < 0.95 * np.mean(losses[:10])
    saved = checkpoint.load(tmp_path / "run")
    kept = saved["config"]
    assert saved["step"] == 60
    assert kept["styles"] == list(learning.STYLES)
    assert kept["size"]["styles"] == 2
    assert kept["databases"] == [f"synthetic {database.fingerprint}"]
    assert (kept["licence"], kept["seed"]) == ("CC BY 4.0", 0)
    logged = json.loads((tmp_path / "run" / "metrics.jsonl").read_text().splitlines()[-1])
    assert {"loss", "position", "likeliest position", "nats", "valid/30", "path/30"} <= set(logged)
    planner = recipe.model_of(saved)
    assert not planner.training
    torch.testing.assert_close(planner.residual_std, saved["ema"]["module.residual_std"])


def test_a_killed_training_goes_on_exactly(database, losses, tmp_path):
    def train(folder, **more):
        return recipe.train([database.path], tmp_path / folder, config=SHORT, **more)

    assert train("whole") == "finished"
    whole = list(losses)
    losses.clear()
    for _ in range(2):
        assert train("cut", max_minutes=0.0) == "out of time"
    assert train("cut") == "finished"
    assert losses == whole
    one, other = checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "cut")
    for part in ("model", "ema"):
        for name, value in one[part].items():
            assert torch.equal(other[part][name], value), name
    with pytest.raises(InputError, match="cannot resume, seed is 1 now"):
        train("cut", seed=1)


def test_what_cannot_be_trained(database, tmp_path):
    with pytest.raises(InputError, match="no preset 'huge'; there are full, small, tiny"):
        recipe.train([database.path], tmp_path / "run", "huge")
    with pytest.raises(InputError, match="nowhere"):
        recipe.train([tmp_path / "nowhere"], tmp_path / "run", "tiny")
    assert not (tmp_path / "run").exists()


def test_the_planner_of_a_run_is_its_average_frozen(frames, tmp_path):
    planner = learning.planner_for(frames)
    run = learning.write_run(tmp_path / "run", planner, learning.PLANNER)
    loaded, config = recipe.load_for(run, learning.STYLES)
    assert config == learning.PLANNER
    assert not any(p.requires_grad for p in loaded.parameters())
    for name, value in planner.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], value), name


def test_planners_that_cannot_be_used(frames, network, tmp_path):
    with pytest.raises(InputError, match="nowhere: no run of 'interpose train plan' is there"):
        recipe.load_for(tmp_path / "nowhere", learning.STYLES)
    other = learning.write_run(tmp_path / "other", network)
    with pytest.raises(InputError, match="other: no run of 'interpose train plan' is there"):
        recipe.load_for(other, learning.STYLES)
    run = learning.write_run(tmp_path / "run", learning.planner_for(frames), learning.PLANNER)
    with pytest.raises(
        InputError, match="the planner's styles are Old, Young, the data's none; train both on the same"
    ):
        recipe.load_for(run, ())
    wider = replace(learning.PLANNER, size=replace(learning.PLANNER.size, hidden=48))
    run = learning.write_run(tmp_path / "wider", learning.planner_for(frames), wider)
    with pytest.raises(InputError, match="the run's weights are not those of its config"):
        recipe.load_for(run, learning.STYLES)
