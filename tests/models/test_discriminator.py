"""The pair of critics: what they see, their windows, and equations 8 and 9 by hand."""

import numpy as np
import pytest
import torch
from stitch_learning import Elsewhere, drawn
from torch import nn

from interpose.models.discriminator import LONG, SHORT, Discriminators, critic_loss, generator_loss, seen
from interpose.models.geometry import to_matrix
from interpose.train.stitch.truth import yaw_motion

CHANNELS = 132


@pytest.fixture
def critics():
    torch.manual_seed(0)
    return Discriminators()


@pytest.fixture
def reading():
    """Critics that say the newest frame's first channel."""
    critics = Discriminators()
    with torch.no_grad():
        for p in critics.parameters():
            p.zero_()
        for critic in critics.critics:
            critic[0].weight[0, 0, -1] = critic[2].weight[0, 0, 0] = critic[4].weight[0, 0, 0] = 1.0
    return critics


def shown(frames, rows=4, steps=14):
    chosen = drawn(frames, rows, steps)
    true = yaw_motion(frames, chosen, steps)
    return true.positions, to_matrix(true.rotations[:, 0, 0])


def test_their_sizes_and_windows(critics):
    for critic, frames in zip(critics.critics, (10, 2), strict=True):
        layers = [x for x in critic if isinstance(x, nn.Conv1d)]
        shapes = [tuple(x.weight.shape) for x in layers]
        assert shapes == [(512, CHANNELS, frames), (256, 512, 1), (1, 256, 1)]
    assert (LONG, SHORT) == (10, 2)


def test_a_score_is_the_mean_over_all_windows(critics):
    motion = torch.randn(3, CHANNELS, 13)
    scores = critics(motion)
    for critic, width, score in zip(critics.critics, (10, 2), scores, strict=True):
        windows = [critic(motion[..., i : i + width])[:, 0, 0] for i in range(14 - width)]
        torch.testing.assert_close(score, torch.stack(windows).mean(dim=0))


@pytest.mark.parametrize(("frames", "count"), [(2, 1), (9, 1), (10, 2), (40, 2)])
def test_the_long_one_sits_out_short_gaps(critics, frames, count):
    motion = torch.randn(3, CHANNELS, frames)
    scores = critics(motion)
    assert [tuple(s.shape) for s in scores] == [(3,)] * count
    torch.testing.assert_close(scores[-1], critics.critics[1](motion).mean(dim=(1, 2)))


def test_losses_are_equations_8_and_9_by_hand(reading):
    real, made = torch.zeros(2, CHANNELS, 12), torch.zeros(2, CHANNELS, 12)
    real[0, 0], real[1, 0] = 1.5, 0.5
    made[0, 0], made[1, 0] = 0.25, 2.0
    # D(X) = 1.5, 0.5; D(G(Z)) = 0.25, 2: both critics say the same
    generator = 0.5 * (0.75**2 + 1.0**2) / 2
    critic = 0.5 * (0.5**2 + 0.5**2) / 2 + 0.5 * (0.25**2 + 2.0**2) / 2
    assert generator_loss(reading, made).item() == pytest.approx(2 * generator)
    assert critic_loss(reading, real, made).item() == pytest.approx(2 * critic)
    short = slice(0, 5)  # the short one alone
    assert generator_loss(reading, made[..., short]).item() == pytest.approx(generator)
    assert critic_loss(reading, real[..., short], made[..., short]).item() == pytest.approx(critic)
    assert generator_loss(reading, torch.ones(2, CHANNELS, 12)).item() == 0.0
    assert critic_loss(reading, torch.ones(2, CHANNELS, 12), torch.zeros(2, CHANNELS, 12)).item() == 0.0


def test_the_generators_gradient_reaches_every_frame_and_the_critics_none(critics, frames):
    positions, hips = shown(frames)
    positions.requires_grad_()
    generator_loss(critics, seen(positions, hips)).backward()
    assert torch.all(positions.grad.abs().sum(dim=(0, 2, 3)) > 0.0)
    positions.grad = None
    critics.zero_grad()
    made = seen(positions, hips)
    critic_loss(critics, made.detach() + 0.1, made).backward()
    assert positions.grad is None
    assert all(float(p.grad.abs().max()) > 0.0 for p in critics.parameters())


def test_what_they_see_by_hand(frames):
    positions, hips = shown(frames)
    motion = seen(positions, hips)
    assert motion.shape == (4, CHANNELS, 14)
    forward = hips.numpy()[:, :, 2]
    left = hips.numpy()[:, :, 0]
    angle = np.arctan2(forward[:, 0] - left[:, 2], forward[:, 2] + left[:, 0])
    turn = np.zeros((4, 3, 3))
    turn[:, 1, 1] = 1.0
    turn[:, 0, 0] = turn[:, 2, 2] = np.cos(angle)
    turn[:, 0, 2], turn[:, 2, 0] = -np.sin(angle), np.sin(angle)
    where = positions.numpy()
    origin = where[:, 1:, :1] * [1.0, 0.0, 1.0]
    place = np.einsum("rij,rfkj->rfki", turn, where[:, 1:] - origin)
    step = np.einsum("rij,rfkj->rfki", turn, where[:, 1:] - where[:, :-1]) / 0.1
    wanted = np.concatenate([place.reshape(4, 14, -1), step.reshape(4, 14, -1)], axis=-1).transpose(0, 2, 1)
    np.testing.assert_allclose(motion, wanted, atol=1e-5)


def test_where_a_motion_lies_and_which_way_it_faces_is_not_seen(frames):
    there = Elsewhere()
    positions, hips = shown(frames)
    moved = seen(there.point(positions), there.vector(hips.mT).mT)
    torch.testing.assert_close(moved, seen(positions, hips), atol=1e-4, rtol=0)
