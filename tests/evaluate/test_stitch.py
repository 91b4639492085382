"""`interpose evaluate stitch`: the protocol, what is best and what is a mean, and that seams show."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose import rotation
from interpose.errors import InputError
from interpose.evaluate import stitch, windows
from interpose.evaluate.case import Case
from interpose.evaluate.fill import INTERP, Contender, FilledGaps, fill
from interpose.retarget import map_skeleton

from .conftest import MakeClip


@pytest.fixture
def case(make_clip: MakeClip) -> Case:
    clips = (make_clip(200, 1), make_clip(150, 2))
    mapping = map_skeleton(clips[0].skeleton)
    return Case("stitch", 12, windows.cut(clips, 50, 20, 1), 0, 11, 1, mapping, windows.position_scale(clips))


def test_windows_are_turned_by_their_first_frame(make_clip: MakeClip) -> None:
    found = windows.cut((make_clip(120, 1),), 50, 20, 1)
    assert found.positions.shape == (4, 50, 22, 3)
    np.testing.assert_allclose(found.root[:, :, [0, 2]].mean(axis=1), 0.0, atol=1e-9)
    hips_y = rotation.rotate(found.rotations[:, 0, 0], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(hips_y[:, 2], 0.0, atol=1e-12)


def test_samples_are_averaged_and_the_best_is_each_windows(case: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples that are so many metres off; the likeliest a metre."""
    wrong = {None: 1.0, 1: 0.1, 2: 0.4, 3: -0.2}

    def fill(case: Case, method: Contender, *, seed: int | None = None) -> FilledGaps:
        motion = replace(case.truth, root=case.truth.root + np.array([0.0, 0.0, wrong[seed]]))
        return FilledGaps(motion, motion, np.full(len(case), 0.25))

    monkeypatch.setattr(stitch, "fill", fill)
    errors, found = stitch.sample_scores(case, Contender("drawn", INTERP.backend), 3, 0)
    assert found["drawn"]["ADE"].value == pytest.approx(1.0)
    assert found["drawn"]["MMPE"].value == pytest.approx(0.25)
    assert found["drawn sample"]["ADE"].value == pytest.approx(0.7 / 3)
    assert found["drawn best of 3"]["ADE"].value == pytest.approx(0.1)
    assert found["drawn sample"]["APD"].value == pytest.approx((0.3 + 0.3 + 0.6) / 3)
    assert [float(e.mean()) for e in errors] == pytest.approx([0.1, 0.4, 0.2])


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
    ("methods", "message"),
    [
        (["nothing"], "nothing: unknown method; choose interp, zero-velocity, dcmoe, stitch"),
        (["interp", "interp"], "names each method once"),
        (["interp=x"], "interp=x: choose interp, zero-velocity"),
        (["mine=nowhere"], "no model 'nowhere'"),
    ],
)
def test_methods_that_cannot_be_had(lafan1_like: Path, tmp_path: Path, methods: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        stitch.evaluate_stitch(lafan1_like, methods, tmp_path / "out", lengths=(10,))
    assert not (tmp_path / "out").exists()


def test_lengths_that_do_not_fit(lafan1_like: Path, tmp_path: Path) -> None:
    for lengths in ((3,), (51,), ()):
        with pytest.raises(InputError, match="gaps have 4 to 50 frames"):
            stitch.evaluate_stitch(lafan1_like, ["interp"], tmp_path, lengths=lengths)


def test_interpolation_is_the_baseline_of_the_paper(case: Case) -> None:
    made = fill(case, INTERP).motion
    start, goal = case.windows.root[:, 0], case.windows.root[:, 11]
    np.testing.assert_allclose(made.root[:, 4], start + (goal - start) * 5.0 / 11.0, atol=1e-9)
