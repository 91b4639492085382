"""DC-MoE stitched from both ends. The backward network is the forward one again: what is tested holds for any."""

import json
import shutil

import learning
import numpy as np
import pytest

from interpose.features.stitch import seam
from interpose.runtime import methods
from interpose.runtime.backends import chains, dcmoe_both_ends
from interpose.runtime.model_folder import Session, load


@pytest.fixture(scope="module")
def session(model_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dual") / "model"
    shutil.copytree(model_folder, folder)
    shutil.copy(folder / "step.onnx", folder / "back.onnx")
    info = json.loads((folder / "model.json").read_text())
    (folder / "model.json").write_text(json.dumps(info | {"backward": {"steps": 1}}))
    return load(folder)


@pytest.fixture(scope="module")
def keys():
    clips = [learning.march(80, 0.8 + 0.3 * i, 2.0 * i) for i in range(3)]
    start = [np.stack([getattr(c, x)[11:12] for c in clips]) for x in ("root_positions", "local_rotations")]
    target = [np.stack([getattr(c, x)[60] for c in clips]) for x in ("root_positions", "local_rotations")]
    return *start, *target


def test_it_is_what_a_model_with_a_backward_network_does(session, keys, model_folder):
    made = methods.generate_batch(session, *keys, 12)
    np.testing.assert_array_equal(made[0], dcmoe_both_ends.generate_batch(session, *keys, 12)[0])
    alone = methods.generate_batch(load(model_folder), *keys, 12)
    assert np.abs(made[0] - alone[0]).max() > 1e-3


def test_the_end_is_the_forward_one_turned_round(session, keys):
    """Both networks are one here, so the gap backwards is the gap read backwards, but for who begins."""
    root, local, goal_root, goal_local = keys
    there = dcmoe_both_ends.generate_batch(session, *keys, 13)[0]
    back = dcmoe_both_ends.generate_batch(
        session, goal_root[:, None], goal_local[:, None], root[:, 0], local[:, 0], 13
    )[0]
    first = seam(14, dcmoe_both_ends.BUFFER).backward - 2
    np.testing.assert_allclose(there[:, :1], back[:, ::-1][:, :1], atol=0.02)
    np.testing.assert_allclose(there[:, -1:], back[:, ::-1][:, -1:], atol=0.02)
    assert first > 1


def test_frames_beside_the_keys_are_near_them(session, keys):
    root, _, contacts = dcmoe_both_ends.generate_batch(session, *keys, 20)
    assert np.linalg.norm(root[:, 0] - keys[0][:, 0], axis=-1).max() < 0.15
    assert np.linalg.norm(root[:, -1] - keys[2], axis=-1).max() < 0.15
    assert np.all((contacts >= 0.0) & (contacts <= 1.0))


def test_lengths_styles_and_paths(session, keys):
    root, local, _ = dcmoe_both_ends.generate_batch(session, *keys, [9, 3, 0], style=[learning.STYLES[0], None, None])
    alone = dcmoe_both_ends.generate_batch(session, *(k[1:2] for k in keys), 3)
    np.testing.assert_allclose(root[1, :3], alone[0][0], atol=2e-3)
    np.testing.assert_array_equal(root[1, 3:], np.repeat(keys[2][1:2], 6, axis=0))
    assert local.shape == (3, 9, 22, 4)
    free = dcmoe_both_ends.generate_batch(session, *(k[:1] for k in keys), 9)
    assert np.abs(free[0][0] - root[0]).max() > 1e-4
    line = np.linspace(0.0, 1.0, 11)[:, None]
    a, b = keys[0][0, 0, [0, 2]], keys[2][0, [0, 2]]
    path = np.concatenate([a + line * (b - a) + np.sin(np.pi * line) * 0.5, 0.0 * line], axis=1)
    led = dcmoe_both_ends.generate_batch(session, *(k[:1] for k in keys), 9, paths=[path])
    assert np.abs(led[0] - free[0]).max() > 1e-3


@pytest.fixture
def fed(monkeypatch):
    """What went into each network, by name."""
    log = {"step": [], "back": []}
    run = Session.run

    def listened(self, name, feed):
        log[name].append(feed)
        return run(self, name, feed)

    monkeypatch.setattr(Session, "run", listened)
    return log


def test_the_chains_meet(session, keys, monkeypatch):
    seen = []
    joined = chains.joined
    monkeypatch.setattr(chains, "joined", lambda made, *rest: seen.append(made) or joined(made, *rest))
    dcmoe_both_ends.generate_batch(session, *keys, 13)
    (front, back) = seen[0]
    middle = 7  # of fourteen steps: the backward chain steps exactly onto the forward one's newest frame
    for name in ("hips", "rotations", "positions"):
        np.testing.assert_allclose(front[middle - 1][name], back[middle - 1][name], atol=1e-4)


def test_the_backward_network_sees_everything_from_its_end(session, keys, fed):
    line = np.linspace(0.0, 1.0, 21)[:, None]
    a, b = keys[0][0, 0, [0, 2]], keys[2][0, [0, 2]]
    path = np.concatenate([a + line * (b - a), 0.0 * line], axis=1)
    speeds = np.zeros((1, 22, 3))
    speeds[..., 2] = 1.5
    dcmoe_both_ends.generate_batch(session, *(k[:1] for k in keys), 19, paths=[path], arriving=speeds)
    first = fed["back"][0]
    np.testing.assert_allclose(first["hips"], keys[2][:1], atol=1e-5)
    np.testing.assert_allclose(first["velocities"], -speeds, atol=1e-6)
    assert first["velocity_known"][0, 0] == 1.0
    np.testing.assert_allclose(first["path"][0, 0, :2], path[15, :2], atol=1e-5)
    np.testing.assert_allclose(fed["step"][0]["path"][0, 0, :2], path[5, :2], atol=1e-5)
