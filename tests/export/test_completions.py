"""A completion of targets, added to a model folder."""

import json

import numpy as np
import pytest
import torch

from interpose import export as exporting
from interpose.errors import InputError
from interpose.export.completions import example_target
from interpose.models.target_pose import Complete, TargetPose, TargetSize
from interpose.runtime.model_folder import load
from interpose.train.common import checkpoint, loop
from interpose.train.target.recipe import TargetConfig


def write_run(folder, styles):
    size = TargetSize(2, 16, 1, styles=len(styles))
    torch.manual_seed(1)
    model = TargetPose(size)
    folder.mkdir()
    parts = {"model": model, "ema": loop.moving_average(model, 0.9)}
    config = TargetConfig(preset="tiny", size=size, styles=styles, databases=("synthetic 1234",), licence="CC BY 4.0")
    checkpoint.save(folder, checkpoint.TrainingState(parts), 7, config)
    return folder, model


def test_a_model_is_completed(tmp_path, model_folder):
    run, model = write_run(tmp_path / "run", ("Old", "Young"))
    with pytest.raises(InputError, match="completes a model; name it with --onto"):
        exporting.export(run, tmp_path / "alone")
    made = exporting.export(run, tmp_path / "both", onto=model_folder)
    assert {p.name for p in made.iterdir()} == {p.name for p in model_folder.iterdir()} | {"target.onnx"}
    info = json.loads((made / "model.json").read_text())["target"]
    assert (info["latent"], info["steps"]) == (2, 7)
    session = load(made)
    assert session.completes
    assert not load(model_folder).completes
    feed = example_target(model, 5, 3)
    made_poses = session.run("target", {name: value.numpy() for name, value in feed.items()})
    assert set(session._open) == {"target"}  # the step is not opened for it
    with torch.no_grad():
        wanted = Complete(model.eval())(*feed.values())
    for (name, got), value in zip(made_poses.items(), wanted, strict=True):
        np.testing.assert_allclose(got, value, atol=2e-2, err_msg=name)


def test_other_styles_are_refused(tmp_path, model_folder):
    run, _ = write_run(tmp_path / "run", ("Angry",))
    with pytest.raises(InputError, match="the run's styles are not those of 'marching'"):
        exporting.export(run, tmp_path / "both", onto=model_folder)
