"""What each part of the recipe of DC-MoE contributes: one change at a time, several seeds, on held-out ends of clips.

    python benchmarks/dcmoe_ablations.py DB PLAN OUT [--phases FILE] [--seeds 2] [--updates 300] [--only A,B]

DB: a prepared database; PLAN: a run of `interpose train plan` whose planner all rows with one share. Every row sees the
same number of updates, by default few: the table compares how fast things are learnt, not what a long training ends at.
Joint errors are ratios to interpolation's, from one start frame (`interpose.train.dcmoe.validation`); OUT keeps the
runs, so that a second call resumes, and the table as `table.md`.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import torch

from interpose.data import database
from interpose.export.dcmoe import model_of
from interpose.io.files import write_whole
from interpose.train.common import checkpoint, setup
from interpose.train.common.frames import Frames
from interpose.train.dcmoe import recipe, validation
from interpose.train.dcmoe.config import PRESETS, DCMoEConfig, Stage

SHOWN = ("valid/15", "valid/30", "valid/60", "valid/90", "path/30", "path/90", "jerk/30", "jerk/90")
NO_PLANNER = "no planner: interpolation as the base"
HEADS = ("15", "30", "60", "90", "true path, 30", "90", "jerk / truth, 30", "90")
Change = Callable[[DCMoEConfig], DCMoEConfig]


def rows() -> dict[str, Change]:
    """Each row's name and what it changes of ours."""

    def sampled(**changes: float) -> Change:
        return lambda c: replace(c, sampling=replace(c.sampling, **changes))  # type: ignore[arg-type]

    def weighed(**changes: float) -> Change:
        return lambda c: replace(c, weights=replace(c.weights, **changes))

    def one_step(c: DCMoEConfig) -> DCMoEConfig:
        return replace(c, stages=tuple(replace(s, unroll=1, rows=512) for s in c.stages))

    def paper(c: DCMoEConfig) -> DCMoEConfig:
        return replace(PRESETS["paper"], experts=c.experts, hidden=c.hidden, gate=c.gate, stages=one_step(c).stages)

    return {
        "ours": lambda c: c,
        "the planner alone, no steps": lambda c: replace(c, stages=(Stage(1, 1, 16),)),
        NO_PLANNER: lambda c: c,
        "one-step training only": one_step,
        "no noise on the input": sampled(rotation_noise=0.0, hips_noise=0.0),
        "without energy and skate": weighed(energy=0.0, skate=0.0),
        "steps along likeliest plans only": lambda c: replace(c, posterior=0.0),
        "phases unknown": lambda c: c,
        "16 experts x 512": lambda c: replace(c, experts=16, hidden=512, gate=(512, 128)),
        "the paper's recipe, batches of 512": paper,
    }


def measured(run: Path, held_out: Frames) -> list[float]:
    """The held-out ratios of a run, in the order of :data:`SHOWN`."""
    saved = checkpoint.load(run)
    assert saved is not None
    model = model_of(saved)
    if run.name.startswith("the-planner-alone"):
        with torch.no_grad():
            model.network.experts[2].linear.weight.zero_()
            model.network.experts[2].linear.bias.zero_()
    found = validation.ratios(model, held_out, PRESETS["small"].sampling.gaps.longest)
    return [found[name] for name in SHOWN]


def main() -> None:
    parser = argparse.ArgumentParser(description="Ablations of DC-MoE's recipe.")
    parser.add_argument("db", type=Path, help="a prepared database")
    parser.add_argument("plan", type=Path, help="a run whose planner all rows share")
    parser.add_argument("out", type=Path, help="the folder for the runs and the table")
    parser.add_argument("--phases", type=Path, help="of interpose train pae on that database")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--updates", type=int, default=300, help="of eight frames, 128 rows")
    parser.add_argument("--only", help="rows, by name, separated by commas")
    asked = parser.parse_args()
    torch.set_num_threads(1)
    loaded = database.load(asked.db)
    _, held_out = setup.split([loaded], loaded.styles)
    ours = replace(PRESETS["small"], stages=(Stage(asked.updates, 8, 128),), average=0.98, warmup=30)
    lines = [f"| | {' | '.join(HEADS)} |", "|---|" + "---|" * len(HEADS)]
    for name, change in rows().items():
        if asked.only and name not in asked.only.split(","):
            continue
        found = []
        for seed in range(asked.seeds):
            run = asked.out / f"{name.replace(' ', '-').replace(',', '')}-{seed}"
            config = change(ours)
            phases = None if asked.phases is None or name == "phases unknown" else [asked.phases]
            plan = None if name == NO_PLANNER or config.preset == "paper" else asked.plan
            recipe.train([asked.db], run, config=config, phases=phases, seed=seed, plan=plan)
            found.append(measured(run, held_out))
        each = np.array(found)
        cells = [f"{m:.3f} ± {s:.3f}" for m, s in zip(each.mean(axis=0), np.ptp(each, axis=0) / 2.0, strict=True)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
        print(lines[-1], flush=True)
    write_whole(asked.out / "table.md", ("\n".join(lines) + "\n").encode())


if __name__ == "__main__":
    main()
