"""The recipe of DC-MoE: its presets, that it learns, that a stopped training goes on exactly, what it refuses."""

import copy
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import learning
import numpy as np
import pytest
import torch

from interpose.errors import InputError
from interpose.features import EXPERT_INPUT, GATE_INPUT
from interpose.models.dcmoe import DCMoE, DCMoESize
from interpose.train.common import checkpoint
from interpose.train.common.config import from_plain
from interpose.train.common.gaps import GapSampling
from interpose.train.dcmoe import recipe, validation
from interpose.train.dcmoe.config import PRESETS, DCMoEConfig, Stage
from interpose.train.dcmoe.recipe import set_statistics, target_mask, unroll
from interpose.train.dcmoe.sequences import RollOutSampling, draw

SHORT = replace(PRESETS["tiny"], stages=(Stage(2, 1, 8), Stage(4, 3, 8)))


@pytest.fixture(autouse=True)
def _quick_statistics(monkeypatch):
    monkeypatch.setattr(recipe, "set_statistics", partial(set_statistics, count=512))


@pytest.fixture(scope="module")
def phases(database, tmp_path_factory):
    path = tmp_path_factory.mktemp("phases") / "phases.npy"
    np.save(path, learning.phases_of(database).astype(np.float16))
    return path


@pytest.fixture
def losses(monkeypatch) -> Iterator[list[float]]:
    """The loss of every update, exactly."""
    seen = []

    def listened(*args):
        total, each = unroll(*args)
        seen.append(float(total.detach()))
        return total, each

    monkeypatch.setattr(recipe, "unroll", listened)
    return seen


@pytest.mark.parametrize(("name", "experts", "hidden"), [("full", 16, 512), ("paper", 16, 512), ("small", 8, 256)])
def test_presets_have_the_sizes_that_they_say(name, experts, hidden):
    config = PRESETS[name]
    assert config.preset == name
    with torch.device("meta"):
        model = DCMoE(DCMoESize(config.experts, config.hidden, config.gate, config.absolute, 100))
    shapes = [tuple(layer.linear.weight.shape) for layer in model.network.experts]
    width = model.layout.width
    assert shapes == [(experts * hidden, EXPERT_INPUT.width), (experts * hidden, hidden), (experts * width, hidden)]
    gate = [tuple(layer.weight.shape) for layer in model.network.gate if isinstance(layer, torch.nn.Linear)]
    assert gate[0][1] == GATE_INPUT.width
    assert gate[-1][0] == experts
    assert model.layout.width == (544 if name == "paper" else 481)


def test_the_papers_recipe_is_the_papers():
    config = PRESETS["paper"]
    assert (config.learning_rate, config.weight_decay, config.absolute, config.gate) == (1e-4, 1e-4, True, (512, 128))
    assert all((stage.unroll, stage.rows) == (1, 32) for stage in config.stages)
    assert config.warmup == 0  # a constant rate
    assert config.average == 0.0
    assert config.mask_target > 0.0
    rule = config.sampling
    assert (rule.rotation_noise, rule.hips_noise, rule.gaps.path, rule.gaps.longest) == (0.0, 0.0, 1.0, 91)


def test_tiny_learns_and_logs(database, phases, losses, tmp_path):
    config = replace(PRESETS["tiny"], learning_rate=1e-2, stages=(Stage(50, 1, 32), Stage(5, 2, 16)))
    assert recipe.train([database.path], tmp_path / "run", phases=[phases], config=config) == "finished"
    assert len(losses) == 55
    assert np.mean(losses[40:50]) < 0.85 * np.mean(losses[:5])
    saved = checkpoint.load(tmp_path / "run")
    config = saved["config"]
    assert saved["step"] == 55
    assert config["styles"] == list(learning.STYLES)
    assert config["databases"] == [f"synthetic {database.fingerprint}"]
    assert config["licence"] == "CC BY 4.0"
    assert config["phases"] is True
    assert config["plan"] is None
    assert saved["model"]["phase_bank"].abs().max() > 0.0


@pytest.fixture(scope="module")
def plan_run(frames, tmp_path_factory):
    """A run of `interpose train plan`."""
    return learning.write_run(tmp_path_factory.mktemp("plan") / "run", learning.planner_for(frames), learning.PLANNER)


def test_the_planner_is_taken_whole_and_stays_as_it_is(database, frames, plan_run, losses, tmp_path):
    assert recipe.train([database.path], tmp_path / "run", plan=plan_run, config=SHORT) == "finished"
    saved = checkpoint.load(tmp_path / "run")
    assert from_plain(DCMoEConfig, saved["config"]).plan == learning.PLANNER
    for part, prefix in (("model", "planner."), ("ema", "module.planner.")):
        for name, value in learning.planner_for(frames).state_dict().items():
            assert torch.equal(saved[part][prefix + name], value), name
    assert np.isfinite(losses).all()


@pytest.mark.parametrize("planned", [False, True])
def test_a_killed_training_goes_on_exactly(database, phases, plan_run, losses, tmp_path, planned):
    plan = plan_run if planned else None

    def train(folder, **more):
        return recipe.train([database.path], tmp_path / folder, phases=[phases], plan=plan, config=SHORT, **more)

    assert train("whole") == "finished"
    whole = list(losses)
    losses.clear()
    for _ in range(4):  # one update each, into the stage whose rows are carried from update to update
        assert train("cut", max_minutes=0.0) == "out of time"
    assert train("cut") == "finished"
    assert losses == whole
    one, other = checkpoint.load(tmp_path / "whole"), checkpoint.load(tmp_path / "cut")
    for part in ("model", "ema"):
        for name, value in one[part].items():
            assert torch.equal(other[part][name], value), name
    with pytest.raises(InputError, match="cannot resume, seed is 1 now"):
        train("cut", seed=1)


def test_two_databases_train_together(database, losses, tmp_path):
    other = learning.write_database(tmp_path / "other", lengths=(60, 1, 2), licence="CC BY-NC-ND 4.0")
    config = replace(PRESETS["tiny"], stages=(Stage(2, 2, 64),))
    recipe.train([database.path, other.path], tmp_path / "run", config=config)
    saved = checkpoint.load(tmp_path / "run")
    assert saved["config"]["licence"] == "CC BY 4.0; CC BY-NC-ND 4.0"
    assert saved["config"]["databases"] == [f"synthetic {one.fingerprint}" for one in (database, other)]
    assert int(saved["extra"]["rows"]["start"].max()) >= 2 * 360
    assert np.isfinite(losses).all()
    assert not saved["model"]["phase_bank"].any()


def test_what_cannot_be_trained(database, phases, tmp_path):
    with pytest.raises(InputError, match="no preset 'huge'; there are full, small, tiny, paper"):
        recipe.train([database.path], tmp_path / "run", "huge")
    with pytest.raises(InputError, match=r"no phases there .*interpose train pae"):
        recipe.train([database.path], tmp_path / "run", "tiny", phases=[tmp_path / "nothing.npy"])
    np.save(tmp_path / "wrong.npy", np.zeros((2, 7, 10, 3)))
    with pytest.raises(InputError, match=r"phases of shape \(2, 7, 10, 3\), the database needs \(2, 360, 10, 3\)"):
        recipe.train([database.path], tmp_path / "run", "tiny", phases=[tmp_path / "wrong.npy"])
    with pytest.raises(InputError, match="2 files of phases for 1 databases"):
        recipe.train([database.path], tmp_path / "run", "tiny", phases=[phases, phases])
    with pytest.raises(InputError, match="nowhere"):
        recipe.train([tmp_path / "nowhere"], tmp_path / "run", "tiny")
    short = learning.write_database(tmp_path / "short", lengths=(20, 1))
    with pytest.raises(InputError, match="no clip is longer than a second"):
        recipe.train([short.path], tmp_path / "run", "tiny")
    assert not (tmp_path / "run").exists()


def test_planners_that_cannot_be_used(database, plan_run, phases, tmp_path):
    def fails(message, config=SHORT, **more):
        with pytest.raises(InputError, match=message):
            recipe.train([database.path], tmp_path / "run", config=config, **more)
        assert not (tmp_path / "run").exists()

    fails("nowhere: no run of 'interpose train plan' is there", plan=tmp_path / "nowhere")
    fails("--plan cannot be used with motion that runs backwards", plan=plan_run, backward=True)
    fails("--plan cannot be used with motion that runs backwards", replace(SHORT, backward=True), plan=plan_run)
    fails("--plan cannot be used with the paper's own form", replace(SHORT, absolute=True), plan=plan_run)
    fails("the config is of a training with --plan RUN; give --plan RUN too", replace(SHORT, plan=learning.PLANNER))
    fails("the config is of a training with --phases FILE; give", replace(SHORT, phases=True), plan=plan_run)


def test_the_step_is_compiled_where_requested(database, tmp_path, monkeypatch):
    compiled = []
    monkeypatch.setattr(DCMoE, "compile", lambda self: compiled.append(self))
    recipe.train([database.path], tmp_path / "run", config=SHORT, compiled=True)
    assert len(compiled) == 1


def test_statistics_normalise_what_goes_in_and_what_comes_out(frames):
    model = DCMoE(DCMoESize(2, 8, (8, 4), True, len(learning.STYLES)))
    set_statistics(model, frames, learning.CONFIG, torch.Generator().manual_seed(0), count=1000)
    rule = learning.CONFIG.sampling
    rows = draw(frames, 1000, len(learning.STYLES), rule, torch.Generator().manual_seed(1))
    x, _, frame, origin = model.features(rows.state, learning.steering(frames, rows))
    moving = x.std(dim=0) > 0.05
    x = (x - model.mean) / model.std
    assert float(x.mean(dim=0).abs().max()) < 0.3
    assert float((x.std(dim=0)[moving] - 1.0).abs().max()) < 0.4
    assert torch.isfinite(x).all()
    real = learning.coming(frames, rows, frame, origin)
    where = model.layout.slices()
    for name, value in (("position", real.positions), ("velocity", real.velocities), ("trajectory", real.trajectory)):
        scaled = (value.flatten(1) - model.out_mean[where[name]]) / model.out_std[where[name]]
        assert float(scaled.mean(dim=0).abs().max()) < 0.3, name
    residual = DCMoE(DCMoESize(2, 8, (8, 4), False, len(learning.STYLES)))
    set_statistics(residual, frames, learning.CONFIG, torch.Generator().manual_seed(0), count=100)
    where = residual.layout.slices()
    assert torch.all(residual.out_std[where["hips"]] == 0.02)
    assert torch.all(residual.out_std[where["rotation"]] == 0.08)
    assert not residual.out_mean[where["rotation"]].any()


def test_the_bank_holds_windows_of_real_phases(frames, network):
    windows = frames.phases.unfold(0, 61, 1)[..., ::5].permute(0, 3, 1, 2)[..., :2]
    bank = network.phase_bank
    middle = (bank[:20, None] - windows[None]).abs().amax(dim=(2, 3, 4)).min(dim=1).values
    assert int((middle < 1e-6).sum()) >= 12  # the others reach past the end of their clip, where its last frame repeats
    assert len(torch.unique(bank[:, 6], dim=0)) > 100


def test_target_joints_are_hidden_together(frames):
    config = replace(DCMoEConfig(), mask_target=0.5, mask_joint=0.25)
    mask = target_mask(2000, config, torch.Generator().manual_seed(0))
    where = EXPERT_INPUT.slices()
    parts = {
        n: mask[:, where[n]].unflatten(1, (22, -1)) for n in ("target_position", "target_rotation", "speed_needed")
    }
    hidden = parts["target_position"][..., 0] == 0.0
    for part in parts.values():
        assert torch.equal(part == 0.0, hidden[..., None].expand_as(part))
    others = torch.ones(EXPERT_INPUT.width, dtype=torch.bool)
    for name in parts:
        others[where[name]] = False
    assert torch.all(mask[:, others] == 1.0)
    assert float(hidden.any(dim=1).float().mean()) == pytest.approx(0.5, abs=0.05)
    assert float(hidden.float().mean()) == pytest.approx(0.125, abs=0.02)


def test_unrolling_goes_on_from_the_own_state_and_stops_at_the_target(frames, network):
    rule = RollOutSampling(GapSampling(longest=6), inside=0.0)
    rows = draw(frames, 16, len(learning.STYLES), rule, torch.Generator().manual_seed(0))
    model = copy.deepcopy(network).requires_grad_()
    config = replace(learning.CONFIG, mask_target=0.0)
    total, each = unroll(model, frames, rows, 4, config, torch.ones(16, EXPERT_INPUT.width))
    assert torch.equal(rows.gone, rows.gaps.steps.clamp(max=4))
    assert not rows.state.hips.requires_grad
    arrived = rows.gaps.steps <= 4
    assert 0 < int(arrived.sum()) < 16
    target = frames.positions[rows.gaps.target]
    torch.testing.assert_close(rows.state.positions[arrived], target[arrived], atol=1e-4, rtol=0)
    weighted = sum(getattr(config.weights, name) * value for name, value in each.items())
    torch.testing.assert_close(total.detach(), weighted, atol=1e-4, rtol=1e-4)
    total.backward()
    assert all(torch.isfinite(p.grad).all() for p in model.parameters())


def test_interpolation_is_the_measure_of_validation(frames, network):
    ratios = validation.ratios(learning.silence(copy.deepcopy(network)), frames, 91, count=4)
    gaps = (5, 15, 30, 45, 60, 90)
    assert set(ratios) == {f"{kind}/{gap}" for kind in ("valid", "path", "jerk") for gap in gaps}
    for kind in ("valid", "path"):
        assert [ratios[f"{kind}/{gap}"] for gap in gaps] == [pytest.approx(1.0, abs=1e-3)] * 6
    assert max(ratios[f"jerk/{gap}"] for gap in gaps) < 0.5  # interpolation hardly has any
    loud = validation.ratios(network, frames, 20, count=12)
    assert {name for name in loud if name.startswith("valid")} == {"valid/5", "valid/15"}
    assert all(abs(loud[name] - 1.0) > 0.05 for name in ("valid/5", "valid/15"))
