"""The plan of a gap: its distributions, what it sees, and that it is the same wherever and whichever way a gap lies."""

import copy
import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from stitch_learning import Elsewhere, double, drawn
from torch.distributions import Normal as Oracle
from torch.distributions import kl_divergence

from interpose import rotation
from interpose.data import root
from interpose.features import RATE
from interpose.features.stitch import ANCHORS, ends_shapes
from interpose.models.planner import INPUT, LONGEST, POSE, Ends, GapPlan, Normal, PlanSize, divergence, normal
from interpose.train.common import gaps

numbers = st.floats(-3.0, 3.0)


@pytest.fixture
def plan(stitch_network):
    return copy.deepcopy(stitch_network.plan)


@pytest.fixture
def ends(frames):
    return gaps.ends(frames, drawn(frames, 8))


def elsewhere(ends: Ends, there: Elsewhere) -> Ends:
    moved = {}
    for end in ("start", "target"):
        for name, move in (
            ("hips", there.point),
            ("rotations", there.turned),
            ("positions", there.point),
            ("velocities", there.vector),
        ):
            moved[f"{end}_{name}"] = move(getattr(ends, f"{end}_{name}"))
    x, y = ends.path[..., :2], ends.path[..., 2:]
    shift = x.new_tensor([there.x, there.z])
    return ends._replace(**moved, path=torch.cat([there.ground(x) + shift, there.ground(y)], dim=-1))


@given(numbers, st.floats(-2.0, 2.0), numbers, st.floats(-2.0, 2.0))
def test_divergence_is_that_of_torch(a, b, c, d):
    q, p = ((torch.tensor([[mean]]).double(), torch.tensor([[log]]).double()) for mean, log in ((a, b), (c, d)))
    wanted = kl_divergence(Oracle(q[0], q[1].exp()), Oracle(p[0], p[1].exp()))
    torch.testing.assert_close(divergence(Normal(*q), Normal(*p)), wanted)
    assert float(divergence(Normal(*q), Normal(*q))) == pytest.approx(0.0, abs=1e-12)


def test_a_head_says_a_mean_and_a_deviation_within_bounds():
    said = normal(torch.tensor([[1.0, -2.0, -50.0, 0.5], [0.0, 0.0, 50.0, 3.5]]))
    assert said.mean.tolist() == [[1.0, -2.0], [0.0, 0.0]]
    assert said.log_deviation.tolist() == [[-5.0, 0.5], [3.0, 3.0]]
    noise = torch.tensor([[1.0, 2.0], [0.0, -1.0]])
    wanted = [[1.0 + math.exp(-5.0), -2.0 + 2.0 * math.exp(0.5)], [0.0, -math.exp(3.0)]]
    np.testing.assert_allclose(said.at(noise), wanted, rtol=1e-6)


def test_shapes(plan, ends):
    assert {k: tuple(v.shape[1:]) for k, v in ends._asdict().items()} == ends_shapes(2)
    x, frame = plan.numbers(ends)
    assert x.shape == (8, INPUT)
    assert frame.shape == (8, 3, 3)


def test_numbers_by_hand(plan, ends):
    ends = double(ends)
    x = plan.double().numbers(ends)[0].numpy()
    yaw = root.pose_yaw(rotation.from_6d(ends.start_rotations[:, 0].numpy()))
    sin, cos = np.sin(yaw), np.cos(yaw)
    origin = ends.start_hips.numpy() * [1.0, 0.0, 1.0]

    def ground(v):
        s, c = (a.reshape(-1, *[1] * (v.ndim - 2)) for a in (sin, cos))
        return np.stack([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1]], axis=-1)

    def local(v):
        out = v.copy() if isinstance(v, np.ndarray) else v.numpy().copy()
        out[..., ::2] = ground(out[..., ::2])
        return out.reshape(8, -1)

    steps = ends.steps.numpy()
    speed = (ends.target_positions - ends.start_positions).numpy() / (steps / RATE)[..., None]
    target_yaw = root.pose_yaw(rotation.from_6d(ends.target_rotations[:, 0].numpy()))
    share = (np.arange(ANCHORS) + 1)[:, None] / 9
    a, b = (v.numpy()[:, None, ::2] for v in (ends.start_hips, ends.target_hips))
    line = a * (1 - share) + b * share
    path = ends.path.numpy()
    wanted = [
        local(ends.start_positions.numpy() - origin[:, None]),
        local(ends.start_rotations.reshape(8, -1, 3)),
        local(ends.start_velocities),
        local(ends.target_positions.numpy() - origin[:, None]),
        local(ends.target_rotations.reshape(8, -1, 3)),
        local(ends.target_velocities),
        local(speed),
        ends.start_known,
        ends.target_known,
        np.stack([np.sin(target_yaw - yaw), np.cos(target_yaw - yaw)], axis=-1),
        np.concatenate([ground(path[..., :2] - line), ground(path[..., 2:])], axis=-1).reshape(8, -1),
        ends.path_known,
        steps / 30.0,
        1.0 / steps,
        np.log(steps),
    ]
    np.testing.assert_allclose(x, np.concatenate([np.asarray(w) for w in wanted], axis=1), atol=1e-6)


@pytest.mark.parametrize("there", [Elsewhere(), Elsewhere(-0.4, 0.0, 20.0), Elsewhere(np.pi, -7.0, 0.0)])
def test_where_a_gap_lies_and_which_way_it_faces_is_nothing_to_the_plan(plan, ends, there):
    here = double(ends)
    plan.double()
    (x, frame), (moved, turned) = (plan.numbers(e) for e in (here, elsewhere(here, there)))
    torch.testing.assert_close(moved, x, atol=1e-6, rtol=0)  # facing leans 1e-8 ahead
    torch.testing.assert_close(turned, there.vector(frame.mT).mT, atol=1e-7, rtol=0)


def test_what_it_adds_and_what_it_recognises_turn_with_the_gap(plan, frames, ends):
    there = Elsewhere()
    chosen = drawn(frames, 8)
    base = gaps.base(frames, chosen, gaps.anchor_times(frames.hips).expand(8, -1))
    residual = gaps.residual(frames, chosen, base)
    z = torch.randn(8, plan.size.latent, generator=torch.Generator().manual_seed(0))
    x, frame = plan(ends)
    moved, turned = plan(elsewhere(ends, there))
    added = plan.decode(x, frame, z)
    assert float(added.abs().mean()) > 0.01
    wanted = there.vector(added.unflatten(-1, (-1, 3))).flatten(2)
    torch.testing.assert_close(plan.decode(moved, turned, z), wanted, atol=2e-4, rtol=1e-4)
    one = plan.recognise(x, frame, residual)
    other = plan.recognise(moved, turned, there.vector(residual.unflatten(-1, (-1, 3))).flatten(2))
    torch.testing.assert_close(other.mean, one.mean, atol=2e-3, rtol=1e-3)
    torch.testing.assert_close(other.log_deviation, one.log_deviation, atol=2e-3, rtol=1e-3)
    assert float((plan.recognise(x, frame, 0.0 * residual).mean - one.mean).abs().max()) > 0.1


def test_the_posterior_sees_in_units_what_the_decoder_says_in_units(plan, ends, monkeypatch):
    said = torch.rand(8, ANCHORS * POSE, generator=torch.Generator().manual_seed(0)) * 10.0 - 5.0
    seen = []

    def listened(network, x):
        seen.append(x)
        return said if network is plan.decoder else torch.zeros(len(x), 2 * plan.size.latent)

    monkeypatch.setattr(plan, "_say", listened)
    plan.residual_std.uniform_(0.1, 2.0)
    x, frame = plan(ends)
    added = plan.decode(x, frame, torch.zeros(8, plan.size.latent))
    plan.recognise(x, frame, added)
    torch.testing.assert_close(seen[1][:, x.shape[1] :], said, atol=1e-4, rtol=1e-4)
    plan.recognise(x, frame, 100.0 * added)
    assert float(seen[2].abs().max()) == 6.0


def test_a_path_that_is_not_known_is_not_seen(plan, ends):
    other = ends._replace(path=ends.path + 1.0)
    unknown = [e._replace(path_known=torch.zeros(8, 1)) for e in (ends, other)]
    assert torch.equal(plan(unknown[0])[0], plan(unknown[1])[0])
    assert not torch.allclose(plan(ends)[0], plan(other)[0])
    assert not torch.allclose(plan(ends)[0], plan(unknown[0])[0])


def test_styles_are_told_apart_and_many_steps_are_seen_as_the_longest(plan, ends):
    free = ends._replace(style=torch.eye(3)[[0] * 8])
    old = ends._replace(style=torch.eye(3)[[1] * 8])
    assert float((plan.expect(plan(free)[0]).mean - plan.expect(plan(old)[0]).mean).abs().max()) > 0.01
    there = ends._replace(target_positions=ends.start_positions)  # the speed needed is the only other thing with time
    long, longer = (plan(there._replace(steps=torch.full((8, 1), s)))[0] for s in (float(LONGEST), 500.0))
    torch.testing.assert_close(long, longer, atol=0, rtol=0)
    shorter = plan(there._replace(steps=torch.full((8, 1), LONGEST - 1.0)))[0]
    assert not torch.allclose(long, shorter)


def test_a_fresh_plan_says_little_of_the_size_it_is_told():
    size = PlanSize(latent=5, hidden=24, depth=2, styles=3)
    plan = GapPlan(size).eval().requires_grad_(False)
    x = torch.randn(4, INPUT + 64 + 32)
    z = torch.randn(4, 5)
    frame = torch.eye(3).expand(4, 3, 3)
    assert plan.expect(x).mean.shape == (4, 5)
    added = plan.decode(x, frame, z)
    assert added.shape == (4, ANCHORS, POSE)
    assert float(added.abs().max()) < 1.0
    plan.half_products = True
    torch.testing.assert_close(plan.decode(x, frame, z), added, atol=0.01, rtol=0.05)
