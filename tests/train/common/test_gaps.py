"""How gaps are drawn, what is known of them, and their true motion."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch
from stitch_learning import KNOWN, drawn

from interpose.features.plan import ANCHORS
from interpose.runtime import poses
from interpose.skeleton import HUMANOID
from interpose.train.common import gaps
from interpose.train.common.gaps import EASE_FRAMES, UPPER_BODY, GapSampling, true_poses

STEPS = 18


@pytest.mark.parametrize(
    "rule", [GapSampling(), GapSampling(shortest=7, longest=30), GapSampling(skew=1.0, longest=140)]
)
def test_gaps_lie_inside_one_clip(frames, rule):
    some = drawn(frames, 3000, rule=rule)
    assert torch.all(some.start >= frames.first[some.start])
    assert torch.all(some.target <= frames.last[some.start])
    assert torch.all(frames.first[some.start] == frames.first[some.target])
    room = frames.last[some.start] - frames.first[some.start]
    assert torch.all((some.steps >= rule.shortest) & (some.steps <= torch.clamp(room, max=rule.longest)))
    assert len(set(some.steps.tolist())) > 0.9 * (rule.longest - rule.shortest)
    assert len(set(some.start.tolist())) > 250


def test_shorter_gaps_are_drawn_more_often(frames):
    shares = []
    for skew in (1.0, 1.5, 3.0):
        some = drawn(frames, 4000, rule=GapSampling(shortest=3, longest=82, skew=skew))
        shares.append(float((some.steps < 43).float().mean()))
    assert shares == pytest.approx([0.5, 0.5 ** (1 / 1.5), 0.5 ** (1 / 3.0)], abs=0.03)


@pytest.mark.parametrize("steps", [2, 30, 119, 149])
def test_gaps_of_one_length_come_from_clips_that_have_room(frames, steps):
    some = drawn(frames, 400, steps)
    assert set(some.steps.tolist()) == {steps}
    assert torch.all(some.target <= frames.last[some.start])
    room = int((frames.last - torch.arange(len(frames)) >= steps).sum())
    assert len(set(some.start.tolist())) == room if room < 20 else len(set(some.start.tolist())) > 0.4 * min(400, room)


def test_clips_shorter_than_a_gap_are_used_whole(tmp_path):
    data = learning.frames_of(learning.write_database(tmp_path / "db", lengths=(40, 2, 9)))
    some = drawn(data, 3000, rule=GapSampling(longest=60))
    assert torch.all(some.target <= data.last[some.start])
    room = data.last[some.start] - data.first[some.start]
    assert set(some.steps[room == 8].tolist()) == set(range(2, 9))
    assert set(some.steps[room == 1].tolist()) == {1}
    assert set(some.steps[room == 39].tolist()) == set(range(2, 40))


def test_shares_are_as_configured_and_the_same_again(frames):
    rule = GapSampling(path=0.25, velocity=0.4, style_dropout=0.3)
    some, same, other = (drawn(frames, 4000, rule=rule, seed=seed) for seed in (1, 1, 2))
    assert float(some.path_known.mean()) == pytest.approx(0.25, abs=0.03)
    inside = (some.start > frames.first[some.start]) & (some.target < frames.last[some.start])
    assert float(some.start_known[inside].mean()) == pytest.approx(0.4, abs=0.03)
    assert float(some.target_known[inside].mean()) == pytest.approx(0.4, abs=0.03)
    both = (some.start_known * some.target_known)[inside].mean()
    assert float(both) == pytest.approx(0.16, abs=0.03)  # each by itself
    assert torch.all(some.style.sum(dim=1) == 1.0)
    assert float(some.style[:, 0].mean()) == pytest.approx(0.3, abs=0.03)
    named = some.style[:, 0] == 0.0
    assert torch.all(some.style[named].argmax(dim=1) == frames.style[some.start[named]])
    for name in ("start", "steps", "style", "path_known", "start_known", "target_known"):
        assert torch.equal(getattr(some, name), getattr(same, name))
    assert not torch.equal(some.start, other.start)


def test_a_velocity_needs_a_frame_beyond_the_key(frames):
    some = drawn(frames, 3000, rule=replace(KNOWN, longest=140))
    assert torch.equal(some.start_known[:, 0] == 1.0, some.start > frames.first[some.start])
    assert torch.equal(some.target_known[:, 0] == 1.0, some.target < frames.last[some.start])
    assert 0.0 < float(some.start_known.mean()) < 1.0


def test_what_is_known_of_a_gap(frames):
    some = drawn(frames, 300, rule=GapSampling(path=0.5, velocity=0.5))
    known = gaps.gap_input(frames, some)
    inside = (some.start > frames.first[some.start]) & (some.target < frames.last[some.start])
    before, after = some.start - 1, some.target + 1
    for end, at, one, other in (
        ("start", some.start, some.start, before),
        ("target", some.target, after, some.target),
    ):
        assert torch.equal(getattr(known, f"{end}_hips"), frames.hips[at])
        assert torch.equal(getattr(known, f"{end}_rotations"), frames.rotations[at])
        assert torch.equal(getattr(known, f"{end}_positions"), frames.positions[at])
        flag = getattr(known, f"{end}_known")
        wanted = (frames.positions[one[inside]] - frames.positions[other[inside]]) * 30.0 * flag[inside][..., None]
        torch.testing.assert_close(getattr(known, f"{end}_velocities")[inside], wanted, atol=1e-4, rtol=0)
        assert not getattr(known, f"{end}_velocities")[flag[:, 0] == 0.0].any()
        assert 0.2 < float(flag.mean()) < 0.8
    assert torch.equal(known.steps[:, 0], some.steps.float())
    assert torch.equal(known.style, some.style)
    assert torch.equal(known.path_known, some.path_known)


def test_the_path_is_the_true_one_at_the_anchors(frames):
    whole = drawn(frames, 20, 9 * 5)
    known = gaps.gap_input(frames, whole)
    at = whole.start[:, None] + 5 * torch.arange(1, ANCHORS + 1)
    torch.testing.assert_close(known.path[..., :2], frames.hips[at][..., ::2], atol=1e-5, rtol=0)
    torch.testing.assert_close(known.path[..., 2:], frames.facing[at], atol=1e-4, rtol=0)
    facing = gaps.gap_input(frames, drawn(frames, 100)).path[..., 2:]
    torch.testing.assert_close(facing.norm(dim=-1), torch.ones(100, ANCHORS))


def test_interpolation_is_that_of_the_run_time(frames):
    some = drawn(frames, 6, STEPS)
    led = gaps.base(frames, some, (torch.arange(STEPS + 1) / STEPS).expand(6, -1))
    for row in range(6):
        ends = [
            (frames.hips[[i]].double().numpy(), frames.local[[i]].double().numpy())
            for i in (int(some.start[row]), int(some.target[row]))
        ]
        wanted = poses.interpolation(ends[0], ends[1], STEPS - 1)[0]
        np.testing.assert_allclose(led[row], wanted, atol=2e-5)


def test_evenly_spaced_gaps_know_their_keys_alone(frames):
    some = gaps.evenly(frames, 40, 12, 2)
    assert torch.all(some.target <= frames.last[some.start])
    able = torch.nonzero(frames.last - torch.arange(len(frames)) >= 40)[:, 0]
    assert (some.start[0], some.start[-1]) == (able[0], able[-1])
    ranks = torch.searchsorted(able, some.start)
    assert int(ranks.diff().max() - ranks.diff().min()) <= 1
    assert some.style.tolist() == [[1.0, 0.0, 0.0]] * 12
    assert not any(x.any() for x in (some.path_known, some.start_known, some.target_known))


def test_interpolation_and_the_residual_at_the_anchors_make_the_truth(frames):
    whole = drawn(frames, 20, 9 * 3)
    true = gaps.true_anchors(frames, whole)
    made = true.base + true.residual
    at = whole.start[:, None] + 3 * torch.arange(1, ANCHORS + 1)
    torch.testing.assert_close(made[..., :3], frames.hips[at], atol=1e-5, rtol=0)
    torch.testing.assert_close(made[..., 3:], frames.rotations[at].flatten(2), atol=1e-5, rtol=0)
    torch.testing.assert_close(true.positions, frames.positions[at], atol=1e-5, rtol=0)
    assert float(true.residual.abs().mean()) > 0.01
    # Anchors between two frames are linear between them.
    odd = drawn(frames, 5, 21)
    at = 21 / (ANCHORS + 1)
    wanted = torch.lerp(frames.hips[odd.start + 2], frames.hips[odd.start + 3], at - 2)
    torch.testing.assert_close(gaps.true_anchors(frames, odd).hips[:, 0], wanted, atol=1e-5, rtol=0)


def test_far_gaps_are_longer_than_the_longest(tmp_path):
    data = learning.frames_of(learning.write_database(tmp_path / "db", lengths=(900, 40)))
    some = drawn(data, 2000, rule=GapSampling(longest=30, far=0.3))
    room = data.last[some.start] - data.first[some.start]
    long = some.steps[room > 600]
    assert 0.2 < float((long > 30).float().mean()) < 0.35
    assert int(long.max()) > 500


MIXED = GapSampling(velocity=1.0, style_dropout=0.5, mixed_keys=1.0)


def test_mixed_style_keys_have_the_upper_body_of_another_clip(frames):
    some = drawn(frames, 200, rule=MIXED)
    assert torch.all(some.mixed)
    assert not any(known.any() for known in (some.start_known, some.target_known))
    assert torch.all(some.style.argmax(dim=1) == frames.style[some.start])  # their label is never dropped
    for at, local in ((some.start, some.start_local), (some.target, some.target_local)):
        own = frames.local[at]
        assert torch.equal(local[:, : UPPER_BODY.start], own[:, : UPPER_BODY.start])
        apart = (local[:, UPPER_BODY] - own[:, UPPER_BODY]).abs().amax(dim=(1, 2))
        assert float(apart.median()) > 0.1
        torch.testing.assert_close(local.norm(dim=-1), torch.ones(200, 22))
    assert [HUMANOID.names[j] for j in range(UPPER_BODY.start)] == [
        *("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToe", "RightUpLeg", "RightLeg", "RightFoot", "RightToe")
    ]


def test_the_other_gaps_keep_their_keys(frames):
    some = drawn(frames, 2000, rule=replace(MIXED, mixed_keys=0.5))
    assert float(some.mixed.float().mean()) == pytest.approx(0.5, abs=0.04)
    plain = ~some.mixed
    assert torch.equal(some.start_local[plain], frames.local[some.start[plain]])
    assert torch.equal(some.target_local[plain], frames.local[some.target[plain]])
    assert some.start_known[plain].any()
    unlabelled = replace(frames, style=torch.zeros_like(frames.style))
    assert not drawn(unlabelled, 50, rule=MIXED).mixed.any()


def test_mixed_style_keys_ease_into_the_data_and_out_of_it(frames):
    some = drawn(frames, 300, rule=MIXED)
    every = torch.arange(92).expand(300, -1)
    turned, placed = true_poses(frames, some, every)
    last = some.steps
    for at, frame, local in (
        (last, some.target, some.target_local),
        (torch.zeros_like(last), some.start, some.start_local),
    ):
        wanted = poses.pose_of(*(x.double().numpy() for x in (frames.hips[frame], local)))
        np.testing.assert_allclose(placed[torch.arange(300), at], wanted.positions, atol=1e-5)
        np.testing.assert_allclose(turned[torch.arange(300), at], wanted.rotations, atol=1e-5)
    true = frames.positions[some.start[:, None] + torch.minimum(every, last[:, None])]
    inside = (every >= EASE_FRAMES) & (every <= last[:, None] - EASE_FRAMES)
    assert inside.any()
    torch.testing.assert_close(placed[inside], true[inside], atol=1e-5, rtol=0)
    legs = slice(0, UPPER_BODY.start)
    torch.testing.assert_close(placed[:, :, legs], true[:, :, legs], atol=1e-5, rtol=0)
    steps = (placed - true).diff(dim=1).norm(dim=-1).amax(dim=2)
    assert float(steps[last > 30].max()) < 0.25  # metres a frame that the easing adds at most, no jump


def test_parts_and_replacements_are_of_whole_rows(frames):
    some, other = drawn(frames, 6, seed=1), drawn(frames, 2, rule=MIXED, seed=2)
    made = some.replaced(torch.tensor([4, 1]), other)
    assert made.mixed.tolist() == [False, True, False, False, True, False]
    for row in range(6):
        source, at = (other, {4: 0, 1: 1}[row]) if row in (1, 4) else (some, row)
        for name in ("start", "steps", "style", "target_local"):
            assert torch.equal(getattr(made, name)[row], getattr(source, name)[at])
    assert torch.equal(made.part(slice(1, 3)).start, made.start[1:3])
    assert len(made.part(slice(1, 3))) == 2
