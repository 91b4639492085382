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
from interpose.export.planner import PlanGraph
from interpose.features.stitch import memory_shapes, network_shapes, schedule, seam, shares, smoothed
from interpose.models.geometry import root_frame
from interpose.motion import mirror
from interpose.runtime import planner, poses
from interpose.runtime.backends import stitch
from interpose.runtime.gap_batch import batch_of, draws
from interpose.runtime.inbetween import inbetween
from interpose.runtime.model_folder import Session, load
from interpose.runtime.request import Request
from interpose.runtime.streaming.streams import Stream
from interpose.runtime.transition import path_deviation
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
    """Starts and targets of three gaps, (root, local) each with a frame axis."""
    clips = [learning.march(80, 0.8 + 0.3 * i, 2.0 * i) for i in range(3)]
    return tuple(
        tuple(np.stack([getattr(c, x)[at : at + 1] for c in clips]) for x in ("root_positions", "local_rotations"))
        for at in (11, 60)
    )


def rows_of(keys, rows):
    return [tuple(x[rows] for x in key) for key in keys]


def stitched(session, keys, frames, **more):
    return stitch.BACKEND.generate(session, batch_of(*keys, frames, **more))


def joints(root, local):
    return poses.pose_of(root, local).positions


def in_torch(monkeypatch, model):
    """Sessions answer by the torch modules themselves, exactly, and training follows the plans of use: mirror means."""

    def plan_of_use(planner, data, chosen, *_):
        return planner(gaps.gap_input(data, chosen), torch.zeros(len(chosen), planner.size.latent))[::-1]

    monkeypatch.setattr(transitions, "_planned", plan_of_use)
    modules = {"front": exporting.GeneratorGraph(model.front), "back": exporting.GeneratorGraph(model.back)}
    if model.plan is not None:
        modules["plan"] = PlanGraph(model.plan)
    memories = memory_shapes(model.size.memory, model.size.decoder_memory)

    def run(self, name, feed):
        order = list(self.shapes[name])
        assert set(order) == set(feed)
        with torch.no_grad():
            said = modules[name].eval()(*(torch.as_tensor(feed[n]) for n in order))
        outputs = ["added", "latent"] if name == "plan" else [f"next_{n}" for n in (*exporting.MADE, *memories)]
        return {n: x.numpy() for n, x in zip(outputs, said, strict=True)}

    monkeypatch.setattr(Session, "run", run)


@pytest.mark.parametrize("config", [stitch_learning.CONFIG, stitch_learning.PAPER], ids=["yaw", "paper"])
@pytest.mark.parametrize("steps", [5, 8])
def test_the_run_time_makes_what_training_makes(frames: Frames, monkeypatch, tmp_path, config, steps):
    model = stitch_learning.network_for(frames, config)
    info = {
        "name": "x",
        "method": "stitch",
        "styles": STYLES,
        "network": json.loads(json.dumps(asdict(config.size))),
        "chains": asdict(config.chains),
        "mean_quaternions": model.mean_quaternions.tolist(),
    }
    if config.size.plan is not None:
        info["planner"] = asdict(config.size.plan)
    in_torch(monkeypatch, model)
    drawn = gaps.evenly(frames, steps, 3, len(STYLES))
    made, _, _ = transitions.made_gaps(model, frames, drawn, config, torch.Generator().manual_seed(0))
    at = [drawn.start.numpy(), drawn.target.numpy()]
    ends = [tuple(x.numpy()[i, None].astype(float) for x in (frames.hips, frames.local)) for i in at]
    got = stitched(Session(tmp_path, info), ends, steps - 1)
    alone = [i for i in range(1, steps) if i not in seam(steps, config.chains.buffer).overlap]
    wanted = made.positions[:, alone]
    said = torch.as_tensor(joints(got.root, got.local)[:, [i - 1 for i in alone]], dtype=torch.float32)
    if config is stitch_learning.PAPER:  # its training works in the start's frame
        frame = root_frame(frames.facing[drawn.start])[:, None]
        origin = frames.hips[drawn.start] * torch.tensor([1.0, 0.0, 1.0])
        said = (said - origin[:, None, None]) @ frame
    torch.testing.assert_close(said, wanted, atol=2e-3, rtol=0.0)


def test_the_plan_of_a_mirrored_gap_is_the_mirrored_plan(session):
    clip = learning.march(60, 1.1, 0.4)
    added = []
    for one in (clip, mirror(clip)):
        first, last = (poses.pose_of(one.root_positions[[i]], one.local_rotations[[i]]) for i in (5, 40))
        gap = planner.gap_inputs(first, None, last, None, [35], session.style_weights([None]), [None])
        added.append(planner.predict(session, gap, np.zeros((1, session.plan_latent)), 36)[0])
    hips, turned = added[0][..., :3], added[0][..., 3:].reshape(1, 36, 22, 6)
    np.testing.assert_allclose(added[1][..., :3], hips * [-1.0, 1.0, 1.0], atol=5e-3)
    wanted = turned[:, :, MIRROR] * [1.0, -1.0, -1.0, -1.0, 1.0, 1.0]
    np.testing.assert_allclose(added[1][..., 3:].reshape(1, 36, 22, 6), wanted, atol=2e-2)
    assert np.abs(turned).max() > 0.1


def test_a_seed_gives_the_same_motion_whatever_stands_beside(session, keys):
    a = stitched(session, keys, 9, draws=draws(5, 3)).root
    np.testing.assert_array_equal(a, stitched(session, keys, 9, draws=draws(5, 3)).root)
    fewer = stitched(session, rows_of(keys, slice(2)), 9, draws=draws(5, 2)).root
    np.testing.assert_allclose(fewer, a[:2], atol=2e-3)
    assert np.abs(stitched(session, keys, 9, draws=draws(6, 3)).root - a).max() > 1e-3


def test_the_first_of_seed_0_is_the_likeliest_and_the_others_vary(session, keys):
    same = rows_of(keys, [0, 0, 0])
    likeliest = stitched(session, same, 9).root
    varied = stitched(session, same, 9, draws=draws(0, 3)).root
    np.testing.assert_allclose(varied[0], likeliest[0], atol=2e-3)
    assert np.abs(varied[1] - varied[2]).max() > 1e-3
    np.testing.assert_allclose(likeliest[1], likeliest[0], atol=2e-3)


def test_rows_of_different_lengths_are_followed_by_their_targets(session, keys):
    made = stitched(session, keys, [9, 4, 0])
    alone = stitched(session, rows_of(keys, slice(1, 2)), 4)
    assert (made.root.shape, made.local.shape, made.contacts.shape) == ((3, 9, 3), (3, 9, 22, 4), (3, 9, 4))
    np.testing.assert_allclose(made.root[1, :4], alone.root[0], atol=2e-3)
    goal = keys[1][0]
    np.testing.assert_array_equal(made.root[1, 4:], np.repeat(goal[1], 5, axis=0))
    np.testing.assert_array_equal(made.root[2], np.repeat(goal[2], 9, axis=0))
    assert np.all((made.contacts >= 0.0) & (made.contacts <= 1.0))


def test_a_gap_elsewhere_is_the_same_gap(session, keys):
    turn = rotation.from_rotation_vector(np.array([0.0, 1.3, 0.0]))
    moved = np.array([4.0, 0.0, -2.0])
    there = []
    for root, local in keys:
        turned = local.copy()
        turned[..., 0, :] = rotation.multiply(turn, turned[..., 0, :])
        there.append((rotation.rotate(turn, root) + moved, turned))
    here, elsewhere = stitched(session, keys, 9).root, stitched(session, there, 9).root
    np.testing.assert_allclose(elsewhere, rotation.rotate(turn, here) + moved, atol=5e-3)


def test_known_velocities_matter_at_both_ends(session, keys):
    (root, local), goal = keys
    plain = stitched(session, keys, 9).root
    before = root - np.array([0.0, 0.0, 0.05])
    context = np.concatenate([before, root], axis=1), np.concatenate([local, local], axis=1)
    assert np.abs(stitched(session, (context, goal), 9).root - plain).max() > 1e-4
    arriving = np.zeros((3, 22, 3))
    arriving[..., 2] = 2.0
    assert np.abs(stitched(session, keys, 9, arriving=arriving).root - plain).max() > 1e-4


def test_the_backward_chain_leaves_the_target_against_its_velocity(session, keys, monkeypatch):
    fed = {}
    run = Session.run

    def listened(self, name, feed):
        fed.setdefault(name, feed)
        return run(self, name, feed)

    monkeypatch.setattr(Session, "run", listened)
    arriving = np.random.default_rng(1).normal(size=(3, 22, 3))
    stitched(session, keys, 9, arriving=arriving)
    np.testing.assert_allclose(fed["back"]["velocities"], -arriving, atol=1e-6)
    np.testing.assert_allclose(fed["plan"]["target_velocities"], arriving, atol=1e-6)
    assert fed["front"]["known"].max() == 0.0
    assert fed["back"]["known"].min() == 1.0


def test_the_root_keeps_to_a_path(session, keys):
    steps = 20
    line = np.linspace(0.0, 1.0, steps + 1)[:, None]
    paths = []
    for a, b in zip(keys[0][0][:, 0], keys[1][0][:, 0], strict=True):
        way = a[[0, 2]] + line * (b - a)[[0, 2]] + np.sin(np.pi * line) * np.array([0.6, 0.0])
        paths.append(np.concatenate([way, np.zeros((steps + 1, 1))], axis=1))
    led, free = (stitched(session, keys, steps - 1, paths=given).root for given in (paths, None))
    away = [np.mean([path_deviation(x, p) for x, p in zip(made, paths, strict=True)]) for made in (led, free)]
    assert away[0] < 0.5 * away[1]
    none = stitched(session, keys, steps - 1, paths=paths, path_control=0.0).root
    np.testing.assert_allclose(none, free, atol=2e-3)


def test_how_far_the_chains_are_apart_in_the_middle(session, keys):
    distance = stitched(session, keys, [7, 7, 0]).chain_distance
    assert np.all(distance[:2] < 1e-5)
    assert np.isnan(distance[2])


def test_transitions_on_a_rig_arrive(session):
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


def test_detail_refines_what_the_chains_make(session, keys, monkeypatch):
    """The detail network is a stand-in: it sees the whole gap with its keys and lifts what is between them."""
    seen = {}

    def run(self, name, feed):
        if name != "detail":
            return run_network(self, name, feed)
        seen.update(feed)
        lifted = feed["hips"] + np.array([0.0, 0.25, 0.0], np.float32)
        return {f"refined_{part}": value for part, value in (feed | {"hips": lifted}).items()}

    run_network = Session.run
    monkeypatch.setattr(Session, "run", run)
    refining = Session(session.path, session.info | {"detail": {}})
    plain = stitched(session, keys, 9)
    made = stitch.REFINED.generate(refining, batch_of(*keys, 9))
    np.testing.assert_allclose(made.root, plain.root + np.array([0.0, 0.25, 0.0]), atol=1e-4)
    np.testing.assert_allclose(seen["hips"][:, [0, -1]], np.stack([k[0][:, 0] for k in keys], axis=1), atol=1e-6)
    assert {name: value.shape[1:] for name, value in seen.items()} == {
        "hips": (11, 3),
        "rotations": (11, 22, 6),
        "contacts": (11, 4),
    }


def test_an_unknown_style_and_a_stream_are_refused(session, keys):
    with pytest.raises(InputError, match="has no style 'Nobody'"):
        stitched(session, keys, 9, styles=["Nobody", None, None])
    with pytest.raises(InputError, match=r"makes whole gaps \(method stitch\); stream with one for dcmoe"):
        Stream(session, learning.march(5, 1.0, 0.0))


def test_files_that_are_not_those_of_the_model(stitch_folder, tmp_path):
    folder = tmp_path / "model"
    shutil.copytree(stitch_folder, folder)
    (folder / "back.onnx").write_bytes(b"no network")
    with pytest.raises(InputError, match=r"back\.onnx cannot be loaded"):
        load(folder).network("back")
    info = json.loads((folder / "model.json").read_text())
    del info["chains"]
    (folder / "model.json").write_text(json.dumps(info))
    with pytest.raises(InputError, match="lacks chains"):
        load(folder)


def test_shapes_are_those_of_the_files(session):
    for name, shapes in network_shapes(session.info["network"], len(session.styles)).items():
        assert [i.name for i in session.network(name).get_inputs()] == list(shapes)


def two(steps, buffer, value):
    """Chains whose frames say ``value(side, frame)`` everywhere."""
    made = ([], [])
    for move in schedule(steps, buffer):
        side = int(move.backward)
        said = np.full((1, 3), value(side, move.made))
        turned = said[0, 0] * np.ones((1, 22, 6))
        made[side].append({"hips": said, "rotations": turned, "contacts": said[:, [0, 0, 0, 0]]})
    return made


def test_short_gaps_are_blended_by_their_shares_and_not_smoothed():
    hips, turned, contacts = stitch.joined(two(9, 2, lambda side, frame: 10.0 * side + frame), 9, 2)
    wanted = np.arange(1, 9) + 10.0 * shares(9, 2)[1:-1]
    for made in (hips, turned, contacts):
        np.testing.assert_allclose(made.reshape(8, -1), np.repeat(wanted[:, None], made[0, 0].size, axis=1))


def test_a_jolt_in_the_middle_of_a_longer_gap_is_smoothed():
    hips = stitch.joined(two(40, 0, lambda side, frame: float(abs(frame - 20))), 40, 0)[0][0, :, 0]
    plain = np.abs(np.arange(1, 40) - 20.0)
    assert np.diff(hips, n=2).max() < 0.8 * np.diff(plain, n=2).max()
    np.testing.assert_allclose(hips[:12], plain[:12], atol=1e-9)


def test_only_the_middle_is_smoothed():
    time = np.arange(41.0)
    kinked = np.stack([np.abs(time - 20.0), time])[None].swapaxes(1, 2)
    flat = smoothed(kinked, 40)
    bends = [np.abs(np.diff(x[0, :, 0], n=2)).max() for x in (kinked, flat)]
    assert bends[1] < 0.8 * bends[0]
    np.testing.assert_allclose(flat[..., 1], kinked[..., 1])  # what has no bend stays
    np.testing.assert_array_equal(flat[:, :14], kinked[:, :14])
    np.testing.assert_array_equal(flat[:, 28:], kinked[:, 28:])
    np.testing.assert_array_equal(smoothed(kinked[:, :16], 15), kinked[:, :16])
