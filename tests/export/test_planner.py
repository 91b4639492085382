"""A planner alone, from its run to a model folder of method plan."""

import json

import learning
import numpy as np
import pytest
import torch
from stitch_learning import drawn

from interpose import export as exporting
from interpose.errors import InputError
from interpose.features.plan import anchor_weights, planner_shapes
from interpose.runtime.model_folder import load
from interpose.train.common.config import to_plain
from interpose.train.common.gaps import gap_input


@pytest.fixture(scope="module")
def planner(frames):
    return learning.planner_for(frames)


@pytest.fixture(scope="module")
def folder(planner, tmp_path_factory):
    made = tmp_path_factory.mktemp("planner")
    run = learning.write_run(made / "run", planner, learning.PLANNER)
    return exporting.export(run, made / "planning", metrics={"valid/30": 0.6})


def test_the_folder_has_the_plan_alone(folder, planner):
    assert {file.name for file in folder.iterdir()} == {"model.json", "plan.onnx"}
    info = json.loads((folder / "model.json").read_text())
    assert (info["name"], info["method"], info["styles"]) == ("planning", "plan", list(learning.STYLES))
    assert info["training"] == to_plain(learning.PLANNER)
    assert info["parameters"] == sum(p.numel() for p in planner.parameters())
    assert info["licence"] == "MIT; trained on data under CC BY 4.0, which asks for credit"
    assert {name: info["planner"][name] for name in ("latent", "hidden", "styles")} == {
        "latent": 8,
        "hidden": 32,
        "styles": 2,
    }
    assert info["planner"]["difference_from_torch"]["as_exported"] < 1e-4


@pytest.mark.parametrize(("batch", "steps"), [(1, 2), (4, 30)])
def test_the_mirror_mean_and_the_spline_are_inside(folder, planner, frames, batch, steps):
    """`planner(gap, noise)` is the mean with the mirror image; see tests/models/test_planner.py."""
    session = load(folder)
    assert (session.method, session.has_planner, session.plan_latent) == ("plan", True, 8)
    gap = gap_input(frames, drawn(frames, batch, steps, seed=batch))
    noise = torch.randn(batch, 8, generator=torch.Generator().manual_seed(0))
    plan, latent = planner(gap, noise)
    at = np.tile(np.arange(steps + 4.0), (batch, 1))  # beyond the target it is zero
    feed = {name: value.numpy() for name, value in (gap._asdict() | {"noise": noise}).items()} | {"frames": at}
    assert list(feed) == list(planner_shapes(8, 2))
    made = session.run("plan", {name: value.astype(np.float32) for name, value in feed.items()})
    wanted = np.zeros((batch, steps + 4, 135))
    wanted[:, : steps + 1] = anchor_weights(steps) @ plan.numpy()
    np.testing.assert_allclose(made["added"], wanted, atol=0.03 * max(1.0, np.abs(wanted).max()))
    np.testing.assert_allclose(made["latent"], latent, atol=0.03 * max(1.0, float(latent.abs().max())))
    assert not made["added"][:, steps:].any()
    assert np.abs(wanted).max() > 0.05


def test_a_planner_completes_no_model(folder, planner, tmp_path):
    run = learning.write_run(tmp_path / "run", planner, learning.PLANNER)
    with pytest.raises(InputError, match="no run for --onto"):
        exporting.export(run, tmp_path / "out", onto=folder)
