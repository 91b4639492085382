"""What plans add to the base, what the planner is held to, and plans for the trainings that work along it."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose.features import POSE
from interpose.features.plan import ANCHORS, LONGEST_PLAN_STEPS, anchor_weights
from interpose.models.geometry import to_six
from interpose.skeleton import HUMANOID
from interpose.train.common.gaps import GapSampling, draw, evenly, gap_input, true_anchors
from interpose.train.planner import objective
from interpose.train.planner.objective import planned_base, reconstruction

STYLES = len(learning.STYLES)
STEPS = 2 * (ANCHORS + 1)
"""A gap in which every other frame is an anchor."""


@pytest.fixture(scope="module")
def planner(frames):
    return learning.planner_for(frames)


@pytest.fixture
def gaps(frames):
    return evenly(frames, STEPS, 5, STYLES)


@pytest.fixture
def generator():
    return torch.Generator().manual_seed(0)


def noise(*shape, seed=1):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


def every(gaps, count=STEPS + 1):
    return torch.arange(count).expand(len(gaps), -1)


def test_the_base_passes_through_the_plan_and_is_exact_at_both_keys(frames, gaps):
    plan = 0.1 * noise(5, ANCHORS, POSE)
    plain, base = (planned_base(frames, gaps, added, every(gaps)) for added in (None, plan))
    torch.testing.assert_close((base - plain)[:, 2:-2:2], plan, atol=1e-6, rtol=0)
    torch.testing.assert_close(base[:, [0, -1]], plain[:, [0, -1]], atol=1e-6, rtol=0)
    wanted = torch.as_tensor(anchor_weights(STEPS)).float() @ plan
    torch.testing.assert_close(base - plain, wanted, atol=1e-6, rtol=0)
    beyond = planned_base(frames, gaps, plan, every(gaps, 30))[:, STEPS:]
    torch.testing.assert_close(beyond, base[:, -1:].expand_as(beyond), atol=1e-6, rtol=0)


def test_with_a_path_the_root_is_on_it(frames, gaps):
    plan = 0.1 * noise(5, ANCHORS, POSE)
    free = planned_base(frames, gaps, plan, every(gaps))
    gaps.path_known[:2] = 1.0
    led = planned_base(frames, gaps, plan, every(gaps))
    path = frames.hips[gaps.start[:, None] + every(gaps)]
    torch.testing.assert_close(led[:2, :, [0, 2]], path[:2, :, [0, 2]], atol=1e-6, rtol=0)
    assert (led - free)[:2, 1:-1, [0, 2]].abs().max() > 0.01
    torch.testing.assert_close(led[2:], free[2:], atol=0, rtol=0)
    torch.testing.assert_close(led[..., 1], free[..., 1], atol=0, rtol=0)
    torch.testing.assert_close(led[..., 3:], free[..., 3:], atol=0, rtol=0)


def test_perfect_plans_are_the_truth_at_the_anchors(frames, gaps):
    plan = objective.perfect_plans(frames, gaps)
    base = planned_base(frames, gaps, plan, every(gaps))[:, 2:-2:2]
    index = gaps.start[:, None] + 2 * torch.arange(1, ANCHORS + 1)
    torch.testing.assert_close(base[..., :3], frames.hips[index], atol=1e-5, rtol=0)
    torch.testing.assert_close(base[..., 3:], frames.rotations[index].flatten(2), atol=1e-5, rtol=0)


def test_gaps_longer_than_plans_have_none(frames, planner, generator):
    gaps = draw(frames, 64, STYLES, GapSampling(longest=140), generator)
    within = gaps.steps <= LONGEST_PLAN_STEPS
    assert 0 < int(within.sum()) < 64
    for plan in (
        objective.perfect_plans(frames, gaps),
        objective.plans(planner, frames, gaps, 0.5, generator)[0],
    ):
        assert not plan[~within].any()
        assert plan[within].abs().amax(dim=(1, 2)).min() > 0.0


def test_plans_are_the_likeliest_or_the_posteriors(frames, gaps, planner, generator):
    x, frame = planner.encode(gap_input(frames, gaps))
    likeliest = planner.decode(x, frame, planner.expect(x).mean)
    plan, latent = objective.plans(planner, frames, gaps, 0.0, generator)
    torch.testing.assert_close(plan, likeliest)
    torch.testing.assert_close(latent, planner.expect(x).mean)
    sampled, again = (objective.plans(planner, frames, gaps, 1.0, generator)[0] for _ in range(2))
    assert (sampled - likeliest).abs().amax(dim=(1, 2)).min() > 1e-3
    assert (again - sampled).abs().amax(dim=(1, 2)).min() > 1e-3
    many = draw(frames, 400, STYLES, GapSampling(longest=60), generator)
    x, frame = planner.encode(gap_input(frames, many))
    likeliest = planner.decode(x, frame, planner.expect(x).mean)
    plan, _ = objective.plans(planner, frames, many, 0.4, generator)
    other = (plan - likeliest).abs().amax(dim=(1, 2)) > 1e-5
    assert float(other.float().mean()) == pytest.approx(0.4, abs=0.08)


@pytest.fixture
def perfect(frames, gaps):
    """The true poses at the anchors as (hips, 6-D), as a plan and as the truth, and the joints at both keys."""
    true, known = true_anchors(frames, gaps), gap_input(frames, gaps)
    made = torch.cat([true.hips, true.rotations.flatten(2)], dim=-1)
    return made, true, (known.start_positions, known.target_positions)


def only(each, **wanted):
    for name, value in each.items():
        assert float(value) == pytest.approx(wanted.get(name, 0.0), abs=1e-5), name


def test_a_perfect_plan_costs_nothing(perfect):
    only(reconstruction(*perfect))


def test_one_anchor_too_far_costs_its_share(perfect):
    made, *rest = perfect
    made[:, 3, 0] += 0.3  # one of three axes at one of eight anchors; two of nine steps
    only(reconstruction(made, *rest), position=0.3 / 3 / ANCHORS, displacement=2 * 0.3 / 3 / (ANCHORS + 1))


def test_a_plan_that_is_off_as_a_whole_costs_its_steps_from_and_to_the_keys(perfect):
    made, *rest = perfect
    made[..., 1] -= 0.3
    only(reconstruction(made, *rest), position=0.3 / 3, displacement=2 * 0.3 / 3 / (ANCHORS + 1))


def test_a_hand_that_is_turned_costs_its_rotation(perfect):
    made, true, keys = perfect
    hand = HUMANOID.index("LeftHand")
    assert hand not in HUMANOID.parents  # nothing hangs on it
    made[:, 0, 3 + 6 * hand : 9 + 6 * hand] = to_six(torch.eye(3)[None])
    away = (true.rotations[:, 0, hand] - to_six(torch.eye(3)[None])).abs().mean()
    only(reconstruction(made, true, keys), rotation=float(away) / 22 / ANCHORS)


def test_the_loss_weighs_both_plans_and_their_distance(frames, gaps, planner):
    config = replace(learning.PLANNER, likeliest=0.5, divergence=0.01)
    total, each = objective.loss(planner, frames, gaps, noise(5, 8), config)

    def weighed(prefix):
        return sum(getattr(config, name) * each[prefix + name] for name in ("position", "rotation", "displacement"))

    posterior, likeliest = weighed(""), weighed("likeliest ")
    torch.testing.assert_close(total, posterior + 0.5 * likeliest + 0.01 * each["nats"])
    alone, _ = objective.loss(planner, frames, gaps, noise(5, 8), replace(config, likeliest=0.0))
    torch.testing.assert_close(alone, posterior + 0.01 * each["nats"])
    _, other = objective.loss(planner, frames, gaps, noise(5, 8, seed=2), config)
    assert other["position"] != each["position"]
    assert other["likeliest position"] == each["likeliest position"]


def test_the_true_plan_costs_its_nats_alone(frames, gaps, planner, monkeypatch):
    residual = true_anchors(frames, gaps).residual
    monkeypatch.setattr(planner, "decode", lambda *args: torch.cat([residual, residual]))
    total, each = objective.loss(planner, frames, gaps, noise(5, 8), learning.PLANNER)
    only({name: value for name, value in each.items() if name != "nats"})
    assert float(each["nats"]) > 0.1
    torch.testing.assert_close(total, learning.PLANNER.divergence * each["nats"], atol=1e-4, rtol=0)
    monkeypatch.setattr(planner, "recognise", lambda x, *_: planner.expect(x))
    _, each = objective.loss(planner, frames, gaps, noise(5, 8), learning.PLANNER)
    assert float(each["nats"]) == pytest.approx(0.0, abs=1e-5)


def test_the_loss_teaches_every_part(frames, gaps):
    planner = learning.planner_for(frames).requires_grad_()
    objective.loss(planner, frames, gaps, noise(5, 8), learning.PLANNER)[0].backward()
    assert all(p.grad is not None and torch.isfinite(p.grad).all() for p in planner.parameters())


def test_statistics_normalise_input_and_output(frames, planner):
    rule = replace(learning.PLANNER.sampling, path=1.0)
    some = draw(frames, 1000, STYLES, rule, torch.Generator().manual_seed(1))
    x, frame = planner.features(gap_input(frames, some))
    x = (x - planner.mean) / planner.std
    assert float(x.mean(dim=0).abs().median()) < 0.15
    assert float(x.std(dim=0).median()) == pytest.approx(1.0, abs=0.15)
    residual = true_anchors(frames, some).residual.unflatten(-1, (-1, 3)) @ frame[:, None]
    units = residual.flatten(1) / planner.residual_std
    assert float(units.std(dim=0).median()) == pytest.approx(1.0, abs=0.25)


def test_interpolation_is_the_measure_of_validation(frames):
    silent = learning.planner_for(frames)
    silent.decoder[-1].weight.zero_()
    silent.decoder[-1].bias.zero_()
    made = objective.ratios(silent, frames, count=4)
    lengths = (5, 15, 30, 45, 60, 90)
    assert set(made) == {f"{kind}/{length}" for kind in ("valid", "path") for length in lengths}
    assert [made[f"valid/{length}"] for length in lengths] == [pytest.approx(1.0, abs=1e-3)] * 6
    assert all(made[f"path/{length}"] < 1.0 for length in lengths[2:])  # the true path alone helps
    assert np.isfinite(list(objective.ratios(learning.planner_for(frames), frames, count=4).values())).all()
