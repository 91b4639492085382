"""A training run to a model folder: the step as ONNX, its weights in 8 bits, checked against torch.

`model.json` tells what the model is; the format is described in docs/model-format.md.
"""

from __future__ import annotations

import json
import logging
import re
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import helper, numpy_helper
from torch import Tensor, nn

from interpose.errors import InputError
from interpose.features import (
    EXPERT_INPUT,
    GATE_INPUT,
    LONGEST,
    RATE,
    SIDE_KEYS,
    control_shapes,
    output_layout,
    state_shapes,
)
from interpose.models.dcmoe import Control, DCMoE, Size, State
from interpose.runtime.session import FORMAT
from interpose.skeleton import HUMANOID
from interpose.train import checkpoint

OPSET = 18
CARRIED = [name for name in state_shapes() if name != "velocity_known"]
"""The state that comes out of a step; the velocity is always known then."""
TOLERANCE = 1e-3
"""Largest difference allowed between ONNX and torch in one step, relative to an output's range."""
TOLERANCE_STORED = 0.3
"""The same once the weights are in 8 bits. The check's random inputs are far from any motion, and a phase without
amplitude has any direction: this only guards against a broken file. On motion the difference is millimetres a gap."""
BLOCK = 32
"""Weights that share a scale."""
_CHATTY = ("torch.onnx._internal.exporter._registration", "onnx_ir.passes.common.initializer_deduplication")
"""Loggers of the exporter that warn of what does not matter here: torchvision's operators, initializers left alone."""


class Step(nn.Module):
    """The step with flat inputs and outputs, in the order of the layout; contacts as probabilities, the root it
    foresees in the world."""

    def __init__(self, model: DCMoE) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        count = len(State._fields)
        after, said = self.model(State(*tensors[:count]), Control(*tensors[count:]))
        back = said.frame[:, ::2, ::2].transpose(-1, -2)
        turned = said.trajectory[:, 1:].flatten(1).unflatten(1, (-1, 2)) @ back
        future = turned.flatten(1).unflatten(1, (SIDE_KEYS, 6))
        ground = said.origin[:, ::2]
        origin = torch.cat([ground, torch.zeros_like(ground), torch.zeros_like(ground)], dim=-1)
        carried = (value for name, value in after._asdict().items() if name in CARRIED)
        return (*carried, said.contacts[:, 0].sigmoid(), future + origin[:, None])


def export(run_dir: Path, out: Path, *, name: str | None = None, metrics: dict[str, Any] | None = None) -> Path:
    """Writes the model folder ``out`` from the newest checkpoint (its moving average where it keeps one); whole or not.

    Raises InputError where ``run_dir`` holds no DC-MoE run, where ``out`` is there and is no model folder, and where
    ONNX Runtime does not give what torch gives.
    """
    saved = checkpoint.load(run_dir)
    if saved is None or "experts" not in saved["config"]:
        raise InputError(f"{run_dir}: no checkpoint of a DC-MoE training is there; give a folder of 'interpose train'")
    if out.exists() and not (out / "model.json").exists():
        raise InputError(f"{out} is there and is no model folder; give another name")
    model = model_of(saved)
    config = saved["config"]
    info = {
        "format": FORMAT,
        "name": name or out.name,
        "method": "dcmoe",
        "version": "0.1.0",
        "made": date.today().isoformat(),
        "preset": config["preset"],
        "steps": saved["step"],
        "absolute": config["absolute"],
        "styles": config["styles"],
        "rate": RATE,
        "skeleton": {
            "names": HUMANOID.names,
            "parents": HUMANOID.parents,
            "offsets": np.round(HUMANOID.offsets, 6).tolist(),
        },
        "network": {"experts": config["experts"], "hidden": config["hidden"], "gate": config["gate"]},
        "parameters": sum(p.numel() for p in model.parameters()),
        "layout": {
            "experts": dict(EXPERT_INPUT.blocks),
            "gate": dict(GATE_INPUT.blocks),
            "output": dict(output_layout(config["absolute"]).blocks),
        },
        "limits": {"trained_frames_to_target": LONGEST},
        "training_data": [" ".join(word[:12] for word in name.split()) for name in config["databases"]],
        "licence": licence(config["licence"]),
        "metrics": metrics or {},
    }
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as folder:
        made = Path(folder) / "model"
        made.mkdir()
        info["difference_from_torch"] = write_step(model, made / "step.onnx")
        bank = model.phase_bank.numpy().astype(np.float16)
        if np.any(bank):
            np.save(made / "phases.npy", bank)
        (made / "model.json").write_text(json.dumps(info, indent=2) + "\n", encoding="utf-8")
        if out.exists():
            shutil.rmtree(out)
        made.replace(out)
    return out


def licence(data: str) -> str:
    """What the weights may be used for, from the licences of the data they were trained on."""
    if re.search(r"\bNC\b", data):
        return f"non-commercial research only (trained on data under {data})"
    return f"MIT; trained on data under {data}, which asks for credit" if data else "unknown"


def model_of(saved: dict[str, Any]) -> DCMoE:
    """The network of a checkpoint, ready to run: the moving average of its weights where one was kept.

    Raises InputError where the weights do not fit the config, as those of an older program may not.
    """
    config = saved["config"]
    size = Size(config["experts"], config["hidden"], tuple(config["gate"]), config["absolute"], len(config["styles"]))
    model = DCMoE(size)
    weights = {k.removeprefix("module."): v for k, v in saved["ema"].items() if k.startswith("module.")}
    try:
        model.load_state_dict(weights)
    except RuntimeError as error:
        reason = str(error).splitlines()[-1].strip()
        raise InputError(f"the run's weights are not those of its config ({reason}); train again") from None
    return model.eval()


def example(styles: int, batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    generator = torch.Generator().manual_seed(seed)
    out = {}
    for name, shape in (state_shapes() | control_shapes(styles)).items():
        out[name] = torch.randn(batch, *shape, generator=generator) * 0.3
    for name in ("rotations", "target_rotations", "base", "base_next"):
        flat = out[name][:, 3:] if name.startswith("base") else out[name]
        flat += torch.tensor([1.0, 0, 0, 0, 1.0, 0]).repeat(flat[0].numel() // 6).view_as(flat[0])
    out["frames_left"] = torch.randint(1, LONGEST, (batch, 1), generator=generator).float()
    out["style"] = torch.nn.functional.one_hot(torch.arange(batch) % (styles + 1), styles + 1).float()
    out["path_known"] = (torch.arange(batch)[:, None] % 2).float()
    return out


def write_step(model: DCMoE, path: Path) -> dict[str, float]:
    """Writes the ONNX file and returns the largest differences from torch, before and after the weights are rounded."""
    step = Step(model).eval()
    inputs = example(model.size.styles, 3)
    outputs = [*(f"next_{name}" for name in CARRIED), "contacts", "next_path"]
    batch = torch.export.Dim("batch", min=1, max=65536)
    with _quiet(), warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            step,
            tuple(inputs.values()),
            input_names=list(inputs),
            output_names=outputs,
            dynamic_shapes=(tuple({0: batch} for _ in inputs),),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    onnx.checker.check_model(program.model_proto)
    exact = check(step, program.model_proto.SerializeToString(), TOLERANCE)
    small = quantise(bare(program.model_proto)).SerializeToString()
    path.write_bytes(small)
    return {"as_exported": exact, "as_stored": check(step, small, TOLERANCE_STORED)}


@contextmanager
def _quiet() -> Iterator[None]:
    """Lets only errors of the chatty loggers through."""
    loggers = [logging.getLogger(name) for name in _CHATTY]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def check(step: Step, model: bytes, tolerance: float) -> float:
    """The largest difference between an ONNX model and torch, relative to an output's range, over two batch sizes.

    Raises InputError where it exceeds ``tolerance``.
    """
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    names = [o.name for o in session.get_outputs()]
    worst = 0.0
    for batch in (1, 7):
        inputs = example(step.model.size.styles, batch, seed=batch)
        with torch.no_grad():
            wanted = step(*inputs.values())
        got = session.run(None, {k: v.numpy() for k, v in inputs.items()})
        for name, a, b in zip(names, wanted, got, strict=True):
            apart = float((a - torch.from_numpy(np.asarray(b))).abs().max()) / max(1.0, float(a.abs().max()))
            if not apart <= tolerance:
                raise InputError(f"the ONNX model's {name} differs from torch's by {apart:.2g}; do not use it")
            worst = max(worst, apart)
    return worst


def bare(model: onnx.ModelProto) -> onnx.ModelProto:
    """The same model without the exporter's notes, which name the files of the machine it was made on."""
    graph = model.graph
    del graph.value_info[:]
    for part in (graph, *graph.node, *graph.input, *graph.output, *graph.initializer):
        del part.metadata_props[:]
    return model


def quantise(model: onnx.ModelProto, least: int = 4096) -> onnx.ModelProto:
    """The same model with the large linear layers' weights in 8 bits, in blocks of :data:`BLOCK` with a scale each.

    A frame reads every weight once, so that a quarter of the bytes is most of the time saved; ONNX Runtime has the
    product as `MatMulNBits`.
    """
    graph = model.graph
    weights = {t.name: t for t in graph.initializer if int(np.prod(t.dims)) >= least}
    nodes = []
    for node in graph.node:
        flags = {a.name: a.i for a in node.attribute}
        if node.op_type != "Gemm" or node.input[1] not in weights or flags.get("transA"):
            nodes.append(node)
            continue
        tensor = weights[node.input[1]]
        matrix = numpy_helper.to_array(tensor).astype(np.float32)
        matrix = matrix if flags.get("transB") else matrix.T
        wide, deep = matrix.shape
        blocks = np.pad(matrix, ((0, 0), (0, -deep % BLOCK))).reshape(wide, -1, BLOCK)
        scales = np.abs(blocks).max(axis=-1) / 127.0
        scales[scales == 0.0] = 1.0
        codes = np.clip(np.round(blocks / scales[..., None]) + 128.0, 0, 255).astype(np.uint8)
        name = tensor.name
        graph.initializer.append(numpy_helper.from_array(codes, f"{name}.codes"))
        graph.initializer.append(numpy_helper.from_array(scales.reshape(-1), f"{name}.scales"))
        graph.initializer.remove(tensor)
        bias = ["", "", node.input[2]] if len(node.input) > 2 else []
        inputs = [node.input[0], f"{name}.codes", f"{name}.scales", *bias]
        shape = {"K": deep, "N": wide, "bits": 8, "block_size": BLOCK, "accuracy_level": 4}
        nodes.append(
            helper.make_node("MatMulNBits", inputs, list(node.output), name=node.name, domain="com.microsoft", **shape)
        )
    del graph.node[:]
    graph.node.extend(nodes)
    model.opset_import.append(helper.make_opsetid("com.microsoft", 1))
    return model
