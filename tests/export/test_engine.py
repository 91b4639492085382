"""The graphs for engines give what the package gives, and the example in Rust what a stream gives."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import learning
import numpy as np
import onnxruntime
import pytest
import torch

from interpose import rotation
from interpose.export import dcmoe, engine, onnx_file, planner
from interpose.motion import from_global
from interpose.runtime import poses
from interpose.runtime.backends.dcmoe import initial_state, resting_path
from interpose.runtime.model_folder import load
from interpose.runtime.streaming import fading
from interpose.runtime.streaming.streams import Stream
from interpose.skeleton import HUMANOID, global_rotations

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "engine"
CLIP = learning.march(90, 1.0, 0.5)
START, TARGET = (20, 45), (60, 10)
"""Frames of two rows."""


def plain(frames) -> tuple[np.ndarray, np.ndarray]:
    """Hips and world quaternions, as an engine has them: of any length."""
    rows = list(frames)
    return CLIP.root_positions[rows], 1.7 * global_rotations(CLIP.local_rotations[rows], HUMANOID.parents)


def local(frames) -> tuple[np.ndarray, np.ndarray]:
    rows = list(frames)
    return CLIP.root_positions[rows], CLIP.local_rotations[rows]


def outputs(graph, feed) -> dict[str, np.ndarray]:
    """What a graph gives in torch."""
    with torch.no_grad():
        made = graph.eval()(*(torch.tensor(np.asarray(feed[name]), dtype=torch.float32) for name in graph.inputs))
    return {name: value.numpy() for name, value in zip(graph.outputs, made, strict=True)}


def begun(known: bool) -> dict[str, np.ndarray]:
    feed = dict(zip(("start_hips", "start_quaternions"), plain(START), strict=True))
    feed |= dict(zip(("before_hips", "before_quaternions"), plain(at - 1 for at in START), strict=True))
    return outputs(engine.BeginGraph(), feed | {"before_known": np.full((2, 1), float(known))})


@pytest.mark.parametrize("known", [True, False])
def test_begin_makes_the_state_of_a_pose(known):
    made = begun(known)
    frames = [[at - 1, at] if known else [at] for at in START]
    context = poses.pose_of(CLIP.root_positions[frames], CLIP.local_rotations[frames])
    wanted = initial_state(context, np.zeros((2, 13, 10, 2)))
    for name, value in wanted.items():
        np.testing.assert_allclose(made[name], value, atol=2e-4 if name == "velocities" else 1e-5, err_msg=name)
    np.testing.assert_allclose(made["path"], resting_path(context), atol=1e-5)


def aim_feed(frames: int) -> dict[str, np.ndarray]:
    state = begun(True)
    goal = dict(zip(("goal_hips", "goal_quaternions"), plain(TARGET), strict=True))
    at = np.tile(np.arange(frames + 1.0), (2, 1))
    style = np.eye(3)[[1, 0]]
    return state | goal | {"frames": np.full((2, 1), float(frames)), "at": at, "style": style}


@pytest.mark.parametrize("steps", [1, 2, 40])
def test_aim_gives_the_target_and_the_interpolation(steps):
    made = outputs(engine.AimGraph(), aim_feed(steps))
    np.testing.assert_allclose(made["bases"], poses.interpolation(local(START), local(TARGET), steps - 1), atol=1e-4)
    target = poses.pose_of(*local(TARGET))
    for name in ("hips", "rotations", "positions"):
        np.testing.assert_allclose(made[f"target_{name}"], getattr(target, name), atol=1e-5)


@pytest.mark.parametrize("change", [0, 1, 2])
def test_pose_shows_what_a_stream_shows(change):
    state, draw = begun(True), np.random.default_rng(change)
    new, former = local((21, 46)), local((23, 40))
    feed = {"change": np.full((2, 1), float(change)), "frames_left": np.array([[9.0], [1.0]])}
    feed |= {name: state[name] for name in engine.PAST_SHAPES}
    feed |= {"offset": 0.05 * draw.normal(size=(2, 23, 3)), "offset_speed": 0.01 * draw.normal(size=(2, 23, 3))}
    feed["offset_left"] = np.array([[6.0], [6.0]])
    for name, (hips, turned) in (("", new), ("former_", former)):
        feed |= {f"{name}hips": hips, f"{name}rotations": poses.pose_of(hips, turned).rotations}
    made = outputs(engine.PoseGraph(), feed)
    fade = fading.Fade(feed["offset"], feed["offset_speed"], feed["offset_left"][:, 0])
    both, before, now = np.array([True, True]), local(at - 1 for at in START), local(START)
    if change == 1:
        fade = fading.kicked(fade, both, fading.velocity(new, former))
    elif change == 2:
        fade = fading.kicked(fade, both, fading.velocity(before, now) - fading.velocity(now, new))
    fade = fading.advanced(fade, feed["frames_left"][:, 0])
    hips, turned = fading.shown(fade, *new)
    shown = poses.pose_of(hips, turned)
    np.testing.assert_allclose(made["shown_hips"], hips, atol=1e-5)
    np.testing.assert_allclose(made["shown_positions"], shown.positions, atol=1e-4)
    same = np.abs(np.sum(made["shown_quaternions"] * global_rotations(turned, HUMANOID.parents), axis=-1))
    np.testing.assert_allclose(same, 1.0, atol=1e-5)
    for name, value in (("offset", fade.value), ("offset_speed", fade.speed), ("offset_left", fade.left[:, None])):
        np.testing.assert_allclose(made[f"next_{name}"], value, atol=1e-4)
    np.testing.assert_allclose(made["next_past_hips"], np.stack([now[0], new[0]], axis=1), atol=1e-5)


@pytest.fixture(scope="module")
def folder(planned_network, planned_folder, tmp_path_factory) -> Path:
    """The exported model, with a step and a planner whose weights are not rounded: so small differences stay small."""
    made = tmp_path_factory.mktemp("engine") / "model"
    shutil.copytree(planned_folder, made)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(onnx_file, "quantise", lambda model: model)
        dcmoe.write_step(planned_network, made / "step.onnx")
        planner.write_plan(planned_network.planner, made)
    return made


def test_the_graphs_are_written_alike(tmp_path):
    assert max(engine.write_engine(tmp_path).values()) < 1e-5
    assert {file.name for file in tmp_path.iterdir()} == {"begin.onnx", "aim.onnx", "pose.onnx"}


def posed(target: dict, moved: tuple[float, float] = (0.0, 0.0)):
    hips = np.array([target["hips"]]) + np.array([[moved[0], 0.0, moved[1]]])
    turned = np.array([target["quaternions"]])
    return from_global(HUMANOID, hips, turned / np.linalg.norm(turned, axis=-1, keepdims=True), 30.0)


def test_the_example_in_rust_gives_what_a_stream_gives(folder, tmp_path):
    cargo = shutil.which("cargo")
    if cargo is None:
        pytest.skip("needs cargo, Rust's package manager")
    target = EXAMPLE.parents[1] / "build" / "engine-target"
    built = [cargo, "build", "--release", "--quiet", "--manifest-path", str(EXAMPLE / "Cargo.toml")]
    done = subprocess.run([*built, "--target-dir", str(target)], capture_output=True, text=True)
    if done.returncode and "error[" not in done.stderr:
        pytest.skip(f"the example's crates cannot be had here: {done.stderr.strip().splitlines()[-1]}")
    assert not done.returncode, done.stderr
    route = json.loads((EXAMPLE / "route.json").read_text())
    for leg in route["legs"]:
        leg["style"] = leg["style"] and "Young"
    (tmp_path / "route.json").write_text(json.dumps(route))
    library = next((Path(onnxruntime.__file__).parent / "capi").glob("*onnxruntime.*"))
    files = [str(folder), *(str(tmp_path / name) for name in ("route.json", "out.html", "numbers.json"))]
    program = str(target / "release" / "interpose-engine")
    ran = subprocess.run(
        [program, *files], capture_output=True, text=True, env=os.environ | {"ORT_DYLIB_PATH": str(library)}
    )
    assert not ran.returncode, ran.stderr
    assert "210 frames" in ran.stdout
    assert '"parents"' in (tmp_path / "out.html").read_text()
    numbers = json.loads((tmp_path / "numbers.json").read_text())

    stream, wanted = Stream(load(folder), posed(route["start"])), []
    for frame in range(route["frames"]):
        leg = [leg for leg in route["legs"] if leg["frame"] <= frame][-1]
        stream.style = leg["style"] or None
        moved = tuple(drift * (frame - leg["frame"]) for drift in leg["drift"])
        wanted.append(stream.step(posed(leg, moved), max(1, leg["arrive"] - frame) / 30.0))
    places = np.concatenate([pose.global_positions() for pose in wanted])
    np.testing.assert_allclose(np.array(numbers["positions"]).reshape(-1, 22, 3), places, atol=1e-3)
    turned = np.array(numbers["quaternions"]).reshape(-1, 22, 4)
    apart = rotation.multiply(rotation.inverse(turned), np.concatenate([pose.global_rotations() for pose in wanted]))
    assert rotation.angle(apart).max() < 2e-3
