"""The planner as `plan.onnx`, its mirror mean and the spline over the anchors inside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from interpose.export import folder, onnx_file
from interpose.features.plan import gap_shapes
from interpose.models.planner import GapInput, Planner, anchor_weights_at
from interpose.train.planner.recipe import model_of


class PlanGraph(nn.Module):
    """Flat inputs: the gap, standard noise, and the frames at which the plan is wanted, counted from the start.
    Outputs: what is added to interpolation there, and the latent."""

    def __init__(self, planner: Planner) -> None:
        super().__init__()
        self.planner = planner

    def forward(self, *tensors: Tensor) -> tuple[Tensor, Tensor]:
        *known, noise, frames = tensors
        gap = GapInput(*known)
        plan, latent = self.planner(gap, noise)
        return anchor_weights_at((frames / gap.steps).clamp(0.0, 1.0)) @ plan, latent


def write_plan(planner: Planner, folder: Path) -> dict[str, Any]:
    """Writes `plan.onnx` into a model's folder; what `model.json` has of it."""

    def inputs(batch: int, seed: int) -> dict[str, Tensor]:
        out = onnx_file.example(gap_shapes(planner.size.styles), batch, seed)
        out["noise"] = torch.randn(batch, planner.size.latent, generator=torch.Generator().manual_seed(seed))
        out["frames"] = (torch.arange(5 + seed) + torch.arange(batch)[:, None]).float()
        return out

    outputs = ["added", "latent"]
    apart = onnx_file.write(PlanGraph(planner), folder / "plan.onnx", inputs, outputs, frames=("frames",))
    return asdict(planner.size) | {"difference_from_torch": apart}


def export(
    saved: Mapping[str, Any], out: Path, name: str | None = None, metrics: Mapping[str, Any] | None = None
) -> Path:
    """Writes the model folder ``out`` of a checkpoint: a planner alone, method `plan`."""
    planner = model_of(saved)
    return folder.write(out, saved, "plan", planner, lambda made: {"planner": write_plan(planner, made)}, name, metrics)
