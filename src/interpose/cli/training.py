"""The work of `interpose prepare`, `labels`, `train` and `export`."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from interpose.cli.inputs import of_extra
from interpose.cli.output import show_progress
from interpose.errors import InputError

_RECIPES = {"pae": "phases.recipe", "plan": "planner.recipe", "detail": "stitch.detail"}
"""The modules of recipes that are not `NAME.recipe`."""


def prepare(dataset: str, sources: Sequence[str], out: str, split: str, workers: int | None) -> int:
    from interpose.data import ingest

    if workers is not None and workers < 1:
        raise InputError(f"--workers must be 1 or more, got {workers}")
    report = ingest.prepare(dataset, list(sources), out, split=split, workers=workers)
    print(report.markdown(), end="")
    print(f"wrote {out}", file=sys.stderr)
    return 0


def labels(data: str, out: str | None, noise: float, seed: int) -> int:
    module = of_extra("interpose.train.style.labels")
    folder = None if out is None else Path(out)
    text = module.distil(Path(data), folder, noise=noise, seed=seed, progress=show_progress)
    print(text, end="")
    kept = module.label_issues.KEPT_LABELS_FILE
    print(f"wrote {folder or Path(data) / 'labels'} and {kept} in {data}", file=sys.stderr)
    return 0


@dataclass(frozen=True)
class RecipeOptions:
    """Options that some recipes alone have."""

    plan: str | None = None
    phases: Sequence[str] = ()
    without: str | None = None
    refines: str | None = None
    backward: bool = False
    compiled: bool = False

    def of(self, network: str) -> dict[str, Any]:
        """The recipe's own. Raises InputError where another's was given."""
        plan, refines = (None if run is None else Path(run) for run in (self.plan, self.refines))
        owned = {
            "plan": ("--plan", plan, ("dcmoe", "stitch")),
            "phases": ("--phases", [Path(p) for p in self.phases] or None, ("dcmoe",)),
            "without": ("--without", self.without, ("stitch",)),
            "refines": ("--refines", refines, ("detail",)),
            "backward": ("--backward", self.backward, ("dcmoe",)),
            "compiled": ("--compile", self.compiled, ("dcmoe",)),
        }
        for option, value, owners in owned.values():
            if network not in owners and value not in (None, False):
                raise InputError(f"{option} is for {' and '.join(owners)}; it is not valid for {network}")
        return {name: value for name, (_, value, owners) in owned.items() if network in owners}


def train(
    network: str,
    data: Sequence[str],
    out: str,
    preset: str,
    config: str | None,
    minutes: float | None,
    device: str | None,
    seed: int | None,
    options: RecipeOptions,
) -> int:
    recipe = of_extra(f"interpose.train.{_RECIPES.get(network, f'{network}.recipe')}")
    configs = of_extra("interpose.train.common.config")
    if device is None:
        device = "cuda" if of_extra("torch").cuda.is_available() else "cpu"
    own = options.of(network)
    settings = configs.preset_of(recipe.PRESETS, preset)
    if config is not None:
        part = network if network in ("plan", "detail", "target") else "backward" if options.backward else None
        settings = configs.read(Path(config), settings, part)
    if network not in ("plan", "dcmoe") and of_extra("interpose.train.common.parallel").started() > 1:
        raise InputError(f"{network} trains on one process; torchrun is for plan and dcmoe")
    outcome = recipe.train(
        [Path(d) for d in data],
        Path(out),
        config=settings,
        seed=settings.seed if seed is None else seed,
        max_minutes=minutes,
        device=device,
        **own,
    )
    if os.environ.get("RANK", "0") == "0":
        if config is not None:
            configs.check_data(Path(config), Path(out))
        print(f"{out}: {outcome}", file=sys.stderr)
    return 130 if outcome == "interrupted" else 0


def export(run: str, out: str, name: str | None, onto: str | None) -> int:
    made = of_extra("interpose.export").export(Path(run), Path(out), name=name, onto=onto)
    print(f"wrote {made}", file=sys.stderr)
    return 0
