"""The planner in training: what plans add to the base, what they are held to, whose planner a training may take."""

from dataclasses import replace
from functools import partial

import learning
import pytest
import stitch_learning
import torch

from interpose.errors import InputError
from interpose.features.stitch import ANCHORS, spread
from interpose.models.geometry import to_six
from interpose.models.planner import LONGEST, POSE
from interpose.skeleton import HUMANOID
from interpose.train.common import checkpoint
from interpose.train.dcmoe import recipe
from interpose.train.dcmoe.recipe import Stage
from interpose.train.dcmoe.sequences import Sampling, base_window, draw, spread_at
from interpose.train.dcmoe.validation import fixed_rows
from interpose.train.planner import objective
from interpose.train.planner.objective import Planning, reconstruction, true_anchors

STYLES = len(learning.STYLES)
STEPS = 2 * (ANCHORS + 1)
"""A gap in which every other frame is an anchor."""


@pytest.fixture
def rows(frames):
    return fixed_rows(frames, STEPS - 1, 5, STYLES)


@pytest.fixture
def generator():
    return torch.Generator().manual_seed(0)


def noise(*shape, seed=1):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("steps", [1, 2, 5, 18, 61, 92])
def test_plans_are_spread_as_at_run_time(steps):
    parts = torch.arange(steps + 1, dtype=torch.float64)[None] / steps
    torch.testing.assert_close(spread_at(parts)[0], torch.as_tensor(spread(steps)), atol=1e-6, rtol=0)


def test_the_base_passes_through_what_is_added_and_is_exact_at_both_keys(frames, rows):
    rows.added = 0.1 * noise(5, ANCHORS, POSE)
    plain, base = (base_window(frames, rows, STEPS, planned) for planned in (False, True))
    torch.testing.assert_close((base - plain)[2:-2:2].transpose(0, 1), rows.added, atol=1e-6, rtol=0)
    torch.testing.assert_close(base[[0, -1]], plain[[0, -1]], atol=1e-6, rtol=0)
    assert (base - plain)[1:-1].abs().amin(dim=(1, 2)).max() > 0.0
    rows.gone += 5  # from inside the gap it is the same base
    torch.testing.assert_close(base_window(frames, rows, 4, True), base[5:10], atol=1e-6, rtol=0)
    beyond = base_window(frames, rows, STEPS, True)[STEPS - 5 :]
    torch.testing.assert_close(beyond, base[-1:].expand_as(beyond), atol=1e-6, rtol=0)


def test_with_a_path_the_root_is_on_it(frames, rows):
    rows.added = 0.1 * noise(5, ANCHORS, POSE)
    free = base_window(frames, rows, STEPS, True)
    rows.path_known[:2] = 1.0
    led = base_window(frames, rows, STEPS, True)
    way = frames.hips[rows.start[:, None] + torch.arange(STEPS + 1)].transpose(0, 1)
    torch.testing.assert_close(led[:, :2, [0, 2]], way[:, :2, [0, 2]], atol=1e-6, rtol=0)
    assert (led - free)[1:-1, :2, [0, 2]].abs().max() > 0.01
    torch.testing.assert_close(led[:, 2:], free[:, 2:], atol=0, rtol=0)
    torch.testing.assert_close(led[:, :, 1], free[:, :, 1], atol=0, rtol=0)
    torch.testing.assert_close(led[:, :, 3:], free[:, :, 3:], atol=0, rtol=0)


def test_perfect_plans_are_the_truth_at_the_anchors(frames, rows):
    objective.add_perfect_plans(frames, rows)
    base = base_window(frames, rows, STEPS, True)[2:-2:2].transpose(0, 1)
    index = rows.start[:, None] + 2 * torch.arange(1, ANCHORS + 1)
    torch.testing.assert_close(base[..., :3], frames.hips[index], atol=1e-5, rtol=0)
    torch.testing.assert_close(base[..., 3:], frames.rotations[index].flatten(2), atol=1e-5, rtol=0)
    # Anchors between frames lie on the line between them.
    odd = fixed_rows(frames, 20, 5, STYLES)
    at = 21 / (ANCHORS + 1)
    wanted = torch.lerp(frames.hips[odd.start + 2], frames.hips[odd.start + 3], at - 2)
    torch.testing.assert_close(true_anchors(frames, odd).hips[:, 0], wanted, atol=1e-5, rtol=0)


def test_gaps_longer_than_plans_have_none(frames, planned_network, generator):
    rows = draw(frames, 64, STYLES, Sampling(longest=140), generator)
    within = rows.total <= LONGEST
    assert 0 < int(within.sum()) < 64
    for add in (
        objective.add_perfect_plans,
        lambda data, rows: objective.add_plans(planned_network.planner, data, rows, 0.5, generator),
    ):
        rows.added = torch.full_like(rows.added, float("nan"))
        add(frames, rows)
        assert not rows.added[~within].any()
        assert rows.added[within].abs().amax(dim=(1, 2)).min() > 0.0


def test_plans_are_the_likeliest_or_the_posteriors(frames, rows, planned_network, generator):
    planner = planned_network.planner
    x, frame = planner(objective.ends(frames, rows))
    likeliest = planner.decode(x, frame, planner.expect(x).mean)
    planner.train()  # what dropout hides is for its own training
    objective.add_plans(planner, frames, rows, 0.0, generator)
    assert planner.training
    planner.eval()
    torch.testing.assert_close(rows.added, likeliest)
    objective.add_plans(planner, frames, rows, 1.0, generator)
    sampled = rows.added
    assert (sampled - likeliest).abs().amax(dim=(1, 2)).min() > 1e-3
    objective.add_plans(planner, frames, rows, 1.0, generator)
    assert (rows.added - sampled).abs().amax(dim=(1, 2)).min() > 1e-3
    many = draw(frames, 400, STYLES, Sampling(longest=60), generator)
    x, frame = planner(objective.ends(frames, many))
    likeliest = planner.decode(x, frame, planner.expect(x).mean)
    objective.add_plans(planner, frames, many, 0.4, generator)
    other = (many.added - likeliest).abs().amax(dim=(1, 2)) > 1e-5
    assert float(other.float().mean()) == pytest.approx(0.4, abs=0.08)


@pytest.fixture
def perfect(frames, rows):
    """The true poses at the anchors as (hips, 6-D), as a plan and as the truth, and the joints at both keys."""
    true, told = true_anchors(frames, rows), objective.ends(frames, rows)
    made = torch.cat([true.hips, true.rotations.flatten(2)], dim=-1)
    return made, true, (told.start_positions, told.target_positions)


def only(each, **wanted):
    for name, value in each.items():
        assert float(value) == pytest.approx(wanted.get(name.removeprefix("plan "), 0.0), abs=1e-5), name


def test_a_perfect_plan_costs_nothing(perfect):
    only(reconstruction(*perfect))


def test_one_anchor_too_far_costs_its_share(perfect):
    made, *rest = perfect
    made[:, 3, 0] += 0.3  # one of three axes at one of eight anchors; two of nine ways
    only(reconstruction(made, *rest), position=0.3 / 3 / ANCHORS, displacement=2 * 0.3 / 3 / (ANCHORS + 1))


def test_a_plan_as_a_whole_too_far_costs_its_ways_from_and_to_the_keys(perfect):
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


def test_the_loss_weighs_both_plans_and_their_distance(frames, rows, planned_network):
    config, drawn = Planning(1, 5, likeliest=0.5, divergence=0.01), noise(5, 8)
    planner = planned_network.planner
    total, each = objective.loss(planner, frames, rows, drawn, config)
    kinds = [objective.weighed({f"plan {n}": each[f"{kind} {n}"] for n in ("position", "rotation", "displacement")})
             for kind in ("plan", "likeliest")]  # fmt: skip
    torch.testing.assert_close(total, kinds[0] + 0.5 * kinds[1] + 0.01 * each["nats"])
    alone, fewer = objective.loss(planner, frames, rows, drawn, replace(config, likeliest=0.0))
    torch.testing.assert_close(alone, kinds[0] + 0.01 * each["nats"])
    assert not any(name.startswith("likeliest") for name in fewer)
    _, other = objective.loss(planner, frames, rows, noise(5, 8, seed=2), config)
    assert other["plan position"] != each["plan position"]
    assert other["likeliest position"] == each["likeliest position"]


def test_what_is_known_of_fixed_rows_is_known_one_by_one(rows):
    rows.path_known.fill_(1.0)
    assert not rows.start_known.any()
    assert not rows.target_known.any()


def test_a_plan_is_told_what_is_known(frames, generator):
    rows = draw(frames, 200, STYLES, Sampling(foreign_keys=0.5), generator)
    told = objective.ends(frames, rows)
    assert not told.start_velocities[rows.start_known[:, 0] == 0.0].any()
    assert not told.target_velocities[rows.target_known[:, 0] == 0.0].any()
    seen = (rows.start_known[:, 0] == 1.0) & (rows.target_known[:, 0] == 1.0)
    assert int(seen.sum()) > 5
    start, target = rows.start[seen], (rows.start + rows.total)[seen]
    leaving, arriving = (frames.positions[at] - frames.positions[at - 1] for at in (start, target + 1))
    torch.testing.assert_close(told.start_velocities[seen], 30.0 * leaving)
    torch.testing.assert_close(told.target_velocities[seen], 30.0 * arriving)
    foreign = rows.keys.foreign
    assert not rows.start_known[foreign].any()
    apart = (told.start_positions - frames.positions[rows.start]).abs().amax(dim=(1, 2))
    assert apart[foreign].max() > 0.1
    assert not apart[~foreign].any()


SMALL = replace(
    recipe.PRESETS["tiny"],
    planner=stitch_learning.CONFIG.size.plan,
    planning=Planning(2, 4),
    stages=(Stage(1, 1, 4),),
)
"""Three updates, of a planner as large as that of `stitch_learning`."""


@pytest.fixture
def trained(database, tmp_path, monkeypatch):
    """Trains so, with what else is asked for, and gives the checkpoint."""
    monkeypatch.setattr(recipe, "set_statistics", partial(recipe.set_statistics, count=64))
    monkeypatch.setattr(objective, "set_statistics", partial(objective.set_statistics, count=64))

    def train(config=SMALL, **more):
        assert recipe.train([database.path], tmp_path / "out", config=config, **more) == "finished"
        return checkpoint.load(tmp_path / "out")

    return train


def weights(saved, place):
    return {k.removeprefix(place): v for k, v in saved.items() if k.startswith(place)}


@pytest.mark.parametrize("kind", ["dcmoe", "stitch"])
def test_a_planner_is_taken_from_another_run(kind, trained, frames, stitch_network, tmp_path):
    if kind == "dcmoe":
        size = replace(SMALL.planner, styles=STYLES)
        config = replace(learning.PLANNED, planner=size)
        run = learning.write_run(tmp_path / "run", learning.network_for(frames, config=config), config)
        wanted = weights(checkpoint.load(run)["ema"], "module.planner.")
    else:
        run = stitch_learning.write_run(tmp_path / "run", stitch_network)
        wanted = weights(checkpoint.load(run)["ema"], "module.plan.")
    assert wanted
    saved = trained(plan_from=run)
    assert saved["step"] == 1  # it is not trained further
    assert saved["config"]["plan_from"] == "run"
    assert saved["config"]["planning"]["steps"] == 0
    got = weights(saved["model"], "planner.")
    assert set(got) == set(wanted)
    for name, value in wanted.items():
        assert torch.equal(got[name], value), name


def test_a_planner_that_was_taken_may_be_trained_further(trained, stitch_network, tmp_path):
    run = stitch_learning.write_run(tmp_path / "run", stitch_network)
    saved = trained(plan_from=run, plan_steps=1)
    assert saved["step"] == 2
    before, after = weights(checkpoint.load(run)["ema"], "module.plan."), weights(saved["model"], "planner.")
    apart = {name: float((after[name] - value).abs().max()) for name, value in before.items()}
    assert 0.0 < max(apart.values()) < 0.1  # from there, and not from the beginning
    assert apart["residual_std"] == 0.0


def test_the_planners_updates_may_be_counted_otherwise(trained):
    assert trained(plan_steps=0)["step"] == 1


def test_planners_that_cannot_be_taken(trained, network, stitch_network, tmp_path):
    with pytest.raises(InputError, match="nowhere: no run of 'interpose train dcmoe' or 'stitch' with a planner"):
        trained(plan_from=tmp_path / "nowhere")
    plain = learning.write_run(tmp_path / "plain", network)
    with pytest.raises(InputError, match="plain: no run of 'interpose train dcmoe' or 'stitch' with a planner"):
        trained(plan_from=plain)
    run = stitch_learning.write_run(tmp_path / "run", stitch_network)
    larger = replace(SMALL, planner=replace(SMALL.planner, hidden=48))
    with pytest.raises(InputError, match=r"the planner to start from does not fit \(.*size"):
        trained(larger, plan_from=run)
    for more in ({"plan_from": run}, {"plan_steps": 3}):
        with pytest.raises(InputError, match="preset 'tiny' has no planner"):
            trained(replace(SMALL, planner=None), **more)
    with pytest.raises(InputError, match="a training on motion that runs backwards has no planner"):
        trained(plan_from=run, backward=True)
    with pytest.raises(InputError, match="must be 0 or more, got -1"):
        trained(plan_steps=-1)
    assert not (tmp_path / "out").exists()


def test_the_step_is_compiled_where_that_is_asked_for(trained, monkeypatch):
    compiled = []
    monkeypatch.setattr(recipe.DCMoE, "compile", lambda self: compiled.append(self))
    trained(plan_steps=0, compiled=True)
    assert len(compiled) == 1
