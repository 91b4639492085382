"""One step of DC-MoE: its parts against the paper's text, and what must hold whatever the weights are."""

import copy
import math
from itertools import pairwise

import learning
import numpy as np
import pytest
import torch

from interpose import rotation
from interpose.data import root
from interpose.features import (
    CHANNELS,
    EXPERT_INPUT,
    KEY_STEP,
    KEYS,
    LONGEST_ARRIVAL,
    RATE,
    control_shapes,
    state_shapes,
)
from interpose.models.dcmoe import Control, DCMoE, DCMoESize, Network, State
from interpose.models.geometry import facing, joint_positions, to_matrix
from interpose.skeleton import HUMANOID
from interpose.train.common.gaps import GapSampling
from interpose.train.dcmoe.sequences import RollOutSampling, base_window, draw

BATCH = 6


@pytest.fixture
def situation(frames):
    """A state and what steers it, in double precision, from the middle of real gaps; the paths are given."""
    rule = RollOutSampling(GapSampling(path=1.0, style_dropout=0.0), inside=1.0, phase_known_inside=1.0)
    rows = draw(frames, BATCH, len(learning.STYLES), rule, torch.Generator().manual_seed(4))
    steer = learning.steering(frames, rows)
    return State(*(x.double() for x in rows.state)), Control(*(x.double() for x in steer))


@pytest.fixture
def double(network):
    return copy.deepcopy(network).double()


def test_shapes_are_those_of_the_features(situation):
    state, steer = situation
    assert {k: tuple(v.shape[1:]) for k, v in state._asdict().items()} == state_shapes()
    assert {k: tuple(v.shape[1:]) for k, v in steer._asdict().items()} == control_shapes(len(learning.STYLES))


def test_a_gate_that_chooses_leaves_one_plain_network():
    torch.manual_seed(0)
    model = Network(DCMoESize(experts=3, hidden=8, gate=(8, 4)))
    for module in model.experts:
        torch.nn.init.normal_(module.linear.bias)
    torch.nn.init.zeros_(model.gate[-1].weight)
    model.gate[-1].bias.data = torch.tensor([-100.0, 100.0, -100.0])
    x, condition = torch.randn(4, EXPERT_INPUT.width), torch.randn(4, 644)
    wanted = x
    for i, module in enumerate(model.experts):
        weight, bias = module.linear.weight.chunk(3)[1], module.linear.bias.chunk(3)[1]
        wanted = wanted @ weight.T + bias
        wanted = wanted * torch.sigmoid(wanted) if i < 2 else wanted
    torch.testing.assert_close(model(x, condition), wanted)


def test_features_by_name(double, situation):
    state, steer = situation
    x, led, _, _ = double.features(state, steer)
    block = {name: x[:, where].numpy() for name, where in EXPERT_INPUT.slices().items()}
    yaw = root.pose_yaw(rotation.from_6d(state.rotations[:, 0].numpy()))
    sin, cos = np.sin(yaw), np.cos(yaw)

    def ground(v):
        """World (x, z) to the root's: turned back by the yaw."""
        s, c = (a.reshape(-1, *[1] * (v.ndim - 2)) for a in (sin, cos))
        return np.stack([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1]], axis=-1)

    def turned(v):
        out = v.numpy().copy()
        out[..., ::2] = ground(out[..., ::2])
        return out.reshape(BATCH, -1)

    origin = state.hips * torch.tensor([1.0, 0.0, 1.0])
    left = steer.frames_left
    np.testing.assert_allclose(block["position"], turned(state.positions - origin[:, None]), atol=1e-7)
    np.testing.assert_allclose(block["velocity"], turned(state.velocities), atol=1e-7)
    np.testing.assert_allclose(block["rotation"], turned(state.rotations.reshape(BATCH, -1, 3)), atol=1e-7)
    np.testing.assert_allclose(block["target_position"], turned(steer.target_positions - origin[:, None]), atol=1e-7)
    target = steer.target_rotations.reshape(BATCH, -1, 3)
    np.testing.assert_allclose(block["target_rotation"], turned(target), atol=1e-7)
    needed = (steer.target_positions - state.positions) / (left[..., None] / RATE)
    np.testing.assert_allclose(block["speed_needed"], turned(needed), atol=1e-7)
    pose = torch.cat([state.hips, state.rotations.flatten(1)], dim=-1)
    torch.testing.assert_close(led, steer.base_next + (left - 1) / left * (pose - steer.base))
    np.testing.assert_allclose(block["base_step"], turned((led - pose).reshape(BATCH, -1, 3)), atol=1e-7)
    np.testing.assert_allclose(block["time"], np.concatenate([left / RATE, 1.0 / left], axis=1))
    np.testing.assert_array_equal(block["known"], np.concatenate([state.velocity_known, steer.path_known], axis=1))

    keys = block["trajectory"].reshape(BATCH, KEYS, 3, 2)
    past = state.track[:, 1::KEY_STEP].numpy()
    before = state.track[:, 0:-1:KEY_STEP].numpy()
    centre = state.hips.numpy()[:, None, ::2]
    np.testing.assert_allclose(keys[:, :7, 0], ground(past[..., :2] - centre), atol=1e-7)
    np.testing.assert_allclose(keys[:, :7, 1], ground(past[..., 2:]), atol=1e-7)
    np.testing.assert_allclose(keys[:, :7, 2], ground((past - before)[..., :2] * RATE), atol=1e-7)
    np.testing.assert_allclose(keys[:, 7:, 0], ground(steer.path[..., :2].numpy() - centre), atol=1e-7)
    np.testing.assert_allclose(keys[:, 7:, 2], ground(steer.path[..., 4:].numpy()), atol=1e-7)


def test_a_long_way_off_looks_as_the_longest_seen_in_training(double, situation):
    state, steer = situation
    x, _, _, _ = double.features(state, steer._replace(frames_left=torch.full((BATCH, 1), 500.0).double()))
    time = x[:, EXPERT_INPUT.slices()["time"]]
    torch.testing.assert_close(time[:, 0], torch.full((BATCH,), LONGEST_ARRIVAL / RATE).double())


def test_a_silent_network_leaves_the_interpolation(network, frames):
    model = learning.silence(copy.deepcopy(network))
    rows = draw(frames, 8, 2, RollOutSampling(inside=0.0), torch.Generator().manual_seed(1))
    base = base_window(frames, rows, 40)
    for i in range(40):
        rows.state, _ = model(rows.state, learning.steering(frames, rows))
        rows.gone = torch.minimum(rows.gone + 1, rows.gaps.steps)
        torch.testing.assert_close(rows.state.hips, base[i + 1, :, :3], atol=2e-5, rtol=0)
        torch.testing.assert_close(rows.state.rotations.flatten(1), base[i + 1, :, 3:], atol=2e-5, rtol=0)


def test_an_error_decays_linearly_and_the_network_adds_in_the_root_frame(double, situation):
    state, steer = situation
    model = learning.silence(double)
    where = model.layout.slices()
    model.out_mean[where["hips"]] = torch.tensor([0.01, 0.02, 0.03], dtype=torch.float64)
    left = torch.full((BATCH, 1), 5.0).double()
    after, _ = model(state, steer._replace(frames_left=left))
    ahead = facing(to_matrix(state.rotations[:, 0]))
    sin, cos = ahead[:, :1], ahead[:, 1:]
    moved = torch.cat([0.01 * cos + 0.03 * sin, torch.full_like(sin, 0.02), -0.01 * sin + 0.03 * cos], dim=-1)
    wanted = steer.base_next[:, :3] + 0.8 * (state.hips - steer.base[:, :3]) + moved
    torch.testing.assert_close(after.hips, wanted)


def test_arrival_is_exact_whatever_the_network_says(network, frames):
    rows = draw(frames, 32, 2, RollOutSampling(), torch.Generator().manual_seed(2))
    rows.gone = rows.gaps.steps - 1
    steer = learning.steering(frames, rows)
    after, _ = network(rows.state, steer)
    target = rows.gaps.target
    torch.testing.assert_close(after.hips, frames.hips[target], atol=1e-6, rtol=0)
    torch.testing.assert_close(after.rotations, frames.rotations[target], atol=1e-5, rtol=0)
    torch.testing.assert_close(after.positions, frames.positions[target], atol=1e-5, rtol=0)
    earlier, _ = network(rows.state, steer._replace(frames_left=torch.full((32, 1), 2.0)))
    assert float((earlier.hips - after.hips).norm(dim=-1).min()) > 1e-3


@pytest.mark.parametrize("absolute", [False, True])
def test_turning_and_moving_the_world_turns_and_moves_the_answer(frames, situation, absolute):
    model = learning.network_for(frames, absolute).double()
    state, steer = situation
    turn, shift = 1.1, torch.tensor([2.0, 0.0, -3.0], dtype=torch.float64)
    c, s = math.cos(turn), math.sin(turn)
    m = torch.tensor([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]], dtype=torch.float64)  # about +Y, for columns

    def place(x):
        return x @ m.T + shift

    def six(x):
        return (x.unflatten(-1, (2, 3)) @ m.T).flatten(-2)

    def ground(x, *moved):
        pairs = x.unflatten(-1, (-1, 2)) @ m[::2, ::2].T
        return (pairs + torch.tensor(moved, dtype=torch.float64)[:, None] * shift[::2]).flatten(-2)

    def pose(x):
        return torch.cat([place(x[:, :3]), six(x[:, 3:].unflatten(1, (22, 6))).flatten(1)], dim=-1)

    def world(x):
        return x._replace(
            hips=place(x.hips),
            rotations=six(x.rotations),
            positions=place(x.positions),
            velocities=x.velocities @ m.T,
            track=ground(x.track, 1.0, 0.0),
        )

    turned = steer._replace(
        target_hips=place(steer.target_hips),
        target_rotations=six(steer.target_rotations),
        target_positions=place(steer.target_positions),
        base=pose(steer.base),
        base_next=pose(steer.base_next),
        path=ground(steer.path, 1.0, 0.0, 0.0),
    )
    wanted, predicted = model(state, steer)
    got, predicted_turned = model(world(state), turned)
    for name, value in world(wanted)._asdict().items():
        torch.testing.assert_close(getattr(got, name), value, atol=1e-4, rtol=0, msg=name)
    for name in ("positions", "rotations", "velocities", "contacts", "trajectory", "phases"):
        torch.testing.assert_close(
            getattr(predicted_turned, name), getattr(predicted, name), atol=1e-4, rtol=0, msg=name
        )
    assert float((wanted.hips - steer.base_next[:, :3]).norm(dim=-1).max()) > 0.01


def test_a_path_that_is_not_given_has_no_influence(network, situation):
    state, steer = (type(part)(*(x.float() for x in part)) for part in situation)
    other = torch.randn(steer.path.shape)
    hidden = torch.zeros_like(steer.path_known)
    one, _ = network(state, steer._replace(path_known=hidden))
    same, _ = network(state, steer._replace(path_known=hidden, path=other))
    torch.testing.assert_close(one, same, atol=0, rtol=0)
    shown, _ = network(state, steer)
    moved, _ = network(state, steer._replace(path=other))
    assert float((shown.positions - moved.positions).abs().max()) > 1e-4
    assert float((shown.positions - one.positions).abs().max()) > 1e-4


def test_the_style_steers_and_labels_mix(double, situation):
    state, steer = situation
    label = torch.eye(3, dtype=torch.float64)
    answers = [double(state, steer._replace(style=row.expand(BATCH, 3)))[0].positions for row in label]
    assert min(float((a - b).abs().max()) for a, b in pairwise(answers)) > 1e-4
    mixed = double.style(torch.tensor([[0.0, 0.3, 0.7]], dtype=torch.float64))
    table = double.style(label)
    torch.testing.assert_close(mixed[0], 0.3 * table[1] + 0.7 * table[2])


def _predicting_phases(model: DCMoE, predicted) -> DCMoE:
    """``model`` made to predict the phases ``predicted``, (key, channel, 3), whatever it sees."""
    model = learning.silence(copy.deepcopy(model)).double()
    model.out_mean[model.layout.slices()["phase"]] = predicted.flatten().double()
    return model


def test_phases_that_agree_turn_by_their_frequency(network, situation):
    state, steer = situation
    start = torch.linspace(-3.0, 3.0, 7 * CHANNELS, dtype=torch.float64).view(7, CHANNELS)
    frequency = torch.linspace(0.5, 3.0, CHANNELS, dtype=torch.float64).expand(7, CHANNELS)

    def point(angle):
        return 5.0 * torch.stack([angle.sin(), angle.cos()], dim=-1)

    wanted = point(start + 2.0 * math.pi * frequency / RATE)
    model = _predicting_phases(network, torch.cat([wanted, frequency[..., None]], dim=-1))
    past = state.phase_past.clone()
    past[:, -1], future = point(start[0]), point(start[1:]).expand(BATCH, -1, -1, -1)
    after, _ = model(state._replace(phase_past=past, phase_future=future), steer)
    torch.testing.assert_close(after.phase_past[:, :-1], past[:, 1:])
    torch.testing.assert_close(after.phase_past[:, -1], wanted[0].expand(BATCH, -1, -1), atol=0.05, rtol=0)
    torch.testing.assert_close(after.phase_future, wanted[1:].expand(BATCH, -1, -1, -1), atol=0.05, rtol=0)


def test_phases_that_disagree_are_averaged_in_direction(network, situation):
    state, steer = situation
    angle = torch.linspace(-2.5, 2.5, CHANNELS, dtype=torch.float64)
    past = state.phase_past.clone()
    past[:, -1] = 5.0 * torch.stack([angle.sin(), angle.cos()], dim=-1)
    still = torch.tensor([0.0, 2.0, 0.0]).expand(7, CHANNELS, 3)  # phase nought, amplitude two, no frequency
    after, _ = _predicting_phases(network, still)(state._replace(phase_past=past), steer)
    predicted = after.phase_past[:, -1]
    torch.testing.assert_close(torch.atan2(*predicted.unbind(-1)), (angle / 2.0).expand(BATCH, -1), atol=0.01, rtol=0)
    torch.testing.assert_close(predicted.norm(dim=-1), torch.full_like(predicted[..., 0], 2.0), atol=0.05, rtol=0)


def test_of_unknown_phases_the_prediction_stands_and_nothing_breaks(network, situation):
    state, steer = situation
    past, future = torch.zeros_like(state.phase_past), torch.zeros_like(state.phase_future)
    predicted = torch.randn(7, CHANNELS, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    predicted[..., :2] *= 5.0 / predicted[..., :2].norm(dim=-1, keepdim=True)
    after, _ = _predicting_phases(network, predicted)(state._replace(phase_past=past, phase_future=future), steer)
    torch.testing.assert_close(after.phase_past[:, -1], predicted[0, :, :2].expand(BATCH, -1, -1), atol=0.1, rtol=0)
    silent = _predicting_phases(network, torch.zeros(7, CHANNELS, 3))
    silent.requires_grad_()
    after, _ = silent(state._replace(phase_past=past, phase_future=future), steer)
    assert not after.phase_past.any()
    sum(x.sum() for x in after).backward()
    gradients = [p.grad for p in silent.parameters() if p.grad is not None]
    assert gradients
    assert all(torch.isfinite(g).all() for g in gradients)


def test_the_next_state_is_of_one_piece(network, situation):
    state, steer = (type(part)(*(x.float() for x in part)) for part in situation)
    after, predicted = network(state, steer)
    matrices = to_matrix(after.rotations)
    torch.testing.assert_close(after.positions, joint_positions(after.hips, matrices))
    torch.testing.assert_close(after.velocities, (after.positions - state.positions) * RATE)
    torch.testing.assert_close(after.track[:, :-1], state.track[:, 1:])
    torch.testing.assert_close(after.track[:, -1, :2], after.hips[:, ::2])
    torch.testing.assert_close(after.track[:, -1, 2:], facing(matrices[:, 0]))
    assert torch.all(after.velocity_known == 1.0)
    local = (after.positions - predicted.origin[:, None]) @ predicted.frame
    torch.testing.assert_close(predicted.positions, local)
    torch.testing.assert_close(predicted.raw_positions, local)
    columns = (after.rotations.reshape(BATCH, 22, 2, 3) @ predicted.frame[:, None]).reshape(BATCH, 22, 6)
    torch.testing.assert_close(predicted.rotations, columns)


def test_the_papers_form_is_the_pose_itself(frames, situation):
    model = learning.silence(learning.network_for(frames, absolute=True)).double()
    state, steer = situation
    predicted = torch.zeros(66 + 132, dtype=torch.float64)
    predicted[:3] = torch.tensor([0.0, 0.9, 0.1])
    predicted[66:] = torch.tensor([1.0, 0.0, 0.0, 0.0, 1.0, 0.0]).repeat(22)
    model.out_mean[:198] = predicted
    after, prediction = model(state, steer)
    yaw = facing(to_matrix(state.rotations[:, 0]))
    wanted = state.hips * torch.tensor([1.0, 0.0, 1.0]) + torch.stack(
        [0.1 * yaw[:, 0], torch.full((BATCH,), 0.9).double(), 0.1 * yaw[:, 1]], dim=-1
    )
    torch.testing.assert_close(after.hips, wanted)
    torch.testing.assert_close(after.track[:, -1, 2:], yaw)
    torch.testing.assert_close(prediction.raw_positions[:, 0], predicted[:3].expand(BATCH, 3))
    head = after.positions[:, HUMANOID.index("Head")] - after.hips
    assert float((prediction.raw_positions - prediction.positions)[:, 1:].norm(dim=-1).min()) > 0.01
    torch.testing.assert_close(head.norm(dim=-1), torch.full((BATCH,), 0.6944).double(), atol=1e-3, rtol=0)
