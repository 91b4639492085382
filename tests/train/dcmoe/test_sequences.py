"""How training draws its rows, and that it shows the network what the run time will show it."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose.features import HISTORY, KEY_STEP, RATE, SIDE_KEYS
from interpose.models.geometry import facing, root_frame, to_matrix
from interpose.runtime import poses as batched
from interpose.runtime.backends import dcmoe
from interpose.train.common.gaps import GapSampling
from interpose.train.dcmoe.sequences import RollOutSampling, Rows, at_lone_start, base_window, draw, fresh_state
from interpose.train.planner.objective import perfect_plans

CLEAN = RollOutSampling(rotation_noise=0.0, hips_noise=0.0)


def gaps(**changes) -> GapSampling:
    return replace(CLEAN.gaps, **changes)


def at_start(velocity: float, **changes) -> RollOutSampling:
    """Rows at the starts of their gaps."""
    return replace(CLEAN, inside=0.0, gaps=gaps(velocity=velocity, **changes))


def drawn(frames, count=64, rule=CLEAN, seed=0):
    return draw(frames, count, len(learning.STYLES), rule, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("rule", [RollOutSampling(), RollOutSampling(gaps=GapSampling(longest=20))])
def test_rows_lie_inside_one_clip(frames, rule):
    rows = drawn(frames, 3000, rule)
    assert torch.all(rows.gaps.start >= frames.first[rows.gaps.start])
    assert torch.all(rows.gaps.target <= frames.last[rows.gaps.start])
    assert torch.all((rows.gaps.steps >= 2) & (rows.gaps.steps <= rule.gaps.longest))
    assert torch.all((rows.gone >= 0) & (rows.gone <= rows.gaps.steps - 2))
    assert len(set(rows.gaps.steps.tolist())) >= rule.gaps.longest - 3
    short = float((rows.gaps.steps <= (rule.gaps.longest + 1) // 2).float().mean())
    assert short == pytest.approx(0.5 ** (1 / 1.5), abs=0.05)


def test_shares_are_as_configured(frames):
    rule = RollOutSampling(gaps(path=0.25, velocity=0.5, style_dropout=0.4), phase_known_at_start=0.2)
    rows = drawn(frames, 4000, rule)
    inside = rows.gone > 0
    assert float(inside.float().mean()) == pytest.approx(0.35, abs=0.04)
    lone = (rows.gone == 0) & (rows.state.velocity_known[:, 0] == 0.0)
    assert float(rows.gaps.path_known.mean()) == pytest.approx(0.25, abs=0.03)
    assert torch.all(rows.gaps.style.sum(dim=1) == 1.0)
    assert float(rows.gaps.style[:, 0].mean()) == pytest.approx(0.4, abs=0.03)
    named = rows.gaps.style[:, 0] == 0.0
    assert torch.all(rows.gaps.style[named].argmax(dim=1) == frames.style[rows.gaps.start[named]])
    known = rows.state.phase_future.flatten(1).abs().sum(dim=1) > 0.0
    assert float(known[lone].float().mean()) == pytest.approx(0.2, abs=0.04)
    assert float(known[rows.gone > 0].float().mean()) == pytest.approx(0.7, abs=0.04)


def test_the_same_generator_gives_the_same_rows(frames):
    one, same, other = drawn(frames, seed=7), drawn(frames, seed=7), drawn(frames, seed=8)
    torch.testing.assert_close(one.state, same.state, atol=0, rtol=0)
    assert torch.equal(one.gaps.start, same.gaps.start)
    assert not torch.equal(one.gaps.start, other.gaps.start)


def test_a_lone_start_stands_still_with_its_flag_down(frames):
    rows = drawn(frames, 200, at_start(0.0))
    state = rows.state
    assert not rows.gone.any()
    assert not state.velocity_known.any()
    assert not state.velocities.any()
    torch.testing.assert_close(state.hips, frames.hips[rows.gaps.start], atol=0, rtol=0)
    here = torch.cat([frames.hips[rows.gaps.start][:, ::2], frames.facing[rows.gaps.start]], dim=-1)
    torch.testing.assert_close(state.track, here[:, None].expand(-1, HISTORY + 1, -1), atol=0, rtol=0)
    assert not state.phase_past[:, :-1].any()


def test_a_context_is_known_for_ten_frames_and_clamped_before(frames):
    rows = drawn(frames, 300, replace(at_start(1.0), phase_known_at_start=1.0))
    deep = torch.nonzero(rows.gaps.start - frames.first[rows.gaps.start] >= 10)[:, 0]
    at = rows.gaps.start[deep]
    state = type(rows.state)(*(x[deep] for x in rows.state))
    assert len(deep) > 100
    assert torch.all(state.velocity_known == 1.0)
    for back in range(HISTORY + 1):
        torch.testing.assert_close(state.track[:, -1 - back, :2], frames.hips[at - min(back, 10)][:, ::2])
    velocity = (frames.positions[at] - frames.positions[at - 1]) * RATE
    torch.testing.assert_close(state.velocities, velocity, atol=1e-4, rtol=0)
    torch.testing.assert_close(
        state.phase_past[:, -11:], torch.stack([frames.phases[at - 10 + i] for i in range(11)], 1)[..., :2]
    )
    assert not state.phase_past[:, :-11].any()


def test_noise_is_for_rows_on_their_way(frames):
    rows = drawn(frames, 500, RollOutSampling(inside=0.8, rotation_noise=0.05, hips_noise=0.02))
    away = (rows.state.hips - frames.hips[rows.gaps.start + rows.gone]).norm(dim=-1)
    turned = (rows.state.rotations - frames.rotations[rows.gaps.start + rows.gone]).abs().amax(dim=(1, 2))
    inside = rows.gone > 0
    assert float(away[inside].median()) == pytest.approx(0.015, rel=0.5)
    assert float(turned[inside].median()) > 0.02
    matrices = to_matrix(rows.state.rotations)
    torch.testing.assert_close(matrices @ matrices.mT, torch.eye(3).expand_as(matrices), atol=1e-5, rtol=0)
    at_starts = drawn(frames, 100, RollOutSampling(inside=0.0))
    torch.testing.assert_close(at_starts.state.hips, frames.hips[at_starts.gaps.start], atol=0, rtol=0)


@pytest.mark.parametrize("known", [1, 2, 10])
@pytest.mark.parametrize("with_phases", [False, True])
def test_training_starts_where_the_run_time_starts(database, frames, known, with_phases):
    """The key of both: the same frames give the same state, phases at the window's keys included."""
    now = torch.tensor([40, 75, 190, 300])
    matrices = to_matrix(frames.rotations[now])
    steady = replace(frames, phases=torch.arange(len(frames))[:, None, None] * torch.linspace(0.1, 1.0, 30).view(10, 3))
    known_phase = torch.full((4,), with_phases)
    before = frames.positions[now - min(known - 1, 1)]
    wanted = fresh_state(steady, now, now - known + 1, frames.hips[now], matrices, before, known_phase)

    local = torch.stack([frames.local[now - known + 1 + i] for i in range(known)], dim=1).double().numpy()
    hips = torch.stack([frames.hips[now - known + 1 + i] for i in range(known)], dim=1).double().numpy()
    keys = KEY_STEP * torch.arange(-SIDE_KEYS, SIDE_KEYS + 1)
    phases = steady.phases[now[:, None] + keys][..., :2].double().numpy() * with_phases
    got = dcmoe.initial_state(batched.pose_of(hips, local), phases)

    assert set(got) == set(wanted._fields)
    for name, value in wanted._asdict().items():
        np.testing.assert_allclose(got[name], value, atol=1e-4, err_msg=name)
    assert got["phase_past"].any() == with_phases


def test_the_base_is_that_of_the_run_time_and_ends_at_the_target(frames):
    rows = drawn(frames, 12)
    rows.gone = torch.zeros_like(rows.gone)
    base = base_window(frames, rows, 95)
    target = rows.gaps.target
    torch.testing.assert_close(base[-1, :, :3], frames.hips[target], atol=1e-6, rtol=0)
    torch.testing.assert_close(base[-1, :, 3:], frames.rotations[target].flatten(1), atol=1e-5, rtol=0)
    for row in range(12):
        start, total = int(rows.gaps.start[row]), int(rows.gaps.steps[row])
        ends = [(frames.hips[[i]].double().numpy(), frames.local[[i]].double().numpy()) for i in (start, start + total)]
        wanted = batched.interpolation(ends[0], ends[1], total - 1)[0]
        np.testing.assert_allclose(base[: total + 1, row], wanted, atol=2e-5)
    rows.gone = rows.gaps.steps - 2
    late = base_window(frames, rows, 4)
    for row in range(12):
        torch.testing.assert_close(late[0, row], base[int(rows.gone[row]), row])
    torch.testing.assert_close(late[2:], late[2].expand(3, -1, -1))


def test_the_truth_of_a_step_is_the_next_frame(frames):
    rows = drawn(frames, 200)
    now = rows.gaps.start + rows.gone
    origin = rows.state.hips * torch.tensor([1.0, 0.0, 1.0])
    frame = root_frame(facing(to_matrix(rows.state.rotations[:, 0])))
    real = learning.coming(frames, rows, frame, origin)
    torch.testing.assert_close(real.positions @ frame.mT + origin[:, None], frames.positions[now + 1])
    moved = (frames.positions[now + 1] - frames.positions[now]) * RATE
    torch.testing.assert_close(real.velocities @ frame.mT, moved, atol=1e-4, rtol=0)
    columns = real.rotations.reshape(200, 22, 2, 3) @ frame.mT[:, None]
    torch.testing.assert_close(columns.flatten(2), frames.rotations[now + 1])
    assert torch.all(real.alive == 1.0)
    for key in range(SIDE_KEYS + 1):
        ahead = torch.minimum(now + 1 + KEY_STEP * key, frames.last[now])
        torch.testing.assert_close(real.contacts[:, key], frames.contacts[ahead])
        torch.testing.assert_close(real.phases[:, key], frames.phases[ahead])
        there = real.trajectory[:, key, None, :2] @ frame[:, ::2, ::2].mT + origin[:, None, ::2]
        torch.testing.assert_close(there[:, 0], frames.hips[ahead][:, ::2])
        inside = now + 1 + KEY_STEP * key <= rows.gaps.target
        torch.testing.assert_close(real.within[:, key], inside.float())


def test_the_step_into_the_target_is_not_learned(frames):
    rows = drawn(frames, 20)
    frame, origin = torch.eye(3).expand(20, 3, 3), torch.zeros(20, 3)
    for left, alive in ((2, 1.0), (1, 0.0), (0, 0.0)):
        rows.gone = rows.gaps.steps - left
        assert set(learning.coming(frames, rows, frame, origin).alive.tolist()) == {alive}


def test_what_steers_is_the_target_and_the_true_path(frames):
    rows = drawn(frames, 100)
    steer = learning.steering(frames, rows)
    target, now = rows.gaps.target, rows.gaps.start + rows.gone
    torch.testing.assert_close(steer.target_positions, frames.positions[target])
    torch.testing.assert_close(steer.frames_left[:, 0], (rows.gaps.steps - rows.gone).float())
    for key in range(SIDE_KEYS):
        ahead = torch.minimum(now + KEY_STEP * (key + 1), target)
        torch.testing.assert_close(steer.path[:, key, :2], frames.hips[ahead][:, ::2])
        torch.testing.assert_close(steer.path[:, key, 2:4], frames.facing[ahead])
        step = (frames.hips[ahead] - frames.hips[ahead - 1])[:, ::2] * RATE
        torch.testing.assert_close(steer.path[:, key, 4:], step)
    rows.gone = rows.gaps.steps.clone()
    assert torch.all(learning.steering(frames, rows).frames_left == 1.0)


def test_fresh_rows_take_the_places_of_others(frames):
    rows, fresh = drawn(frames, 6, seed=1), drawn(frames, 2, MIXED, seed=2)
    rows.plan, fresh.plan = (perfect_plans(frames, each.gaps) for each in (rows, fresh))
    made = rows.replaced(torch.tensor([4, 1]), fresh)
    assert made.gaps.mixed.tolist() == [False, True, False, False, True, False]
    for row in range(6):
        source, at = (fresh, {4: 0, 1: 1}[row]) if row in (1, 4) else (rows, row)
        assert made.gaps.start[row] == source.gaps.start[at]
        assert made.gone[row] == source.gone[at]
        assert torch.equal(made.plan[row], source.plan[at])
        for field in made.state._fields:
            assert torch.equal(getattr(made.state, field)[row], getattr(source.state, field)[at])


def test_a_part_is_of_the_same_rows(frames):
    rows = drawn(frames, 6)
    rows.plan = perfect_plans(frames, rows.gaps)
    part = rows.part(slice(2, 4))
    assert isinstance(part, Rows)
    assert len(part) == 2
    assert torch.equal(part.gone, rows.gone[2:4])
    assert torch.equal(part.plan, rows.plan[2:4])
    assert torch.equal(part.state.hips, rows.state.hips[2:4])
    assert Rows(rows.gaps, rows.gone, rows.state).part(slice(0, 1)).plan is None


def test_the_base_follows_the_plan(frames):
    rows = drawn(frames, 12, replace(CLEAN, gaps=gaps(path=0.0)))
    plain = base_window(frames, rows, 3)
    rows.plan = perfect_plans(frames, rows.gaps)
    planned = base_window(frames, rows, 3)
    at = torch.minimum(rows.gone[:, None] + torch.arange(4), rows.gaps.steps[:, None])
    true = frames.hips[rows.gaps.start[:, None] + at].transpose(0, 1)
    assert float((planned[..., :3] - true).norm(dim=-1).mean()) < 0.5 * float(
        (plain[..., :3] - true).norm(dim=-1).mean()
    )


def test_a_lone_start_knows_neither_past_nor_phases(frames):
    some = drawn(frames, 20).gaps
    rows = at_lone_start(frames, some)
    assert not rows.gone.any()
    assert not rows.state.velocity_known.any()
    assert not rows.state.phase_future.any()
    torch.testing.assert_close(rows.state.hips, frames.hips[some.start], atol=0, rtol=0)
    torch.testing.assert_close(rows.state.positions, frames.positions[some.start], atol=1e-5, rtol=0)


MIXED = at_start(0.0, mixed_keys=1.0)


def test_mixed_style_keys_begin_as_they_are_and_never_come_with_a_context(frames):
    rows = drawn(frames, 500, replace(at_start(1.0), gaps=gaps(velocity=1.0, mixed_keys=0.5)))
    mixed = rows.gaps.mixed
    assert 0.3 < float(mixed.float().mean()) < 0.7
    assert not rows.state.velocity_known[mixed].any()
    assert rows.state.velocity_known[~mixed].any()
    keys = frames.hips[rows.gaps.start], rows.gaps.start_local
    begun = batched.pose_of(*(x.double().numpy() for x in keys))
    np.testing.assert_allclose(rows.state.positions, begun.positions, atol=1e-5)


def test_base_target_and_truth_of_mixed_rows_agree(frames):
    """At the gap's end."""
    rows = drawn(frames, 50, MIXED)
    steer = learning.steering(frames, rows)
    base = base_window(frames, rows, 91)
    torch.testing.assert_close(base[-1, :, 3:], steer.target_rotations.flatten(1), atol=1e-5, rtol=0)
    torch.testing.assert_close(base[0, :, 3:], rows.state.rotations.flatten(1), atol=1e-5, rtol=0)
    rows.gone = rows.gaps.steps - 1
    real = learning.coming(frames, rows, torch.eye(3).expand(50, 3, 3), torch.zeros(50, 3))
    torch.testing.assert_close(real.positions, steer.target_positions)
