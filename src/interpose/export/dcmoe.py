"""A DC-MoE run to a model folder: the step as ONNX."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from interpose.errors import InputError
from interpose.export import folder, onnx_file
from interpose.export.engine import write_engine
from interpose.export.planner import write_plan
from interpose.features import (
    EXPERT_INPUT,
    GATE_INPUT,
    LONGEST_ARRIVAL,
    SIDE_KEYS,
    control_shapes,
    output_layout,
    state_shapes,
)
from interpose.models.dcmoe import Control, DCMoE, State
from interpose.runtime.model_folder import Session
from interpose.train.common import checkpoint
from interpose.train.common.config import from_plain
from interpose.train.dcmoe.config import DCMoEConfig

CARRIED = [name for name in state_shapes() if name != "velocity_known"]
"""The state that comes out of a step; the velocity is always known then."""


class StepGraph(nn.Module):
    """The step with flat inputs and outputs, in the order of the layout; contacts as probabilities, the predicted root
    in the world."""

    def __init__(self, model: DCMoE) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        count = len(State._fields)
        after, prediction = self.model(State(*tensors[:count]), Control(*tensors[count:]))
        back = prediction.frame[:, ::2, ::2].transpose(-1, -2)
        turned = prediction.trajectory[:, 1:].flatten(1).unflatten(1, (-1, 2)) @ back
        future = turned.flatten(1).unflatten(1, (SIDE_KEYS, 6))
        ground = prediction.origin[:, ::2]
        origin = torch.cat([ground, torch.zeros_like(ground), torch.zeros_like(ground)], dim=-1)
        carried = (value for name, value in after._asdict().items() if name in CARRIED)
        return (*carried, prediction.contacts[:, 0].sigmoid(), future + origin[:, None])


def export(
    saved: Mapping[str, Any], out: Path, name: str | None = None, metrics: Mapping[str, Any] | None = None
) -> Path:
    """Writes the model folder ``out`` of a checkpoint."""
    model = model_of(saved)
    config = saved["config"]

    def fill(made: Path) -> dict[str, Any]:
        difference = write_step(model, made / "step.onnx")
        planner = {} if model.planner is None else {"planner": write_plan(model.planner, made)}
        write_engine(made)
        bank = model.phase_bank.numpy().astype(np.float16)
        if np.any(bank):
            np.save(made / "phases.npy", bank)
        return {
            "absolute": config["absolute"],
            "network": {"experts": config["experts"], "hidden": config["hidden"], "gate": config["gate"]},
            "layout": {
                "experts": dict(EXPERT_INPUT.blocks),
                "gate": dict(GATE_INPUT.blocks),
                "output": dict(output_layout(config["absolute"]).blocks),
            },
            "limits": {"trained_frames_to_target": LONGEST_ARRIVAL},
            "difference_from_torch": difference,
        } | planner

    return folder.write(out, saved, "dcmoe", model, fill, name, metrics)


def export_backward(saved: Mapping[str, Any], onto: Session, out: Path, name: str | None = None) -> Path:
    """Writes a copy of a model that has the backward step too, so that it can stitch; see
    `interpose.runtime.backends.dcmoe`.

    Raises InputError where the two are not of one kind, and where one walks along a plan, which both ends cannot share.
    """
    model = model_of(saved)
    if onto.has_planner or model.planner is not None:
        raise InputError(f"'{onto.name}' or the backward run has a planner; stitch with networks that have none")
    if list(onto.styles) != list(saved["config"]["styles"]) or onto.feeds_path_back != saved["config"]["absolute"]:
        raise InputError(f"the backward run's styles or form are not those of '{onto.name}'; train both alike")

    def fill(made: Path) -> dict[str, Any]:
        difference = write_step(model, made / "back.onnx")
        kept = {"steps": saved["step"], "training": saved["config"]}
        return {"backward": kept | {"difference_from_torch": difference}}

    return folder.complete(onto, out, name, "dcmoe", fill)


def model_of(saved: Mapping[str, Any]) -> DCMoE:
    """The network of a checkpoint, ready to run. Raises InputError where the weights do not fit the config."""
    model = DCMoE(from_plain(DCMoEConfig, saved["config"]).size)
    checkpoint.average_into(model, saved)
    return model


def write_step(model: DCMoE, path: Path) -> dict[str, float]:
    """Writes the ONNX file and returns the largest differences from torch, before and after the weights are rounded."""
    shapes = state_shapes() | control_shapes(model.size.styles)
    outputs = [*(f"next_{name}" for name in CARRIED), "contacts", "next_path"]
    return onnx_file.write(StepGraph(model), path, partial(onnx_file.example, shapes, longest=LONGEST_ARRIVAL), outputs)
