"""Gaps made by the whole model: the same everywhere, along the plan that they should follow, and their statistics."""

import copy
from dataclasses import replace

import pytest
import stitch_learning
import torch
from stitch_learning import KNOWN, Elsewhere, drawn

from interpose.features.plan import anchor_weights
from interpose.train.common import gaps
from interpose.train.common.gaps import gap_input, true_anchors
from interpose.train.stitch import transitions
from interpose.train.stitch.transitions import made_gaps, ratios, set_statistics
from interpose.train.stitch.truth import mean_quaternions

CONFIG, PAPER = stitch_learning.CONFIG, stitch_learning.PAPER


@pytest.fixture(scope="module")
def paper_network(frames):
    """The paper's form; not to be changed."""
    return stitch_learning.network_for(frames, PAPER)


def make(model, data, some, config=CONFIG, **more):
    return made_gaps(model, data, some, config, torch.Generator().manual_seed(0), **more)


@pytest.mark.parametrize("form", ["yaw", "paper"])
def test_a_gap_is_made_the_same_everywhere(stitch_network, paper_network, frames, form):
    model, config = (stitch_network, CONFIG) if form == "yaw" else (paper_network, PAPER)
    there = Elsewhere()
    rule = replace(KNOWN, velocity=0.0) if form == "paper" else KNOWN
    moved = there.frames(frames)
    noise = torch.randn(6, model.size.latent, generator=torch.Generator().manual_seed(1))
    (one, true, _), (other, turned, _) = (
        make(model, data, drawn(data, 6, 12, rule), config, noise=noise) for data in (frames, moved)
    )
    same = (lambda x: x) if form == "paper" else there.point  # the paper's form is in the start's own frame
    torch.testing.assert_close(turned.positions, same(true.positions), atol=1e-4, rtol=0)
    torch.testing.assert_close(other.positions, same(one.positions), atol=5e-3, rtol=0)
    assert float((one.positions - true.positions).abs().mean()) > 0.01


def test_the_generators_follow_the_plan_between_the_keys(stitch_network, frames):
    model = copy.deepcopy(stitch_network)
    for side in (model.front, model.back):
        side.experts[-1].linear.weight.zero_()
        side.experts[-1].linear.bias.zero_()
    some = drawn(frames, 5, 18)
    noise = torch.randn(5, model.size.latent, generator=torch.Generator().manual_seed(1))
    x, frame = model.plan.encode(gap_input(frames, some))
    for given, z in ((noise, model.plan.expect(x).at(noise)), (None, model.plan.expect(x).mean)):
        made, _, _ = make(model, frames, some, noise=given)
        added = model.plan.decode(x, frame, z)
        base = gaps.base(frames, some, (torch.arange(19) / 18).expand(5, -1))
        base += torch.tensor(anchor_weights(18)).float() @ added
        torch.testing.assert_close(made.front.hips, base[:, made.front.frames, :3], atol=1e-4, rtol=0)
        torch.testing.assert_close(made.back.hips, base[:, made.back.frames, :3], atol=1e-4, rtol=0)
    bare = replace(model.size, planned=False)
    model.size = bare
    made, _, _ = make(model, frames, some)
    base = gaps.base(frames, some, (torch.arange(19) / 18).expand(5, -1))
    torch.testing.assert_close(made.front.hips, base[:, made.front.frames, :3], atol=1e-4, rtol=0)


def test_in_training_rows_follow_posterior_mean_and_samples_and_are_held_by_that(stitch_network, frames, monkeypatch):
    some = drawn(frames, 10, 12)
    seen = []
    real = transitions.roll
    monkeypatch.setattr(transitions, "roll", lambda *args: seen.append(args[5]) or real(*args))
    known = torch.ones(10)
    config = replace(CONFIG, posterior=0.5, likeliest=0.3, sampled=0.2)
    made_gaps(stitch_network, frames, some, config, torch.Generator().manual_seed(0), known)
    assert known.tolist() == pytest.approx([1.0] * 8 + [0.2] * 2)
    plan = stitch_network.plan
    x, frame = plan.encode(gap_input(frames, some))
    q = plan.recognise(x, frame, true_anchors(frames, some).residual)
    p = plan.expect(x)
    draws = torch.randn(2, 10, plan.size.latent, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(seen[0][:5], q.at(draws[0])[:5])
    torch.testing.assert_close(seen[0][5:8], p.mean[5:8])
    torch.testing.assert_close(seen[0][8:], p.at(draws[1])[8:])


def test_latents_a_frame_are_drawn_in_training_and_nil_otherwise(paper_network, frames):
    some = drawn(frames, 4, 10, replace(KNOWN, velocity=0.0))
    still, again = (make(paper_network, frames, some, PAPER)[0].positions for _ in range(2))
    assert torch.equal(still, again)
    one, other = (
        made_gaps(paper_network, frames, some, PAPER, torch.Generator().manual_seed(seed), torch.ones(4))
        for seed in (0, 1)
    )
    assert not torch.equal(one[0].positions, other[0].positions)
    assert len(one[2]) == len(one[0].front.frames) + len(one[0].back.frames)


@pytest.mark.parametrize("config", [CONFIG, PAPER])
def test_statistics_are_those_of_what_the_networks_see(frames, config):
    model = stitch_learning.network_for(frames, config)
    set_statistics(model, frames, config, torch.Generator().manual_seed(0), count=64)
    seen = {}

    def listen(module, given):
        features = module.form.features(*given[:2])
        for name in ("state", "offset", "target"):
            seen.setdefault((module, name), []).append(module.normalised(name, getattr(features, name)))

    hooks = [side.register_forward_pre_hook(listen) for side in (model.front, model.back)]
    for side in (model.front, model.back):  # silent: along interpolation
        side.experts[-1].linear.weight.zero_()
        side.experts[-1].linear.bias.zero_()
    for steps in (5, 8, 11):
        make(model, frames, drawn(frames, 64, steps, config.sampling), config)
    for hook in hooks:
        hook.remove()
    assert len(seen) == 6
    for (_, name), values in seen.items():
        x = torch.cat(values)
        x = x[:, x.std(dim=0) > 0.05]  # many joints never move
        assert x.shape[1] > 20
        assert float(x.mean(dim=0).abs().median()) < 0.25, name
        assert float(x.std(dim=0).median()) == pytest.approx(1.0, abs=0.5), name
    if config is PAPER:
        torch.testing.assert_close(model.mean_quaternions, mean_quaternions(frames))


def test_interpolation_is_the_measure_of_validation(stitch_network, frames):
    quiet = copy.deepcopy(stitch_network)
    for side in (quiet.front, quiet.back):
        side.experts[-1].linear.weight.zero_()
        side.experts[-1].linear.bias.zero_()
    quiet.plan.decoder[-1].weight.zero_()
    quiet.plan.decoder[-1].bias.zero_()
    made = ratios(quiet, frames, replace(CONFIG, longest=30), count=4)
    assert set(made) == {"valid/10", "valid/30", "jerk/10", "jerk/30"}
    assert [made["valid/10"], made["valid/30"]] == pytest.approx([1.0, 1.0], abs=1e-3)
    assert made["jerk/30"] < 0.5  # interpolation is smooth
    loud = ratios(stitch_network, frames, CONFIG, count=4)
    assert set(loud) == {"valid/10", "jerk/10"}
    assert abs(loud["valid/10"] - 1.0) > 0.05
    stitch_network.train()
    assert ratios(stitch_network, frames, CONFIG, count=4) == loud
    assert stitch_network.training
    stitch_network.eval()
