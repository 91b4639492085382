"""Runs that complete a model, to a copy of its folder with one more network: a transformer that refines stitched
transitions, and a completion of partial targets."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from interpose.errors import InputError
from interpose.export import folder, onnx_file
from interpose.features import JOINTS, target_shapes
from interpose.features.stitch import DETAIL_SHAPES
from interpose.models.detail_transformer import DetailTransformer
from interpose.models.target_pose import LONGEST_TARGET_FRAMES, Complete, TargetPose
from interpose.runtime.model_folder import Session
from interpose.train.common import checkpoint
from interpose.train.common.config import from_plain
from interpose.train.stitch.detail import DetailConfig
from interpose.train.target.recipe import model_of


class Refine(nn.Module):
    """The transformer with contacts as probabilities."""

    def __init__(self, model: DetailTransformer) -> None:
        super().__init__()
        self.model = model

    def forward(self, *motion: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        hips, rotations, contacts = self.model(*motion)
        return hips, rotations, contacts.sigmoid()


def export_detail(saved: Mapping[str, Any], onto: Session, out: Path, name: str | None = None) -> Path:
    """Writes a copy of the model ``onto`` with `detail.onnx`. Raises InputError where it is no stitching model."""
    if onto.method == "stitch" and onto.info["network"]["form"] == "paper":
        raise InputError(f"the model '{onto.name}' has the paper's own form, which is not refined")
    model = DetailTransformer(from_plain(DetailConfig, saved["config"]).size)
    checkpoint.average_into(model, saved)

    def fill(made: Path) -> dict[str, Any]:
        names = [f"refined_{name}" for name in DETAIL_SHAPES]
        apart = onnx_file.write(Refine(model), made / "detail.onnx", example_transition, names, frames=True)
        kept = {"steps": saved["step"], "refines": saved["config"]["refines"], "training": saved["config"]}
        return {"detail": kept | {"difference": apart}}

    return folder.complete(onto, out, name, "stitch", fill)


def example_transition(batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check, of another length for each seed."""
    return onnx_file.example({name: (7 + 4 * seed, *shape[1:]) for name, shape in DETAIL_SHAPES.items()}, batch, seed)


def export_target(saved: Mapping[str, Any], onto: Session, out: Path, name: str | None = None) -> Path:
    """Writes a copy of the model ``onto`` with `target.onnx`. Raises InputError where the styles are not the same."""
    if onto.method == "dcmoe" and list(onto.styles) != list(saved["config"]["styles"]):
        raise InputError(f"the run's styles are not those of '{onto.name}'; train both on the same databases")
    model = model_of(saved)

    def fill(made: Path) -> dict[str, Any]:
        names = ["hips", "rotations", "contacts"]
        apart = onnx_file.write(Complete(model), made / "target.onnx", partial(example_target, model), names)
        size = {"latent": model.size.latent, "hidden": model.size.hidden, "steps": saved["step"]}
        return {"target": size | {"difference_from_torch": apart, "training": saved["config"]}}

    return folder.complete(onto, out, name, "dcmoe", fill)


def example_target(model: TargetPose, batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    shapes = target_shapes(model.size.styles, model.size.latent)
    out = onnx_file.example(shapes, batch, seed, LONGEST_TARGET_FRAMES)
    out["joints"] = ((torch.arange(batch)[:, None] + torch.arange(JOINTS)) % 3 == 0).float()
    return out
