from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import lafan1, run
from interpose.evaluate.fill import INTERP, ZERO_VELOCITY, Carrier, Contender
from interpose.evaluate.run import Case
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
    return Case(lafan1.cut(clips), 12, lafan1.position_scale(clips))


def carrier_of(case: Case) -> Carrier:
    return Carrier.of(case.windows.skeleton, case.windows.rate)


class Perfect:
    """A method that knows the truth."""

    name = summary = "perfect"

    def __init__(self, case: Case) -> None:
        self.case = case

    def abilities(self, model: object) -> Abilities:
        return Abilities(any_rig=True)

    def generate(self, model: object, batch: GapBatch) -> Generated:
        windows, inner = self.case.windows, slice(self.case.start + 1, self.case.target)
        assert batch.context_root.shape[1] == batch.context_local.shape[1] == 3
        np.testing.assert_array_equal(batch.context_root[:, -1], windows.root[:, 9])
        np.testing.assert_array_equal(batch.target_root, windows.root[:, 22])
        np.testing.assert_array_equal(batch.target_local, windows.local[:, 22])
        assert set(batch.frames) == {12}
        return Generated(windows.root[:, inner], windows.local[:, inner], np.zeros((len(batch), 12, 4)))


def test_a_perfect_method_has_no_error_and_the_truths_foot_slide(case: Case) -> None:
    found, truth = (
        run.scores(case, Contender("perfect", Perfect(case), None, 3), carrier_of(case)),
        run.truth_scores(case),
    )
    for name in ("L2P", "L2Q", "L2Q_aligned", "NPSS", "ADE", "SLDE"):
        assert found[name].value == pytest.approx(0.0, abs=1e-12), name
    assert found["jerk_ratio"].value == pytest.approx(1.0)
    for name in truth:
        assert found[name].value == pytest.approx(truth[name].value, nan_ok=True), name


def test_rows_carry_the_ratio_to_interp_on_the_same_windows(case: Case) -> None:
    rows = {(row.method, row.metric): row for row in run.case_rows(case, [ZERO_VELOCITY, INTERP], carrier_of(case))}
    zero, interp = rows["zero-velocity", "L2P"], rows["interp", "L2P"]
    assert zero.ratio_to_interp == pytest.approx(zero.value / interp.value)
    assert zero.ratio_ci_low < zero.ratio_to_interp < zero.ratio_ci_high
    assert zero.ci_low < zero.value < zero.ci_high
    assert interp.ratio_to_interp == interp.ratio_ci_low == interp.ratio_ci_high == 1.0
    assert math.isnan(rows["zero-velocity", "jerk_ratio"].ratio_to_interp)
    assert "foot_slide" in {metric for method, metric in rows if method == "truth"}


def test_evaluate_writes_what_it_returns(lafan1_like: Path, tmp_path: Path) -> None:
    rows = run.evaluate_lafan1(lafan1_like, ["interp", "zero-velocity"], tmp_path, lengths=(60, 5))
    written = json.loads((tmp_path / "results.json").read_text())
    assert [row["value"] for row in written] == [None if math.isnan(row.value) else row.value for row in rows]
    assert {(row.frames, row.protocol) for row in rows} == {(5, "lafan1"), (60, "lafan1-extended")}
    assert {row.method for row in rows} == {"truth", "interp", "zero-velocity"}
    assert {row.context_frames for row in rows} == {10}


@pytest.mark.parametrize("methods", [[], ["spline"], ["truth=model"]])
def test_methods_that_do_not_exist(methods: list[str], lafan1_like: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--methods"):
        run.evaluate_lafan1(lafan1_like, methods, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_lengths_and_contexts_that_cannot_be_served(lafan1_like: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="2 frames or more, got 1"):
        run.evaluate_lafan1(lafan1_like, ["interp"], tmp_path / "out", lengths=(1,))
    with pytest.raises(InputError, match="1 to 10 frames, not 11"):
        run.evaluate_lafan1(lafan1_like, ["interp"], tmp_path / "out", context_frames=11)
    with pytest.raises(InputError, match="window of 320 frames"):
        run.evaluate_lafan1(lafan1_like, ["interp"], tmp_path / "out", lengths=(5, 300))
    assert not (tmp_path / "out").exists()


def test_a_model_that_is_not_there(lafan1_like: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no-such-model"):
        run.evaluate_lafan1(lafan1_like, ["mine=no-such-model"], tmp_path / "out", lengths=(5,))


@pytest.fixture(scope="module")
def official(lafan1_dir: Path) -> tuple[lafan1.Windows, lafan1.Data]:
    source = lafan1.read(lafan1_dir)
    windows = lafan1.cut(source.clips)
    if len(windows) != 376:
        pytest.skip(f"the expected values are for 376 windows, here are {len(windows)}")
    return windows, source


def test_the_golden_values_of_the_official_code_to_every_printed_digit(
    official: tuple[lafan1.Windows, lafan1.Data],
) -> None:
    windows, source = official
    carrier = Carrier.of(windows.skeleton, windows.rate)
    np.testing.assert_allclose(100.0 * source.scale[0], [39.9, 35.9, 18.5], atol=0.06)
    rows = [
        row
        for frames in lafan1.LENGTHS
        for row in run.case_rows(Case(windows, frames, source.scale), [INTERP, ZERO_VELOCITY], carrier)
    ]
    for (method, metric), expected in GOLDEN.items():
        digits = len(expected[0]) - 2
        found = tuple(f"{row.value:.{digits}f}" for row in rows if (row.method, row.metric) == (method, metric))
        assert found == expected, (method, metric)


def test_foot_slide_of_truth_and_interp_is_what_others_measured(official: tuple[lafan1.Windows, lafan1.Data]) -> None:
    windows, source = official
    case = Case(windows, 15, source.scale)
    assert run.truth_scores(case)["foot_slide"].value == pytest.approx(0.135, abs=0.006)
    assert run.scores(case, INTERP, carrier_of(case))["foot_slide"].value == pytest.approx(2.8, abs=0.05)
