"""DC-MoE stitched from both ends. The backward network is the forward one again: what is tested holds for any."""

import json
import shutil

import learning
import numpy as np
import pytest

from interpose.features.stitch import seam
from interpose.runtime.backends import chains, dcmoe, dcmoe_both_ends
from interpose.runtime.gap_batch import batch_of
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
    """Starts and targets, (root, local) each with a frame axis."""
    clips = [learning.march(80, 0.8 + 0.3 * i, 2.0 * i) for i in range(3)]
    return tuple(
        tuple(np.stack([getattr(c, x)[at : at + 1] for c in clips]) for x in ("root_positions", "local_rotations"))
        for at in (11, 60)
    )


def rows_of(keys, rows):
    return [tuple(x[rows] for x in key) for key in keys]


def stitched(session, keys, frames, **more):
    return dcmoe_both_ends.generate(session, batch_of(*keys, frames, **more))


def test_it_is_what_a_model_with_a_backward_network_does(session, keys, model_folder):
    batch = batch_of(*keys, 12)
    made = dcmoe.BACKEND.generate(session, batch).root
    np.testing.assert_array_equal(made, dcmoe_both_ends.generate(session, batch).root)
    assert np.abs(made - dcmoe.BACKEND.generate(load(model_folder), batch).root).max() > 1e-3


def test_the_end_is_the_forward_one_turned_round(session, keys):
    """Both networks are one here, so the gap backwards is the gap read backwards, but for who begins."""
    there, back = stitched(session, keys, 13).root, stitched(session, keys[::-1], 13).root
    first = seam(14, dcmoe_both_ends.BUFFER).backward - 2
    np.testing.assert_allclose(there[:, :1], back[:, ::-1][:, :1], atol=0.02)
    np.testing.assert_allclose(there[:, -1:], back[:, ::-1][:, -1:], atol=0.02)
    assert first > 1


def test_frames_beside_the_keys_are_near_them(session, keys):
    made = stitched(session, keys, 20)
    assert np.linalg.norm(made.root[:, 0] - keys[0][0][:, 0], axis=-1).max() < 0.15
    assert np.linalg.norm(made.root[:, -1] - keys[1][0][:, 0], axis=-1).max() < 0.15
    assert np.all((made.contacts >= 0.0) & (made.contacts <= 1.0))


def arc(keys, steps, height):
    """A path from the first start to the first target that swings out by so much."""
    line = np.linspace(0.0, 1.0, steps + 1)[:, None]
    a, b = (key[0][0, 0, [0, 2]] for key in keys)
    return np.concatenate([a + line * (b - a) + np.sin(np.pi * line) * height, 0.0 * line], axis=1)


def test_lengths_styles_and_paths(session, keys):
    made = stitched(session, keys, [9, 3, 0], styles=[learning.STYLES[0], None, None])
    alone = stitched(session, rows_of(keys, slice(1, 2)), 3)
    np.testing.assert_allclose(made.root[1, :3], alone.root[0], atol=2e-3)
    np.testing.assert_array_equal(made.root[1, 3:], np.repeat(keys[1][0][1], 6, axis=0))
    assert made.local.shape == (3, 9, 22, 4)
    first = rows_of(keys, slice(1))
    free = stitched(session, first, 9).root
    assert np.abs(free[0] - made.root[0]).max() > 1e-4
    assert np.abs(stitched(session, first, 9, paths=[arc(keys, 10, 0.5)]).root - free).max() > 1e-3


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
    stitched(session, keys, 13)
    (front, back) = seen[0]
    middle = 7  # of fourteen steps: the backward chain steps exactly onto the forward one's newest frame
    for name in ("hips", "rotations", "positions"):
        np.testing.assert_allclose(front[middle - 1][name], back[middle - 1][name], atol=1e-4)


def test_the_backward_network_sees_everything_from_its_end(session, keys, fed):
    path = arc(keys, 20, 0.0)
    speeds = np.zeros((1, 22, 3))
    speeds[..., 2] = 1.5
    stitched(session, rows_of(keys, slice(1)), 19, paths=[path], arriving=speeds)
    first = fed["back"][0]
    np.testing.assert_allclose(first["hips"], keys[1][0][:1, 0], atol=1e-5)
    np.testing.assert_allclose(first["velocities"], -speeds, atol=1e-6)
    assert first["velocity_known"][0, 0] == 1.0
    np.testing.assert_allclose(first["path"][0, 0, :2], path[15, :2], atol=1e-5)
    np.testing.assert_allclose(fed["step"][0]["path"][0, 0, :2], path[5, :2], atol=1e-5)
