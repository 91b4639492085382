"""Stitched gaps at run time: against the training's own roll-out, by seed, along paths, in any place."""

import json
import shutil
from dataclasses import asdict

import learning
import numpy as np
import pytest
import stitch_learning
import torch

from interpose import rotation
from interpose.errors import InputError
from interpose.export import stitch as exporting
from interpose.export.planner import Plan
from interpose.features.stitch import network_shapes, pressed, seam
from interpose.models.geometry import root_frame
from interpose.motion import mirror
from interpose.runtime import methods, planner, poses
from interpose.runtime.backends import dcmoe, stitch
from interpose.runtime.inbetween import inbetween
from interpose.runtime.model_folder import Session, load
from interpose.runtime.request import Request
from interpose.runtime.streaming.stream import Stream
from interpose.skeleton import MIRROR
from interpose.train.common import gaps
from interpose.train.common.frames import Frames
from interpose.train.stitch import transitions

STYLES = list(learning.STYLES)


@pytest.fixture(scope="module")
def session(stitch_folder):
    return load(stitch_folder)


@pytest.fixture(scope="module")
def keys():
    """Starts and targets of three gaps: root and local rotations of one frame, and of the target."""
    clips = [learning.march(80, 0.8 + 0.3 * i, 2.0 * i) for i in range(3)]
    start = [np.stack([getattr(c, x)[11:12] for c in clips]) for x in ("root_positions", "local_rotations")]
    target = [np.stack([getattr(c, x)[60] for c in clips]) for x in ("root_positions", "local_rotations")]
    return *start, *target


def joints(root, local):
    return poses.pose_of(root, local).positions


def in_torch(monkeypatch, model):
    """Sessions answer by the torch modules themselves, exactly."""
    modules = {"front": exporting.Step(model.front), "back": exporting.Step(model.back)}
    if model.plan is not None:
        modules["plan"] = Plan(model.plan)

    def run(self, name, feed):
        order = list(self.shapes[name])
        assert set(order) == set(feed)
        with torch.no_grad():
            said = modules[name].eval()(*(torch.as_tensor(feed[n]) for n in order))
        outputs = ["added", "latent"] if name == "plan" else [f"next_{n}" for n in (*exporting.MADE, *order[14:18])]
        assert len(said) == len(outputs)
        return {n: x.numpy() for n, x in zip(outputs, said, strict=True)}

    monkeypatch.setattr(Session, "run", run)


def plainly(session, ends, noise):
    """The plan alone, not averaged with its mirror image."""
    said = session.run("plan", {k: np.asarray(v, dtype=np.float32) for k, v in (ends | {"noise": noise}).items()})
    return said["added"], said["latent"]


@pytest.mark.parametrize("config", [stitch_learning.CONFIG, stitch_learning.PAPER], ids=["yaw", "paper"])
@pytest.mark.parametrize("steps", [5, 8])
def test_the_run_time_makes_what_training_makes(frames: Frames, monkeypatch, tmp_path, config, steps):
    model = stitch_learning.network_for(frames, config)
    info = {
        "name": "x",
        "method": "stitch",
        "styles": STYLES,
        "network": json.loads(json.dumps(asdict(config.size))),
        "course": [config.course.buffer, config.course.aligned, config.course.both],
        "mean_quaternions": model.mean_quaternions.tolist(),
    }
    in_torch(monkeypatch, model)
    monkeypatch.setattr(planner, "plan", plainly)
    drawn = gaps.evenly(frames, steps, 3, len(STYLES))
    made, _, _ = transitions.made_gaps(model, frames, drawn, config, torch.Generator().manual_seed(0))
    at = [drawn.start.numpy(), drawn.target.numpy()]
    root = [frames.hips.numpy()[i].astype(float) for i in at]
    local = [frames.local.numpy()[i].astype(float) for i in at]
    got = methods.generate_batch(
        Session(tmp_path, info), root[0][:, None], local[0][:, None], root[1], local[1], steps - 1
    )
    alone = [i for i in range(1, steps) if i not in seam(steps, config.course.buffer).overlap]
    wanted = made.positions[:, alone]
    said = torch.as_tensor(joints(got[0], got[1])[:, [i - 1 for i in alone]], dtype=torch.float32)
    if config is stitch_learning.PAPER:  # its training works in the start's frame
        frame = root_frame(frames.facing[drawn.start])[:, None]
        origin = frames.hips[drawn.start] * torch.tensor([1.0, 0.0, 1.0])
        said = (said - origin[:, None, None]) @ frame
    torch.testing.assert_close(said, wanted, atol=2e-3, rtol=0.0)


def test_the_plan_of_a_mirrored_gap_is_the_mirrored_plan(session):
    clip = learning.march(60, 1.1, 0.4)
    noise = np.zeros((1, 16))
    plans = []
    for one in (clip, mirror(clip)):
        first, last = (poses.pose_of(one.root_positions[[i]], one.local_rotations[[i]]) for i in (5, 40))
        ends = planner.ends(first, None, last, None, [35], session.style_weights([None]), [None], 1.0)
        plans.append(planner.plan(session, ends, noise)[0])
    hips, turned = plans[0][..., :3], plans[0][..., 3:].reshape(1, 8, 22, 6)
    np.testing.assert_allclose(plans[1][..., :3], hips * [-1.0, 1.0, 1.0], atol=5e-3)
    wanted = turned[:, :, MIRROR] * [1.0, -1.0, -1.0, -1.0, 1.0, 1.0]
    np.testing.assert_allclose(plans[1][..., 3:].reshape(1, 8, 22, 6), wanted, atol=2e-2)
    assert np.abs(turned).max() > 0.1


def test_the_seam_is_pressed_and_nothing_else():
    time = np.arange(41.0)
    kinked = np.stack([np.abs(time - 20.0), time])[None].swapaxes(1, 2)
    flat = pressed(kinked, 40)
    bends = [np.abs(np.diff(x[0, :, 0], n=2)).max() for x in (kinked, flat)]
    assert bends[1] < 0.8 * bends[0]
    np.testing.assert_allclose(flat[..., 1], kinked[..., 1])  # what has no bend stays
    np.testing.assert_array_equal(flat[:, :14], kinked[:, :14])
    np.testing.assert_array_equal(flat[:, 28:], kinked[:, 28:])
    np.testing.assert_array_equal(pressed(kinked[:, :16], 15), kinked[:, :16])


def test_a_seed_gives_the_same_motion_whatever_stands_beside(session, keys):
    a = methods.generate_batch(session, *keys, 9, seed=5, vary=True)
    b = methods.generate_batch(session, *keys, 9, seed=5, vary=True)
    np.testing.assert_array_equal(a[0], b[0])
    fewer = methods.generate_batch(session, *(k[:2] for k in keys), 9, seed=5, vary=True)
    np.testing.assert_allclose(fewer[0], a[0][:2], atol=2e-3)
    other = methods.generate_batch(session, *keys, 9, seed=6, vary=True)
    assert np.abs(other[0] - a[0]).max() > 1e-3


def test_the_first_of_seed_0_is_the_likeliest_and_the_others_vary(session, keys):
    same = [np.repeat(k[:1], 3, axis=0) for k in keys]
    likeliest = methods.generate_batch(session, *same, 9)[0]
    varied = methods.generate_batch(session, *same, 9, vary=True)[0]
    np.testing.assert_allclose(varied[0], likeliest[0], atol=2e-3)
    assert np.abs(varied[1] - varied[2]).max() > 1e-3
    np.testing.assert_allclose(likeliest[1], likeliest[0], atol=2e-3)


def test_rows_of_different_lengths_are_followed_by_their_targets(session, keys):
    root, local, contacts = methods.generate_batch(session, *keys, [9, 4, 0])
    alone = methods.generate_batch(session, *(k[1:2] for k in keys), 4)
    assert root.shape == (3, 9, 3)
    assert local.shape == (3, 9, 22, 4)
    assert contacts.shape == (3, 9, 4)
    np.testing.assert_allclose(root[1, :4], alone[0][0], atol=2e-3)
    np.testing.assert_array_equal(root[1, 4:], np.repeat(keys[2][1:2], 5, axis=0))
    np.testing.assert_array_equal(root[2], np.repeat(keys[2][2:3], 9, axis=0))
    assert np.all((contacts >= 0.0) & (contacts <= 1.0))


def test_a_gap_elsewhere_is_the_same_gap(session, keys):
    root, local, goal_root, goal_local = keys
    turn = rotation.from_rotation_vector(np.array([0.0, 1.3, 0.0]))
    moved = np.array([4.0, 0.0, -2.0])
    turned = [local.copy(), goal_local.copy()]
    for each in turned:
        each[..., 0, :] = rotation.multiply(turn, each[..., 0, :])
    there = rotation.rotate(turn, root) + moved, turned[0], rotation.rotate(turn, goal_root) + moved, turned[1]
    here = methods.generate_batch(session, *keys, 9)
    elsewhere = methods.generate_batch(session, *there, 9)
    np.testing.assert_allclose(elsewhere[0], rotation.rotate(turn, here[0]) + moved, atol=5e-3)


def test_known_velocities_matter_at_both_ends(session, keys):
    root, local, *goal = keys
    plain = methods.generate_batch(session, *keys, 9)[0]
    before = root - np.array([0.0, 0.0, 0.05])
    context = np.concatenate([before, root], axis=1), np.concatenate([local, local], axis=1)
    assert np.abs(methods.generate_batch(session, *context, *goal, 9)[0] - plain).max() > 1e-4
    arriving = np.zeros((3, 22, 3))
    arriving[..., 2] = 2.0
    assert np.abs(methods.generate_batch(session, *keys, 9, arriving=arriving)[0] - plain).max() > 1e-4


def test_the_backward_chain_leaves_the_target_against_its_velocity(session, keys, monkeypatch):
    fed = {}
    run = Session.run

    def listened(self, name, feed):
        fed.setdefault(name, feed)
        return run(self, name, feed)

    monkeypatch.setattr(Session, "run", listened)
    arriving = np.random.default_rng(1).normal(size=(3, 22, 3))
    methods.generate_batch(session, *keys, 9, arriving=arriving)
    np.testing.assert_allclose(fed["back"]["velocities"], -arriving, atol=1e-6)
    np.testing.assert_allclose(fed["plan"]["target_velocities"], arriving, atol=1e-6)
    assert fed["front"]["known"].max() == 0.0
    assert fed["back"]["known"].min() == 1.0


def test_the_root_keeps_to_a_path(session, keys):
    steps = 20
    line = np.linspace(0.0, 1.0, steps + 1)[:, None]
    paths = []
    for a, b in zip(keys[0][:, 0], keys[2], strict=True):
        way = a[[0, 2]] + line * (b - a)[[0, 2]] + np.sin(np.pi * line) * np.array([0.6, 0.0])
        paths.append(np.concatenate([way, np.zeros((steps + 1, 1))], axis=1))
    led = methods.generate_batch(session, *keys, steps - 1, paths=paths)[0]
    free = methods.generate_batch(session, *keys, steps - 1)[0]
    away = [np.mean([dcmoe.strayed(x, p) for x, p in zip(made, paths, strict=True)]) for made in (led, free)]
    assert away[0] < 0.5 * away[1]
    none = methods.generate_batch(session, *keys, steps - 1, paths=paths, control=0.0)[0]
    np.testing.assert_allclose(none, free, atol=2e-3)


def test_chains_that_meet_are_told_of(session, keys):
    _, apart = stitch.stitch(session, *keys, [7, 7, 0])
    assert np.all(apart[:2] < 1e-5)
    assert np.isnan(apart[2])


def test_transitions_on_a_rig_arrive_and_are_told_of(session):
    clip = learning.march(40, 1.0, 0.3)
    request = Request("stitch", session, seed=1, path="none")
    made = inbetween(clip[5], clip[30], 24, request, variants=3)
    assert len(made) == 3
    for one in made:
        assert one.info.method == "stitch"
        assert one.info.fallback is None
        assert one.info.trajectory == "model"
        assert one.info.arrival_position_error_m < 1e-6
        assert len(one.motion) == 24
    assert Request("stitch", session).session is session
    fallen = inbetween(clip[5], clip[30], 24, Request("stitch+detail", session), variants=1)[0]
    assert "is for method stitch" in (fallen.info.fallback or "")


def test_an_unknown_style_and_a_stream_are_refused(session, keys):
    with pytest.raises(InputError, match="has no style 'Nobody'"):
        methods.generate_batch(session, *keys, 9, style=["Nobody", None, None])
    with pytest.raises(InputError, match=r"makes whole gaps \(method stitch\); stream with one for dcmoe"):
        Stream(session, learning.march(5, 1.0, 0.0))


def test_files_that_are_not_those_of_the_model(stitch_folder, tmp_path):
    folder = tmp_path / "model"
    shutil.copytree(stitch_folder, folder)
    (folder / "back.onnx").write_bytes(b"no network")
    with pytest.raises(InputError, match=r"back\.onnx cannot be loaded"):
        _ = load(folder).networks
    info = json.loads((folder / "model.json").read_text())
    del info["course"]
    (folder / "model.json").write_text(json.dumps(info))
    with pytest.raises(InputError, match="lacks course"):
        load(folder)


def test_methods_choose_by_the_model(session, keys):
    chosen = methods.generate_batch(session, *keys, 9, seed=2, vary=True)
    np.testing.assert_array_equal(chosen[0], stitch.stitch(session, *keys, 9, seed=2, vary=True)[0][0])


def test_shapes_are_those_of_the_files(session):
    shapes = network_shapes(session.info["network"], len(session.styles))
    for name, network in session.networks.items():
        assert [i.name for i in network.get_inputs()] == list(shapes[name])
