"""How training draws its rows, and that it shows the network what the run time will show it."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose import rotation
from interpose.data import root
from interpose.features import HISTORY, KEY_STEP, RATE, SIDE_KEYS
from interpose.models.geometry import facing, root_frame, to_matrix
from interpose.runtime import poses as batched
from interpose.runtime.backends import dcmoe
from interpose.skeleton import HUMANOID, MIRROR
from interpose.train.common.frames import load_frames
from interpose.train.dcmoe.sequences import (
    EASE,
    UPPER,
    Sampling,
    base_window,
    draw,
    fresh_state,
    poses,
    replace_rows,
)

CLEAN = Sampling(rotation_noise=0.0, hips_noise=0.0)


def drawn(frames, count=64, rule=CLEAN, seed=0):
    return draw(frames, count, len(learning.STYLES), rule, torch.Generator().manual_seed(seed))


def test_frames_are_the_databases(database, frames):
    assert len(frames) == 2 * database.frames
    for clip, (start, stop) in enumerate(database.ranges):
        motion = database.clip(clip)
        np.testing.assert_allclose(frames.positions[start:stop], motion.global_positions(), atol=1e-6)
        np.testing.assert_allclose(frames.rotations[start:stop], rotation.to_6d(motion.global_rotations()), atol=1e-6)
        yaw = root.pose_yaw(motion.global_rotations()[:, 0])
        np.testing.assert_allclose(frames.facing[start:stop], np.stack([np.sin(yaw), np.cos(yaw)], -1), atol=1e-6)
        assert set(frames.style[start:stop].tolist()) == {1 + clip % 2}
        assert set(frames.first[start:stop].tolist()) == {start}
        assert set(frames.last[start:stop].tolist()) == {stop - 1}
        np.testing.assert_allclose(frames.local[start:stop], motion.local_rotations, atol=1e-6)
    np.testing.assert_array_equal(frames.contacts[: database.frames], database.contacts)
    np.testing.assert_array_equal(frames.phases[: database.frames], learning.phases_of(database)[0])


def test_mirrored_copies_follow_and_are_mirrored_throughout(database, frames):
    count = database.frames
    flip = torch.tensor([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(frames.positions[count:], frames.positions[:count][:, MIRROR] * flip, atol=1e-6)
    np.testing.assert_allclose(frames.hips[count:], frames.hips[:count] * flip, atol=1e-6)
    np.testing.assert_allclose(frames.facing[count:], frames.facing[:count] * flip[:2], atol=1e-6)
    plain, turned = to_matrix(frames.rotations[:count]), to_matrix(frames.rotations[count:])
    reflect = torch.diag(torch.tensor([-1.0, 1.0, 1.0]))
    torch.testing.assert_close(turned, reflect @ plain[:, MIRROR] @ reflect, atol=1e-5, rtol=0)
    swapped = [["LeftFoot", "LeftToe", "RightFoot", "RightToe"].index(n) for n in _other_side()]
    torch.testing.assert_close(frames.contacts[count:], frames.contacts[:count][:, swapped])
    np.testing.assert_array_equal(frames.phases[count:], learning.phases_of(database)[1])
    torch.testing.assert_close(frames.style[count:], frames.style[:count])
    torch.testing.assert_close(frames.first[count:], frames.first[:count] + count)


def _other_side():
    return [HUMANOID.names[MIRROR[HUMANOID.index(n)]] for n in ("LeftFoot", "LeftToe", "RightFoot", "RightToe")]


def test_unlisted_styles_are_free_and_missing_phases_zero(database):
    made = load_frames(database, None, ["Young"], [(10, 60), (150, 240)])
    assert len(made) == 2 * (50 + 90)
    assert made.style[:50].tolist() == [0] * 50
    assert made.style[50:140].tolist() == [1] * 90
    assert not made.phases.any()
    assert made.first[55] == 50


@pytest.mark.parametrize("rule", [Sampling(), Sampling(longest=20)])
def test_rows_lie_inside_one_clip(frames, rule):
    rows = drawn(frames, 3000, rule)
    assert torch.all(rows.start >= frames.first[rows.start])
    assert torch.all(rows.start + rows.total <= frames.last[rows.start])
    assert torch.all((rows.total >= 2) & (rows.total <= rule.longest))
    assert torch.all((rows.gone >= 0) & (rows.gone <= rows.total - 2))
    assert len(set(rows.total.tolist())) >= rule.longest - 3
    short = float((rows.total <= (rule.longest + 1) // 2).float().mean())
    assert 0.7 < short < 0.85  # half are drawn short, and half of the others come out so


def test_clips_shorter_than_a_gap_are_used_whole(tmp_path):
    data = learning.frames_of(learning.write_database(tmp_path / "db", lengths=(150, 2, 9)))
    rows = drawn(data, 2000)
    assert torch.all(rows.start + rows.total <= data.last[rows.start])
    assert {1, 8} <= set(rows.total[data.last[rows.start] - data.first[rows.start] < 10].tolist())


def test_shares_are_as_configured(frames):
    rule = Sampling(path=0.25, style_dropout=0.4, phase_known_at_start=0.2)
    rows = drawn(frames, 4000, rule)
    at_start = rows.gone == 0
    lone = at_start & (rows.state.velocity_known[:, 0] == 0.0)
    assert float(lone.float().mean()) == pytest.approx(0.5, abs=0.04)
    assert float(rows.path_known.mean()) == pytest.approx(0.25, abs=0.03)
    assert torch.all(rows.style.sum(dim=1) == 1.0)
    assert float(rows.style[:, 0].mean()) == pytest.approx(0.4, abs=0.03)
    named = rows.style[:, 0] == 0.0
    assert torch.all(rows.style[named].argmax(dim=1) == frames.style[rows.start[named]])
    known = rows.state.phase_future.flatten(1).abs().sum(dim=1) > 0.0
    assert float(known[lone].float().mean()) == pytest.approx(0.2, abs=0.04)
    assert float(known[rows.gone > 0].float().mean()) == pytest.approx(0.7, abs=0.04)


def test_the_same_generator_gives_the_same_rows(frames):
    one, same, other = drawn(frames, seed=7), drawn(frames, seed=7), drawn(frames, seed=8)
    torch.testing.assert_close(one.state, same.state, atol=0, rtol=0)
    assert torch.equal(one.start, same.start)
    assert not torch.equal(one.start, other.start)


def test_a_lone_start_stands_still_with_its_flag_down(frames):
    rows = drawn(frames, 200, Sampling(lone_start=1.0, context_start=0.0))
    state = rows.state
    assert not rows.gone.any()
    assert not state.velocity_known.any()
    assert not state.velocities.any()
    torch.testing.assert_close(state.hips, frames.hips[rows.start], atol=0, rtol=0)
    here = torch.cat([frames.hips[rows.start][:, ::2], frames.facing[rows.start]], dim=-1)
    torch.testing.assert_close(state.track, here[:, None].expand(-1, HISTORY + 1, -1), atol=0, rtol=0)
    assert not state.phase_past[:, :-1].any()


def test_a_context_is_known_for_ten_frames_and_clamped_before(frames):
    rows = drawn(frames, 300, replace(CLEAN, lone_start=0.0, context_start=1.0, phase_known_at_start=1.0))
    deep = torch.nonzero(rows.start - frames.first[rows.start] >= 10)[:, 0]
    at = rows.start[deep]
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
    rows = drawn(frames, 500, Sampling(rotation_noise=0.05, hips_noise=0.02))
    away = (rows.state.hips - frames.hips[rows.start + rows.gone]).norm(dim=-1)
    turned = (rows.state.rotations - frames.rotations[rows.start + rows.gone]).abs().amax(dim=(1, 2))
    inside = rows.gone > 0
    assert float(away[inside].median()) == pytest.approx(0.015, rel=0.5)
    assert float(turned[inside].median()) > 0.02
    matrices = to_matrix(rows.state.rotations)
    torch.testing.assert_close(matrices @ matrices.mT, torch.eye(3).expand_as(matrices), atol=1e-5, rtol=0)
    context = drawn(frames, 100, Sampling(lone_start=0.5, context_start=0.5))
    torch.testing.assert_close(context.state.hips, frames.hips[context.start], atol=0, rtol=0)


@pytest.mark.parametrize("known", [1, 2, 10])
@pytest.mark.parametrize("with_phases", [False, True])
def test_training_starts_where_the_run_time_starts(database, frames, known, with_phases):
    """The key of both: the same frames give the same state, phases at the window's keys included."""
    now = torch.tensor([40, 75, 190, 300])
    matrices = to_matrix(frames.rotations[now])
    steady = replace(frames, phases=torch.arange(len(frames))[:, None, None] * torch.linspace(0.1, 1.0, 30).view(10, 3))
    told = torch.full((4,), with_phases)
    before = frames.positions[now - min(known - 1, 1)]
    wanted = fresh_state(steady, now, now - known + 1, frames.hips[now], matrices, before, told)

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
    target = rows.start + rows.total
    torch.testing.assert_close(base[-1, :, :3], frames.hips[target], atol=1e-6, rtol=0)
    torch.testing.assert_close(base[-1, :, 3:], frames.rotations[target].flatten(1), atol=1e-5, rtol=0)
    for row in range(12):
        start, total = int(rows.start[row]), int(rows.total[row])
        ends = [(frames.hips[[i]].double().numpy(), frames.local[[i]].double().numpy()) for i in (start, start + total)]
        wanted = batched.interpolation(ends[0], ends[1], total - 1)[0]
        np.testing.assert_allclose(base[: total + 1, row], wanted, atol=2e-5)
    rows.gone = rows.total - 2
    late = base_window(frames, rows, 4)
    for row in range(12):
        torch.testing.assert_close(late[0, row], base[int(rows.gone[row]), row])
    torch.testing.assert_close(late[2:], late[2].expand(3, -1, -1))


def test_the_truth_of_a_step_is_the_next_frame(frames):
    rows = drawn(frames, 200)
    now = rows.start + rows.gone
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
        inside = now + 1 + KEY_STEP * key <= rows.start + rows.total
        torch.testing.assert_close(real.within[:, key], inside.float())


def test_the_step_into_the_target_is_not_learned(frames):
    rows = drawn(frames, 20)
    frame, origin = torch.eye(3).expand(20, 3, 3), torch.zeros(20, 3)
    for left, alive in ((2, 1.0), (1, 0.0), (0, 0.0)):
        rows.gone = rows.total - left
        assert set(learning.coming(frames, rows, frame, origin).alive.tolist()) == {alive}


def test_what_steers_is_the_target_and_the_true_path(frames):
    rows = drawn(frames, 100)
    steer = learning.steering(frames, rows)
    target, now = rows.start + rows.total, rows.start + rows.gone
    torch.testing.assert_close(steer.target_positions, frames.positions[target])
    torch.testing.assert_close(steer.frames_left[:, 0], (rows.total - rows.gone).float())
    for key in range(SIDE_KEYS):
        ahead = torch.minimum(now + KEY_STEP * (key + 1), target)
        torch.testing.assert_close(steer.path[:, key, :2], frames.hips[ahead][:, ::2])
        torch.testing.assert_close(steer.path[:, key, 2:4], frames.facing[ahead])
        step = (frames.hips[ahead] - frames.hips[ahead - 1])[:, ::2] * RATE
        torch.testing.assert_close(steer.path[:, key, 4:], step)
    rows.gone = rows.total.clone()
    assert torch.all(learning.steering(frames, rows).frames_left == 1.0)


def test_fresh_rows_take_the_places_of_others(frames):
    rows, fresh = drawn(frames, 6, seed=1), drawn(frames, 2, FOREIGN, seed=2)
    before = drawn(frames, 6, seed=1)
    replace_rows(rows, fresh, torch.tensor([4, 1]))
    assert rows.keys.foreign.tolist() == [False, True, False, False, True, False]
    for row in range(6):
        source, at = (fresh, {4: 0, 1: 1}[row]) if row in (1, 4) else (before, row)
        assert rows.start[row] == source.start[at]
        assert torch.equal(rows.style[row], source.style[at])
        assert torch.equal(rows.keys.target_local[row], source.keys.target_local[at])
        for field in rows.state._fields:
            assert torch.equal(getattr(rows.state, field)[row], getattr(source.state, field)[at])


FOREIGN = replace(CLEAN, lone_start=1.0, context_start=0.0, foreign_keys=1.0)


def test_foreign_keys_have_somebody_elses_upper_body_only(frames):
    rows = drawn(frames, 200, FOREIGN)
    assert torch.all(rows.keys.foreign)
    for at, local in ((rows.start, rows.keys.start_local), (rows.start + rows.total, rows.keys.target_local)):
        own = frames.local[at]
        assert torch.equal(local[:, : UPPER.start], own[:, : UPPER.start])
        apart = (local[:, UPPER] - own[:, UPPER]).abs().amax(dim=(1, 2))
        assert float(apart.median()) > 0.1
        torch.testing.assert_close(local.norm(dim=-1), torch.ones(200, 22))
    assert [HUMANOID.names[j] for j in range(UPPER.start)] == [
        *("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe", "RightUpLeg", "RightLeg", "RightFoot", "RightToe")
    ]


def test_foreign_keys_tell_their_style_and_never_come_with_a_context(frames):
    rows = drawn(frames, 2000, replace(Sampling(), foreign_keys=0.5))
    foreign = rows.keys.foreign
    assert float(foreign.float().mean()) == pytest.approx(0.5 * 0.85, abs=0.04)
    assert torch.all(rows.style[foreign].argmax(dim=1) == frames.style[rows.start[foreign]])
    context = (rows.gone == 0) & (rows.state.velocity_known[:, 0] == 1.0) & ~foreign
    assert context.any()
    plain = ~foreign
    assert torch.equal(rows.keys.start_local[plain], frames.local[rows.start[plain]])
    assert torch.equal(rows.keys.target_local[plain], frames.local[(rows.start + rows.total)[plain]])


def test_foreign_keys_ease_into_the_style_and_out_of_it(frames):
    rows = drawn(frames, 300, FOREIGN)
    every = torch.arange(92).expand(300, -1)
    turned, placed = poses(frames, rows.start, rows.total, rows.keys, every)
    last = rows.total
    ends = batched.pose_of(*(x.double().numpy() for x in (frames.hips[rows.start + last], rows.keys.target_local)))
    np.testing.assert_allclose(placed[torch.arange(300), last], ends.positions, atol=1e-5)
    np.testing.assert_allclose(turned[torch.arange(300), last], ends.rotations, atol=1e-5)
    begun = batched.pose_of(*(x.double().numpy() for x in (frames.hips[rows.start], rows.keys.start_local)))
    np.testing.assert_allclose(placed[:, 0], begun.positions, atol=1e-5)
    np.testing.assert_allclose(rows.state.positions, begun.positions, atol=1e-5)
    true = frames.positions[rows.start[:, None] + torch.minimum(every, last[:, None])]
    inside = (every >= EASE) & (every <= last[:, None] - EASE)
    assert inside.any()
    torch.testing.assert_close(placed[inside], true[inside], atol=1e-5, rtol=0)
    legs = slice(0, UPPER.start)
    torch.testing.assert_close(placed[:, :, legs], true[:, :, legs], atol=1e-5, rtol=0)
    steps = (placed - true).diff(dim=1).norm(dim=-1).amax(dim=2)
    assert float(steps[last > 30].max()) < 0.25  # metres a frame that the change of hands adds at most, no jump


def test_foreign_rows_are_of_one_piece(frames):
    """Base, target and truth of a row agree at its end."""
    rows = drawn(frames, 50, FOREIGN)
    steer = learning.steering(frames, rows)
    base = base_window(frames, rows, 91)
    torch.testing.assert_close(base[-1, :, 3:], steer.target_rotations.flatten(1), atol=1e-5, rtol=0)
    torch.testing.assert_close(base[0, :, 3:], rows.state.rotations.flatten(1), atol=1e-5, rtol=0)
    rows.gone = rows.total - 1
    real = learning.coming(frames, rows, torch.eye(3).expand(50, 3, 3), torch.zeros(50, 3))
    torch.testing.assert_close(real.positions, steer.target_positions)
