"""A training run to a model folder, whatever its method; the format is described in docs/model-format.md."""

from __future__ import annotations

import json
import re
import shutil
import tempfile
from collections.abc import Callable, Mapping
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
from torch import nn

from interpose.errors import InputError
from interpose.features import RATE
from interpose.runtime.model_folder import FORMAT, Session
from interpose.skeleton import HUMANOID

Fill = Callable[[Path], Mapping[str, Any]]
"""Writes a model's files into a folder; what `model.json` has of them."""


def check_place(out: Path) -> None:
    """Raises InputError where ``out`` exists and is not a model folder."""
    if out.exists() and not (out / "model.json").exists():
        raise InputError(f"{out} exists but is not a model folder; give another name")


def write(
    out: Path,
    saved: Mapping[str, Any],
    method: str,
    model: nn.Module,
    fill: Fill,
    name: str | None = None,
    metrics: Mapping[str, Any] | None = None,
) -> Path:
    """Writes the folder ``out``; whole or not at all. ``saved``: the checkpoint that the model is from. ``name``: by
    default the folder's. ``metrics``: its scores."""
    config = saved["config"]
    info = {
        "format": FORMAT,
        "name": name or out.name,
        "method": method,
        "version": "0.1.0",
        "made": date.today().isoformat(),
        "preset": config["preset"],
        "steps": saved["step"],
        "styles": config["styles"],
        "rate": RATE,
        "skeleton": {
            "names": HUMANOID.names,
            "parents": HUMANOID.parents,
            "offsets": np.round(HUMANOID.offsets, 6).tolist(),
        },
        "parameters": sum(p.numel() for p in model.parameters()),
        "training_data": [" ".join(word[:12] for word in data.split()) for data in config["databases"]],
        "licence": licence(config["licence"]),
        "training": config,
        "metrics": dict(metrics or {}),
    }
    return _placed(out, info, fill)


def complete(session: Session, out: Path, name: str | None, method: str, fill: Fill) -> Path:
    """Writes a copy of a model's folder with more in it; whole or not at all. Raises InputError for another method."""
    if session.method != method:
        raise InputError(f"the model '{session.name}' is for method {session.method}; give one for {method}")

    def filled(made: Path) -> dict[str, Any]:
        for file in session.path.iterdir():
            if file.name != "model.json":
                shutil.copy2(file, made / file.name)
        return dict(fill(made))

    return _placed(out, session.info | {"name": name or out.name, "made": date.today().isoformat()}, filled)


def _placed(out: Path, info: dict[str, Any], fill: Fill) -> Path:
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=f".{out.name}.") as folder:
        made = Path(folder) / "model"
        made.mkdir()
        whole = info | dict(fill(made))
        (made / "model.json").write_text(json.dumps(whole, indent=2) + "\n", encoding="utf-8")
        if out.exists():
            shutil.rmtree(out)
        made.replace(out)
    return out


def licence(data: str) -> str:
    """What the weights may be used for, from the licences of the data they were trained on."""
    if re.search(r"\bNC\b", data):
        return f"non-commercial research only (trained on data under {data})"
    return f"MIT; trained on data under {data}, which asks for credit" if data else "unknown"
