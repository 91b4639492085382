"""What the generators see and say: the yaw form's axioms, and the paper's numbers by hand."""

import numpy as np
import pytest
import torch
from hypothesis import given
from stitch_learning import Elsewhere, double, situation
from strategies import humanoid_motions

from interpose import rotation, skeleton
from interpose.data import root
from interpose.features import RATE
from interpose.models.geometry import joint_positions, to_matrix
from interpose.models.stitch_forms import FORMS, chain_positions
from interpose.skeleton import HUMANOID

YAW, PAPER = FORMS["yaw"], FORMS["paper"]
BATCH = 6


@pytest.fixture
def yaw(frames):
    return tuple(double(x) for x in situation(frames, BATCH))


@pytest.fixture
def paper(frames):
    return tuple(double(x) for x in situation(frames, BATCH, form="paper"))


def noise(width, scale=3.0):
    return torch.randn(BATCH, width, generator=torch.Generator().manual_seed(0)).double() * scale


def test_yaw_features_by_hand(yaw):
    body, aim = yaw
    seen = YAW.features(body, aim)
    assert [x.shape[1] for x in seen[:3]] == [YAW.state, YAW.offset, YAW.target] == [269, 336, 198]
    angle = root.pose_yaw(rotation.from_6d(body.rotations[:, 0].numpy()))
    sin, cos = np.sin(angle)[:, None], np.cos(angle)[:, None]

    def local(v):
        v = v.numpy() if isinstance(v, torch.Tensor) else v
        v = v.reshape(BATCH, -1, 3)
        out = [cos * v[..., 0] - sin * v[..., 2], v[..., 1], sin * v[..., 0] + cos * v[..., 2]]
        return np.stack(out, axis=-1).reshape(BATCH, -1)

    origin = (body.hips * torch.tensor([1.0, 0.0, 1.0]))[:, None]
    state = [local(body.positions - origin), local(body.rotations), local(body.velocities), body.contacts, body.known]
    np.testing.assert_allclose(seen.state, np.concatenate(state, axis=1), atol=1e-6)
    pose = torch.cat([body.hips, body.rotations.flatten(1)], dim=1)
    there = torch.cat([aim.hips, aim.rotations.flatten(1)], dim=1)
    k = aim.left
    led = aim.following + (1 - 1 / k) * (pose - aim.here) + (there - aim.there) / k
    speed = (aim.positions - body.positions) / (k[..., None] / RATE)
    np.testing.assert_allclose(
        seen.offset, np.concatenate([local(x) for x in (speed, there - pose, led - pose)], 1), atol=1e-6
    )
    target = np.concatenate([local(aim.positions - origin), local(aim.rotations)], axis=1)
    np.testing.assert_allclose(seen.target, target, atol=1e-6)
    torch.testing.assert_close(seen.led, led)


@pytest.mark.parametrize("turn", [0.0, 0.7, 1.6, np.pi, -2.9, 40.0])
@pytest.mark.parametrize(("x", "z"), [(0.0, 0.0), (9.0, -4.0)])
def test_the_yaw_form_is_the_same_everywhere(yaw, turn, x, z):
    there = Elsewhere(turn, x, z)
    body, aim = yaw
    out = noise(YAW.output)
    here, away = YAW.features(body, aim), YAW.features(there.body(body), there.aim(aim))
    for one, other in zip(here[:3], away[:3], strict=True):
        torch.testing.assert_close(other, one, atol=1e-6, rtol=0)  # facing leans 1e-8 ahead
    after, contacts = YAW.advance(body, aim, here, out)
    moved, same = YAW.advance(there.body(body), there.aim(aim), away, out)
    for one, other in zip(there.body(after), moved, strict=True):
        torch.testing.assert_close(other, one, atol=1e-6, rtol=0)
    assert torch.equal(contacts, same)
    arrived = YAW.arrived(there.body(body), there.aim(aim))
    torch.testing.assert_close(arrived, there.body(YAW.arrived(body, aim)), atol=1e-10, rtol=1e-10)


@pytest.mark.parametrize("scale", [0.0, 1.0, 100.0])
def test_the_last_step_makes_the_aim_whatever_the_network_says(yaw, scale):
    body, aim = yaw
    last = aim._replace(left=torch.ones(BATCH, 1).double(), following=aim.there)
    after, _ = YAW.advance(body, last, YAW.features(body, last), noise(YAW.output, scale))
    torch.testing.assert_close(after.hips, aim.hips, atol=1e-12, rtol=0)
    torch.testing.assert_close(after.rotations, aim.rotations, atol=1e-6, rtol=0)  # the data is single precision
    torch.testing.assert_close(after.positions, aim.positions, atol=1e-5, rtol=0)
    torch.testing.assert_close(after.velocities, (after.positions - body.positions) * RATE)


def test_what_the_network_says_is_added_in_the_chains_own_frame(yaw):
    body, aim = yaw
    features = YAW.features(body, aim)
    plain, logits = YAW.advance(body, aim, features, torch.zeros(BATCH, YAW.output).double())
    torch.testing.assert_close(plain.hips, features.led[:, :3])
    assert torch.all(plain.contacts == 0.5)
    assert not logits.any()
    assert torch.all(plain.known == 1.0)
    out = torch.zeros(BATCH, YAW.output).double()
    out[:, :3] = torch.tensor([0.0, 1.0, 5.0])  # 2 cm up and 10 cm on
    out[:, -4:] = torch.tensor([-2.0, 0.0, 1.0, 3.0])
    after, logits = YAW.advance(body, aim, features, out)
    angle = root.pose_yaw(rotation.from_6d(body.rotations[:, 0].numpy()))
    on = np.stack([0.1 * np.sin(angle), np.full(BATCH, 0.02), 0.1 * np.cos(angle)], axis=-1)
    np.testing.assert_allclose(after.hips - plain.hips, on, atol=1e-9)
    torch.testing.assert_close(after.rotations, plain.rotations)
    np.testing.assert_allclose(after.contacts, np.tile(1 / (1 + np.exp([2.0, 0.0, -1.0, -3.0])), (BATCH, 1)))
    assert logits[0].tolist() == [-2.0, 0.0, 1.0, 3.0]
    loud, _ = YAW.advance(body, aim, features, noise(YAW.output))
    matrices = to_matrix(loud.rotations)
    torch.testing.assert_close(matrices @ matrices.mT, torch.eye(3).double().expand_as(matrices))
    torch.testing.assert_close(matrices.flatten(-2)[..., ::3], loud.rotations[..., :3])
    wanted = skeleton.global_positions(
        loud.hips.numpy(), rotation.from_matrix(matrices.numpy()), HUMANOID.parents, HUMANOID.offsets
    )
    np.testing.assert_allclose(loud.positions, wanted, atol=1e-6)
    assert float((loud.rotations - plain.rotations).abs().mean()) > 0.05


def test_what_the_network_adds_fades_before_the_aim(yaw):
    body, aim = yaw
    out = torch.zeros(BATCH, YAW.output).double()
    out[:, 1] = 1.0
    for left, part in ((1.0, 0.0), (2.0, 1 / 3), (3.0, 2 / 3), (4.0, 1.0), (50.0, 1.0)):
        led = aim._replace(left=torch.full((BATCH, 1), left).double())
        features = YAW.features(body, led)
        plain, loud = (YAW.advance(body, led, features, x)[0].hips for x in (0.0 * out, out))
        np.testing.assert_allclose((loud - plain)[:, 1], 0.02 * part, atol=1e-12)


def test_a_silent_chain_on_the_base_stays_on_it(yaw):
    body, aim = yaw
    on_base = [(p[:, :3], p[:, 3:].unflatten(1, (22, 6))) for p in (aim.here, aim.there)]
    body = body._replace(hips=on_base[0][0], rotations=on_base[0][1])
    aim = aim._replace(hips=on_base[1][0], rotations=on_base[1][1])
    for left in (1.0, 2.0, 30.0):
        led = aim._replace(left=torch.full((BATCH, 1), left).double())
        after, _ = YAW.advance(body, led, YAW.features(body, led), torch.zeros(BATCH, YAW.output).double())
        torch.testing.assert_close(after.hips, aim.following[:, :3])
        torch.testing.assert_close(after.rotations.flatten(1), aim.following[:, 3:], atol=1e-6, rtol=0)


def test_what_a_chain_is_off_its_base_goes_evenly_over_the_frames_left(yaw):
    body, aim = yaw
    apart = body.hips - aim.here[:, :3], aim.hips - aim.there[:, :3]
    assert float((apart[0] - apart[1]).abs().max()) > 1e-3
    left, at = aim._replace(left=torch.full((BATCH, 1), 5.0).double()), aim.here
    for step in range(1, 6):
        features = YAW.features(body, left)
        body, _ = YAW.advance(body, left, features, torch.zeros(BATCH, YAW.output).double())
        part = step / 5
        torch.testing.assert_close(body.hips, left.following[:, :3] + (1 - part) * apart[0] + part * apart[1])
        at = left.following + 0.01
        left = left._replace(left=left.left - 1.0, here=left.following, following=at if step < 4 else left.there)
    torch.testing.assert_close(body.hips, aim.hips)


@pytest.mark.parametrize("name", ["yaw", "paper"])
def test_arrived_is_the_aim_at_rest(request, name):
    body, aim = request.getfixturevalue(name)
    form = FORMS[name]
    there = form.arrived(body, aim)
    assert all(torch.equal(getattr(there, n), getattr(aim, n)) for n in ("hips", "rotations", "positions"))
    assert not there.velocities.any()
    assert torch.equal(there.contacts, body.contacts)
    offset = form.features(there, aim).offset
    needed = offset[:, : 66 + 135] if name == "yaw" else offset
    torch.testing.assert_close(needed, torch.zeros_like(needed))


def test_paper_features_by_hand(paper):
    body, aim = paper
    seen = PAPER.features(body, aim)
    assert [x.shape[1] for x in seen[:3]] == [95, 91, 88] == [PAPER.state, PAPER.offset, PAPER.target]
    assert (PAPER.output, PAPER.turn) == (95, 4)
    for row in range(BATCH):
        turned, target = body.rotations[row].flatten().tolist(), aim.rotations[row].flatten().tolist()
        velocity = (body.velocities[row, 0] / 30.0).tolist()
        assert seen.state[row].tolist() == pytest.approx([*turned, *velocity, *body.contacts[row].tolist()])
        away = (aim.hips - body.hips)[row].tolist()
        assert seen.offset[row].tolist() == pytest.approx([*(b - a for a, b in zip(turned, target)), *away])  # noqa: B905
        assert seen.target[row].tolist() == target


def test_paper_updates_are_added_normalised_and_integrated(paper):
    body, aim = paper
    out = noise(95)
    after, logits = PAPER.advance(body, aim, PAPER.features(body, aim), out)
    sums = body.rotations.numpy() + 0.05 * out[:, :88].reshape(BATCH, 22, 4).numpy()
    np.testing.assert_allclose(after.rotations, sums / np.linalg.norm(sums, axis=-1, keepdims=True))
    torch.testing.assert_close(after.hips, body.hips + 0.02 * out[:, 88:91])
    world = skeleton.global_rotations(after.rotations.numpy(), HUMANOID.parents)
    wanted = skeleton.global_positions(after.hips.numpy(), world, HUMANOID.parents, HUMANOID.offsets)
    np.testing.assert_allclose(after.positions, wanted, atol=1e-6)
    torch.testing.assert_close(after.velocities, (after.positions - body.positions) * RATE)
    assert torch.equal(logits, out[:, -4:])
    torch.testing.assert_close(after.contacts, out[:, -4:].sigmoid())
    assert torch.all(after.known == 1.0)
    still, _ = PAPER.advance(body, aim, PAPER.features(body, aim), torch.zeros_like(out))
    torch.testing.assert_close(still.hips, body.hips)
    torch.testing.assert_close(still.rotations, body.rotations, atol=1e-6, rtol=0)


@given(humanoid_motions())
def test_positions_from_local_quaternions_are_the_skeletons(motion):
    hips, local = torch.tensor(motion.root_positions), torch.tensor(motion.local_rotations)
    got = chain_positions(hips, local)
    np.testing.assert_allclose(got, motion.global_positions(), atol=1e-5)
    matrices = torch.tensor(rotation.to_matrix(motion.global_rotations()))
    torch.testing.assert_close(got, joint_positions(hips, matrices), atol=1e-9, rtol=0)
