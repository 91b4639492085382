"""The completion of targets: what it looks at, in which frame it speaks, what it leaves as it is given."""

import pytest
import torch

from interpose import parts
from interpose.export.completions import example_target
from interpose.models.geometry import root_frame, to_matrix, to_six
from interpose.models.target_pose import TargetInput, TargetPose, TargetSize, posed, residual
from interpose.skeleton import HUMANOID

SIZE = TargetSize(latent=3, hidden=32, depth=1, styles=2)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(2)
    model = TargetPose(SIZE).eval().requires_grad_(False)
    model.decoder[-1].weight.mul_(5.0)
    return model


def asked_for(text, network, batch=4):
    given = parts.parse(text)
    one = example_target(network, batch, 1)
    one["start_rotations"] = to_six(to_matrix(one["start_rotations"]))
    one["target_rotations"] = to_six(to_matrix(one["target_rotations"]))
    one["joints"] = torch.tensor(given.known).float().expand(batch, -1)
    one["ground"] = torch.full((batch, 1), float(given.ground))
    noise = one.pop("noise")
    return TargetInput(**one), noise


def complete(network, known, noise):
    x, place = network(known)
    return network.decode(x, place, known, noise)


@pytest.mark.parametrize("text", ["hips", "hands", "left-foot", "head", "upper", "lower", "ground"])
def test_what_is_not_given_is_not_looked_at(network, text):
    known, noise = asked_for(text, network)
    made = complete(network, known, noise)
    leads = set(parts.parse(text).joints) or {0}  # the given joints, and those whose turn says where they are
    for joint in sorted(leads):
        while joint >= 0:
            leads.add(joint)
            joint = HUMANOID.parents[joint]
    free = [joint for joint in range(22) if joint not in leads]
    wild = known.target_rotations.clone()
    wild[:, free] = wild.roll(1, dims=0)[:, free]
    other = complete(network, known._replace(target_rotations=wild), noise)
    for a, b in zip(made, other, strict=True):
        torch.testing.assert_close(a, b, atol=1e-5, rtol=1e-5)


def test_what_is_given_stays(network):
    known, noise = asked_for("hips,right-hand", network)
    made = complete(network, known, noise)
    torch.testing.assert_close(made.hips, known.target_hips)
    kept = known.joints[0].bool()
    torch.testing.assert_close(made.rotations[:, kept], to_matrix(known.target_rotations)[:, kept])
    assert not torch.allclose(made.rotations[:, ~kept], to_matrix(known.target_rotations)[:, ~kept], atol=1e-2)
    known, noise = asked_for("ground", network)
    made = complete(network, known, noise)
    torch.testing.assert_close(made.hips[:, ::2], known.target_hips[:, ::2])
    assert not torch.allclose(made.hips[:, 1], known.target_hips[:, 1], atol=1e-3)


@pytest.mark.parametrize("text", ["hands", "ground", "left-foot"])
def test_the_scene_may_be_turned_and_moved(network, text):
    known, noise = asked_for(text, network)
    turn = root_frame(torch.tensor([[0.6, 0.8]]))[0].T
    move = torch.tensor([3.0, 0.0, -2.0])

    def turned(six):
        return (six.reshape(six.shape[0], -1, 3) @ turn).reshape(six.shape)

    elsewhere = known._replace(
        start_hips=known.start_hips @ turn + move,
        target_hips=known.target_hips @ turn + move,
        start_rotations=turned(known.start_rotations),
        target_rotations=turned(known.target_rotations),
        start_velocities=known.start_velocities @ turn,
    )
    here, there = complete(network, known, noise), complete(network, elsewhere, noise)
    torch.testing.assert_close(here.hips @ turn + move, there.hips, atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(turned(to_six(here.rotations)), to_six(there.rotations), atol=1e-4, rtol=1e-4)


def test_the_residual_of_the_truth_gives_the_truth(network):
    known, _ = asked_for("left-hand", network)
    _, place = network(known)
    hips, rotations = posed(place, known, residual(place, known))
    torch.testing.assert_close(hips, known.target_hips, atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(rotations, to_matrix(known.target_rotations), atol=1e-5, rtol=1e-5)


def test_noise_makes_other_poses(network):
    known, noise = asked_for("head", network)
    assert not torch.allclose(complete(network, known, noise).hips, complete(network, known, -noise).hips, atol=1e-4)
