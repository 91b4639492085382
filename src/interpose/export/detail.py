"""A run of the detail transformer to a copy of the stitching model that it refines, with the transformer as ONNX."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from interpose.errors import InputError
from interpose.export import folder, onnx_file
from interpose.models.detail_transformer import DetailTransformer
from interpose.runtime.model_folder import Session
from interpose.train.common import checkpoint
from interpose.train.common.config import from_plain
from interpose.train.stitch.detail import DetailConfig


class Refine(nn.Module):
    """The transformer with contacts as probabilities."""

    def __init__(self, model: DetailTransformer) -> None:
        super().__init__()
        self.model = model

    def forward(self, *motion: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        hips, rotations, contacts = self.model(*motion)
        return hips, rotations, contacts.sigmoid()


def export(saved: Mapping[str, Any], onto: Session, out: Path, name: str | None = None) -> Path:
    """Writes a copy of the model ``onto`` with `detail.onnx`. Raises InputError where it is no stitching model."""
    if onto.method == "stitch" and onto.info["network"]["form"] == "paper":
        raise InputError(f"the model '{onto.name}' has the paper's own form, which is not refined")
    model = DetailTransformer(from_plain(DetailConfig, saved["config"]).size)
    checkpoint.average_into(model, saved)

    def fill(made: Path) -> dict[str, Any]:
        names = ["refined_hips", "refined_rotations", "refined_contacts"]
        file = made / "detail.onnx"
        apart = onnx_file.write(Refine(model), file, example, names, frames=True)
        kept = {"steps": saved["step"], "refines": saved["config"]["refines"], "training": saved["config"]}
        return {"detail": kept | {"difference": apart}}

    return folder.complete(onto, out, name, "stitch", fill)


def example(batch: int, seed: int = 0) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    generator = torch.Generator().manual_seed(seed)
    frames = 7 + 4 * seed
    six = torch.tensor([1.0, 0, 0, 0, 1.0, 0]) + 0.3 * torch.randn(batch, frames, 22, 6, generator=generator)
    return {
        "hips": 0.3 * torch.randn(batch, frames, 3, generator=generator),
        "rotations": six,
        "contacts": torch.rand(batch, frames, 4, generator=generator),
    }
