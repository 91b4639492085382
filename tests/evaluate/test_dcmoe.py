"""`interpose evaluate dcmoe`: kinds of paths, seeds together, the best of variants, pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import dcmoe, windows
from interpose.evaluate.fill import Contender, fill
from interpose.runtime.backends.dcmoe import DCMoEBackend
from interpose.runtime.gap_batch import Generated

FRAMES = 8


@pytest.fixture(scope="module")
def results(lafan1_like: Path, planned_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What two seeds, here the same model twice, scored."""
    out = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dcmoe, "DCMOE_VARIANTS", 3)
        patch.setattr(dcmoe, "SHEET_GAPS", 2)
        patch.setattr(dcmoe, "SHEET_LENGTHS", (FRAMES, 12))
        dcmoe.evaluate_dcmoe(lafan1_like, [f"a={planned_folder}", f"b={planned_folder}"], out, lengths=[FRAMES])
    return out


def value(folder: Path, method: str, metric: str) -> float:
    (found,) = (
        r for r in json.loads((folder / "results.json").read_text()) if (r["method"], r["metric"]) == (method, metric)
    )
    return found["value"]


def test_every_kind_is_scored_and_seeds_are_averaged(results):
    methods = {row["method"] for row in json.loads((results / "results.json").read_text())}
    kinds = {"", " true path", " auto", " best of 3"}
    assert methods == {"truth", "interp"} | {name + kind for name in ("a", "b", "mean") for kind in kinds}
    for kind in kinds:
        assert value(results, "mean" + kind, "L2P") == pytest.approx(value(results, "a" + kind, "L2P"))
    assert all(
        row["ratio_to_interp"] == 1.0
        for row in json.loads((results / "results.json").read_text())
        if (row["method"], row["metric"]) == ("interp", "L2P")
    )


def test_the_model_follows_the_paths_and_draws_variants(lafan1_like: Path, planned_session, monkeypatch):
    """A stand-in walks what it is shown: along the true paths its root is the true one."""
    asked = []

    def walks(self, model, batch):
        asked.append(batch.draws)
        assert batch.context_root.shape[1] == 1
        ground = np.zeros((len(batch), FRAMES, 3))
        if all(path is not None for path in batch.paths):
            ground = np.stack([path[1:-1, [0, 0, 1]] for path in batch.paths])
        ground[..., 1] = batch.context_root[:, :, 1]
        return Generated(ground, np.repeat(batch.context_local, FRAMES, axis=1), np.zeros((len(batch), FRAMES, 4)))

    monkeypatch.setattr(DCMoEBackend, "generate", walks)
    model = Contender("a", DCMoEBackend(), planned_session, context_frames=4)
    (case,) = windows.cases(windows.read(lafan1_like), [FRAMES], 1, "dcmoe")
    made = fill(case, model, paths=case.true_paths).motion
    np.testing.assert_allclose(made.root[..., [0, 2]], case.truth.root[..., [0, 2]], atol=1e-6)
    fill(case, model, seed=4)
    rows = range(len(case))
    assert asked == [tuple(None for _ in rows), tuple((4, row) for row in rows)]


def test_gaps_are_drawn(results):
    assert (results / "gaps-1.png").stat().st_size > 10_000
    assert not (results / "gaps-2.png").exists()


def test_the_mean_is_of_models_of_one_method(lafan1_like: Path, planned_folder: Path, tmp_path, monkeypatch):
    monkeypatch.setattr(dcmoe, "DCMOE_VARIANTS", 1)
    monkeypatch.setattr(dcmoe, "SHEET_GAPS", 1)
    named = [f"dcmoe={planned_folder}", f"plan={planned_folder}"]
    rows = dcmoe.evaluate_dcmoe(lafan1_like, named, tmp_path, lengths=[FRAMES])
    assert {"dcmoe", "plan", "plan true path"} < {row.method for row in rows}
    assert not any(row.method.startswith("mean") for row in rows)


@pytest.mark.parametrize(
    ("named", "lengths", "said"),
    [
        (["a="], [5], "a=: choose interp"),
        (["mean=lafan1"], [5], "mean=lafan1: choose interp"),
        (["interp"], [5], "--methods interp: name methods that follow paths, such as dcmoe or plan"),
        (["zero-velocity", "dcmoe"], [5], "name methods that follow paths"),
        (["dcmoe"], [1], "gaps have 2 frames or more, got 1"),
    ],
)
def test_what_cannot_be_served_is_refused(lafan1_like: Path, tmp_path, named, lengths, said):
    with pytest.raises(InputError, match=said):
        dcmoe.evaluate_dcmoe(lafan1_like, named, tmp_path / "out", lengths=lengths)
    assert not (tmp_path / "out").exists()
