"""A training run to a model folder: its networks as ONNX, their weights in 8 bits, checked against torch."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from interpose.errors import InputError
from interpose.export import completions, dcmoe, planner, stitch
from interpose.export.folder import check_place, licence
from interpose.runtime import model_folder
from interpose.train.common import checkpoint

__all__ = ["export", "licence"]


def export(
    run_dir: Path,
    out: Path,
    *,
    name: str | None = None,
    metrics: dict[str, Any] | None = None,
    onto: str | Path | None = None,
) -> Path:
    """Writes the model folder ``out`` from the newest checkpoint (its moving average where it keeps one); whole or not.

    onto: for runs that complete a model, a detail transformer, a backward DC-MoE or a completion of targets: the model,
    of which ``out`` becomes a copy. Raises InputError where ``run_dir`` holds no run of a model, where ``out`` is there
    and is no model folder, where ``onto`` is not what the run completes, and where ONNX Runtime does not give what
    torch gives.
    """
    saved = checkpoint.load(run_dir) or {"config": {}}
    check_place(out)
    config = saved["config"]
    completes = "refines" in config or "completes" in config or config.get("backward", False)
    if completes != (onto is not None):
        raise InputError(
            f"{run_dir}: {'this run completes a model; name it with --onto' if completes else 'no run for --onto'}"
        )
    if onto is not None:
        completing = completions.export_target if "completes" in config else dcmoe.export_backward
        write = completions.export_detail if "refines" in config else completing
        return write(saved, model_folder.load(onto), out, name)
    for key, kind in (("stitch", stitch), ("experts", dcmoe), ("displacement", planner)):
        if key in config:
            return kind.export(saved, out, name, metrics)
    raise InputError(
        f"{run_dir}: no checkpoint of a model is there; give a run of 'interpose train plan, dcmoe or stitch'"
    )
