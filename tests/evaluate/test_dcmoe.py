"""`interpose evaluate dcmoe`: kinds of paths, seeds together, the best of variants, pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import dcmoe, lafan1
from interpose.evaluate.methods import Carrier
from interpose.evaluate.run import Case
from interpose.gallery.tracks import track_of
from interpose.motion import Motion
from interpose.retarget import map_skeleton
from interpose.skeleton import HUMANOID

FRAMES = 8


@pytest.fixture(scope="module")
def results(lafan1_like: Path, planned_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What two seeds, here the same model twice, scored."""
    out = tmp_path_factory.mktemp("results")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dcmoe, "VARIANTS", 3)
        patch.setattr(dcmoe, "SHEETS", 2)
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


def test_the_model_is_asked_along_the_ways_and_for_variants(lafan1_like: Path, planned_session, monkeypatch):
    """A stand-in walks what it is shown: along the true ways its root is the true one."""
    asked = []

    def walks(model, root, local, target, target_local, frames, seed, vary, paths):
        asked.append((seed, vary))
        assert root.shape[1] == 1
        ground = (
            np.zeros((len(root), frames, 3)) if paths is None else np.stack([way[1:-1, [0, 0, 1]] for way in paths])
        )
        ground[..., 1] = root[:, :, 1]
        return ground, np.repeat(local, frames, axis=1), np.zeros((len(root), frames, 4))

    monkeypatch.setattr(dcmoe.methods, "generate_batch", walks)
    source = lafan1.read(lafan1_like)
    carrier = Carrier(source.clips[0].skeleton, 30.0, map_skeleton(source.clips[0].skeleton))
    case = Case(lafan1.cut(source.clips), FRAMES, source.scale)
    inner = slice(case.start + 1, case.target)
    root, _ = dcmoe._filled(case, carrier, planned_session, dcmoe._true_ways(case, carrier))
    np.testing.assert_allclose(root[..., [0, 2]], case.windows.root[:, inner][..., [0, 2]], atol=1e-6)
    dcmoe._filled(case, carrier, planned_session, None, 4)
    assert asked == [(0, False), (4, True)]


def test_gaps_are_drawn(results):
    assert (results / "gaps-1.png").stat().st_size > 10_000
    assert not (results / "gaps-2.png").exists()


def test_the_true_way_is_the_roots(lafan1_like: Path):
    source = lafan1.read(lafan1_like)
    first = source.clips[0]
    carrier = Carrier(first.skeleton, first.rate, map_skeleton(first.skeleton))
    windows = lafan1.cut(source.clips)
    case = Case(windows, FRAMES, source.scale)
    ways = dcmoe._true_ways(case, carrier)
    root, local = carrier.onto(windows.root, windows.local)
    keys = slice(lafan1.PAST - 1, lafan1.PAST + FRAMES + 1)
    wanted = track_of(Motion(HUMANOID, root[2, keys], local[2, keys], first.rate))
    np.testing.assert_allclose(ways[2], wanted, atol=1e-9)
    assert len(windows.one(2)) == 1
    np.testing.assert_array_equal(windows.one(2).positions[0], windows.positions[2])


@pytest.mark.parametrize(
    ("named", "lengths", "said"),
    [
        (["a="], [5], "give interp, dcmoe or LABEL=MODEL"),
        (["mean=lafan1"], [5], "give interp, dcmoe or LABEL=MODEL"),
        (["stitch=stitch"], [5], "is for method stitch; see 'evaluate stitch'"),
        (["interp"], [5], "names each model once, got interp"),
        (["dcmoe"], [1], "gaps have 2 frames or more, got 1"),
    ],
)
def test_what_cannot_be_served_is_refused(lafan1_like: Path, tmp_path, named, lengths, said):
    with pytest.raises(InputError, match=said):
        dcmoe.evaluate_dcmoe(lafan1_like, named, tmp_path / "out", lengths=lengths)
    assert not (tmp_path / "out").exists()
