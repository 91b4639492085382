"""A model's folder holds all that its training needs to be repeated."""

import json
from dataclasses import replace
from functools import partial

import learning
import numpy as np
import pytest
import torch

from interpose import export as exporting
from interpose.cli import train_and_measure
from interpose.errors import InputError
from interpose.export import dcmoe, onnx_file, stitch
from interpose.export.folder import check_place
from interpose.train.common import checkpoint
from interpose.train.common.config import to_plain
from interpose.train.dcmoe import recipe as dcmoe_recipe
from interpose.train.planner import objective
from interpose.train.stitch import recipe as stitch_recipe


@pytest.fixture
def train(database, tmp_path, monkeypatch):
    """`interpose train NETWORK` into a folder of that name, with a file of settings; the checkpoint."""
    monkeypatch.setattr(objective, "set_statistics", partial(objective.set_statistics, count=64))
    for module in (dcmoe_recipe, stitch_recipe):
        monkeypatch.setattr(module, "set_statistics", partial(module.set_statistics, count=16))
    phases = tmp_path / "phases.npy"
    np.save(phases, learning.phases_of(database).astype(np.float16))

    def train(network, name, settings, plan=None, **more):
        out = tmp_path / name
        more |= {"plan": None if plan is None else str(tmp_path / plan)}
        more |= {"phases": (str(phases),) if network == "dcmoe" else ()}
        data = (str(database.path),)
        done = train_and_measure.train(
            network, data=data, out=str(out), preset="tiny", config=settings, device="cpu", **more
        )
        assert done == 0
        return checkpoint.load(out)

    return train


def settings(path, **values):
    path.write_text(json.dumps(values))
    return str(path)


@pytest.mark.parametrize("network", ["dcmoe", "stitch"])
def test_a_model_is_trained_again_from_its_model_json(network, train, tmp_path, monkeypatch, capsys):
    """Its planner too; every weight comes out the same."""
    monkeypatch.setattr(onnx_file, "write", lambda *args, **more: {})
    for module in (dcmoe, stitch):
        monkeypatch.setattr(module, "write_plan", lambda planner, folder: {})
    monkeypatch.setattr(dcmoe, "write_engine", lambda folder: {})
    plan = train("plan", "plan", settings(tmp_path / "plan.json", steps=3, rows=4, size={"hidden": 24}), seed=5)
    changes = (
        {"stages": [{"steps": 2, "unroll": 2, "rows": 4}], "hidden": 24}
        if network == "dcmoe"
        else {"phases": {"steps": 1, "rows": 4}, "stitch": {"steps": 2, "rows": 4}, "growth": 0.2}
    )
    first = train(network, "first", settings(tmp_path / "own.json", **changes), "plan", seed=7)
    model = exporting.export(tmp_path / "first", tmp_path / "model") / "model.json"
    kept = json.loads(model.read_text())["training"]
    assert kept == first["config"]
    assert (kept["seed"], kept["plan"]["seed"], kept["plan"]["size"]["hidden"]) == (7, 5, 24)
    again = train("plan", "plan again", str(model))
    assert again["config"] == plan["config"]
    second = train(network, "second", str(model), "plan again")
    assert second["config"] == first["config"]
    for one, other in ((plan, again), (first, second)):
        for name, value in one["ema"].items():
            assert torch.equal(other["ema"][name], value), name
    assert "warning" not in capsys.readouterr().err


def test_other_data_give_a_warning(train, tmp_path, capsys):
    config = replace(learning.PLANNER, databases=("other 5678",), steps=1, rows=4)
    train("plan", "run", settings(tmp_path / "model.json", training=to_plain(config)))
    assert "was made from other data: other 5678; this run has synthetic" in capsys.readouterr().err


def test_the_autoencoder_takes_settings_too(train, tmp_path):
    saved = train("pae", "run", settings(tmp_path / "own.json", steps=2, batch=8))
    assert (saved["step"], saved["config"]["batch"], saved["config"]["channels"]) == (2, 8, 3)


def test_a_place_that_is_taken(tmp_path):
    check_place(tmp_path / "new")
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "model.json").write_text("{}")
    check_place(tmp_path / "model")
    with pytest.raises(InputError, match="exists but is not a model folder; give another name"):
        check_place(tmp_path)
