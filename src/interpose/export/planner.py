"""The plan of a gap as ONNX, for the models that have one."""

from __future__ import annotations

from pathlib import Path

from torch import Tensor, nn

from interpose import stitch_layout
from interpose.export import onnx_file
from interpose.models.planner import Ends, GapPlan

TOLERANCE = 2e-3
"""Largest difference allowed between ONNX and torch, relative to an output's range."""
TOLERANCE_STORED = 0.3
"""The same once the weights are in 8 bits; see `interpose.export.dcmoe`."""


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


def write_plan(plan: GapPlan, path: Path) -> dict[str, float]:
    """Writes the ONNX file and returns the largest differences from torch, before and after the weights are rounded."""
    shapes = stitch_layout.plan_shapes(plan.size.latent, plan.size.styles)

    def inputs(batch: int, seed: int) -> dict[str, Tensor]:
        return onnx_file.example(shapes, batch, seed)

    return onnx_file.write(Plan(plan), path, inputs, ["added", "latent"], TOLERANCE, TOLERANCE_STORED)
