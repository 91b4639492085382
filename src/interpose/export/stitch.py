"""An S-CVAE run to a model folder: the plan, the forward and the backward generator as ONNX."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from interpose import stitching
from interpose.export import folder, onnx_file
from interpose.models.gap_plan import LONGEST, Ends, GapPlan
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Generator, Latent, Memory
from interpose.train.stitch import model_of

TOLERANCE = 2e-3
"""Largest difference allowed between ONNX and torch, relative to an output's range."""
TOLERANCE_STORED = 0.3
"""The same once the weights are in 8 bits; see `interpose.export.dcmoe`."""
MADE = ("hips", "rotations", "positions", "velocities", "contacts", "phase")


class Plan(nn.Module):
    """The plan with flat inputs: what is known of the gap and standard noise in, what is added to interpolation at the
    anchors and the latent out."""

    def __init__(self, plan: GapPlan) -> None:
        super().__init__()
        self.plan = plan

    def forward(self, *tensors: Tensor) -> tuple[Tensor, Tensor]:
        x, frame = self.plan(Ends(*tensors[:-1]))
        z = self.plan.expect(x).at(tensors[-1])
        return self.plan.decode(x, frame, z), z


class Step(nn.Module):
    """One step of a generator with flat inputs and outputs, in the order of `interpose.stitching`."""

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
    network = {k: v for k, v in config["size"].items() if k != "plan"} | {"plan": config["size"]["plan"]}

    def fill(made: Path) -> dict[str, Any]:
        wanted = stitching.network_shapes(network, size.styles)
        modules: dict[str, nn.Module] = {"front": Step(model.front), "back": Step(model.back)}
        if "plan" in wanted:
            assert model.plan is not None
            modules["plan"] = Plan(model.plan)
        memory = [f"next_{name}" for name in Memory._fields]
        names = {"plan": ["added", "latent"]}
        difference = {}
        for each, module in modules.items():
            shapes = wanted[each]

            def inputs(batch: int, seed: int, shapes: dict[str, tuple[int, ...]] = shapes) -> dict[str, Tensor]:
                return example(shapes, batch, seed)

            outputs = names.get(each, [*(f"next_{name}" for name in MADE), *memory])
            file = made / f"{each}.onnx"
            difference[each] = onnx_file.write(module, file, inputs, outputs, TOLERANCE, TOLERANCE_STORED)
        course = config["course"]
        told: dict[str, Any] = {
            "network": network,
            "course": [course["buffer"], course["aligned"], course["both"]],
            "limits": {"trained_frames_to_target": LONGEST},
            "difference_from_torch": difference,
        }
        if size.form == "paper":
            told["mean_quaternions"] = np.round(model.mean_quaternions.numpy().astype(float), 6).tolist()
        return told

    return folder.write(out, saved, folder.Told(name, "stitch", dict(metrics or {})), model, fill)


def example(shapes: Mapping[str, tuple[int, ...]], batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    generator = torch.Generator().manual_seed(seed)
    out = {}
    for name, shape in shapes.items():
        out[name] = torch.randn(batch, *shape, generator=generator) * 0.3
    for name, value in out.items():
        if name.endswith("rotations") and value.shape[-1] == 6:
            value += torch.tensor([1.0, 0, 0, 0, 1.0, 0])
        elif name.endswith("rotations"):
            value += torch.tensor([0.0, 0, 0, 1.0])
            value /= value.norm(dim=-1, keepdim=True)
        elif name.startswith("base_"):
            value[:, 3:] += torch.tensor([1.0, 0, 0, 0, 1.0, 0]).repeat(22)
    for name in ("left", "steps"):
        if name in out:
            out[name] = torch.randint(2, 40, (batch, 1), generator=generator).float()
    if "style" in out:
        count = out["style"].shape[1]
        out["style"] = torch.nn.functional.one_hot(torch.arange(batch) % count, count).float()
    return out
