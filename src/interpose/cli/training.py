"""The commands of those who train and measure: prepare, labels, train, export, evaluate."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from interpose.errors import InputError

_RECIPES = {"pae": "phases.recipe", "detail": "stitch.detail"}
"""The modules of recipes that are not `NAME.recipe`."""
_EXTRA = {"torch", "roma", "safetensors", "onnx", "onnxscript", "tensorboard", "cleanlab", "matplotlib"}


def prepare(dataset: str, sources: Sequence[str], out: str, split: str, workers: int | None) -> int:
    from interpose.data import ingest

    if workers is not None and workers < 1:
        raise InputError(f"--workers must be 1 or more, got {workers}")
    report = ingest.prepare(dataset, list(sources), out, split=split, workers=workers)
    print(report.markdown(), end="")
    print(f"wrote {out}", file=sys.stderr)
    return 0


def labels(data: str, out: str | None, noise: float, seed: int) -> int:
    module = _of_extra("interpose.train.style.labels")
    folder = None if out is None else Path(out)
    text = module.distil(Path(data), folder, noise=noise, seed=seed, progress=_say)
    print(text, end="")
    kept = module.label_issues.KEPT_LABELS_FILE
    print(f"wrote {folder or Path(data) / 'labels'} and {kept} in {data}", file=sys.stderr)
    return 0


@dataclass(frozen=True)
class Extra:
    """Options that one recipe alone has."""

    phases: Sequence[str] = ()
    foreign_keys: float | None = None
    without: str | None = None
    plan_from: str | None = None
    refines: str | None = None
    backward: bool = False
    plan_steps: int | None = None
    compiled: bool = False

    def of(self, network: str) -> dict[str, Any]:
        """The recipe's own. Raises InputError where another's was given."""
        for option, value, owners in (
            ("--phases", self.phases, ("dcmoe",)),
            ("--foreign-keys", self.foreign_keys, ("dcmoe",)),
            ("--without", self.without, ("stitch",)),
            ("--plan-from", self.plan_from, ("dcmoe", "stitch")),
            ("--plan-steps", self.plan_steps, ("dcmoe",)),
            ("--refines", self.refines, ("detail",)),
            ("--backward", self.backward, ("dcmoe",)),
            ("--compile", self.compiled, ("dcmoe",)),
        ):
            if network not in owners and value not in (None, False, (), []):
                raise InputError(f"{option} is for {' and '.join(owners)}; {network} has no use for it")
        plan = None if self.plan_from is None else Path(self.plan_from)
        if network == "dcmoe":
            return {
                "phases": [Path(p) for p in self.phases] or None,
                "foreign_keys": self.foreign_keys,
                "backward": self.backward,
                "plan_from": plan,
                "plan_steps": self.plan_steps,
                "compiled": self.compiled,
            }
        if network == "stitch":
            return {"without": self.without, "plan_from": plan}
        if network == "detail":
            return {"refines": None if self.refines is None else Path(self.refines)}
        return {}


def train(
    network: str,
    data: Sequence[str],
    out: str,
    preset: str,
    minutes: float | None,
    device: str | None,
    seed: int,
    extra: Extra,
) -> int:
    recipe = _of_extra(f"interpose.train.{_RECIPES.get(network, f'{network}.recipe')}")
    if device is None:
        device = "cuda" if _of_extra("torch").cuda.is_available() else "cpu"
    settings = {"max_minutes": minutes, "device": device, "seed": seed}
    settings |= extra.of(network)
    if network != "dcmoe" and _of_extra("interpose.train.common.parallel").started() > 1:
        raise InputError(f"{network} trains on one process; torchrun is for dcmoe")
    outcome = recipe.train([Path(d) for d in data], Path(out), preset, **settings)
    if os.environ.get("RANK", "0") == "0":
        print(f"{out}: {outcome}", file=sys.stderr)
    return 130 if outcome == "interrupted" else 0


def export(run: str, out: str, name: str | None, onto: str | None) -> int:
    made = _of_extra("interpose.export").export(Path(run), Path(out), name=name, onto=onto)
    print(f"wrote {made}", file=sys.stderr)
    return 0


def evaluate(data: str, methods: str, model: str | None, out: str, context: int, seed: int) -> int:
    from interpose.evaluate.run import evaluate_lafan1

    folder = Path(out)
    evaluate_lafan1(
        Path(data),
        methods.split(","),
        folder,
        context_frames=context,
        seed=seed,
        model=model,
        progress=_say,
    )
    return _show(folder)


def evaluate_dcmoe(data: str, methods: str, out: str, seed: int) -> int:
    from interpose.evaluate import dcmoe

    folder = Path(out)
    dcmoe.evaluate_dcmoe(
        Path(data),
        methods.split(","),
        folder,
        seed=seed,
        progress=_say,
    )
    return _show(folder)


def evaluate_stitch(data: str, methods: str, model: str | None, out: str, seed: int) -> int:
    from interpose.evaluate import stitch

    folder = Path(out)
    stitch.evaluate_stitch(
        Path(data),
        methods.split(","),
        folder,
        model=model,
        seed=seed,
        progress=_say,
    )
    return _show(folder)


def evaluate_gallery(data: str, gallery: str | None, model: str | None, out: str, part: str, seed: int) -> int:
    from interpose.cli.gallery import gallery_of
    from interpose.data import database
    from interpose.evaluate.gallery import evaluate_gallery as measure
    from interpose.runtime import model_folder

    chosen = model_folder.load(model)
    folder = Path(out)
    measure(
        database.load(data),
        gallery_of(gallery or str(chosen.path)),
        chosen,
        folder,
        part=part,
        seed=seed,
        progress=_say,
    )
    return _show(folder)


def evaluate_style(data: str, model: str | None, out: str, strengths: str, part: str, seed: int) -> int:
    from interpose.data import database
    from interpose.runtime import model_folder

    try:
        asked = [float(text) for text in strengths.split(",")]
    except ValueError:
        raise InputError(f"--strength takes numbers separated by commas, got {strengths!r}") from None
    _of_extra("torch")
    folder = Path(out)
    _of_extra("interpose.evaluate.style").evaluate_style(
        database.load(data), model_folder.load(model), folder, strengths=asked, part=part, seed=seed, progress=_say
    )
    return _show(folder)


def _say(message: str) -> None:
    print(message, file=sys.stderr, flush=True)


def _show(folder: Path) -> int:
    """Prints the tables of an evaluation; the exit status."""
    print((folder / "results.md").read_text(encoding="utf-8"), end="")
    print(f"wrote {folder}", file=sys.stderr)
    return 0


def _of_extra(name: str) -> ModuleType:
    """A module that needs the extra `train`; InputError where the extra is not installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in _EXTRA:
            raise InputError(f"{error.name} is not installed; pip install 'interpose[train]' brings it") from None
        raise
