"""An S-CVAE run to a model folder: the plan, the forward and the backward generator as ONNX."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from interpose.export import folder, onnx_file
from interpose.export.planner import write_plan
from interpose.features import stitch
from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Generator, Latent, Memory
from interpose.train.stitch.recipe import model_of

MADE = ("hips", "rotations", "positions", "velocities", "contacts", "phase")


class GeneratorGraph(nn.Module):
    """One step of a generator with flat inputs and outputs, in the order of `interpose.features.stitch`."""

    def __init__(self, generator: Generator) -> None:
        super().__init__()
        self.generator = generator

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        parts, at = [], 0
        for kind in (Body, Aim, Memory, Latent):
            parts.append(kind(*tensors[at : at + len(kind._fields)]))
            at += len(kind._fields)
        body, memory, _, _ = self.generator(*parts)
        # Inputs that a form does not look at must stay inputs: the run time gives them all.
        unused = sum(0.0 * t.flatten(1).sum(dim=1) for t in tensors)
        out = body._asdict()
        out["hips"] = out["hips"] + torch.as_tensor(unused)[:, None]
        return (*(out[name] for name in MADE), *memory)


def export(
    saved: Mapping[str, Any], out: Path, name: str | None = None, metrics: Mapping[str, Any] | None = None
) -> Path:
    """Writes the model folder ``out`` of a checkpoint."""
    model = model_of(saved)
    config, size = saved["config"], model.size
    network = {k: v for k, v in config["size"].items() if k != "plan"}

    def fill(made: Path) -> dict[str, Any]:
        wanted = stitch.network_shapes(network, size.styles)
        outputs = [f"next_{name}" for name in (*MADE, *Memory._fields)]
        difference = {}
        for each, generator in (("front", model.front), ("back", model.back)):
            inputs, file = partial(onnx_file.example, wanted[each]), made / f"{each}.onnx"
            difference[each] = onnx_file.write(GeneratorGraph(generator), file, inputs, outputs)
        info: dict[str, Any] = {
            "network": network,
            "chains": config["chains"],
            "limits": {"trained_frames_to_target": LONGEST_PLAN_STEPS},
            "difference_from_torch": difference,
        }
        if model.plan is not None:
            info["planner"] = write_plan(model.plan, made)
        if size.form == "paper":
            info["mean_quaternions"] = np.round(model.mean_quaternions.numpy().astype(float), 6).tolist()
        return info

    return folder.write(out, saved, "stitch", model, fill, name, metrics)
