"""From a run of S-CVAE to a model folder: whole, described, and the same functions as the networks in torch."""

import copy
import json

import learning
import numpy as np
import onnx
import onnxruntime
import pytest
import stitch_learning
import torch
from stitch_learning import drawn, latent, situation

from interpose import export as exporting
from interpose.errors import InputError
from interpose.export import onnx_file, planner
from interpose.export import stitch as export
from interpose.features import stitch
from interpose.features.plan import LONGEST_PLAN_STEPS, anchor_weights, planner_shapes
from interpose.models.stitching_cvae import Memory
from interpose.runtime.model_folder import FORMAT
from interpose.skeleton import HUMANOID
from interpose.train.common.config import to_plain
from interpose.train.common.gaps import gap_input

CONFIG, PAPER = stitch_learning.CONFIG, stitch_learning.PAPER


@pytest.fixture(scope="module")
def paper_network(frames):
    """The paper's form; not to be changed."""
    return stitch_learning.network_for(frames, PAPER)


def info_of(folder):
    return json.loads((folder / "model.json").read_text())


def memory(side, count):
    draws = torch.Generator().manual_seed(5)
    empty = side.begin(count, torch.zeros(1))
    return Memory(*(0.5 * torch.randn(x.shape, generator=draws) for x in empty))


def compare(file, module, tensors, names):
    """ONNX against torch, each output by its own range; the weights are in 8 bits."""
    session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
    inputs = [i.name for i in session.get_inputs()]
    assert inputs == list(names)
    made = session.run(None, {name: x.numpy() for name, x in zip(inputs, tensors, strict=True)})
    wanted = module(*tensors)
    outputs = [o.name for o in session.get_outputs()]
    assert len(made) == len(wanted) == len(outputs)
    out = {}
    for name, got, value in zip(outputs, made, wanted, strict=True):
        assert got.shape == tuple(value.shape), name
        np.testing.assert_allclose(got, value, atol=0.03 * max(1.0, float(value.abs().max())), err_msg=name)
        out[name] = got, value.numpy()
    return out


def step_inputs(frames, model, side, count):
    body, aim = situation(frames, count, form=model.size.form, seed=count)
    return [*body, *aim, *memory(side, count), *latent(model.size, count)]


def test_the_folder_is_whole_and_alone(stitch_folder):
    assert {p.name for p in stitch_folder.iterdir()} == {"model.json", "plan.onnx", "front.onnx", "back.onnx"}
    assert {p.name for p in stitch_folder.parent.iterdir()} == {"run", "stitching"}


def test_model_json_says_what_the_model_is(stitch_folder, stitch_network):
    info = info_of(stitch_folder)
    assert (info["format"], info["name"], info["method"]) == (FORMAT, "stitching", "stitch")
    assert (info["preset"], info["steps"], info["rate"]) == ("tiny", 20, 30.0)
    assert info["styles"] == list(learning.STYLES)
    assert info["skeleton"]["names"] == list(HUMANOID.names)
    assert info["chains"] == {"buffer": 2, "aligned": True, "both": True}
    network = info["network"]
    assert (network["form"], network["latents"], network["planned"], network["latent"]) == ("yaw", "gap", True, 8)
    assert (network["memory"], network["decoder_memory"]) == (16, 16)
    assert "plan" not in network
    size = to_plain(learning.PLANNER)["size"]
    assert {name: info["planner"][name] for name in size} == size
    assert info["training"] == to_plain(CONFIG)
    assert info["limits"] == {"trained_frames_to_target": LONGEST_PLAN_STEPS}
    assert info["training_data"] == ["synthetic 1234"]
    assert info["licence"] == "MIT; trained on data under CC BY 4.0, which asks for credit"
    assert info["metrics"] == {"valid/30": 0.9}
    assert info["parameters"] == sum(p.numel() for p in stitch_network.parameters())
    assert set(info["difference_from_torch"]) == {"front", "back"}
    for apart in (*info["difference_from_torch"].values(), info["planner"]["difference_from_torch"]):
        assert apart["as_exported"] < 1e-4
        assert apart["as_stored"] <= onnx_file.TOLERANCE_STORED
    assert "mean_quaternions" not in info


def test_the_files_have_the_inputs_that_model_json_promises(stitch_folder):
    info = info_of(stitch_folder)
    shapes = stitch.network_shapes(info["network"], len(info["styles"]))
    assert set(shapes) == {"front", "back"}
    for name, wanted in shapes.items():
        inputs = onnx.load(stitch_folder / f"{name}.onnx").graph.input
        got = {i.name: tuple(d.dim_value for d in i.type.tensor_type.shape.dim[1:]) for i in inputs}
        assert got == wanted
        assert list(got) == list(wanted)
        assert all(i.type.tensor_type.shape.dim[0].dim_param == "batch" for i in inputs)


@pytest.mark.parametrize("batch", [1, 5])
def test_the_plan_gives_what_torch_gives(stitch_folder, stitch_network, frames, batch):
    gap = gap_input(frames, drawn(frames, batch, 18, seed=batch))
    noise = torch.randn(batch, 8, generator=torch.Generator().manual_seed(0))
    at = torch.arange(19.0).expand(batch, -1)
    module, names = planner.PlanGraph(stitch_network.plan), planner_shapes(8, 2)
    out = compare(stitch_folder / "plan.onnx", module, [*gap, noise, at], names)
    plan, latent_ = stitch_network.plan(gap, noise)
    np.testing.assert_allclose(out["latent"][1], latent_)
    np.testing.assert_allclose(out["added"][1], torch.tensor(anchor_weights(18)).float() @ plan, atol=1e-5)
    assert float(np.abs(out["added"][0]).mean()) > 0.01


@pytest.mark.parametrize("batch", [1, 5])
@pytest.mark.parametrize("side", ["front", "back"])
def test_a_step_gives_what_torch_gives(stitch_folder, stitch_network, frames, side, batch):
    generator = getattr(stitch_network, side)
    tensors = step_inputs(frames, stitch_network, generator, batch)
    names = stitch.network_shapes(info_of(stitch_folder)["network"], 2)[side]
    out = compare(stitch_folder / f"{side}.onnx", export.GeneratorGraph(generator), tensors, names)
    assert list(out) == [*(f"next_{n}" for n in export.MADE), *(f"next_{n}" for n in Memory._fields)]
    np.testing.assert_allclose(*out["next_positions"], atol=5e-3)
    after, kept, _, _ = generator(
        *situation(frames, batch, seed=batch), memory(generator, batch), latent(CONFIG.size, batch)
    )
    np.testing.assert_allclose(out["next_contacts"][1], after.contacts)
    np.testing.assert_allclose(out["next_decoder_cell"][1], kept.decoder_cell)
    moved = np.abs(out["next_hips"][0] - tensors[0].numpy()).max()
    assert moved > 0.005


def test_the_last_step_makes_the_aim_in_8_bits_as_well(stitch_folder, stitch_network, frames):
    tensors = step_inputs(frames, stitch_network, stitch_network.front, 4)
    names = list(stitch.network_shapes(info_of(stitch_folder)["network"], 2)["front"])
    given = dict(zip(names, tensors, strict=True))
    given |= {"left": torch.ones(4, 1), "base_following": given["base_there"]}
    session = onnxruntime.InferenceSession(stitch_folder / "front.onnx", providers=["CPUExecutionProvider"])
    hips, rotations = session.run(["next_hips", "next_rotations"], {k: v.numpy() for k, v in given.items()})
    np.testing.assert_allclose(hips, given["aim_hips"], atol=1e-6)
    np.testing.assert_allclose(rotations, given["aim_rotations"], atol=1e-6)


def test_the_papers_form_gives_what_torch_gives(paper_network, frames, tmp_path):
    network = {"form": "paper", "memory": 16, "decoder_memory": 16, "latent": 8, "planned": False, "latents": "frame"}
    shapes = stitch.network_shapes(network, 2)["front"]
    module = export.GeneratorGraph(paper_network.front)
    outputs = [*(f"next_{n}" for n in export.MADE), *(f"next_{n}" for n in Memory._fields)]
    file = tmp_path / "front.onnx"
    apart = onnx_file.write(
        module,
        file,
        lambda batch, seed: onnx_file.example(shapes, batch, seed),
        outputs,
        1e-4,
        onnx_file.TOLERANCE_STORED,
    )
    assert apart["as_exported"] < 1e-4
    for batch in (1, 5):
        out = compare(file, module, step_inputs(frames, paper_network, paper_network.front, batch), shapes)
        np.testing.assert_allclose(np.linalg.norm(out["next_rotations"][0], axis=-1), 1.0, atol=1e-5)
    # Both heads look at the state through one encoder, whose weights are stored once.
    names = [t.name for t in onnx.load(file).graph.initializer]
    assert len(names) == len(set(names))
    assert len([n for n in names if n.endswith(".codes")]) == sum(
        p.numel() >= 4096 for n, p in paper_network.front.named_parameters() if n.endswith("weight")
    )


def test_the_papers_model_has_its_signs_and_no_plan(paper_network, tmp_path, monkeypatch):
    monkeypatch.setattr(onnx_file, "write", lambda network, path, *rest, **more: path.write_bytes(b"new") and {})
    run = stitch_learning.write_run(tmp_path / "run", paper_network, PAPER)
    out = exporting.export(run, tmp_path / "paper")
    assert {p.name for p in out.iterdir()} == {"model.json", "front.onnx", "back.onnx"}
    info = info_of(out)
    np.testing.assert_allclose(info["mean_quaternions"], paper_network.mean_quaternions, atol=1e-6)
    assert (info["preset"], info["chains"]["buffer"]) == ("paper", 5)
    assert "planner" not in info
    assert info["network"]["form"] == "paper"


def test_examples_have_every_input(frames):
    for form in ("yaw", "paper"):
        network = {"form": form, "memory": 3, "decoder_memory": 4, "latent": 5, "planned": True, "latents": "gap"}
        for shapes in stitch.network_shapes(network, 2).values():
            made = onnx_file.example(shapes, 7, 1)
            assert {k: tuple(v.shape[1:]) for k, v in made.items()} == shapes
            assert all(torch.equal(made[k], v) for k, v in onnx_file.example(shapes, 7, 1).items())
            assert all(float(made[k].min()) >= 2.0 for k in ("left",) if k in made)
            assert torch.all(made["style"].sum(dim=1) == 1.0)
            if form == "paper" and "left" in made:
                torch.testing.assert_close(made["rotations"].norm(dim=-1), torch.ones(7, 22))


def test_an_onnx_file_of_another_network_is_refused(stitch_folder, stitch_network):
    other = copy.deepcopy(stitch_network)
    other.front.experts[-1].linear.bias.add_(2.0)
    shapes = stitch.network_shapes(info_of(stitch_folder)["network"], 2)["front"]
    content = (stitch_folder / "front.onnx").read_bytes()

    def inputs(batch, seed):
        return onnx_file.example(shapes, batch, seed)

    apart = onnx_file.check(export.GeneratorGraph(stitch_network.front), content, inputs, onnx_file.TOLERANCE_STORED)
    assert apart <= onnx_file.TOLERANCE_STORED
    with pytest.raises(InputError, match=r"the ONNX model's next_.* differs from torch's by"):
        onnx_file.check(export.GeneratorGraph(other.front), content, inputs, 0.05)


def test_an_export_that_fails_leaves_the_old_model(stitch_network, tmp_path, monkeypatch):
    run = stitch_learning.write_run(tmp_path / "run", stitch_network)
    out = tmp_path / "model"
    out.mkdir()
    (out / "model.json").write_text("old")
    (out / "front.onnx").write_bytes(b"old")

    def broken(network, path, *_, **__):
        path.write_bytes(b"half")
        if path.name == "plan.onnx":
            raise InputError("the ONNX model's added differs")
        return {}

    monkeypatch.setattr(onnx_file, "write", broken)
    with pytest.raises(InputError, match="differs"):
        exporting.export(run, out)
    assert (out / "model.json").read_text() == "old"
    assert (out / "front.onnx").read_bytes() == b"old"
    assert {p.name for p in tmp_path.iterdir()} == {"run", "model"}
    monkeypatch.setattr(onnx_file, "write", lambda network, path, *rest, **more: path.write_bytes(b"new") and {})
    assert exporting.export(run, out, name="Newer") == out
    assert info_of(out)["name"] == "Newer"
    assert {p.name for p in out.iterdir()} == {"model.json", "plan.onnx", "front.onnx", "back.onnx"}


def test_runs_that_cannot_be_exported(stitch_network, tmp_path):
    run = stitch_learning.write_run(tmp_path / "run", stitch_network, PAPER)
    with pytest.raises(InputError, match="weights are not those of its config"):
        exporting.export(run, tmp_path / "out")
    whole = stitch_learning.write_run(tmp_path / "whole", stitch_network)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="taken exists but is not a model folder"):
        exporting.export(whole, tmp_path / "taken")
    assert (tmp_path / "taken" / "notes.txt").read_text() == "mine"
    assert not (tmp_path / "out").exists()
