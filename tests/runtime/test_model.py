"""The library's model: what `interpose.load_model` gives."""

import json

import numpy as np
import pytest

import interpose
from interpose import rotation
from interpose.errors import InputError
from interpose.features import state_shapes
from interpose.motion import Motion
from interpose.runtime.backends import dcmoe
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.model_folder import Session
from interpose.skeleton import HUMANOID, Skeleton


def swaying_step(self, feed):
    """The step of a network of few lines: the interpolation base, swayed by the phases and the style."""
    left = feed["frames_left"]
    pose = np.concatenate([feed["hips"], feed["rotations"].reshape(len(left), -1)], axis=-1)
    after = feed["base_next"] + (left - 1) / left * (pose - feed["base"])
    after[:, :1] += 0.001 * (feed["phase_past"][:, -1, :1, 0] + feed["style"][:, 1:2]) * (left > 1)
    said = {f"next_{name}": feed[name] for name in state_shapes()}
    said |= {"next_hips": after[:, :3], "next_rotations": after[:, 3:].reshape(-1, 22, 6)}
    return said | {"contacts": np.zeros((len(left), 4), np.float32), "next_path": feed["path"]}


@pytest.fixture
def model(tmp_path, monkeypatch):
    info = {"format": 2, "name": "swaying", "method": "dcmoe", "styles": ["Old"], "licence": "MIT"}
    (tmp_path / "model.json").write_text(json.dumps(info))
    np.save(tmp_path / "phases.npy", np.random.default_rng(0).normal(size=(50, 13, 10, 2)))
    monkeypatch.setattr(Session, "step", swaying_step)
    return interpose.load_model(tmp_path)


def walk(frames, rate=30.0):
    times = np.arange(frames) / rate
    root = np.stack([np.zeros(frames), np.full(frames, 1.5), 1.3 * times], axis=-1)
    angles = 0.25 * np.sin(4.0 * times[:, None] + np.arange(22))
    axes = np.random.default_rng(3).normal(size=(22, 3))
    return Motion(HUMANOID, root, rotation.from_rotation_vector(angles[..., None] * axes), rate)


def test_it_tells_what_it_is(model):
    assert model.styles == ("Old",)
    assert model.info["name"] == "swaying"


def test_candidates_as_in_the_documentation(model):
    clip = walk(61)
    candidates = model.inbetween(clip[0], clip[60], frames=59, style="Old", speed=None, path=None, variants=4, seed=1)
    assert [len(c.motion) for c in candidates] == [59] * 4
    assert len({float(c.motion.root_positions[30, 0]) for c in candidates}) == 4
    again = model.inbetween(clip[0], clip[60], frames=59, style="Old", variants=4, seed=1)
    for one, other in zip(candidates, again, strict=True):
        np.testing.assert_array_equal(one.motion.local_rotations, other.motion.local_rotations)
        np.testing.assert_array_equal(one.motion.root_positions, other.motion.root_positions)
    free = model.inbetween(clip[0], clip[60], frames=59)[0]
    styled = model.inbetween(clip[0], clip[60], frames=59, style="Old")[0]
    assert not np.array_equal(free.motion.root_positions, styled.motion.root_positions)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"style": "Sad"}, "no style 'Sad'; it has Old"),
        ({"speed": "fast"}, "speed 'fast' and 18 frames contradict each other"),
        ({"path": "sideways"}, "unknown path 'sideways'"),
        ({"path": [[0.0, float("nan")]]}, "the path's points"),
        ({"variants": 0}, "variants must be 1 or more"),
        ({"frames": 0}, "got 0"),
        ({"seed": -1}, "seed must be 0 or more"),
    ],
)
def test_what_cannot_be_had_is_refused(model, options, said):
    clip = walk(20)
    with pytest.raises(InputError, match=said):
        model.inbetween(clip[0], clip[-1], **({"frames": 18} | options))


@pytest.mark.parametrize("name", ["no-such-model", "/no/such/folder"])
def test_an_unknown_model_is_refused(name):
    with pytest.raises(InputError, match=f"no model '{name}'"):
        interpose.load_model(name)


def test_an_undisturbed_stream_gives_the_frames_of_the_whole_roll_out(model):
    clip = walk(41)
    start, target = clip[4], clip[40]  # with frames before it the stream would also carry their speed on
    keys = [(pose.root_positions[None], pose.local_rotations[None]) for pose in (start, target)]
    made = dcmoe.BACKEND.generate(model.session, batch_of(*keys, 35, styles="Old"))
    root, local = made.root, made.local
    stream = model.stream(start, style="Old")
    for i in range(35):
        pose = stream.step(target=target, seconds_left=(36 - i) / 30.0)
        np.testing.assert_allclose(pose.root_positions[0], root[0, i], atol=1e-5)
        turn = rotation.multiply(rotation.inverse(pose.local_rotations[0]), local[0, i])
        assert rotation.angle(turn).max() < 1e-4
    last = stream.step(target=target, seconds_left=1 / 30.0)
    np.testing.assert_array_equal(last.root_positions, target.root_positions)
    np.testing.assert_array_equal(last.local_rotations, target.local_rotations)


def test_the_target_and_the_time_may_change_on_the_way(model):
    clip = walk(90)
    stream = model.stream(clip[0])
    poses = [stream.pose]
    poses += [stream.step(target=clip[40], seconds_left=(40 - i) / 30.0) for i in range(10)]
    poses += [stream.step(target=clip[80], seconds_left=(70 - i) / 30.0) for i in range(20)]
    poses += [stream.step(target=clip[80], seconds_left=(30 - i) / 30.0) for i in range(30)]
    poses += [stream.step(target=clip[20], seconds_left=(15 - i) / 30.0) for i in range(15)]
    root = np.concatenate([p.root_positions for p in poses])
    np.testing.assert_array_equal(root[60], clip.root_positions[80])
    np.testing.assert_array_equal(root[75], clip.root_positions[20])
    # Turned back by 2.6 m in half a second, while the old speed dies away.
    assert np.linalg.norm(np.diff(root, axis=0), axis=-1).max() < 0.3, "no call makes the figure jump"


def test_a_stream_refuses_what_it_cannot_serve(model):
    clip = walk(3)
    stream = model.stream(clip[0])
    with pytest.raises(InputError, match="seconds_left must be 0 or more, got -1"):
        stream.step(clip[2], -1.0)
    with pytest.raises(InputError, match="seconds_left must be 0 or more, got nan"):
        stream.step(clip[2], float("nan"))
    crate = Skeleton(("crate",), (-1,), np.zeros((1, 3)))
    box = Motion(crate, np.zeros((1, 3)), np.tile(rotation.IDENTITY, (1, 1, 1)), 30.0)
    with pytest.raises(InputError, match="share one skeleton"):
        stream.step(box, 1.0)
    with pytest.raises(InputError, match="no humanoid"):
        model.stream(box)
    with pytest.raises(InputError, match="no style 'Sad'"):
        model.stream(clip[0], style="Sad")
