"""A run of the target completion to a copy of the DC-MoE model that it completes targets for, as ONNX."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from interpose.errors import InputError
from interpose.export import folder, onnx_file
from interpose.features import JOINTS, target_shapes
from interpose.models.target_pose import LONGEST_TARGET_FRAMES, Complete, TargetPose
from interpose.runtime.model_folder import Session
from interpose.train.target.recipe import model_of


def export(saved: Mapping[str, Any], onto: Session, out: Path, name: str | None = None) -> Path:
    """Writes a copy of the model ``onto`` with `target.onnx`. Raises InputError where the styles are not the same."""
    if onto.method == "dcmoe" and list(onto.styles) != list(saved["config"]["styles"]):
        raise InputError(f"the run's styles are not those of '{onto.name}'; train both on the same databases")
    model = model_of(saved)

    def fill(made: Path) -> dict[str, Any]:
        names = ["hips", "rotations", "contacts"]
        apart = onnx_file.write(Complete(model), made / "target.onnx", partial(example, model), names)
        size = {"latent": model.size.latent, "hidden": model.size.hidden, "steps": saved["step"]}
        return {"target": size | {"difference_from_torch": apart, "training": saved["config"]}}

    return folder.complete(onto, out, name, "dcmoe", fill)


def example(model: TargetPose, batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    shapes = target_shapes(model.size.styles, model.size.latent)
    out = onnx_file.example(shapes, batch, seed, LONGEST_TARGET_FRAMES)
    out["joints"] = ((torch.arange(batch)[:, None] + torch.arange(JOINTS)) % 3 == 0).float()
    return out
