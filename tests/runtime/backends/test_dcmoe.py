"""Whole roll-outs of an exported network: against torch, from one frame to many, row by row; and from both ends."""

import json
import shutil
from itertools import pairwise

import learning
import numpy as np
import pytest

from interpose import rotation
from interpose.errors import InputError
from interpose.features import HISTORY, KEY_STEP
from interpose.features.stitch import seam
from interpose.runtime import poses
from interpose.runtime.backends import dcmoe
from interpose.runtime.gap_batch import batch_of, draws
from interpose.runtime.model_folder import Session, load
from interpose.skeleton import HUMANOID, local_rotations
from interpose.train.common.gaps import evenly
from interpose.train.dcmoe import validation
from interpose.train.dcmoe.sequences import at_lone_start

BATCH = 3


@pytest.fixture
def keys():
    """Starts and targets of three gaps, (root, local) each, and ten frames of context before the starts."""
    clips = [learning.march(80, 0.8 + 0.3 * i, 2.0 * i) for i in range(BATCH)]
    context = tuple(np.stack([getattr(c, x)[11:21] for c in clips]) for x in ("root_positions", "local_rotations"))
    target = tuple(np.stack([getattr(c, x)[60:61] for c in clips]) for x in ("root_positions", "local_rotations"))
    return tuple(x[:, -1:] for x in context), target, context


def ends(start, target):
    """Start and target without their frame axes."""
    return tuple(x[:, 0] for x in start), tuple(x[:, 0] for x in target)


def generate(session, start, target, frames, **more):
    return dcmoe.BACKEND.generate(session, batch_of(start, target, frames, **more))


@pytest.fixture
def fed(monkeypatch):
    """What went into each step, and what came out."""
    log = []
    step = Session.step

    def listened(self, feed):
        said = step(self, feed)
        log.append((feed, said))
        return said

    monkeypatch.setattr(Session, "step", listened)
    return log


def joints(root, local):
    return poses.pose_of(root, local).positions


def test_poses_are_those_of_the_motion():
    clip = learning.march(5, 1.0, 0.4)
    pose = poses.pose_of(clip.root_positions, clip.local_rotations)
    np.testing.assert_allclose(pose.positions, clip.global_positions(), atol=1e-12)
    np.testing.assert_allclose(pose.rotations, rotation.to_6d(clip.global_rotations()), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(pose.facing, axis=-1), 1.0)
    assert pose.facing[0] @ [np.sin(0.4), np.cos(0.4)] > 0.99


def test_the_base_is_straight_and_of_constant_speed(keys):
    start, target, _ = keys
    first, last = ends(start, target)
    base = poses.interpolation(first, last, 9)
    assert base.shape == (BATCH, 11, 3 + 22 * 6)
    for at, (root, local) in ((0, first), (10, last)):
        pose = poses.pose_of(root, local)
        np.testing.assert_allclose(base[:, at, :3], pose.hips, atol=1e-12)
        np.testing.assert_allclose(base[:, at, 3:], pose.rotations.reshape(BATCH, -1), atol=1e-9)
    np.testing.assert_allclose(base[:, 5, :3], (first[0] + last[0]) / 2.0)
    hips = rotation.from_6d(base[:, :, 3:9])
    turns = rotation.angle(rotation.multiply(rotation.inverse(hips[:, :-1]), hips[:, 1:]))
    np.testing.assert_allclose(turns, np.broadcast_to(turns[:, :1], turns.shape), atol=1e-7)
    assert poses.interpolation(first, last, 0).shape[1] == 2


def test_before_a_lone_start_the_figure_stands_and_only_the_present_phase_is_known(keys):
    start, _, context = keys
    phases = np.random.default_rng(0).normal(size=(BATCH, 13, 10, 2))
    state = dcmoe.initial_state(poses.pose_of(*start), phases)
    assert not state["velocities"].any()
    assert not state["velocity_known"].any()
    np.testing.assert_array_equal(state["track"], np.repeat(state["track"][:, -1:], HISTORY + 1, axis=1))
    assert not state["phase_past"][:, :-1].any()
    np.testing.assert_array_equal(state["phase_past"][:, -1], phases[:, 6])
    np.testing.assert_array_equal(state["phase_future"], phases[:, 7:])
    longer = dcmoe.initial_state(poses.pose_of(*context), phases)["phase_past"]
    assert not longer[:, : HISTORY - 10].any()
    np.testing.assert_allclose(longer[:, -1 - KEY_STEP], phases[:, 5])
    assert np.abs(longer[:, -10:]).min() > 0.0


@pytest.mark.parametrize("count", [0, 1, 2, 30])
def test_a_gap_gets_its_frames(session, keys, fed, count):
    start, target, _ = keys
    made = generate(session, start, target, count)
    root, local, contacts = made.root, made.local, made.contacts
    assert root.shape == (BATCH, count, 3)
    assert local.shape == (BATCH, count, 22, 4)
    assert contacts.shape == (BATCH, count, 4)
    assert root.dtype == local.dtype == contacts.dtype == np.float64
    assert [feed["frames_left"].tolist() for feed, _ in fed] == [[[k]] * BATCH for k in range(count + 1, 1, -1)]
    assert all(not feed["path"].any() and not feed["path_known"].any() for feed, _ in fed)
    np.testing.assert_allclose(np.linalg.norm(local, axis=-1), 1.0, atol=1e-6)
    assert np.all((contacts >= 0.0) & (contacts <= 1.0))
    whole = np.concatenate([start[1], local], axis=1)
    assert np.all(np.sum(whole[:, 1:] * whole[:, :-1], axis=-1) >= 0.0)
    if count:
        base = poses.interpolation(*ends(start, target), count)[:, 1:-1, :3]
        assert np.linalg.norm(root - base, axis=-1).max() > 0.005


@pytest.mark.parametrize("count", [1, 7, 40])
def test_the_last_frame_leads_into_the_target_exactly(session, keys, fed, count):
    start, target, _ = keys
    made = generate(session, start, target, count)
    feed, said = fed[-1]
    base = poses.interpolation(*ends(start, target), count).astype(np.float32)
    last = feed | dcmoe.after(said) | {"frames_left": np.ones((BATCH, 1), dtype=np.float32)}
    last |= {"base": base[:, count], "base_next": base[:, count + 1]}
    arrived = session.step(last)
    goal = poses.pose_of(*ends(start, target)[1])
    np.testing.assert_allclose(arrived["next_hips"], goal.hips, atol=1e-6)
    np.testing.assert_allclose(arrived["next_rotations"], goal.rotations, atol=1e-5)
    np.testing.assert_allclose(arrived["next_positions"], goal.positions, atol=1e-5)
    placed = np.concatenate([joints(made.root, made.local), goal.positions[:, None]], axis=1)
    placed = np.concatenate([joints(*start), placed], axis=1)
    steps = np.linalg.norm(np.diff(placed, axis=1), axis=-1).max(axis=2)
    assert np.all(steps[:, -1] < 2.0 * steps[:, :-1].max(axis=1))  # no pop, random as the network is


def test_rows_do_not_know_of_each_other(session, keys):
    start, target, _ = keys
    styles = [None, "Old", "Young"]
    together = generate(session, start, target, 20, styles=styles)
    for row in range(BATCH):
        mine = slice(row, row + 1)
        alone = generate(session, *(tuple(x[mine] for x in key) for key in (start, target)), 20, styles=styles[mine])
        for name in ("root", "local", "contacts"):
            np.testing.assert_allclose(getattr(alone, name), getattr(together, name)[mine], atol=1e-4)


def test_the_seed_decides_the_variants(session, keys):
    start, target, _ = keys

    def made(drawn):
        keys = [tuple(np.repeat(x[:1], len(drawn), axis=0) for x in key) for key in (start, target)]
        return generate(session, *keys, 20, draws=drawn).root

    plain = made([None] * BATCH)
    np.testing.assert_allclose(plain, np.repeat(plain[:1], BATCH, axis=0), atol=1e-6)
    varied = made(draws(0, BATCH))
    np.testing.assert_array_equal(varied, made(draws(0, BATCH)))
    np.testing.assert_allclose(varied[0], plain[0], atol=1e-6)
    apart = [np.abs(varied[i] - varied[j]).max() for i, j in ((0, 1), (0, 2), (1, 2))]
    assert min(apart) > 1e-4
    np.testing.assert_allclose(made(draws(0, 5))[:BATCH], varied, atol=1e-5)
    np.testing.assert_allclose(made([(0, 2), None])[0], varied[2], atol=1e-5)
    assert np.abs(made(draws(1, BATCH))[0] - varied[0]).max() > 1e-4


def test_the_style_steers_and_must_be_known(session, keys):
    start, target, _ = keys
    made = [generate(session, start, target, 20, styles=style).root for style in (None, "Old", "Young")]
    assert min(np.abs(made[i] - made[j]).max() for i, j in ((0, 1), (0, 2), (1, 2))) > 1e-3
    with pytest.raises(InputError, match="has no style 'Angry'"):
        generate(session, start, target, 20, styles="Angry")


def test_the_context_is_seen(session, keys, fed):
    start, target, context = keys
    alone = generate(session, start, target, 20).root
    known = generate(session, context, target, 20).root
    assert np.abs(alone - known).max() > 1e-3
    first = fed[20][0]
    assert first["velocity_known"].all()
    speed = (joints(*context)[:, -1] - joints(*context)[:, -2]) * 30.0
    np.testing.assert_allclose(first["velocities"], speed, atol=1e-4)
    assert all(feed["velocity_known"].all() for feed, _ in fed[1:20])


def test_torch_rolls_out_to_the_same_frames(session, network, frames):
    gap = 30
    rows = at_lone_start(frames, evenly(frames, gap + 1, 5, len(learning.STYLES)))
    keys = [
        (frames.hips[at].double().numpy(), frames.local[at].double().numpy())
        for at in (rows.gaps.start, rows.gaps.target)
    ]
    wanted = validation.roll_out(network, frames, rows).numpy()
    found = generate(session, *(tuple(x[:, None] for x in key) for key in keys), gap)
    made = joints(found.root, found.local)
    base = poses.interpolation(*keys, gap)[:, 1:-1]
    naive = joints(
        base[..., :3], local_rotations(rotation.from_6d(base[..., 3:].reshape(5, gap, 22, 6)), HUMANOID.parents)
    )
    off = np.linalg.norm(made - wanted, axis=-1)
    moved = np.linalg.norm(naive - wanted, axis=-1)
    assert moved.mean() > 0.05
    assert off.mean() < 0.02 * moved.mean()  # the weights are in 8 bits
    assert off.max() < 0.02


def test_a_network_of_the_papers_form_is_fed_the_root_that_it_foresees(session, keys, fed):
    start, target, _ = keys
    fed_back = Session(session.path, session.info | {"absolute": True})
    generate(fed_back, start, target, 4)
    assert all(feed["path_known"].all() for feed, _ in fed)
    pose = poses.pose_of(*start)
    resting = np.concatenate([pose.hips[:, -1, ::2], pose.facing[:, -1], np.zeros((BATCH, 2))], axis=-1)
    np.testing.assert_allclose(fed[0][0]["path"], np.repeat(resting[:, None], 6, axis=1), atol=1e-6)
    for (_, said), (feed, _) in pairwise(fed):
        np.testing.assert_array_equal(feed["path"], said["next_path"])


# From both ends. The backward network is the forward one again: what is tested holds for any.


@pytest.fixture(scope="module")
def dual(model_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dual") / "model"
    shutil.copytree(model_folder, folder)
    shutil.copy(folder / "step.onnx", folder / "back.onnx")
    info = json.loads((folder / "model.json").read_text())
    (folder / "model.json").write_text(json.dumps(info | {"backward": {"steps": 1}}))
    return load(folder)


@pytest.fixture(scope="module")
def pairs():
    """Starts and targets, (root, local) each with a frame axis."""
    clips = [learning.march(80, 0.8 + 0.3 * i, 2.0 * i) for i in range(3)]
    return tuple(
        tuple(np.stack([getattr(c, x)[at : at + 1] for c in clips]) for x in ("root_positions", "local_rotations"))
        for at in (11, 60)
    )


def rows_of(pairs, rows):
    return [tuple(x[rows] for x in key) for key in pairs]


def stitched(dual, pairs, frames, **more):
    return dcmoe.BACKEND.generate(dual, batch_of(*pairs, frames, **more))


def test_it_is_what_a_model_with_a_backward_network_does(dual, pairs, model_folder):
    batch = batch_of(*pairs, 12)
    made = dcmoe.BACKEND.generate(dual, batch).root
    np.testing.assert_array_equal(made, dcmoe.BACKEND.generate(dual, batch).root)
    assert np.abs(made - dcmoe.BACKEND.generate(load(model_folder), batch).root).max() > 1e-3


def test_the_end_is_the_forward_one_turned_round(dual, pairs):
    """Both networks are one here, so the gap backwards is the gap read backwards, but for who begins."""
    there, back = stitched(dual, pairs, 13).root, stitched(dual, pairs[::-1], 13).root
    first = seam(14, dcmoe.CHAIN_BUFFER).backward - 2
    np.testing.assert_allclose(there[:, :1], back[:, ::-1][:, :1], atol=0.02)
    np.testing.assert_allclose(there[:, -1:], back[:, ::-1][:, -1:], atol=0.02)
    assert first > 1


def test_frames_beside_the_keys_are_near_them(dual, pairs):
    made = stitched(dual, pairs, 20)
    assert np.linalg.norm(made.root[:, 0] - pairs[0][0][:, 0], axis=-1).max() < 0.15
    assert np.linalg.norm(made.root[:, -1] - pairs[1][0][:, 0], axis=-1).max() < 0.15
    assert np.all((made.contacts >= 0.0) & (made.contacts <= 1.0))


def arc(pairs, steps, height):
    """A path from the first start to the first target that swings out by so much."""
    line = np.linspace(0.0, 1.0, steps + 1)[:, None]
    a, b = (key[0][0, 0, [0, 2]] for key in pairs)
    return np.concatenate([a + line * (b - a) + np.sin(np.pi * line) * height, 0.0 * line], axis=1)


def test_lengths_styles_and_paths(dual, pairs):
    made = stitched(dual, pairs, [9, 3, 0], styles=[learning.STYLES[0], None, None])
    alone = stitched(dual, rows_of(pairs, slice(1, 2)), 3)
    np.testing.assert_allclose(made.root[1, :3], alone.root[0], atol=2e-3)
    np.testing.assert_array_equal(made.root[1, 3:], np.repeat(pairs[1][0][1], 6, axis=0))
    assert made.local.shape == (3, 9, 22, 4)
    first = rows_of(pairs, slice(1))
    free = stitched(dual, first, 9).root
    assert np.abs(free[0] - made.root[0]).max() > 1e-4
    assert np.abs(stitched(dual, first, 9, paths=[arc(pairs, 10, 0.5)]).root - free).max() > 1e-3


@pytest.fixture
def fed_both(monkeypatch):
    """What went into each network, by name."""
    log = {"step": [], "back": []}
    run = Session.run

    def listened(self, name, feed):
        log[name].append(feed)
        return run(self, name, feed)

    monkeypatch.setattr(Session, "run", listened)
    return log


def test_the_chains_meet(dual, pairs, monkeypatch):
    seen = []
    joined = dcmoe.joined
    monkeypatch.setattr(dcmoe, "joined", lambda made, *rest: seen.append(made) or joined(made, *rest))
    stitched(dual, pairs, 13)
    (front, back) = seen[0]
    middle = 7  # of fourteen steps: the backward chain steps exactly onto the forward one's newest frame
    for name in ("hips", "rotations", "positions"):
        np.testing.assert_allclose(front[middle - 1][name], back[middle - 1][name], atol=1e-4)


def test_the_backward_network_sees_everything_from_its_end(dual, pairs, fed_both):
    path = arc(pairs, 20, 0.0)
    speeds = np.zeros((1, 22, 3))
    speeds[..., 2] = 1.5
    stitched(dual, rows_of(pairs, slice(1)), 19, paths=[path], arriving=speeds)
    first = fed_both["back"][0]
    np.testing.assert_allclose(first["hips"], pairs[1][0][:1, 0], atol=1e-5)
    np.testing.assert_allclose(first["velocities"], -speeds, atol=1e-6)
    assert first["velocity_known"][0, 0] == 1.0
    np.testing.assert_allclose(first["path"][0, 0, :2], path[15, :2], atol=1e-5)
    np.testing.assert_allclose(fed_both["step"][0]["path"][0, 0, :2], path[5, :2], atol=1e-5)
