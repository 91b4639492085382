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
from interpose.train.stitch import recipe
from interpose.train.stitch.config import PRESETS, Part, ablations
from interpose.train.stitch.transitions import ratios, set_statistics

TINY = PRESETS["tiny"]
SHORT = replace(TINY, phases=Part(2, 8), plan=Part(2, 8), stitch=Part(3, 4))
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

    for name in ("phase_loss", "plan_loss", "stitch_loss"):
        monkeypatch.setattr(recipe, name, listened(getattr(recipe, name)))
    return seen


def logged(run_dir):
    return [json.loads(line) for line in (run_dir / "metrics.jsonl").read_text().splitlines()]


def test_tiny_trains_and_tells(database, losses, tmp_path):
    assert recipe.train([database.path], tmp_path / "run", "tiny") == "finished"
    assert len(losses) == 20
    assert np.isfinite(losses).all()
    saved = checkpoint.load(tmp_path / "run")
    assert saved["step"] == 20
    config = saved["config"]
    assert config["styles"] == list(learning.STYLES)
    assert config["size"]["plan"]["styles"] == 2
    assert config["databases"] == [f"synthetic {database.fingerprint}"]
    assert config["licence"] == "CC BY 4.0"
    assert (config["seed"], config["plan_from"], config["preset"]) == (0, "", "tiny")
    told = logged(tmp_path / "run")[-1]
    assert {"loss", "phase", "plan position", "nats", "position", "stitch", "adversarial", "critics"} <= set(told)
    assert {"valid/10", "jerk/10"} <= set(told)
    assert told["valid/10"] > 0.0
    model = recipe.model_of(saved)
    assert not model.training
    torch.testing.assert_close(model.front.state_mean, saved["ema"]["module.front.state_mean"])


def test_every_part_learns(losses, tmp_path):
    few = learning.write_database(tmp_path / "few", lengths=(14, 14))
    config = replace(
        SHORT,
        phases=Part(40, 32, 3e-3),
        plan=Part(60, 32, 3e-3),
        stitch=Part(40, 16, 1e-2),
        shortest=12,
        longest=12,
        weights=replace(TINY.weights, adversarial=0.0, energy=0.0, foot=0.0, skate=0.0),
        posterior=1.0,
        average_way=0.0,
    )
    recipe.train([few.path], tmp_path / "run", "tiny", config=config)
    phases, plan, last = losses[:40], losses[40:100], losses[100:]
    assert np.mean(phases[-5:]) < 0.9 * np.mean(phases[:5])
    assert np.mean(plan[-10:]) < 0.95 * np.mean(plan[:5])
    assert np.mean(last[-10:]) < 0.9 * np.mean(last[:5])


def test_a_killed_training_goes_on_exactly(database, losses, tmp_path):
    config = replace(SHORT, critics_from=0.0)  # so that the critics' optimizer has something to remember

    def train(folder, **more):
        return recipe.train([database.path], tmp_path / folder, "tiny", config=config, **more)

    assert train("whole") == "finished"
    whole = list(losses)
    losses.clear()
    for _ in range(6):  # one update each, into every part
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
def test_every_row_of_table_6_takes_steps(database, losses, tmp_path, row):
    config = replace(TINY, phases=Part(1, 8), plan=Part(1, 8), stitch=Part(2, 4))
    assert recipe.train([database.path], tmp_path / "run", "tiny", without=row, config=config) == "finished"
    assert np.isfinite(losses).all()
    told = logged(tmp_path / "run")[-1]
    frame = row.startswith("z a frame") or row == "as printed"
    assert ("divergence" in told) == frame
    assert ("stitch" in told) == (row != "w/o BS")
    assert ("adversarial" in told) == (row != "w/o D")
    saved = checkpoint.load(tmp_path / "run")
    fresh = StitchingCVAE(recipe.model_of(saved).size).state_dict()
    assert set(fresh) == set(saved["model"])


def test_the_papers_recipe_takes_steps(database, losses, tmp_path):
    config = replace(
        PRESETS["paper"], size=stitch_learning.letter(TINY.size), phases=Part(1, 8), plan=Part(0, 32), stitch=Part(2, 4)
    )
    recipe.train([database.path], tmp_path / "run", "paper", config=config)
    assert len(losses) == 3
    assert np.isfinite(losses).all()
    saved = checkpoint.load(tmp_path / "run")
    assert not any(name.startswith("plan.") for name in saved["model"])
    assert float(saved["model"]["mean_quaternions"].norm()) == pytest.approx(22**0.5, abs=1e-4)
    for name, value in saved["model"].items():  # it keeps no average of its weights
        assert torch.equal(saved["ema"][f"module.{name}"], value)


def test_generators_alone_along_another_runs_plan(database, losses, tmp_path):
    recipe.train([database.path], tmp_path / "first", "tiny", config=SHORT)
    losses.clear()
    more = {"config": SHORT, "seed": 5}
    assert recipe.train([database.path], tmp_path / "run", plan_from=tmp_path / "first", **more) == "finished"
    assert len(losses) == 3
    before, after = checkpoint.load(tmp_path / "first")["ema"], checkpoint.load(tmp_path / "run")
    assert after["config"]["plan_from"] == "first"
    same = {n: torch.equal(v, after["model"][n.removeprefix("module.")]) for n, v in before.items() if "module." in n}
    assert all(equal for name, equal in same.items() if ".plan." in name or name.endswith(("_mean", "_std")))
    assert not any(equal for name, equal in same.items() if ".experts." in name)


def test_two_databases_train_together(database, losses, tmp_path):
    other = learning.write_database(tmp_path / "other", lengths=(60, 1, 2), licence="CC BY-NC-ND 4.0")
    recipe.train([database.path, other.path], tmp_path / "run", "tiny", config=SHORT)
    saved = checkpoint.load(tmp_path / "run")
    assert saved["config"]["licence"] == "CC BY 4.0; CC BY-NC-ND 4.0"
    assert saved["config"]["databases"] == [f"synthetic {one.fingerprint}" for one in (database, other)]
    assert np.isfinite(losses).all()


def test_what_cannot_be_trained(database, tmp_path):
    def fails(said, *, data=database.path, preset="tiny", **more):
        with pytest.raises(InputError, match=said):
            recipe.train([data], tmp_path / "run", preset, **more)
        assert not (tmp_path / "run").exists()

    fails("no preset 'huge'; there are full, small, tiny, paper", preset="huge")
    fails("no ablation 'w/o nothing'; there are ours, w/o BS, w/o SL", without="w/o nothing")
    fails("nowhere", data=tmp_path / "nowhere")
    short = learning.write_database(tmp_path / "short", lengths=(11, 2))
    fails(r"no clip has 12 frames for training; prepare longer ones", data=short.path)
    fails("no finished run of 'interpose train stitch' is there", plan_from=tmp_path / "nowhere")


def test_a_plan_of_another_size_is_not_taken(database, tmp_path):
    recipe.train([database.path], tmp_path / "first", "tiny", config=replace(SHORT, phases=Part(1, 4), plan=Part(1, 4)))
    other = replace(SHORT, size=replace(TINY.size, plan=replace(TINY.size.plan, hidden=24)))
    for config in (other, replace(SHORT, size=stitch_learning.letter(TINY.size))):
        with pytest.raises(InputError, match=r"the plan to start from does not fit this one \(.*; give a run of the"):
            recipe.train([database.path], tmp_path / "run", config=config, plan_from=tmp_path / "first")


def test_weights_that_do_not_fit_their_config(stitch_network, tmp_path):
    run = stitch_learning.write_run(tmp_path / "run", stitch_network)
    saved = checkpoint.load(run)
    saved["config"]["size"]["memory"] = 24
    with pytest.raises(InputError, match="weights are not those of its config"):
        recipe.model_of(saved)
