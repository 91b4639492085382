"""ONNX files of networks: written from torch, their large layers in 8 bits, checked against torch."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import torch
from onnx import helper, numpy_helper
from torch import Tensor, nn

from interpose.errors import InputError

OPSET = 18
BLOCK = 32
"""Weights that share a scale."""
_CHATTY = ("torch.onnx._internal.exporter._registration", "onnx_ir.passes.common.initializer_deduplication")
"""Loggers of the exporter that warn of what does not matter here: torchvision's operators, initializers left alone."""

TOLERANCE = 2e-3
"""Largest difference allowed between ONNX and torch, relative to an output's range."""
TOLERANCE_STORED = 0.3
"""The same once the weights are in 8 bits. The check's random inputs are far from any motion, and a phase without
amplitude has any direction: this only guards against a broken file. On motion the difference is millimetres a gap."""

Example = Callable[[int, int], dict[str, Tensor]]
"""Inputs of plausible size, by name: (batch, seed)."""


def write(
    network: nn.Module,
    path: Path,
    example: Example,
    outputs: Sequence[str],
    tolerance: float = TOLERANCE,
    tolerance_stored: float = TOLERANCE_STORED,
    frames: bool | tuple[str, ...] = False,
) -> dict[str, float]:
    """Writes ``network`` and returns the largest differences from torch, before and after its weights are rounded.

    frames: whether the inputs' second axis, too, may have any length (from 3 on), or that of those inputs (from 1 on).
    Raises InputError where a difference is larger than its tolerance.
    """
    network = network.eval()
    inputs = example(3, 0)
    named = frames if isinstance(frames, tuple) else tuple(inputs) if frames else ()
    batch = torch.export.Dim("batch", min=1, max=65536)
    longer = torch.export.Dim("frames", min=1 if isinstance(frames, tuple) else 3, max=4096)
    free: list[dict[int, Any]] = [{0: batch, 1: longer} if name in named else {0: batch} for name in inputs]
    with _quiet(), warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            network,
            tuple(inputs.values()),
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_shapes=(tuple(free),),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None
    onnx.checker.check_model(program.model_proto)
    exact = check(network, program.model_proto.SerializeToString(), example, tolerance)
    small = quantise(bare(program.model_proto)).SerializeToString()
    path.write_bytes(small)
    return {"as_exported": exact, "as_stored": check(network, small, example, tolerance_stored)}


def check(network: nn.Module, model: bytes, example: Example, tolerance: float) -> float:
    """The largest difference between an ONNX model and torch, relative to an output's range, over two batch sizes.

    Raises InputError where it exceeds ``tolerance``.
    """
    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    names = [o.name for o in session.get_outputs()]
    worst = 0.0
    for batch in (1, 7):
        inputs = example(batch, batch)
        with torch.no_grad():
            wanted = network(*inputs.values())
        got = session.run(None, {k: v.numpy() for k, v in inputs.items()})
        for name, a, b in zip(names, wanted, got, strict=True):
            apart = float((a - torch.from_numpy(np.asarray(b))).abs().max()) / max(1.0, float(a.abs().max()))
            if not apart <= tolerance:
                raise InputError(f"the ONNX model's {name} differs from torch's by {apart:.2g}; do not use it")
            worst = max(worst, apart)
    return worst


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
    nodes, stored = [], set()
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
        if name not in stored:  # a layer may be used twice
            graph.initializer.append(numpy_helper.from_array(codes, f"{name}.codes"))
            graph.initializer.append(numpy_helper.from_array(scales.reshape(-1), f"{name}.scales"))
            graph.initializer.remove(tensor)
            stored.add(name)
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


def example(shapes: Mapping[str, tuple[int, ...]], batch: int, seed: int = 0, longest: int = 40) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check: flags, styles and rotations are what their names say.
    longest: frames to the target stay below it."""
    generator = torch.Generator().manual_seed(seed)
    rows, no_turn = torch.arange(batch), torch.tensor([1.0, 0, 0, 0, 1.0, 0])
    out = {name: torch.randn(batch, *shape, generator=generator) * 0.3 for name, shape in shapes.items()}
    for name, value in out.items():
        if name.endswith("rotations") and value.shape[-1] == 6:
            value += no_turn
        elif name.endswith(("rotations", "quaternions")):
            value += torch.tensor([0.0, 0, 0, 1.0])
            value /= value.norm(dim=-1, keepdim=True)
        elif name.startswith("base"):
            value[:, 3:] += no_turn.repeat(22)
        elif name in ("left", "steps", "frames", "frames_left"):
            value[:] = torch.randint(2, longest, (batch, 1), generator=generator)
        elif name.endswith("known") or name == "ground":
            value[:] = rows[:, None] % 2
        elif name == "style":
            value[:] = torch.nn.functional.one_hot(rows % value.shape[1], value.shape[1])
    return out
