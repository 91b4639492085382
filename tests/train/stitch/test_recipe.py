"""The recipe of S-CVAE: that it learns and tells, that a stopped training goes on exactly, what it refuses."""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import learning
import numpy as np
import pytest
import stitch_learning
import torch

from interpose.errors import InputError
from interpose.models.stitching_cvae import StitchingCVAE
from interpose.train.common import checkpoint
from interpose.train.common.config import from_plain
from interpose.train.stitch import recipe
from interpose.train.stitch.config import PRESETS, StitchConfig, TrainingPart, ablations
from interpose.train.stitch.transitions import ratios, set_statistics

TINY = PRESETS["tiny"]
SHORT = replace(TINY, phases=TrainingPart(2, 8), stitch=TrainingPart(3, 4))
ROWS = list(ablations(TINY))


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(recipe, "set_statistics", partial(set_statistics, count=16))
    monkeypatch.setattr(recipe, "ratios", partial(ratios, count=8))


@pytest.fixture
def losses(monkeypatch) -> Iterator[list[float]]:
    """The loss of every update, exactly."""
    seen = []

    def listened(made):
        def loss(*args):
            total, each = made(*args)
            seen.append(float(total.detach()))
            return total, each

        return loss

    for name in ("phase_loss", "stitch_loss"):
        monkeypatch.setattr(recipe, name, listened(getattr(recipe, name)))
    return seen


@pytest.fixture(scope="module")
def plan_run(frames, tmp_path_factory):
    """A run of `interpose train plan`."""
    return learning.write_run(tmp_path_factory.mktemp("plan") / "run", learning.planner_for(frames), learning.PLANNER)


def logged(run_dir):
    return [json.loads(line) for line in (run_dir / "metrics.jsonl").read_text().splitlines()]


def test_tiny_trains_and_logs(database, frames, plan_run, losses, tmp_path):
    assert recipe.train([database.path], tmp_path / "run", "tiny", plan=plan_run) == "finished"
    assert len(losses) == 10
    assert np.isfinite(losses).all()
    saved = checkpoint.load(tmp_path / "run")
    assert saved["step"] == 10
    config = saved["config"]
    assert config["styles"] == list(learning.STYLES)
    assert config["size"]["plan"]["styles"] == 2
    assert config["databases"] == [f"synthetic {database.fingerprint}"]
    assert config["licence"] == "CC BY 4.0"
    assert (config["seed"], config["preset"]) == (0, "tiny")
    assert from_plain(StitchConfig, config).plan == learning.PLANNER
    last = logged(tmp_path / "run")[-1]
    assert {"loss", "phase", "position", "stitch", "adversarial", "critics"} <= set(last)
    assert {"valid/10", "jerk/10"} <= set(last)
    assert last["valid/10"] > 0.0
    model = recipe.model_of(saved)
    assert not model.training
    torch.testing.assert_close(model.front.state_mean, saved["ema"]["module.front.state_mean"])
    for name, value in learning.planner_for(frames).state_dict().items():  # taken whole, and as it was
        assert torch.equal(saved["model"][f"plan.{name}"], value), name
        assert torch.equal(saved["ema"][f"module.plan.{name}"], value), name


def test_every_part_learns(losses, plan_run, tmp_path):
    few = learning.write_database(tmp_path / "few", lengths=(14, 14))
    config = replace(
        SHORT,
        phases=TrainingPart(40, 32, 3e-3),
        stitch=TrainingPart(40, 16, 1e-2),
        shortest=12,
        longest=12,
        weights=replace(TINY.weights, adversarial=0.0, energy=0.0, foot=0.0, skate=0.0),
        posterior=1.0,
        likeliest=0.0,
    )
    recipe.train([few.path], tmp_path / "run", plan=plan_run, config=config)
    phases, last = losses[:40], losses[40:]
    assert np.mean(phases[-5:]) < 0.9 * np.mean(phases[:5])
    assert np.mean(last[-10:]) < 0.9 * np.mean(last[:5])


def test_a_killed_training_goes_on_exactly(database, plan_run, losses, tmp_path):
    config = replace(SHORT, critics_from=0.0)  # so that the critics' optimizer has something to remember

    def train(folder, **more):
        return recipe.train([database.path], tmp_path / folder, plan=plan_run, config=config, **more)

    assert train("whole") == "finished"
    whole = list(losses)
    losses.clear()
    for _ in range(4):  # one update each, into every part
        assert train("cut", max_minutes=0.0) == "out of time"
    assert train("cut") == "finished"
    assert losses == whole
    one, other = checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "cut")
    for part in ("model", "ema", "critics"):
        for name, value in one[part].items():
            assert torch.equal(other[part][name], value), name
    with pytest.raises(InputError, match="cannot resume, seed is 1 now"):
        train("cut", seed=1)


@pytest.mark.parametrize("row", ROWS)
def test_every_row_of_table_6_takes_steps(database, plan_run, losses, tmp_path, row):
    config = replace(TINY, phases=TrainingPart(1, 8), stitch=TrainingPart(2, 4))
    plan = plan_run if ablations(config)[row].needs_plan else None
    assert recipe.train([database.path], tmp_path / "run", plan=plan, without=row, config=config) == "finished"
    assert np.isfinite(losses).all()
    last = logged(tmp_path / "run")[-1]
    frame = row.startswith("z a frame") or row == "as printed"
    assert ("divergence" in last) == frame
    assert ("stitch" in last) == (row != "w/o BS")
    assert ("adversarial" in last) == (row != "w/o D")
    saved = checkpoint.load(tmp_path / "run")
    fresh = StitchingCVAE(recipe.model_of(saved).size).state_dict()
    assert set(fresh) == set(saved["model"])


def test_the_papers_recipe_takes_steps(database, losses, tmp_path):
    config = replace(
        PRESETS["paper"],
        size=stitch_learning.paper_form(TINY.size),
        phases=TrainingPart(1, 8),
        stitch=TrainingPart(2, 4),
    )
    recipe.train([database.path], tmp_path / "run", "paper", config=config)
    assert len(losses) == 3
    assert np.isfinite(losses).all()
    saved = checkpoint.load(tmp_path / "run")
    assert not any(name.startswith("plan.") for name in saved["model"])
    assert float(saved["model"]["mean_quaternions"].norm()) == pytest.approx(22**0.5, abs=1e-4)
    for name, value in saved["model"].items():  # it keeps no average of its weights
        assert torch.equal(saved["ema"][f"module.{name}"], value)


def test_two_databases_train_together(database, plan_run, losses, tmp_path):
    other = learning.write_database(tmp_path / "other", lengths=(60, 1, 2), licence="CC BY-NC-ND 4.0")
    recipe.train([database.path, other.path], tmp_path / "run", plan=plan_run, config=SHORT)
    saved = checkpoint.load(tmp_path / "run")
    assert saved["config"]["licence"] == "CC BY 4.0; CC BY-NC-ND 4.0"
    assert saved["config"]["databases"] == [f"synthetic {one.fingerprint}" for one in (database, other)]
    assert np.isfinite(losses).all()


def test_what_cannot_be_trained(database, plan_run, tmp_path):
    def fails(message, *, data=database.path, preset="tiny", plan=plan_run, **more):
        with pytest.raises(InputError, match=message):
            recipe.train([data], tmp_path / "run", preset, plan=plan, **more)
        assert not (tmp_path / "run").exists()

    fails("no preset 'huge'; there are full, small, tiny, paper", preset="huge")
    fails("no ablation 'w/o nothing'; there are ours, w/o BS, w/o SL", without="w/o nothing")
    fails("nowhere", data=tmp_path / "nowhere")
    short = learning.write_database(tmp_path / "short", lengths=(11, 2))
    fails(r"no clip has 12 frames for training; prepare longer ones", data=short.path)
    fails("nowhere: no run of 'interpose train plan' is there", plan=tmp_path / "nowhere")
    fails("the generators work along a planner; give --plan RUN", plan=None)
    fails("preset 'paper' uses no planner; leave out --plan", preset="paper")


def test_weights_that_do_not_fit_their_config(stitch_network, tmp_path):
    run = stitch_learning.write_run(tmp_path / "run", stitch_network)
    saved = checkpoint.load(run)
    saved["config"]["size"]["memory"] = 24
    with pytest.raises(InputError, match="weights are not those of its config"):
        recipe.model_of(saved)
