"""From a run folder to a model folder: whole, described, and the same function as the network in torch."""

import copy
import json
from dataclasses import replace
from functools import partial

import learning
import numpy as np
import onnx
import pytest
import torch

from interpose import export as exporting
from interpose.errors import InputError
from interpose.export import dcmoe as export
from interpose.export import onnx_file
from interpose.features import EXPERT_INPUT, GATE_INPUT, LONGEST_ARRIVAL, control_shapes, output_layout, state_shapes
from interpose.models.dcmoe import Control, State
from interpose.runtime import model_folder as runtime
from interpose.skeleton import HUMANOID
from interpose.train.common import checkpoint
from interpose.train.common.config import to_plain
from interpose.train.dcmoe.sequences import RollOutSampling, draw


def test_the_folder_is_whole_and_alone(model_folder):
    graphs = {"step.onnx", "begin.onnx", "aim.onnx", "pose.onnx"}
    assert {p.name for p in model_folder.iterdir()} == {"model.json", "phases.npy"} | graphs
    assert {p.name for p in model_folder.parent.iterdir()} == {"run", "marching"}


def test_model_json_says_what_the_model_is(model_folder, network):
    info = json.loads((model_folder / "model.json").read_text())
    assert info["format"] == runtime.FORMAT
    assert (info["name"], info["method"], info["version"], info["rate"]) == ("marching", "dcmoe", "0.1.0", 30.0)
    assert info["styles"] == list(learning.STYLES)
    assert (info["preset"], info["steps"], info["absolute"]) == ("tiny", 20, False)
    assert info["skeleton"]["names"] == list(HUMANOID.names)
    assert info["skeleton"]["parents"] == list(HUMANOID.parents)
    np.testing.assert_allclose(info["skeleton"]["offsets"], HUMANOID.offsets, atol=1e-6)
    assert info["layout"] == {
        "experts": dict(EXPERT_INPUT.blocks),
        "gate": dict(GATE_INPUT.blocks),
        "output": dict(output_layout(False).blocks),
    }
    assert info["limits"] == {"trained_frames_to_target": LONGEST_ARRIVAL}
    assert info["training_data"] == ["synthetic 1234"]
    assert info["licence"] == "MIT; trained on data under CC BY 4.0, which asks for credit"
    assert info["metrics"] == {"valid/30": 0.9}
    assert info["training"] == to_plain(learning.CONFIG)
    assert "planner" not in info
    assert info["parameters"] == sum(p.numel() for p in network.parameters())
    assert info["difference_from_torch"]["as_exported"] < 1e-4
    assert info["difference_from_torch"]["as_stored"] <= onnx_file.TOLERANCE_STORED


def test_model_json_has_the_planners_config_too(planned_folder):
    info = json.loads((planned_folder / "model.json").read_text())
    assert info["training"] == to_plain(learning.PLANNED)
    assert info["training"]["plan"]["seed"] == 0
    size = to_plain(learning.PLANNER)["size"]
    assert {name: info["planner"][name] for name in size} == size
    assert (planned_folder / "plan.onnx").exists()


@pytest.mark.parametrize(
    ("data", "terms"),
    [
        ("CC BY 4.0", "MIT; trained on data under CC BY 4.0"),
        ("CC BY-NC-ND 4.0", "non-commercial research only (trained on data under CC BY-NC-ND 4.0)"),
        ("CC BY 4.0; CC BY-NC 4.0", "non-commercial research only"),
        ("MIT LICENCE", "MIT; trained on data under MIT LICENCE"),
        ("", "unknown"),
    ],
)
def test_the_licence_follows_the_data(data, terms):
    assert exporting.licence(data).startswith(terms)


@pytest.mark.parametrize("batch", [1, 2, 9])
def test_onnx_gives_what_torch_gives(session, network, frames, batch):
    rows = draw(frames, batch, len(learning.STYLES), RollOutSampling(), torch.Generator().manual_seed(batch))
    steer = learning.steering(frames, rows)
    step = export.StepGraph(network)
    wanted = step(*rows.state, *steer)
    made = session.step({name: x.numpy() for name, x in (rows.state._asdict() | steer._asdict()).items()})
    assert len(made) == len(wanted)
    for (name, got), value in zip(made.items(), wanted, strict=True):
        off = 0.1 if "phase" in name else 0.02  # where the old phase and the predicted one oppose, 8 bits may turn them
        np.testing.assert_allclose(got, value, atol=off * max(1.0, float(value.abs().max())), err_msg=name)
    np.testing.assert_allclose(made["next_positions"], wanted[2], atol=2e-3)


def test_the_step_gives_the_coming_root_in_the_world(network, frames):
    rows = draw(frames, 4, len(learning.STYLES), RollOutSampling(), torch.Generator().manual_seed(5))
    model = learning.silence(copy.deepcopy(network))
    where = model.layout.slices()["trajectory"]
    key = torch.tensor([0.1, 0.5, 0.0, 1.0, 0.2, 1.5])  # to the left and ahead, facing ahead, on the move
    model.out_mean[where] = key.repeat(7)
    *_, contacts, path = export.StepGraph(model)(*rows.state, *learning.steering(frames, rows))
    facing = rows.state.track[:, -1, 2:]
    left = torch.stack([facing[:, 1], -facing[:, 0]], dim=-1)
    wanted = rows.state.hips[:, None, ::2] + (0.1 * left + 0.5 * facing)[:, None]
    away = frames.facing[rows.gaps.start + rows.gone] - facing
    assert float(away.abs().max()) < 0.05  # the facing is the pose's own, noise included
    torch.testing.assert_close(path[..., :2], wanted.expand(4, 6, 2), atol=0.05, rtol=0)
    torch.testing.assert_close(path[..., 2:4], facing[:, None].expand(4, 6, 2), atol=0.05, rtol=0)
    torch.testing.assert_close(path[..., 4:], (0.2 * left + 1.5 * facing)[:, None].expand(4, 6, 2), atol=0.1, rtol=0)
    assert torch.all(contacts == 0.5)


def test_weights_are_stored_in_8_bits_without_notes_of_the_machine(model_folder, network):
    model = onnx.load(model_folder / "step.onnx")
    large = sum(p.numel() for p in network.network.parameters() if p.numel() >= 4096)
    codes = [t for t in model.graph.initializer if t.name.endswith(".codes")]
    assert all(t.data_type == onnx.TensorProto.UINT8 for t in codes)
    assert large <= sum(np.prod(t.dims) for t in codes) < 1.5 * large
    assert all(np.prod(t.dims) < 4096 for t in model.graph.initializer if t not in codes)
    bytes_ = (model_folder / "step.onnx").read_bytes()
    assert len(bytes_) < 2 * large + 120_000
    assert b"stack_trace" not in bytes_
    assert b"dcmoe.py" not in bytes_


def test_the_phases_to_begin_variants_in_come_along(session, network):
    np.testing.assert_allclose(session.phase_bank, network.phase_bank, atol=1e-3)


def test_an_onnx_file_of_another_network_is_refused(model_folder, network):
    other = copy.deepcopy(network)
    other.out_mean[other.layout.slices()["hips"]] += 1.0
    content = (model_folder / "step.onnx").read_bytes()

    inputs = partial(onnx_file.example, state_shapes() | control_shapes(len(learning.STYLES)))
    apart = onnx_file.check(export.StepGraph(network), content, inputs, onnx_file.TOLERANCE_STORED)
    assert apart <= onnx_file.TOLERANCE_STORED
    with pytest.raises(InputError, match="the ONNX model's next_hips differs from torch's by"):
        onnx_file.check(export.StepGraph(other), content, inputs, onnx_file.TOLERANCE_STORED)


def test_the_example_has_every_input():
    shapes = state_shapes() | control_shapes(3)
    inputs = onnx_file.example(shapes, 5, longest=LONGEST_ARRIVAL)
    assert {name: tuple(x.shape) for name, x in inputs.items()} == {n: (5, *shape) for n, shape in shapes.items()}
    assert list(inputs) == [*State._fields, *Control._fields]
    assert float(inputs["frames_left"].min()) >= 1.0


def test_runs_that_cannot_be_exported(network, tmp_path):
    def fails(run, message, out=tmp_path / "out"):
        with pytest.raises(InputError, match=message):
            exporting.export(run, out)
        assert not list(tmp_path.glob(".out*"))

    fails(tmp_path / "nowhere", "no checkpoint of a model is there")
    (tmp_path / "damaged").mkdir()
    (tmp_path / "damaged" / "checkpoint-000000001.pt").write_bytes(b"no weights")
    fails(tmp_path / "damaged", "no checkpoint can be read")
    (tmp_path / "other").mkdir()
    checkpoint.save(tmp_path / "other", checkpoint.TrainingState({"model": network}), 1, learning.PLANNER.size)
    fails(tmp_path / "other", "no checkpoint of a model is there")
    wider = replace(learning.CONFIG, hidden=24)
    fails(learning.write_run(tmp_path / "older", network, wider), "weights are not those of its config")
    run = learning.write_run(tmp_path / "run", network)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").write_text("mine")
    fails(run, "taken exists but is not a model folder", tmp_path / "taken")
    assert (tmp_path / "taken" / "notes.txt").read_text() == "mine"
    (tmp_path / "file").write_text("mine")
    fails(run, "file exists but is not a model folder", tmp_path / "file")
    assert not (tmp_path / "out").exists()


def test_an_export_that_fails_leaves_the_old_model(network, tmp_path, monkeypatch):
    run = learning.write_run(tmp_path / "run", network)
    out = tmp_path / "model"
    out.mkdir()
    (out / "model.json").write_text("old")

    def broken(*_):
        raise InputError("the ONNX model's next_hips differs")

    monkeypatch.setattr(export, "write_step", broken)
    with pytest.raises(InputError, match="differs"):
        exporting.export(run, out)
    assert (out / "model.json").read_text() == "old"
    assert {p.name for p in tmp_path.iterdir()} == {"run", "model"}
    monkeypatch.setattr(export, "write_step", lambda _, path: path.write_bytes(b"new") and {})
    monkeypatch.setattr(export, "write_engine", lambda folder: {})
    assert exporting.export(run, out, name="Newer") == out
    assert json.loads((out / "model.json").read_text())["name"] == "Newer"
    assert (out / "step.onnx").read_bytes() == b"new"


def test_a_model_with_a_planner_takes_no_backward_network(planned_folder, model_folder, network, tmp_path):
    run = learning.write_run(tmp_path / "run", network, replace(learning.CONFIG, backward=True))
    with pytest.raises(InputError, match="has a planner; stitch with networks that have none"):
        exporting.export(run, tmp_path / "out", onto=str(planned_folder))
    assert not (tmp_path / "out").exists()
    assert exporting.export(run, tmp_path / "out", onto=str(model_folder)).exists()
