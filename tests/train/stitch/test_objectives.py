"""What each part of the recipe of S-CVAE minimises: nothing for what is right, and what each of it teaches."""

import copy
from dataclasses import replace

import pytest
import stitch_learning
import torch

from interpose.models.discriminator import Discriminators
from interpose.train.common.gaps import evenly
from interpose.train.stitch import objectives
from interpose.train.stitch.losses import PAPER_WEIGHTS
from interpose.train.stitch.objectives import phase_loss, stitch_loss
from interpose.train.stitch.phase_targets import phase_targets

CONFIG, PAPER = stitch_learning.CONFIG, stitch_learning.PAPER


@pytest.fixture(scope="module")
def paper_network(frames):
    """The paper's form; not to be changed."""
    return stitch_learning.network_for(frames, PAPER)


def draws(seed=0):
    return torch.Generator().manual_seed(seed)


def learned(total, model):
    """The parts of the model that a loss teaches."""
    total.backward()
    return {name.split(".")[0] for name, p in model.named_parameters() if p.grad is not None and p.grad.any()}


@pytest.mark.parametrize("form", ["yaw", "paper"])
def test_phases_that_stay_are_predicted_by_silent_networks(stitch_network, paper_network, frames, form):
    model = copy.deepcopy(stitch_network if form == "yaw" else paper_network)
    for side in (model.front, model.back):
        side.phases.layers[-1].weight.zero_()
        side.phases.layers[-1].bias.zero_()
    resting = torch.zeros(len(frames), 4)
    blurred = float(phase_loss(model, frames, resting, 4000, draws())[0])
    # 0.4 of the rows are blurred by 0.1, mean |N| = 0.798, on either side; the others are nil
    assert blurred == pytest.approx(2 * 0.4 * 0.1 * 0.798, rel=0.05)
    held = torch.full((len(frames), 4), 0.5)
    total = float(phase_loss(model, frames, held, 4000, draws())[0])
    # and 0.2 of the rows are told nothing
    assert total == pytest.approx(2 * (0.4 * 0.1 * 0.798 + 0.2 * 0.5), rel=0.05)


def test_the_backward_network_predicts_phases_that_turn_backwards(stitch_network, frames, monkeypatch):
    calls = []
    model = copy.deepcopy(stitch_network)
    for side in (model.front, model.back):
        monkeypatch.setattr(
            side.phases, "forward", lambda state, phase: calls.append((state, phase)) or torch.zeros_like(phase)
        )
    starts = torch.arange(64) + 20
    monkeypatch.setattr(
        objectives, "draw", lambda *args, steps: replace(evenly(frames, 2, 64, 2), start=starts, steps=starts * 0 + 2)
    )
    phases = torch.linspace(0.1, 1.0, len(frames))[:, None] * torch.tensor([1.0, 2.0, -1.0, 0.5])
    total, _ = phase_loss(model, frames, phases, 64, draws())
    assert float(total) == pytest.approx(float(phases[22:86].abs().mean() + phases[20:84].abs().mean()), rel=1e-5)
    plain = phases[21:85]
    for (state, phase), sign in zip(calls, (1.0, -1.0), strict=True):
        unchanged = phase[(phase - plain * torch.tensor([sign, 1.0, sign, 1.0])).abs().amax(dim=1) < 1e-6]
        assert 0.25 < len(unchanged) / 64 < 0.6  # neither blurred nor kept back
        assert int((phase == 0.0).all(dim=1).sum()) > 3
        assert state.shape == (64, 269)
    where = slice(198, 264)
    seen = [state[:, where] for state, _ in calls]
    velocities = [
        x * side.state_std[where] + side.state_mean[where]
        for x, side in zip(seen, (model.front, model.back), strict=True)
    ]
    inside = (seen[0].abs() < 5.9) & (seen[1].abs() < 5.9)
    # The backward side's velocities run from the frame after: nearly those of the front, the other way round.
    apart = (velocities[0] + velocities[1])[inside].abs().mean()
    assert float(apart) < 0.4 * float(velocities[0][inside].abs().mean())


def test_the_phase_loss_teaches_the_phases_alone(stitch_network, frames):
    model = copy.deepcopy(stitch_network).requires_grad_()
    total, each = phase_loss(model, frames, phase_targets(frames), 32, draws())
    assert torch.equal(total, each["phase"])
    total.backward()
    taught = {n for n, p in model.named_parameters() if p.grad is not None and p.grad.any()}
    assert taught
    assert all(".phases." in name for name in taught)


@pytest.mark.parametrize("form", ["yaw", "paper"])
def test_the_stitch_loss_is_its_terms_by_their_weights_and_teaches_the_generators(
    stitch_network, paper_network, frames, form
):
    config = CONFIG if form == "yaw" else replace(PAPER, weights=PAPER_WEIGHTS)
    model = copy.deepcopy(stitch_network if form == "yaw" else paper_network).requires_grad_()
    critics = Discriminators()
    against = torch.optim.SGD(critics.parameters(), 0.0)
    total, each = stitch_loss(model, critics, against, frames, config, 1.0, draws())
    names = set(each) - {"critics", "adversarial"}
    weighted = sum(getattr(config.weights, name) * each[name] for name in names)
    torch.testing.assert_close(total, weighted + config.weights.adversarial * each["adversarial"])
    assert ("divergence" in each) == (form == "paper")
    assert learned(total, model) == {"front", "back"}  # the plan is taken as it is
    assert all(torch.isfinite(p.grad).all() for p in model.parameters() if p.grad is not None)


def test_the_critics_come_in_slowly_and_are_taught_by_their_own_loss(stitch_network, frames):
    config = replace(CONFIG, critics_from=0.5)

    def at(gone, rate=0.0):
        critics = Discriminators()
        before = copy.deepcopy(critics.state_dict())
        total, each = stitch_loss(
            stitch_network, critics, torch.optim.SGD(critics.parameters(), rate), frames, config, gone, draws()
        )
        taught = any(not torch.equal(v, before[k]) for k, v in critics.state_dict().items())
        rest = sum(getattr(config.weights, k) * v for k, v in each.items() if k not in ("critics", "adversarial"))
        strength = (
            float((total - rest).detach()) / float(each["adversarial"].detach()) if "adversarial" in each else 0.0
        )
        return strength, taught

    assert at(0.49, 0.1) == (0.0, False)
    assert at(0.5, 0.1)[1]
    torch.manual_seed(0)
    strengths = [at(gone)[0] for gone in (0.5, 0.55, 0.8)]
    full = config.weights.adversarial
    assert strengths == pytest.approx([0.001 * full, 0.501 * full, full], abs=0.02 * full)


def test_gaps_grow_to_the_longest(stitch_network, frames, monkeypatch):
    lengths = []
    real = objectives.made_gaps
    monkeypatch.setattr(objectives, "made_gaps", lambda *a: lengths.append(int(a[2].steps[0]) + 1) or real(*a))
    config = replace(
        CONFIG, shortest=5, longest=12, growth=0.5, critics_from=2.0, stitch=replace(CONFIG.stitch, rows=1)
    )
    critics = Discriminators()
    against = torch.optim.SGD(critics.parameters(), 0.0)
    seen = {}
    for gone in (0.0, 0.25, 0.5, 1.0):
        lengths.clear()
        generator = draws()
        for _ in range(40):
            stitch_loss(stitch_network, critics, against, frames, config, gone, generator)
        seen[gone] = set(lengths)
    assert seen == {0.0: {5}, 0.25: set(range(5, 9)), 0.5: set(range(5, 13)), 1.0: set(range(5, 13))}
