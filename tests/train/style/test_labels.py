"""A stretch of another style under the wrong label is found; what nobody can judge is kept."""

import json
from dataclasses import replace

import learning
import numpy as np
import pytest

from interpose.data import database, label_issues, root
from interpose.data.database import ClipArrays, ClipInfo
from interpose.errors import InputError
from interpose.motion import Motion, concatenate
from interpose.train.style import labels

SLOW, FAST = 0.7, 1.8
WRONG = (120, 240)
"""Frames of the clip `slow1` that are fast."""


def write(folder, clips: dict[str, tuple[str, Motion]]):
    arrays = []
    for _, motion in clips.values():
        count = len(motion)
        way = root.trajectory(motion.global_positions(), 30.0).astype(np.float32)
        placed, turned = motion.root_positions.astype(np.float32), motion.local_rotations.astype(np.float32)
        arrays.append(ClipArrays(placed, turned, way, np.zeros((count, 4), dtype=np.uint8)))
    infos = [
        (ClipInfo(name, f"{name}.bvh", style, "", "", 30.0, len(motion), (0, len(motion)), 0.0), len(motion))
        for name, (style, motion) in clips.items()
    ]
    return database.write(folder, infos, arrays, dataset="marches", licence="CC0")


@pytest.fixture
def marches(tmp_path):
    """Three recordings of each of two styles, one with a stretch of the other, and one recording of a third."""
    clips = {}
    for i in range(3):
        clips[f"slow{i}"] = ("slow", learning.march(240, SLOW, 1.0 * i))
        clips[f"fast{i}"] = ("fast", learning.march(240, FAST, 2.0 * i))
    mixed = concatenate(clips["slow1"][1][: WRONG[0]], learning.march(120, FAST, 0.3))
    clips |= {"slow1": ("slow", mixed), "still": ("lone", learning.march(150, 0.1, 0.0))}
    return write(tmp_path / "db", clips)


def test_the_wrong_stretch_loses_its_label_and_is_drawn(marches, tmp_path, monkeypatch):
    monkeypatch.setattr(labels, "PICTURES", 1)
    monkeypatch.setattr(labels, "DRAWN_FRAMES", 4)
    monkeypatch.setattr(labels, "FOLDS", 3)
    likelihoods = []
    text = labels.distil(marches.path, tmp_path / "report", steps=30, noise=1.0, progress=likelihoods.append)
    kept = label_issues.kept(marches)
    assert kept is not None
    first = marches.ranges[[c.name for c in marches.clips].index("slow1"), 0]
    inside = np.zeros(marches.frames, dtype=bool)
    inside[first + WRONG[0] + 45 : first + WRONG[1]] = True
    assert not kept[inside].any()
    inside[first + WRONG[0] - 30 : first + WRONG[1]] = True
    assert kept[~inside].mean() > 0.97
    assert "only one recording: lone." in text
    assert (tmp_path / "report" / "report.md").read_text() == text
    told = json.loads((tmp_path / "report" / "labels.json").read_text())
    assert told["kept"] == pytest.approx(kept.mean(), abs=1e-4)
    assert told["kept_by_style"]["lone"] == 1.0
    run = max(told["dropped"], key=lambda run: run["stop"] - run["start"])
    assert (run["clip"], run["given"], run["believed"]) == ("slow1", "slow", "fast")
    assert WRONG[0] - 30 <= run["start"] <= WRONG[0] + 45
    assert run["stop"] == WRONG[1]
    assert (tmp_path / "report" / "dropped-slow.png").exists()
    assert len(likelihoods) == 1 + len({k for k in label_issues.folds(marches, labels.FOLDS) if k >= 0})


def test_no_network_judges_what_it_was_trained_on(marches, monkeypatch):
    seen = []
    monkeypatch.setattr(labels, "fit", lambda frames, starts, label, *_: seen.append(set(starts.tolist())))
    monkeypatch.setattr(labels, "probabilities", lambda model, frames, starts: seen.append(set(starts.tolist())) or 0.5)
    fold = label_issues.folds(marches, labels.FOLDS)
    labels.ask(marches, fold, 1, 0, lambda message: None)
    of_clip = {start: clip for clip, (a, b) in enumerate(marches.ranges.tolist()) for start in range(a, b)}
    for trained, judged in zip(seen[::2], seen[1::2], strict=True):
        assert not {of_clip[s] for s in trained} & {of_clip[s] for s in judged}
    everyone = {of_clip[s] for judged in seen[1::2] for s in judged}
    assert everyone == set(np.flatnonzero(fold >= 0).tolist())


def test_a_smaller_share_of_the_noise_drops_less_and_the_most_doubtful_first():
    """Every fourth window is taken for the other style, each more surely than the one before."""
    label = np.arange(80) // 40
    sure = np.where(np.arange(80) % 4 == 0, 0.1 - 0.001 * np.arange(80), 0.9)
    likelihoods = np.where(np.arange(2) == label[:, None], sure[:, None], 1.0 - sure[:, None])
    opinions = labels.Opinions(12 * np.arange(80), label, np.array([3, 5]), likelihoods)
    whole, half = (labels.verdicts(opinions, noise) for noise in (1.0, 0.5))
    assert set(whole.given.tolist()) == {3, 5}
    assert whole.issue.mean() == pytest.approx(0.25, abs=0.03)
    assert half.issue.mean() == pytest.approx(0.125, abs=0.03)
    assert half.doubt[half.issue].min() > np.median(whole.doubt[whole.issue]) - 0.02
    assert (whole.given[whole.issue] != whole.believed[whole.issue]).all()


def test_what_cannot_be_judged_is_refused(database, tmp_path):
    with pytest.raises(InputError, match="need two recordings each"):
        labels.distil(database.path, tmp_path / "out")
    with pytest.raises(InputError, match="--noise must be above 0 and at most 1, got 0"):
        labels.distil(database.path, tmp_path / "out", noise=0.0)
    assert label_issues.kept(replace(database)) is None
    assert not (tmp_path / "out").exists()
