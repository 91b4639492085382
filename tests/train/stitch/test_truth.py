"""The true motion of gaps in each form's numbers, and the chains' first frames."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from stitch_learning import drawn

from interpose import rotation, skeleton
from interpose.data.contacts import CONTACT_INDICES as FEET
from interpose.features import RATE
from interpose.features.stitch import STANDING
from interpose.models.geometry import root_frame, to_matrix
from interpose.skeleton import HUMANOID
from interpose.train.common.gaps import GapSampling
from interpose.train.stitch import truth

STEPS = 18


@pytest.fixture(scope="module")
def mean(frames):
    return truth.mean_quaternions(frames)


def test_the_motion_is_what_happened(frames):
    some = drawn(frames, 10, STEPS)
    true = truth.yaw_motion(frames, some, STEPS)
    for row in range(10):
        at = slice(int(some.start[row]), int(some.target[row]) + 1)
        for name in ("hips", "rotations", "positions", "contacts"):
            assert torch.equal(getattr(true, name)[row], getattr(frames, name)[at])


def test_the_papers_motion_lies_in_the_starts_frame(frames, mean):
    some = drawn(frames, 40, STEPS)
    here, world = truth.paper_motion(frames, some, STEPS, mean), truth.yaw_motion(frames, some, STEPS)
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
    return rotation.rotate(q, np.array(axis, dtype=float))


def test_quaternions_have_the_signs_of_the_mean(frames, mean):
    torch.testing.assert_close(mean.norm(dim=-1), torch.ones(22))
    assert torch.all((frames.local[:, 1:] * mean[1:]).sum(dim=-1).abs() > 0.5)
    some = drawn(frames, 40, STEPS)
    here = truth.paper_motion(frames, some, STEPS, mean)
    assert torch.all((here.rotations * mean).sum(dim=-1) >= 0.0)
    flips = torch.where(torch.rand(len(frames), 22, 1, generator=torch.Generator().manual_seed(0)) < 0.5, -1.0, 1.0)
    mixed = replace(frames, local=frames.local * flips)
    other = truth.mean_quaternions(mixed)
    other = truth.signed(other, mean)
    torch.testing.assert_close(other, mean, atol=1e-4, rtol=0)
    again = truth.paper_motion(mixed, some, STEPS, mean)
    torch.testing.assert_close(again.rotations, here.rotations, atol=1e-6, rtol=0)
    by_hand = truth.signed(torch.tensor([[1.0, 0.0, 0.0, 0.0]] * 22), torch.tensor([[-0.5, 0.5, 0.5, 0.5]] * 22))
    assert by_hand.tolist() == [[-1.0, 0.0, 0.0, 0.0]] * 22


def test_chains_begin_at_the_keys_each_in_its_own_direction_of_time(frames, mean):
    some = drawn(frames, 60, STEPS, GapSampling(velocity=0.5))
    for true in (truth.yaw_motion(frames, some, STEPS), truth.paper_motion(frames, some, STEPS, mean)):
        front, back = truth.chain_ends(frames, some, true)
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
        assert torch.equal(front.contacts, truth.standing(frames.positions[some.start]))


def test_feet_of_a_lone_key_stand_where_they_are_low():
    assert [HUMANOID.names[j] for j in FEET] == ["LeftFoot", "LeftToe", "RightFoot", "RightToe"]
    positions = torch.zeros(2, 22, 3)
    positions[..., 1] = 1.0
    positions[0, FEET, 1] = torch.tensor(STANDING) - 0.001
    positions[1, FEET, 1] = torch.tensor(STANDING) + torch.tensor([0.001, -0.001, 0.0, -0.2])
    assert truth.standing(positions).tolist() == [[1.0] * 4, [0.0, 1.0, 0.0, 1.0]]
