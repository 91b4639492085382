from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import lafan1, windows
from interpose.evaluate.case import Case, scores, truth_scores
from interpose.evaluate.fill import INTERP, ZERO_VELOCITY, Contender, fill
from interpose.evaluate.lafan1 import LAFAN1_METRICS
from interpose.retarget import map_skeleton
from interpose.runtime.backends.backend import Abilities
from interpose.runtime.gap_batch import GapBatch, Generated

from .conftest import MakeClip

GOLDEN = {
    ("interp", "L2P"): ("0.292", "1.061", "2.158", "3.164"),
    ("interp", "L2Q"): ("0.18", "0.52", "0.87", "1.09"),
    ("interp", "NPSS"): ("0.0016", "0.0284", "0.1552", "0.3723"),
    ("zero-velocity", "L2P"): ("1.274", "3.117", "5.556", "7.827"),
    ("zero-velocity", "L2Q"): ("0.49", "1.01", "1.47", "1.78"),
    ("zero-velocity", "NPSS"): ("0.0039", "0.0399", "0.1905", "0.4377"),
}
"""The official code's own output on 3 files of subject 5 (fallAndGetUp1, ground1, obstacles1) and 24 of the others."""


@pytest.fixture
def case(make_clip: MakeClip) -> Case:
    clips = (make_clip(200, 1), make_clip(150, 2))
    mapping = map_skeleton(clips[0].skeleton)
    return Case("lafan1", 12, windows.cut(clips), 9, 22, 10, mapping, windows.position_scale(clips))


class Perfect:
    """A method that knows the truth."""

    name = summary = "perfect"

    def __init__(self, case: Case) -> None:
        self.case = case

    def abilities(self, model: object) -> Abilities:
        return Abilities(any_rig=True)

    def generate(self, model: object, batch: GapBatch) -> Generated:
        recorded, inner = self.case.windows, slice(self.case.start + 1, self.case.target)
        assert batch.context_root.shape[1] == batch.context_local.shape[1] == 3
        np.testing.assert_array_equal(batch.context_root[:, -1], recorded.root[:, 9])
        np.testing.assert_array_equal(batch.target_root, recorded.root[:, 22])
        np.testing.assert_array_equal(batch.target_local, recorded.local[:, 22])
        assert set(batch.frames) == {12}
        return Generated(recorded.root[:, inner], recorded.local[:, inner], np.zeros((len(batch), 12, 4)))


def test_a_perfect_method_has_no_error_and_the_truths_foot_slide(case: Case) -> None:
    found = scores(case, fill(case, Contender("perfect", Perfect(case), None, 3)).motion, LAFAN1_METRICS)
    truth = truth_scores(case, LAFAN1_METRICS)
    assert set(truth) < set(found)
    for name in ("L2P", "L2Q", "L2Q_aligned", "NPSS", "ADE", "SLDE"):
        assert found[name].value == pytest.approx(0.0, abs=1e-12), name
    assert found["jerk_ratio"].value == pytest.approx(1.0)
    for name in truth:
        assert found[name].value == pytest.approx(truth[name].value, nan_ok=True), name


def test_rows_carry_the_ratio_to_interp_on_the_same_windows(case: Case) -> None:
    rows = {(row.method, row.metric): row for row in lafan1.case_rows(case, [ZERO_VELOCITY, INTERP])}
    zero, interp = rows["zero-velocity", "L2P"], rows["interp", "L2P"]
    assert zero.ratio_to_interp == pytest.approx(zero.value / interp.value)
    assert zero.ratio_ci_low < zero.ratio_to_interp < zero.ratio_ci_high
    assert zero.ci_low < zero.value < zero.ci_high
    assert interp.ratio_to_interp == interp.ratio_ci_low == interp.ratio_ci_high == 1.0
    assert math.isnan(rows["zero-velocity", "jerk_ratio"].ratio_to_interp)
    assert "foot_slide" in {metric for method, metric in rows if method == "truth"}


def test_evaluate_writes_what_it_returns(lafan1_like: Path, tmp_path: Path) -> None:
    rows = lafan1.evaluate_lafan1(lafan1_like, ["interp", "zero-velocity"], tmp_path, lengths=(60, 5))
    written = json.loads((tmp_path / "results.json").read_text())
    assert [row["value"] for row in written] == [None if math.isnan(row.value) else row.value for row in rows]
    assert {(row.frames, row.protocol) for row in rows} == {(5, "lafan1"), (60, "lafan1-extended")}
    assert {row.method for row in rows} == {"truth", "interp", "zero-velocity"}
    assert {row.context_frames for row in rows} == {10}


@pytest.mark.parametrize("methods", [[], ["spline"], ["truth=model"]])
def test_methods_that_do_not_exist(methods: list[str], lafan1_like: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--methods"):
        lafan1.evaluate_lafan1(lafan1_like, methods, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_lengths_and_contexts_that_cannot_be_served(lafan1_like: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="2 frames or more, got 1"):
        lafan1.evaluate_lafan1(lafan1_like, ["interp"], tmp_path / "out", lengths=(1,))
    with pytest.raises(InputError, match="1 to 10 frames, not 11"):
        lafan1.evaluate_lafan1(lafan1_like, ["interp"], tmp_path / "out", context_frames=11)
    with pytest.raises(InputError, match="window of 320 frames"):
        lafan1.evaluate_lafan1(lafan1_like, ["interp"], tmp_path / "out", lengths=(5, 300))
    assert not (tmp_path / "out").exists()


def test_a_model_that_is_not_there(lafan1_like: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no-such-model"):
        lafan1.evaluate_lafan1(lafan1_like, ["mine=no-such-model"], tmp_path / "out", lengths=(5,))


@pytest.fixture(scope="module")
def official(lafan1_dir: Path) -> list[Case]:
    """The cases of the official lengths."""
    source = windows.read(lafan1_dir)
    cases = list(windows.cases(source, windows.OFFICIAL_LENGTHS))
    if len(cases[0]) != 376:
        pytest.skip(f"the expected values are for 376 windows, here are {len(cases[0])}")
    np.testing.assert_allclose(100.0 * source.scale[0], [39.9, 35.9, 18.5], atol=0.06)
    return cases


def test_the_golden_values_of_the_official_code_to_every_printed_digit(official: list[Case]) -> None:
    rows = [row for case in official for row in lafan1.case_rows(case, [INTERP, ZERO_VELOCITY])]
    for (method, metric), expected in GOLDEN.items():
        digits = len(expected[0]) - 2
        found = tuple(f"{row.value:.{digits}f}" for row in rows if (row.method, row.metric) == (method, metric))
        assert found == expected, (method, metric)


def test_foot_slide_of_truth_and_interp_is_what_others_measured(official: list[Case]) -> None:
    case = official[1]
    assert case.frames == 15
    assert truth_scores(case, ["foot_slide"])["foot_slide"].value == pytest.approx(0.135, abs=0.006)
    made = fill(case, INTERP).motion
    assert scores(case, made, ["foot_slide"])["foot_slide"].value == pytest.approx(2.8, abs=0.05)
