"""The planner at run time: bases and roll-outs are training's, and models without a planner interpolate."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose.export import dcmoe as exporting
from interpose.export import planner as exporting_plan
from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.runtime import planner, poses
from interpose.runtime.backends import dcmoe
from interpose.runtime.gap_batch import batch_of, draws
from interpose.runtime.model_folder import Session
from interpose.train.common.gaps import evenly, gap_input
from interpose.train.dcmoe import validation
from interpose.train.dcmoe.sequences import at_lone_start, base_window
from interpose.train.planner.objective import placed, within

COUNT = 4


def gaps(frames, steps, known=False, path=False):
    """Gaps of `steps` from start to target in training's form and as a batch."""
    drawn = evenly(frames, steps, COUNT, len(learning.STYLES))
    start = torch.maximum(drawn.start, frames.first[drawn.start] + 1)
    start = torch.minimum(start, frames.last[start] - steps - 1)  # frames before and beyond are there
    flags = [torch.full((COUNT, 1), float(flag)) for flag in (path, known, known)]
    drawn = replace(
        drawn,
        start=start,
        start_local=frames.local[start],
        target_local=frames.local[start + steps],
        path_known=flags[0],
        start_known=flags[1],
        target_known=flags[2],
    )

    def at(index):
        return frames.hips[index].double().numpy(), frames.local[index].double().numpy()

    index = start[:, None] + torch.arange(steps + 1)
    facing = frames.facing[index].double().numpy()
    yaw = np.unwrap(np.arctan2(facing[..., 0], facing[..., 1]), axis=-1)
    way = np.concatenate([frames.hips[index][..., ::2].double().numpy(), yaw[..., None]], axis=-1)
    target = drawn.target
    arriving = 30.0 * (frames.positions[target + 1] - frames.positions[target]).double().numpy()
    batch = batch_of(
        at(start[:, None] + torch.arange(-1 if known else 0, 1)),
        at(target[:, None]),
        steps - 1,
        paths=list(way) if path else None,
        arriving=arriving if known else None,
    )
    return drawn, batch


def trained_base(network, frames, drawn, steps):
    """What training works along, (row, frame, pose), with the mirror mean of use."""
    plan, _ = network.planner(gap_input(frames, drawn), torch.zeros(COUNT, network.planner.size.latent))
    rows = at_lone_start(frames, drawn)
    rows.plan = plan * within(drawn)
    return base_window(frames, rows, steps).transpose(0, 1).numpy(), rows


@pytest.fixture
def in_torch(monkeypatch, planned_network):
    """Sessions answer by the torch modules themselves, exactly."""
    modules = {"step": exporting.StepGraph(planned_network), "plan": exporting_plan.PlanGraph(planned_network.planner)}
    names = {
        "step": [*(f"next_{name}" for name in exporting.CARRIED), "contacts", "next_path"],
        "plan": ["added", "latent"],
    }

    def run(self, name, feed):
        order = list(self.shapes[name])
        assert set(order) == set(feed)
        with torch.no_grad():
            said = modules[name].eval()(*(torch.as_tensor(feed[n]) for n in order))
        return {n: x.numpy() for n, x in zip(names[name], said, strict=True)}

    monkeypatch.setattr(Session, "run", run)


def base_of(session, batch, noise=None):
    unvaried = np.zeros((len(batch), session.plan_latent)) if noise is None else noise
    return planner.base(session, batch, unvaried if session.has_planner else None, LONGEST_PLAN_STEPS)[0]


def interpolated(batch):
    return poses.bases(*batch.keys, list(batch.frames))


@pytest.mark.parametrize("steps", [2, 31, LONGEST_PLAN_STEPS])
@pytest.mark.parametrize(("known", "path"), [(False, False), (True, False), (False, True), (True, True)])
def test_the_base_is_that_of_training(in_torch, planned_session, planned_network, frames, steps, known, path):
    drawn, batch = gaps(frames, steps, known, path)
    wanted, _ = trained_base(planned_network, frames, drawn, steps)
    got, plain = base_of(planned_session, batch), interpolated(batch)
    np.testing.assert_allclose(got, wanted, atol=2e-3)
    if steps > 2:
        assert np.abs(got - plain)[:, 1:-1].max() > 0.05
        assert np.abs(got - wanted).mean() < 0.01 * np.abs(got - plain).mean()


def test_what_is_known_changes_the_base(planned_session, frames):
    made = [base_of(planned_session, gaps(frames, 31, known)[1]) for known in (False, True)]
    assert np.abs(made[0] - made[1]).max() > 1e-3


def test_rows_of_other_lengths_have_their_own_plans(in_torch, planned_session, frames):
    _, batch = gaps(frames, 31)
    whole = base_of(planned_session, batch)
    mixed = base_of(planned_session, replace(batch, frames=(30, 8, 30, 0)))
    np.testing.assert_allclose(mixed[::2], whole[::2], atol=1e-4)
    np.testing.assert_allclose(mixed[1, 9:], np.repeat(whole[1:2, -1], 23, axis=0), atol=1e-4)
    np.testing.assert_allclose(mixed[3, 1:], np.repeat(whole[3:4, -1], 31, axis=0), atol=1e-4)


def test_gaps_longer_than_plans_have_none(planned_session, planned_network, frames):
    steps = LONGEST_PLAN_STEPS + 1
    drawn, batch = gaps(frames, steps)
    wanted, rows = trained_base(planned_network, frames, drawn, steps)
    assert not rows.plan.any()
    got = base_of(planned_session, batch)
    np.testing.assert_array_equal(got, interpolated(batch))
    np.testing.assert_allclose(got, wanted, atol=1e-4)


def test_noise_makes_another_base_between_the_same_keys(planned_session, frames):
    _, batch = gaps(frames, 31)
    likeliest = base_of(planned_session, batch)
    noise = planner.noise(draws(0, COUNT), (planned_session.plan_latent,))
    assert not noise[0].any()
    np.testing.assert_array_equal(noise[2], planner.noise([(0, 2)], (planned_session.plan_latent,))[0])
    varied = base_of(planned_session, batch, noise)
    np.testing.assert_allclose(varied[0], likeliest[0], atol=1e-4)
    assert np.abs(varied - likeliest)[1:].max(axis=(1, 2)).min() > 1e-3
    np.testing.assert_allclose(varied[:, [0, -1]], likeliest[:, [0, -1]], atol=1e-9)


@pytest.mark.parametrize("path", [False, True])
def test_torch_rolls_out_to_the_same_frames(planned_session, planned_network, frames, path):
    drawn, batch = gaps(frames, 31, path=path)
    base, rows = trained_base(planned_network, frames, drawn, 31)
    naive = placed(torch.as_tensor(base[:, 1:-1])).numpy()
    wanted = validation.roll_out(planned_network, frames, rows).numpy()
    made = dcmoe.BACKEND.generate(planned_session, batch)
    off = np.linalg.norm(poses.pose_of(made.root, made.local).positions - wanted, axis=-1)
    moved = np.linalg.norm(naive - wanted, axis=-1)
    assert moved.mean() > 0.05
    assert off.mean() < 0.03 * moved.mean()  # the weights are in 8 bits
    assert off.max() < 0.03


def test_variants_follow_plans_of_their_own(planned_session, frames):
    same = gaps(frames, 31)[1].take([0, 0, 0])
    made = dcmoe.BACKEND.generate(planned_session, replace(same, draws=draws(0, 3))).root
    assert min(np.abs(made[i] - made[j]).max() for i, j in ((0, 1), (0, 2), (1, 2))) > 1e-3
    again = dcmoe.BACKEND.generate(planned_session, replace(same, draws=draws(0, 3))).root
    np.testing.assert_array_equal(made, again)


def test_a_model_without_a_planner_interpolates(session, frames):
    assert not session.has_planner
    assert session.plan_latent == 0
    assert set(session.shapes) == {"step"}
    _, batch = gaps(frames, 31)
    np.testing.assert_array_equal(base_of(session, batch), interpolated(batch))


def test_the_planners_file_and_what_model_json_has_of_it(planned_folder, planned_session, planned_network):
    assert {p.name for p in planned_folder.iterdir()} >= {"model.json", "step.onnx", "plan.onnx", "phases.npy"}
    info = planned_session.info["planner"]
    assert (info["latent"], info["hidden"], info["styles"]) == (8, 32, len(learning.STYLES))
    assert info["difference_from_torch"]["as_exported"] < 1e-4
    assert planned_session.info["parameters"] == sum(p.numel() for p in planned_network.parameters())
    assert planned_session.has_planner
    assert planned_session.plan_latent == 8
    assert planned_session.network("plan").get_outputs()[0].shape[2] == 135
