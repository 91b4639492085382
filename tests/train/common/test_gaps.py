"""How whole gaps are drawn, what is told of them, and the paper's form of their motion."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch
from stitch_learning import KNOWN, drawn

from interpose import skeleton
from interpose.data.contacts import CONTACT_INDICES as FEET
from interpose.features import RATE
from interpose.features.stitch import ANCHORS, STANDING
from interpose.models.geometry import root_frame, to_matrix
from interpose.runtime import poses
from interpose.skeleton import HUMANOID
from interpose.train.common import gaps
from interpose.train.common.gaps import Sampling

STEPS = 18


@pytest.fixture(scope="module")
def mean(frames):
    return gaps.mean_quaternions(frames)


@pytest.mark.parametrize("rule", [Sampling(), Sampling(shortest=7, longest=30), Sampling(longer=1.0, longest=140)])
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
    for longer in (1.0, 1.5, 3.0):
        some = drawn(frames, 4000, rule=Sampling(shortest=3, longest=82, longer=longer))
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
    some = drawn(data, 3000, rule=Sampling(longest=60))
    assert torch.all(some.target <= data.last[some.start])
    room = data.last[some.start] - data.first[some.start]
    assert set(some.steps[room == 8].tolist()) == set(range(3, 9))
    assert set(some.steps[room == 1].tolist()) == {1}
    assert set(some.steps[room == 39].tolist()) == set(range(3, 40))


def test_shares_are_as_configured_and_the_same_again(frames):
    rule = Sampling(path=0.25, velocity=0.4, style_dropout=0.3)
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


def test_what_is_told_of_a_gap(frames):
    some = drawn(frames, 300, rule=Sampling(path=0.5, velocity=0.5))
    told = gaps.ends(frames, some)
    inside = (some.start > frames.first[some.start]) & (some.target < frames.last[some.start])
    before, after = some.start - 1, some.target + 1
    for end, at, one, other in (
        ("start", some.start, some.start, before),
        ("target", some.target, after, some.target),
    ):
        assert torch.equal(getattr(told, f"{end}_hips"), frames.hips[at])
        assert torch.equal(getattr(told, f"{end}_rotations"), frames.rotations[at])
        assert torch.equal(getattr(told, f"{end}_positions"), frames.positions[at])
        known = getattr(told, f"{end}_known")
        wanted = (frames.positions[one[inside]] - frames.positions[other[inside]]) * 30.0 * known[inside][..., None]
        torch.testing.assert_close(getattr(told, f"{end}_velocities")[inside], wanted, atol=1e-4, rtol=0)
        assert not getattr(told, f"{end}_velocities")[known[:, 0] == 0.0].any()
        assert 0.2 < float(known.mean()) < 0.8
    assert torch.equal(told.steps[:, 0], some.steps.float())
    assert torch.equal(told.style, some.style)
    assert torch.equal(told.path_known, some.path_known)


def test_the_path_is_the_true_one_at_the_anchors(frames):
    whole = drawn(frames, 20, 9 * 5)
    told = gaps.ends(frames, whole)
    at = whole.start[:, None] + 5 * torch.arange(1, ANCHORS + 1)
    torch.testing.assert_close(told.path[..., :2], frames.hips[at][..., ::2], atol=1e-5, rtol=0)
    torch.testing.assert_close(told.path[..., 2:], frames.facing[at], atol=1e-4, rtol=0)
    facing = gaps.ends(frames, drawn(frames, 100)).path[..., 2:]
    torch.testing.assert_close(facing.norm(dim=-1), torch.ones(100, ANCHORS))


def test_between_frames_values_go_in_straight_lines(frames):
    some = replace(drawn(frames, 3), start=torch.tensor([0, 5, 7]), steps=torch.tensor([4, 1, 10]))
    values = torch.arange(100.0)[:, None] * torch.tensor([1.0, 2.0])
    parts = torch.tensor([0.0, 0.3, 0.5, 1.0])
    wanted = torch.tensor([[0.0, 1.2, 2.0, 4.0], [5.0, 5.3, 5.5, 6.0], [7.0, 10.0, 12.0, 17.0]])
    got = gaps.between(values, some, parts)
    torch.testing.assert_close(got, wanted[..., None] * torch.tensor([1.0, 2.0]))


def test_interpolation_and_what_it_lacks_make_the_truth(frames):
    whole = drawn(frames, 20, 9 * 3)
    parts = gaps.anchor_times(frames.hips)
    led = gaps.base(frames, whole, parts.expand(20, -1))
    made = led + gaps.residual(frames, whole, led)
    at = whole.start[:, None] + 3 * torch.arange(1, ANCHORS + 1)
    torch.testing.assert_close(made[..., :3], frames.hips[at], atol=1e-5, rtol=0)
    torch.testing.assert_close(made[..., 3:], frames.rotations[at].flatten(2), atol=1e-5, rtol=0)
    assert float((led - made).abs().mean()) > 0.01


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


def test_the_motion_is_what_happened(frames):
    some = drawn(frames, 10, STEPS)
    true = gaps.motion(frames, some, STEPS)
    for row in range(10):
        at = slice(int(some.start[row]), int(some.target[row]) + 1)
        for name in ("hips", "rotations", "positions", "contacts"):
            assert torch.equal(getattr(true, name)[row], getattr(frames, name)[at])


def test_evenly_spaced_gaps_know_their_keys_alone(frames):
    some = gaps.evenly(frames, 40, 12, 2)
    assert torch.all(some.target <= frames.last[some.start])
    able = torch.nonzero(frames.last - torch.arange(len(frames)) >= 40)[:, 0]
    assert (some.start[0], some.start[-1]) == (able[0], able[-1])
    ranks = torch.searchsorted(able, some.start)
    assert int(ranks.diff().max() - ranks.diff().min()) <= 1
    assert some.style.tolist() == [[1.0, 0.0, 0.0]] * 12
    assert not any(x.any() for x in (some.path_known, some.start_known, some.target_known))


def test_the_papers_motion_lies_in_the_starts_frame(frames, mean):
    some = drawn(frames, 40, STEPS)
    here, world = gaps.letter_motion(frames, some, STEPS, mean), gaps.motion(frames, some, STEPS)
    turned = skeleton.global_rotations(here.rotations.double().numpy(), HUMANOID.parents)
    placed = skeleton.global_positions(here.hips.double().numpy(), turned, HUMANOID.parents, HUMANOID.offsets)
    np.testing.assert_allclose(here.positions, placed, atol=2e-5)
    # Turned back by the start's facing and moved back it is the world's motion.
    back = root_frame(frames.facing[some.start])[:, None].mT
    origin = frames.hips[some.start] * torch.tensor([1.0, 0.0, 1.0])
    torch.testing.assert_close(here.positions @ back + origin[:, None, None], world.positions, atol=2e-5, rtol=0)
    torch.testing.assert_close((here.hips[:, :, None] @ back)[:, :, 0] + origin[:, None], world.hips, atol=2e-5, rtol=0)
    assert torch.equal(here.contacts, world.contacts)
    # At the start the character stands at the origin and faces +z.
    torch.testing.assert_close(here.hips[:, 0, ::2], torch.zeros(40, 2), atol=1e-6, rtol=0)
    hips = to_matrix(
        torch.cat([torch.as_tensor(_columns(turned[:, 0, 0], axis)) for axis in ((1.0, 0, 0), (0, 1.0, 0))], dim=-1)
    )
    torch.testing.assert_close(hips[:, 0, 2], hips[:, 2, 0], atol=1e-6, rtol=0)  # no twist about the vertical
    assert torch.all(hips[:, 0, 0] + hips[:, 2, 2] > 0.0)


def _columns(q, axis):
    from interpose import rotation

    return rotation.rotate(q, np.array(axis, dtype=float))


def test_quaternions_have_the_signs_of_the_mean(frames, mean):
    torch.testing.assert_close(mean.norm(dim=-1), torch.ones(22))
    assert torch.all((frames.local[:, 1:] * mean[1:]).sum(dim=-1).abs() > 0.5)
    some = drawn(frames, 40, STEPS)
    here = gaps.letter_motion(frames, some, STEPS, mean)
    assert torch.all((here.rotations * mean).sum(dim=-1) >= 0.0)
    flips = torch.where(torch.rand(len(frames), 22, 1, generator=torch.Generator().manual_seed(0)) < 0.5, -1.0, 1.0)
    mixed = replace(frames, local=frames.local * flips)
    other = gaps.mean_quaternions(mixed)
    other = gaps.signed(other, mean)
    torch.testing.assert_close(other, mean, atol=1e-4, rtol=0)
    again = gaps.letter_motion(mixed, some, STEPS, mean)
    torch.testing.assert_close(again.rotations, here.rotations, atol=1e-6, rtol=0)
    by_hand = gaps.signed(torch.tensor([[1.0, 0.0, 0.0, 0.0]] * 22), torch.tensor([[-0.5, 0.5, 0.5, 0.5]] * 22))
    assert by_hand.tolist() == [[-1.0, 0.0, 0.0, 0.0]] * 22


def test_chains_begin_at_the_keys_each_in_its_own_direction_of_time(frames, mean):
    some = drawn(frames, 60, STEPS, Sampling(velocity=0.5))
    for true in (gaps.motion(frames, some, STEPS), gaps.letter_motion(frames, some, STEPS, mean)):
        front, back = gaps.bodies(frames, some, true)
        for body, end in ((front, 0), (back, -1)):
            for name in ("hips", "rotations", "positions"):
                assert torch.equal(getattr(body, name), getattr(true, name)[:, end])
            assert not body.phase.any()
        assert torch.equal(front.known, some.start_known)
        assert torch.equal(back.known, some.target_known)
        first = (frames.positions[some.start] - frames.positions[some.start - 1]) * RATE
        last = (frames.positions[some.target] - frames.positions[torch.clamp(some.target + 1, max=719)]) * RATE
        close = {"atol": 1e-4, "rtol": 0}
        torch.testing.assert_close(front.velocities, first * front.known[..., None], **close)
        torch.testing.assert_close(back.velocities, last * back.known[..., None], **close)
        assert torch.equal(front.contacts, gaps.standing(frames.positions[some.start]))


def test_feet_of_a_lone_key_stand_where_they_are_low():
    assert [HUMANOID.names[j] for j in FEET] == ["LeftFoot", "LeftToe", "RightFoot", "RightToe"]
    positions = torch.zeros(2, 22, 3)
    positions[..., 1] = 1.0
    positions[0, FEET, 1] = torch.tensor(STANDING) - 0.001
    positions[1, FEET, 1] = torch.tensor(STANDING) + torch.tensor([0.001, -0.001, 0.0, -0.2])
    assert gaps.standing(positions).tolist() == [[1.0] * 4, [0.0, 1.0, 0.0, 1.0]]
