"""What a model makes of a gap that it does not know stays near interpolation, and says so."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interpose import io, rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.runtime import confidence, model_folder
from interpose.runtime.confidence import Calibration
from interpose.runtime.gap_batch import GapBatch, Generated, batch_of
from interpose.runtime.inbetween import fill, inbetween
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID

CASES = Path(__file__).parent.parent / "cases"
COUNT = len(confidence.FEATURES)
PLAIN = Session(Path("nowhere"), {"name": "plain", "method": "dcmoe", "styles": ["Old"]})


def calibration(keep: float, count: int = COUNT) -> Calibration:
    """One that knows nothing and keeps that share of everything."""
    logit = np.log(keep / (1.0 - keep))
    return Calibration(
        np.zeros((1, 66)),
        np.zeros(count),
        np.ones(count),
        np.zeros((count, 4)),
        np.zeros(4),
        np.zeros((4, 2)),
        np.array([0.0, logit]),
    )


def gap(frames: int = 9, style: str | None = None) -> tuple[GapBatch, Generated]:
    """Two rows between poses 10 cm apart, and a motion that lies half a metre aside."""
    rng = np.random.default_rng(0)
    turns = rng.normal(size=(2, 2, 22, 3)) * 0.3
    turns[..., 0, :] = 0.0
    local = rotation.from_rotation_vector(turns)
    root = np.array([[[0.0, 0.9, 0.0]], [[0.0, 0.9, 0.1]]]).transpose(1, 0, 2).repeat(2, axis=0)
    batch = batch_of((root[:, :1], local[:, :1]), (root[:, 1:], local[:, 1:]), frames, styles=style)
    base_root, base_local = confidence.interpolated(batch)
    aside = Generated(base_root + np.array([0.5, 0.0, 0.0]), base_local[:, ::-1], np.zeros((2, frames, 4)))
    return batch, aside


@given(st.lists(st.floats(-1e6, 1e6), min_size=COUNT, max_size=COUNT), st.integers(0, 5))
def test_confidence_is_a_share_whatever_comes(values: list[float], seed: int) -> None:
    rng = np.random.default_rng(seed)
    some = Calibration(
        np.zeros((1, 66)),
        rng.normal(size=COUNT),
        rng.uniform(0.1, 2.0, COUNT),
        rng.normal(size=(COUNT, 4)),
        rng.normal(size=4),
        rng.normal(size=(4, 2)),
        rng.normal(size=2),
    )
    for share in some(np.array([values])):
        assert 0.0 <= share[0] <= 1.0


def test_kept_shares_lie_between_interpolation_and_what_was_made() -> None:
    batch, made = gap()
    root, local = confidence.interpolated(batch)
    none, whole, half = (
        confidence.kept(batch, made, np.full(2, share), np.full(2, share)) for share in (0.0, 1.0, 0.5)
    )
    np.testing.assert_allclose(none[0], root)
    assert rotation.angle(rotation.multiply(rotation.inverse(none[1]), local)).max() < 1e-6
    np.testing.assert_allclose(whole[0], made.root)
    assert rotation.angle(rotation.multiply(rotation.inverse(whole[1]), made.local)).max() < 1e-6
    np.testing.assert_allclose(half[0], 0.5 * (root + made.root))


def test_legs_step_on_while_the_body_keeps_to_the_line() -> None:
    batch, made = gap()
    root, local = confidence.kept(batch, made, np.zeros(2), np.ones(2))
    straight, base = confidence.interpolated(batch)
    np.testing.assert_allclose(root[..., ::2], straight[..., ::2])
    np.testing.assert_allclose(root[..., 1], made.root[..., 1])
    knee, head = HUMANOID.index("LeftLeg"), HUMANOID.index("Head")
    for joint, wanted in ((knee, made.local), (head, base)):
        apart = rotation.multiply(rotation.inverse(local[..., joint, :]), wanted[..., joint, :])
        assert rotation.angle(apart).max() < 1e-6


def test_a_model_without_calibration_keeps_all_and_says_nothing() -> None:
    batch, made = gap()
    assert confidence.judged(PLAIN, batch, made) == (made, None)


@pytest.mark.parametrize(("style", "moved"), [(None, 0.05), ("Old", 0.5)])
def test_a_style_that_was_asked_for_is_kept_whole(
    style: str | None, moved: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(confidence, "calibration", lambda folder: calibration(0.1))
    batch, made = gap(style=style)
    after, sure = confidence.judged(PLAIN, batch, made)
    np.testing.assert_allclose(after.root[..., 0], moved)
    np.testing.assert_allclose(sure, 0.5)


def test_a_damaged_file_and_one_of_other_features(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / confidence.FILE).write_bytes(b"PK nonsense")
    with pytest.raises(InputError, match="cannot be read"):
        confidence.calibration(tmp_path / "a")
    (tmp_path / "b").mkdir()
    other = calibration(0.5, 3)
    np.savez(tmp_path / "b" / confidence.FILE, **{f.name: getattr(other, f.name) for f in fields(other)})
    with pytest.raises(InputError, match="of other features"):
        confidence.calibration(tmp_path / "b")


def test_a_body_that_must_step_or_turn_is_not_held_back() -> None:
    numbers = np.zeros((4, COUNT))
    numbers[1, confidence.FEATURES.index("hips apart")] = 0.7
    numbers[2, confidence.FEATURES.index("turn")] = 2.0
    numbers[3, confidence.FEATURES.index("hips apart")] = 0.4
    np.testing.assert_allclose(confidence.travel(numbers), [0.0, 1.0, 1.0, 0.5])


@pytest.mark.parametrize("folder", model_folder.installed(), ids=lambda folder: folder.name)
def test_every_installed_model_has_one(folder: Path) -> None:
    assert confidence.calibration(folder) is not None


@pytest.mark.parametrize("model", ["default", "lafan1"])
def test_who_stands_still_in_both_keys_stands_still_between(model: str) -> None:
    clip = io.read(CASES / "stand_still.bvh")
    session = model_folder.load(model)
    request = Request(method=session.method, model=session)
    (made,) = fill(clip, (*range(5), *range(95, 100)), request)
    apart = np.linalg.norm(made.motion.global_positions() - clip.global_positions(), axis=-1)
    assert apart.mean() < 0.01


def test_a_pose_upside_down_half_a_second_on_is_doubted() -> None:
    local = np.tile(rotation.IDENTITY, (2, len(HUMANOID), 1))
    local[1, 0] = rotation.from_rotation_vector(np.array([np.pi, 0.0, 0.0]))
    clip = Motion(HUMANOID, np.array([[0.0, 0.93, 0.0], [0.0, 1.0, 0.3]]), local, 30.0)
    session = model_folder.load()
    (made,) = inbetween(clip[0], clip[1], 14, Request(method=session.method, model=session))
    assert made.info.confidence is not None
    assert made.info.confidence < confidence.LOW
    assert "does not know" in made.info.warnings[0]
    steps = np.linalg.norm(np.diff(made.motion.global_positions(), axis=0), axis=-1)
    assert steps.max() < 0.6
