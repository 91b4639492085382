from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from interpose import rotation
from interpose.data import database, root
from interpose.data.database import ClipArrays, ClipInfo, Database
from interpose.errors import InputError
from interpose.models.periodic_autoencoder import PeriodicAutoencoder
from interpose.motion import Motion, mirror, velocities
from interpose.skeleton import HUMANOID, MODEL_RATE
from interpose.train.common import loop
from interpose.train.phases import extract, recipe


def march(frames: int, hertz: float, heading: float) -> Motion:
    """Legs and arms that swing like pendulums on a straight line."""
    seconds = np.arange(frames) / MODEL_RATE
    swing = np.sin(2 * np.pi * hertz * seconds)
    turned = np.tile(rotation.IDENTITY, (frames, len(HUMANOID), 1))
    about_x = np.stack([swing, np.zeros(frames), np.zeros(frames)], axis=-1)
    for name, size in (("LeftUpLeg", 0.5), ("RightUpLeg", -0.5), ("LeftArm", -0.3), ("RightArm", 0.3), ("Spine", 0.1)):
        turned[:, HUMANOID.index(name)] = rotation.from_rotation_vector(size * about_x)
    turned[:, 0] = rotation.from_rotation_vector(np.array([0.0, heading, 0.0]))
    ahead = hertz * seconds[:, None] * np.array([math.sin(heading), 0.0, math.cos(heading)])
    return Motion(HUMANOID, ahead + np.array([0.0, 0.95, 0.0]), turned, MODEL_RATE)


def arrays(motion: Motion) -> ClipArrays:
    return ClipArrays(
        motion.root_positions.astype(np.float32),
        motion.local_rotations.astype(np.float32),
        root.trajectory(motion.global_positions(), MODEL_RATE).astype(np.float32),
        np.zeros((len(motion), 4), dtype=np.uint8),
    )


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Database:
    motions = [march(150, 0.8, 0.3), march(200, 1.2, -2.0), march(40, 1.0, 1.0), march(1, 1.0, 0.0)]
    infos = [
        ClipInfo(f"march{i}", "", "Neutral", "", "", MODEL_RATE, len(m), (0, len(m)), 0.0)
        for i, m in enumerate(motions)
    ]
    return database.write(
        tmp_path_factory.mktemp("db"),
        [(info, len(m)) for info, m in zip(infos, motions, strict=True)],
        [arrays(m) for m in motions],
        dataset="synthetic",
        licence="ours",
    )


def test_velocities_do_not_depend_on_where_the_character_walks() -> None:
    seen = []
    for heading in (0.0, 2.5):
        motion = march(90, 1.0, heading)
        placed = motion.global_positions()
        seen.append(extract.in_root_frame(placed, root.trajectory(placed, MODEL_RATE)))
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
    assert np.all(seen[0][:, HUMANOID.index("LeftArm"), 0] > 0.1)


def test_the_low_pass_keeps_a_walk_in_place_and_drops_jitter() -> None:
    seconds = np.arange(300) / MODEL_RATE
    walk = np.sin(2 * np.pi * seconds)
    passed = extract.low_pass((walk + 0.5 * np.sin(2 * np.pi * 12 * seconds))[:, None], MODEL_RATE)[:, 0]
    np.testing.assert_allclose(passed[30:-30], walk[30:-30], atol=0.02)
    np.testing.assert_allclose(extract.low_pass(np.ones((1, 2)), MODEL_RATE), 1.0)


def test_windows_repeat_the_ends_of_their_clip_and_mirror_as_motions_do(data: Database) -> None:
    curves = extract.velocity_curves(data)
    assert len(curves) == data.frames
    middle = torch.tensor([151, 340])
    plain = extract.windows(curves, middle, torch.tensor([False, False]), 61)
    torch.testing.assert_close(plain[0, :, 30], curves.values[151])
    torch.testing.assert_close(plain[0, :, :30], curves.values[150][:, None].expand(-1, 30))
    torch.testing.assert_close(plain[1, :, 50], curves.values[349])
    mirrored = mirror(data.clip(1))
    placed = mirrored.global_positions()
    expected = velocities(extract.in_root_frame(placed, root.trajectory(placed, MODEL_RATE)), MODEL_RATE)
    expected = extract.low_pass(expected, MODEL_RATE).reshape(len(mirrored), -1)
    seen = extract.windows(curves, middle, torch.tensor([True, True]), 61)
    np.testing.assert_allclose(seen[1, :, 30], expected[340 - 150], atol=2e-3)


def test_phase_features_are_those_of_single_windows(data: Database) -> None:
    torch.manual_seed(0)
    curves, model = extract.velocity_curves(data), PeriodicAutoencoder()
    features = extract.phase_features(curves, model, batch=100)
    assert features.shape == (2, data.frames, 10, 3)
    phase = extract.encode(curves, model, torch.tensor([123]), torch.tensor([True]))
    turns = np.arctan2(*features[1, 123, :, :2].astype(float).T) / (2 * np.pi)
    np.testing.assert_allclose(np.exp(2j * np.pi * turns), np.exp(2j * np.pi * phase.shift[0].numpy()), atol=0.01)
    np.testing.assert_allclose(features[1, 123, :, 2], phase.frequency[0], rtol=2e-3)


def metrics(folder: Path) -> list[dict[str, float]]:
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def trained(data: Database, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(recipe.PRESETS, "tiny", replace(recipe.PRESETS["tiny"], steps=150))
        assert recipe.train([data.path], folder, "tiny") == "finished"
    return folder


def test_tiny_trains_and_leaves_phases_figures_and_a_report(trained: Path, data: Database) -> None:
    losses = [line["loss"] for line in metrics(trained)]
    assert losses[-1] < 0.5 * losses[0]
    features = np.load(trained / "phases.npy")
    assert features.shape == (2, data.frames, 3, 3)
    assert features.dtype == np.float16
    assert np.isfinite(features).all()
    (report,) = json.loads((trained / "report.json").read_text())
    assert report["frames"] == data.frames
    assert 0.0 < report["unexplained"] < 0.6
    for name in ("manifold.png", "clip.png"):
        assert (trained / name).read_bytes().startswith(b"\x89PNG")


def test_phases_cycle_at_the_pace_of_the_march(trained: Path) -> None:
    steady = np.load(trained / "phases.npy")[0, 200:300].astype(float)
    strongest = int(np.argmax(np.linalg.norm(steady[..., :2], axis=-1).mean(axis=0)))
    turned = np.unwrap(np.arctan2(steady[:, strongest, 0], steady[:, strongest, 1])) / (2 * np.pi)
    assert abs(turned[-1] - turned[0]) / (99 / MODEL_RATE) == pytest.approx(1.2, rel=0.1)


def test_a_killed_training_goes_on_exactly(data: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(recipe.PRESETS, "tiny", replace(recipe.PRESETS["tiny"], steps=12))
    assert recipe.train([data.path], tmp_path / "whole", "tiny", max_minutes=None) == "finished"
    assert recipe.train([data.path], tmp_path / "cut", "tiny", max_minutes=0.0) == "out of time"
    assert not (tmp_path / "cut" / "phases.npy").exists()
    assert recipe.train([data.path], tmp_path / "cut", "tiny") == "finished"
    whole, cut = recipe.load_model(tmp_path / "whole"), recipe.load_model(tmp_path / "cut")
    for name, value in whole.state_dict().items():
        torch.testing.assert_close(cut.state_dict()[name], value, rtol=0, atol=0)
    with pytest.raises(InputError, match="cannot resume, seed is 1 now"):
        recipe.train([data.path], tmp_path / "cut", "tiny", seed=1)


@pytest.mark.parametrize("preset", recipe.PRESETS)
def test_every_preset_takes_a_step(
    data: Database, tmp_path: Path, preset: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loop, "cosine", lambda *_: 1.0)
    assert recipe.train([data.path, data.path], tmp_path, preset, max_minutes=0.0) == "out of time"
    assert metrics(tmp_path)[-1]["step"] == 1


def test_unknown_presets_and_empty_runs_are_refused(data: Database, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no preset 'huge'; there are full, small, tiny"):
        recipe.train([data.path], tmp_path, "huge")
    with pytest.raises(InputError, match="holds no trained autoencoder"):
        recipe.load_model(tmp_path)
