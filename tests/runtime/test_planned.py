"""DC-MoE along a plan at run time: the base and the roll-out are training's, and models without a planner go on."""

import learning
import numpy as np
import pytest
import torch

from interpose.export import dcmoe as exporting
from interpose.export import planner as exporting_plan
from interpose.features.stitch import ANCHORS, LONGEST_PLAN
from interpose.runtime import planner, poses
from interpose.runtime.backends import dcmoe
from interpose.runtime.model_folder import Session
from interpose.train.common import checkpoint
from interpose.train.dcmoe import validation
from interpose.train.dcmoe.sequences import base_window
from interpose.train.planner import objective as training

COUNT = 4


def gaps(frames, steps, known=False, path=False):
    """Rows of `steps` from start to target, and the same gaps as the run time has them: context, start, target, paths,
    velocities at the target."""
    rows = validation.fixed_rows(frames, steps - 1, COUNT, len(learning.STYLES))
    rows.start = torch.maximum(rows.start, frames.first[rows.start] + 1)
    rows.start = torch.minimum(rows.start, frames.last[rows.start] - steps - 1)  # frames before and beyond are there
    rows = _restarted(frames, rows)
    rows.start_known.fill_(float(known))
    rows.target_known.fill_(float(known))
    rows.path_known.fill_(float(path))
    target = rows.start + rows.total

    def at(index):
        return frames.hips[index].double().numpy(), frames.local[index].double().numpy()

    before = torch.arange(-1 if known else 0, 1)
    context = poses.pose_of(*at(rows.start[:, None] + before))
    index = rows.start[:, None] + torch.arange(steps + 1)
    facing = frames.facing[index].double().numpy()
    yaw = np.unwrap(np.arctan2(facing[..., 0], facing[..., 1]), axis=-1)
    way = np.concatenate([frames.hips[index][..., ::2].double().numpy(), yaw[..., None]], axis=-1)
    arriving = 30.0 * (frames.positions[target + 1] - frames.positions[target]).double().numpy()
    paths = list(way) if path else [None] * COUNT
    return rows, (context, at(rows.start), at(target)), paths, arriving if known else None


def _restarted(frames, rows):
    """The same rows, their keys those at their new starts."""
    keys = type(rows.keys)(rows.keys.foreign, frames.local[rows.start], frames.local[rows.start + rows.total])
    rows.keys = keys
    return rows


def plainly(session, told, noise):
    """The plan alone, not averaged with its mirror image."""
    said = session.run("plan", {k: np.asarray(v, dtype=np.float32) for k, v in (told | {"noise": noise}).items()})
    return said["added"], said["latent"]


@pytest.fixture
def in_torch(monkeypatch, planned_network):
    """Sessions answer by the torch modules themselves, exactly, and plans are not averaged."""
    modules = {"step": exporting.Step(planned_network), "plan": exporting_plan.Plan(planned_network.planner)}
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
    monkeypatch.setattr(planner, "plan", plainly)


def led(session, ends, paths, arriving, steps, drawn=None):
    context, start, target = ends
    weights = session.style_weights([None] * COUNT)
    noise = np.zeros((COUNT, session.plan_latent)) if drawn is None else drawn
    return dcmoe.led(session, context, start, target, [steps - 1] * COUNT, weights, noise, paths, 1.0, arriving)


@pytest.mark.parametrize("steps", [2, 31, LONGEST_PLAN])
@pytest.mark.parametrize(("known", "path"), [(False, False), (True, False), (False, True), (True, True)])
def test_the_base_is_that_of_training(in_torch, planned_session, planned_network, frames, steps, known, path):
    rows, ends, paths, arriving = gaps(frames, steps, known, path)
    training.add_plans(planned_network.planner, frames, rows, 0.0, torch.Generator())
    wanted = base_window(frames, rows, steps, True).transpose(0, 1).numpy()
    got = led(planned_session, ends, paths, arriving, steps)
    np.testing.assert_allclose(got, wanted, atol=2e-3)
    plain = poses.bases(*ends[1:], [steps - 1] * COUNT)
    if steps > 2:
        assert np.abs(got - plain)[:, 1:-1].max() > 0.05
        assert np.abs(got - wanted).mean() < 0.01 * np.abs(got - plain).mean()


def test_what_is_known_changes_the_base(planned_session, frames):
    made = [led(planned_session, *gaps(frames, 31, *said)[1:], 31) for said in ((False, False), (True, False))]
    assert np.abs(made[0] - made[1]).max() > 1e-3


def test_rows_of_other_lengths_have_their_own_plans(in_torch, planned_session, frames):
    _, ends, _, _ = gaps(frames, 31)
    whole = led(planned_session, ends, [None] * COUNT, None, 31)
    context, start, target = ends
    weights, noise = planned_session.style_weights([None] * COUNT), np.zeros((COUNT, planned_session.plan_latent))
    mixed = dcmoe.led(planned_session, context, start, target, [30, 8, 30, 0], weights, noise, [None] * COUNT)
    np.testing.assert_allclose(mixed[::2], whole[::2], atol=1e-4)
    np.testing.assert_allclose(mixed[1, 9:], np.repeat(whole[1:2, -1], 23, axis=0), atol=1e-4)
    np.testing.assert_allclose(mixed[3, 1:], np.repeat(whole[3:4, -1], 31, axis=0), atol=1e-4)


def test_gaps_longer_than_plans_have_none(planned_session, planned_network, frames):
    steps = LONGEST_PLAN + 1
    rows, ends, paths, _ = gaps(frames, steps)
    training.add_plans(planned_network.planner, frames, rows, 0.0, torch.Generator())
    assert not rows.added.any()
    got = led(planned_session, ends, paths, None, steps)
    np.testing.assert_array_equal(got, poses.bases(*ends[1:], [steps - 1] * COUNT))
    np.testing.assert_allclose(got, base_window(frames, rows, steps, True).transpose(0, 1).numpy(), atol=1e-4)


def test_noise_makes_another_base_between_the_same_keys(planned_session, frames):
    _, ends, paths, _ = gaps(frames, 31)
    likeliest = led(planned_session, ends, paths, None, 31)
    drawn = planner.noise((planned_session.plan_latent,), COUNT, 0, True)
    assert not drawn[0].any()
    varied = led(planned_session, ends, paths, None, 31, drawn)
    np.testing.assert_allclose(varied[0], likeliest[0], atol=1e-4)
    assert np.abs(varied - likeliest)[1:].max(axis=(1, 2)).min() > 1e-3
    np.testing.assert_allclose(varied[:, [0, -1]], likeliest[:, [0, -1]], atol=1e-9)


def joints(root, local):
    return poses.pose_of(root, local).positions


@pytest.mark.parametrize("path", [False, True])
def test_torch_rolls_out_to_the_same_frames(planned_session, planned_network, frames, monkeypatch, path):
    monkeypatch.setattr(planner, "plan", plainly)
    gap = 30
    rows = validation.fixed_rows(frames, gap, COUNT, len(learning.STYLES))
    rows.path_known.fill_(float(path))
    start, target, index = rows.start, rows.start + rows.total, rows.start[:, None] + torch.arange(gap + 2)
    training.add_plans(planned_network.planner, frames, rows, 0.0, torch.Generator())
    naive = validation._placed(base_window(frames, rows, gap)[1:]).numpy()
    wanted = validation.roll_out(planned_network, frames, rows).numpy()
    ends = [(frames.hips[at].double().numpy(), frames.local[at].double().numpy()) for at in (start, target)]
    facing = frames.facing[index].double().numpy()
    yaw = np.unwrap(np.arctan2(facing[..., 0], facing[..., 1]), axis=-1)
    way = np.concatenate([frames.hips[index][..., ::2].double().numpy(), yaw[..., None]], axis=-1)
    root, local, _ = dcmoe.generate_batch(
        planned_session, ends[0][0][:, None], ends[0][1][:, None], *ends[1], gap, paths=list(way) if path else None
    )
    off = np.linalg.norm(joints(root, local) - wanted, axis=-1)
    moved = np.linalg.norm(naive - wanted, axis=-1)
    assert moved.mean() > 0.05
    assert off.mean() < 0.03 * moved.mean()  # the weights are in 8 bits
    assert off.max() < 0.03


def test_variants_go_along_plans_of_their_own(planned_session, frames):
    _, (_, start, target), _, _ = gaps(frames, 31)
    same = [np.repeat(x[:1], 3, axis=0) for x in (start[0][:, None], start[1][:, None], *target)]
    made = dcmoe.generate_batch(planned_session, *same, 30, vary=True)[0]
    assert min(np.abs(made[i] - made[j]).max() for i, j in ((0, 1), (0, 2), (1, 2))) > 1e-3
    again = dcmoe.generate_batch(planned_session, *same, 30, vary=True)[0]
    np.testing.assert_array_equal(made, again)


def test_what_is_foreseen_are_the_hips_of_the_likeliest_base(planned_session, frames):
    _, (context, start, target), _, _ = gaps(frames, 31)
    one = [x[:1] for x in (start[0][:, None], start[1][:, None], *target)]
    got = dcmoe.foreseen(planned_session, tuple(one[:2]), tuple(one[2:]), 30, None, 1.0)
    whole = led(planned_session, (context, start, target), [None] * COUNT, None, 31)
    np.testing.assert_allclose(got, whole[0, 1:-1, :3], atol=1e-4)


def test_a_model_without_a_planner_interpolates_as_before(session, network, frames, tmp_path):
    assert not session.plans
    assert session.plan_latent == 0
    assert set(session.networks) == {"step"}
    _, ends, paths, _ = gaps(frames, 31)
    np.testing.assert_array_equal(led(session, ends, paths, None, 31), poses.bases(*ends[1:], [30] * COUNT))
    saved = checkpoint.load(learning.write_run(tmp_path / "run", network))
    del saved["config"]["planner"]  # as runs of older programs have it
    assert exporting.model_of(saved).planner is None


def test_the_planners_file_and_what_is_told_of_it(planned_folder, planned_session, planned_network):
    assert {p.name for p in planned_folder.iterdir()} == {"model.json", "step.onnx", "plan.onnx", "phases.npy"}
    told = planned_session.info["planner"]
    assert (told["latent"], told["hidden"], told["styles"]) == (8, 32, len(learning.STYLES))
    assert told["difference_from_torch"]["as_exported"] < exporting_plan.TOLERANCE
    assert planned_session.info["parameters"] == sum(p.numel() for p in planned_network.parameters())
    assert planned_session.plans
    assert planned_session.plan_latent == 8
    assert planned_session.networks["plan"].get_outputs()[0].shape[1:] == [ANCHORS, 135]
