"""`interpose evaluate stitch`: the protocol, what is best and what is a mean, and that seams show."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import lafan1, metrics, stitch
from interpose.evaluate.fill import INTERP, Carrier, Contender, FilledGaps
from interpose.evaluate.metrics import Scores
from interpose.evaluate.stitch import Case
from interpose.runtime.gap_batch import Batch, Draw

from .conftest import MakeClip


@pytest.fixture
def case(make_clip: MakeClip) -> Case:
    clips = (make_clip(200, 1), make_clip(150, 2))
    return Case(lafan1.cut(clips, 50, 20, 1), 12, lafan1.position_scale(clips))


def test_windows_are_turned_by_their_first_frame(make_clip: MakeClip) -> None:
    windows = lafan1.cut((make_clip(120, 1),), 50, 20, 1)
    forward = windows.positions[:, 0]
    assert len(windows) == 4
    np.testing.assert_allclose(windows.root[:, :, [0, 2]].mean(axis=1), 0.0, atol=1e-9)
    assert forward.shape[1] == 22


def test_the_truth_has_no_error(case: Case) -> None:
    w = case.windows
    found = stitch.scores(case, w.rotations[:, 1:11], w.positions[:, 1:11])
    for name in ("L2P", "L2Q", "L2Q_aligned", "NPSS", "ADE", "SLDE"):
        assert found[name].value == pytest.approx(0.0, abs=1e-12), name
    assert found["jerk_ratio"].value == pytest.approx(1.0)


def test_errors_are_those_of_the_frames_between(case: Case) -> None:
    w = case.windows
    moved = w.positions[:, 1:11] + np.array([0.1, 0.0, 0.0])
    moved[:, -1] += np.array([0.1, 0.0, 0.0])
    found = stitch.scores(case, w.rotations[:, 1:11], moved)
    assert found["ADE"].value == pytest.approx(0.11)
    assert found["SLDE"].value == pytest.approx(0.2)


def test_samples_are_averaged_and_the_best_is_each_windows(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples that are so many metres off; the likeliest a metre."""
    wrong = {None: 1.0, 1: 0.1, 2: 0.4, 3: -0.2}

    def fill(
        method: Contender, start: Batch, target: Batch, frames: int, *, carrier: Carrier, draws: list[Draw]
    ) -> FilledGaps:
        assert start[0].shape[1] == start[1].shape[1] == 1
        assert frames == 10
        np.testing.assert_array_equal(target[0][:, 0], case.windows.root[:, 11])
        (seed,) = {None if draw is None else draw[0] for draw in draws}
        assert seed is None or [draw[1] for draw in draws if draw is not None] == list(range(len(case.windows)))
        root = case.windows.root[:, 1:11] + np.array([0.0, 0.0, wrong[seed]])
        motion = root, case.windows.local[:, 1:11]
        return FilledGaps(motion, motion, np.full(len(root), 0.25))

    monkeypatch.setattr(stitch, "fill", fill)
    carrier = Carrier.of(case.windows.skeleton, case.windows.rate)
    errors, found = stitch._several(case, Contender("drawn", INTERP.backend), carrier, 3, 0)
    assert found["drawn"]["ADE"].value == pytest.approx(1.0)
    assert found["drawn"]["MMPE"].value == pytest.approx(0.25)
    assert found["drawn sample"]["ADE"].value == pytest.approx(0.7 / 3)
    assert found["drawn best of 3"]["ADE"].value == pytest.approx(0.1)
    assert found["drawn sample"]["APD"].value == pytest.approx((0.3 + 0.3 + 0.6) / 3)
    assert [float(e.mean()) for e in errors] == pytest.approx([0.1, 0.4, 0.2])


def test_the_best_follows_the_window() -> None:
    a = Scores(np.array([1.0, 4.0]), np.array([1.0, 2.0]))
    b = Scores(np.array([3.0, 1.0]), np.array([2.0, 1.0]))
    best = metrics.best([a, b])
    np.testing.assert_array_equal(best.total, [1.0, 1.0])
    np.testing.assert_array_equal(best.weight, [1.0, 1.0])


def test_a_kink_in_the_middle_shows_as_a_seam() -> None:
    time = np.arange(21.0)
    smooth = np.sin(time / 5.0)
    kinked = smooth + np.where(time > 10.0, 1.0, 0.0)
    whole = np.zeros((2, 21, 3, 3))
    whole[0, :, :, 0], whole[1, :, :, 0] = smooth[:, None], kinked[:, None]
    speed, acceleration = metrics.seam(whole)
    assert speed.total[1] / speed.weight[1] > 1.5 > speed.total[0] / speed.weight[0]
    assert acceleration.total[1] / acceleration.weight[1] > 3.0
    assert acceleration.total[0] / acceleration.weight[0] < 2.0


def test_evaluate_writes_tables_and_figures(lafan1_like: Path, tmp_path: Path, stitch_folder: Path) -> None:
    methods = ["interp", f"mine={stitch_folder}"]
    rows = stitch.evaluate_stitch(lafan1_like, methods, tmp_path, lengths=(10,), samples=2, offset=60)
    written = json.loads((tmp_path / "results.json").read_text())
    assert len(written) == len(rows)
    names = {row["method"] for row in written}
    assert names == {"truth", "interp", "mine", "mine raw", "mine sample", "mine best of 2", "mine worst of 2"}
    assert {row["protocol"] for row in written} == {"stitch"}
    found = {(row.method, row.metric): row for row in rows}
    assert found["interp", "L2P"].ratio_to_interp == 1.0
    assert found["mine best of 2", "ADE"].value <= found["mine sample", "ADE"].value
    assert found["mine sample", "APD"].value > 0.0
    assert {p.name for p in tmp_path.iterdir()} >= {"results.md", "results.csv", "errors.png", "samples.png"}


@pytest.mark.parametrize(
    ("methods", "said"),
    [
        (["nothing"], "nothing: unknown method; choose interp, zero-velocity, dcmoe, stitch"),
        (["interp", "interp"], "names each method once"),
        (["interp=x"], "interp=x: choose interp, zero-velocity"),
        (["mine=nowhere"], "no model 'nowhere'"),
    ],
)
def test_methods_that_cannot_be_had(lafan1_like: Path, tmp_path: Path, methods: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        stitch.evaluate_stitch(lafan1_like, methods, tmp_path / "out", lengths=(10,))
    assert not (tmp_path / "out").exists()


def test_lengths_that_do_not_fit(lafan1_like: Path, tmp_path: Path) -> None:
    for lengths in ((3,), (51,), ()):
        with pytest.raises(InputError, match="gaps have 4 to 50 frames"):
            stitch.evaluate_stitch(lafan1_like, ["interp"], tmp_path, lengths=lengths)


def test_interpolation_is_the_baseline_of_the_paper(case: Case) -> None:
    carrier = Carrier.of(case.windows.skeleton, case.windows.rate)
    positions, _ = stitch._fill(case, INTERP, carrier).motion
    start, goal = case.windows.root[:, 0], case.windows.root[:, 11]
    np.testing.assert_allclose(positions[:, 4], start + (goal - start) * 5.0 / 11.0, atol=1e-9)
