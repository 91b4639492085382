"""A run of the target completion to a copy of the DC-MoE model that it completes targets for, as ONNX."""

from __future__ import annotations

from collections.abc import Mapping
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
        file = made / "target.onnx"

        def inputs(batch: int, seed: int) -> dict[str, Tensor]:
            return example(model, batch, seed)

        apart = onnx_file.write(Complete(model), file, inputs, names)
        size = {"latent": model.size.latent, "hidden": model.size.hidden, "steps": saved["step"]}
        return {"target": size | {"difference_from_torch": apart, "training": saved["config"]}}

    return folder.complete(onto, out, name, "dcmoe", fill)


def example(model: TargetPose, batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    generator = torch.Generator().manual_seed(seed)
    shapes = target_shapes(model.size.styles, model.size.latent)
    out = {name: 0.3 * torch.randn(batch, *shape, generator=generator) for name, shape in shapes.items()}
    for name in ("start_rotations", "target_rotations"):
        out[name] = out[name] + torch.tensor([1.0, 0, 0, 0, 1.0, 0])
    rows = torch.arange(batch)[:, None]
    out["joints"] = ((rows + torch.arange(JOINTS)) % 3 == 0).float()
    out["ground"] = (rows % 2).float()
    out["velocity_known"] = (rows % 2).float()
    out["frames"] = torch.randint(1, LONGEST_TARGET_FRAMES, (batch, 1), generator=generator).float()
    out["style"] = torch.nn.functional.one_hot(rows[:, 0] % (model.size.styles + 1), model.size.styles + 1).float()
    return out
