"""The planner: its input, that its plan turns with the gap, the mirror mean, and the spline over the anchors."""

import learning
import numpy as np
import pytest
import torch
from stitch_learning import Elsewhere, double, drawn

from interpose import rotation
from interpose.data import root
from interpose.features import POSE, RATE
from interpose.features.plan import ANCHORS, LONGEST_PLAN_STEPS, anchor_weights, gap_shapes
from interpose.models.planner import (
    GAP_INPUT_WIDTH,
    GapInput,
    Planner,
    PlannerSize,
    anchor_weights_at,
    mirrored,
    mirrored_poses,
)
from interpose.motion import mirror
from interpose.train.common.gaps import gap_input, true_anchors


@pytest.fixture
def plan(frames):
    return learning.planner_for(frames)


@pytest.fixture
def ends(frames):
    return gap_input(frames, drawn(frames, 8))


def elsewhere(ends: GapInput, there: Elsewhere) -> GapInput:
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


def test_shapes(plan, ends):
    assert {k: tuple(v.shape[1:]) for k, v in ends._asdict().items()} == gap_shapes(2)
    x, frame = plan.features(ends)
    assert x.shape == (8, GAP_INPUT_WIDTH)
    assert frame.shape == (8, 3, 3)


def test_numbers_by_hand(plan, ends):
    ends = double(ends)
    x = plan.double().features(ends)[0].numpy()
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
    straight = a * (1 - share) + b * share
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
        np.concatenate([ground(path[..., :2] - straight), ground(path[..., 2:])], axis=-1).reshape(8, -1),
        ends.path_known,
        steps / 30.0,
        1.0 / steps,
        np.log(steps),
    ]
    np.testing.assert_allclose(x, np.concatenate([np.asarray(w) for w in wanted], axis=1), atol=1e-6)


@pytest.mark.parametrize("there", [Elsewhere(), Elsewhere(-0.4, 0.0, 20.0), Elsewhere(np.pi, -7.0, 0.0)])
def test_the_plan_is_the_same_wherever_a_gap_lies(plan, ends, there):
    here = double(ends)
    plan.double()
    (x, frame), (moved, turned) = (plan.features(e) for e in (here, elsewhere(here, there)))
    torch.testing.assert_close(moved, x, atol=1e-6, rtol=0)  # facing leans 1e-8 ahead
    torch.testing.assert_close(turned, there.vector(frame.mT).mT, atol=1e-7, rtol=0)


def test_what_it_adds_and_what_it_recognises_turn_with_the_gap(plan, frames, ends):
    there = Elsewhere()
    chosen = drawn(frames, 8)
    residual = true_anchors(frames, chosen).residual
    z = torch.randn(8, plan.size.latent, generator=torch.Generator().manual_seed(0))
    x, frame = plan.encode(ends)
    moved, turned = plan.encode(elsewhere(ends, there))
    added = plan.decode(x, frame, z)
    assert float(added.abs().mean()) > 0.01
    wanted = there.vector(added.unflatten(-1, (-1, 3))).flatten(2)
    torch.testing.assert_close(plan.decode(moved, turned, z), wanted, atol=2e-4, rtol=1e-4)
    one = plan.recognise(x, frame, residual)
    other = plan.recognise(moved, turned, there.vector(residual.unflatten(-1, (-1, 3))).flatten(2))
    torch.testing.assert_close(other.mean, one.mean, atol=2e-3, rtol=1e-3)
    torch.testing.assert_close(other.log_deviation, one.log_deviation, atol=2e-3, rtol=1e-3)
    assert float((plan.recognise(x, frame, 0.0 * residual).mean - one.mean).abs().max()) > 0.1


def test_the_posterior_sees_the_units_of_the_decoder(plan, ends, monkeypatch):
    output = torch.rand(8, ANCHORS * POSE, generator=torch.Generator().manual_seed(0)) * 10.0 - 5.0
    seen = []

    def listened(network, x):
        seen.append(x)
        return output if network is plan.decoder else torch.zeros(len(x), 2 * plan.size.latent)

    monkeypatch.setattr(plan, "_run", listened)
    plan.residual_std.uniform_(0.1, 2.0)
    x, frame = plan.encode(ends)
    added = plan.decode(x, frame, torch.zeros(8, plan.size.latent))
    plan.recognise(x, frame, added)
    torch.testing.assert_close(seen[1][:, x.shape[1] :], output, atol=1e-4, rtol=1e-4)
    plan.recognise(x, frame, 100.0 * added)
    assert float(seen[2].abs().max()) == 6.0


def test_a_path_that_is_not_known_is_not_seen(plan, ends):
    other = ends._replace(path=ends.path + 1.0)
    unknown = [e._replace(path_known=torch.zeros(8, 1)) for e in (ends, other)]
    assert torch.equal(plan.encode(unknown[0])[0], plan.encode(unknown[1])[0])
    assert not torch.allclose(plan.encode(ends)[0], plan.encode(other)[0])
    assert not torch.allclose(plan.encode(ends)[0], plan.encode(unknown[0])[0])


def test_styles_differ_and_many_steps_are_seen_as_the_longest(plan, ends):
    free = ends._replace(style=torch.eye(3)[[0] * 8])
    old = ends._replace(style=torch.eye(3)[[1] * 8])
    assert float((plan.expect(plan.encode(free)[0]).mean - plan.expect(plan.encode(old)[0]).mean).abs().max()) > 0.01
    there = ends._replace(target_positions=ends.start_positions)  # the speed needed is the only other thing with time
    long, longer = (
        plan.encode(there._replace(steps=torch.full((8, 1), s)))[0] for s in (float(LONGEST_PLAN_STEPS), 500.0)
    )
    torch.testing.assert_close(long, longer, atol=0, rtol=0)
    shorter = plan.encode(there._replace(steps=torch.full((8, 1), LONGEST_PLAN_STEPS - 1.0)))[0]
    assert not torch.allclose(long, shorter)


def test_a_fresh_planner_adds_little():
    size = PlannerSize(latent=5, hidden=24, depth=2, styles=3)
    plan = Planner(size).eval().requires_grad_(False)
    x = torch.randn(4, GAP_INPUT_WIDTH + 64 + 32)
    z = torch.randn(4, 5)
    frame = torch.eye(3).expand(4, 3, 3)
    assert plan.expect(x).mean.shape == (4, 5)
    added = plan.decode(x, frame, z)
    assert added.shape == (4, ANCHORS, POSE)
    assert float(added.abs().max()) < 1.0
    plan.half_products = True
    torch.testing.assert_close(plan.decode(x, frame, z), added, atol=0.01, rtol=0.05)


def test_the_plan_is_the_mean_with_its_mirror_image(plan, ends):
    """Written out: decode both gaps at the prior's means, mirror one back."""
    zero = torch.zeros(8, plan.size.latent)
    (x, frame), (turned, other) = plan.encode(ends), plan.encode(mirrored(ends))
    likeliest = plan.decode(x, frame, plan.expect(x).mean)
    back = mirrored_poses(plan.decode(turned, other, plan.expect(turned).mean))
    assert float((likeliest - back).abs().max()) > 0.01  # this network is not symmetrical
    made, latent = plan(ends, zero)
    torch.testing.assert_close(made, 0.5 * (likeliest + back), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(latent, plan.expect(x).mean)
    there, _ = plan(mirrored(ends), zero)
    torch.testing.assert_close(mirrored_poses(there), made, atol=1e-5, rtol=1e-5)
    noise = torch.randn(8, plan.size.latent, generator=torch.Generator().manual_seed(1))
    sampled, latent = plan(ends, noise)
    z = plan.expect(x).at(noise)
    torch.testing.assert_close(latent, z)
    torch.testing.assert_close(sampled, plan.decode(x, frame, z) + 0.5 * (back - likeliest), atol=1e-5, rtol=1e-5)


def test_a_mirrored_gap_is_that_of_the_mirrored_motion(database, frames):
    """The mirrored frames follow the originals in the data."""
    some = drawn(frames, 20)
    some = some.part(slice(0, 20))
    count = database.frames
    start = torch.where(some.start < count, some.start + count, some.start - count)
    there = type(some)(**(vars(some) | {"start": start}))
    there = type(there)(
        **(vars(there) | {"start_local": frames.local[start], "target_local": frames.local[start + some.steps]})
    )
    made, wanted = mirrored(gap_input(frames, some)), gap_input(frames, there)
    for name, value in wanted._asdict().items():
        torch.testing.assert_close(getattr(made, name), value, atol=2e-4, rtol=0, msg=name)


def test_mirrored_poses_are_those_of_the_motion(database):
    clip = database.clip(0)
    pose, other = (
        torch.as_tensor(
            np.concatenate([m.root_positions, rotation.to_6d(m.global_rotations()).reshape(len(m), -1)], axis=1)
        )[None]
        for m in (clip, mirror(clip))
    )
    torch.testing.assert_close(mirrored_poses(pose), other, atol=1e-5, rtol=0)


@pytest.mark.parametrize("steps", [1, 2, 5, 18, 61, 92])
def test_the_spline_is_that_of_the_run_time(steps):
    parts = torch.arange(steps + 1, dtype=torch.float64)[None] / steps
    torch.testing.assert_close(anchor_weights_at(parts)[0], torch.as_tensor(anchor_weights(steps)), atol=1e-6, rtol=0)
