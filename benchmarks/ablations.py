"""Table 6 of Ren et al. 2024: what each part of stitching contributes, all rows trained with one budget.

    python benchmarks/ablations.py DB LAFAN1 PLAN OUT [--steps N] [--rows A,B,...]

DB: the training database. LAFAN1: the folder of LaFAN1's BVH files. PLAN: a finished run of `interpose train plan` on
DB, whose planner all rows with one share. Each row is a run in OUT/runs, resumes where it was stopped, and is exported
to OUT/models. The table, of gaps of 50 frames, is printed and written to OUT/table6.md.
"""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from interpose import export
from interpose.evaluate.stitch import evaluate_stitch
from interpose.evaluate.tables import Row
from interpose.train.stitch import recipe
from interpose.train.stitch.config import PRESETS, TrainingPart, ablations

FRAMES = 50
SHOWN = (
    ("", "L2P", "L2P, mean"),
    (" best of 10", "L2P", "L2P, best of 10"),
    (" sample", "APD", "APD, cm"),
    ("", "ADE", "ADE"),
    ("", "SLDE", "SLDE"),
    ("", "NPSS", "NPSS"),
    (" raw", "foot_slide", "foot slide before the lock, cm"),
    ("", "foot_slide", "foot slide, cm"),
    (" raw", "jerk_ratio", "jerk / truth"),
    ("", "seam_acceleration", "acceleration at the seam / gap"),
    ("", "MMPE", "MMPE, cm"),
)
"""Which row of the evaluation, which metric, and its heading; ratios to interp where there are any."""


def label(name: str) -> str:
    return name.replace(" ", "-").replace("/", "").replace(",", "")


def table(rows: list[Row], names: list[str]) -> str:
    found = {(row.method, row.metric): row for row in rows}
    lines = ["| | " + " | ".join(heading for _, _, heading in SHOWN) + " |", "|---" * (len(SHOWN) + 1) + "|"]
    for name in names:
        cells = []
        for suffix, metric, _ in SHOWN:
            row = found.get((label(name) + suffix, metric))
            if row is None or row.value != row.value:
                cells.append("-")
            elif metric in ("APD", "MMPE"):
                cells.append(f"{100.0 * row.value:.2f}")
            elif metric == "foot_slide" or row.ratio_to_interp != row.ratio_to_interp:
                cells.append(f"{row.value:.2f}")
            else:
                cells.append(f"{row.ratio_to_interp:.3f}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description="Trains and measures the rows of table 6.")
    parser.add_argument("db", type=Path)
    parser.add_argument("lafan1", type=Path)
    parser.add_argument("plan", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, default=500, help="updates of 128 gaps each")
    parser.add_argument("--rows", default="", help="names of rows, separated by semicolons; all where left out")
    asked = parser.parse_args()
    config = replace(PRESETS["small"], stitch=TrainingPart(asked.steps, 128), average=0.99)
    rows = ablations(config)
    names = [name.strip() for name in asked.rows.split(";") if name.strip()] or list(rows)
    methods = ["interp"]
    for name in names:
        run, model = asked.out / "runs" / label(name), asked.out / "models" / label(name)
        print(f"{name}: training", file=sys.stderr)
        plan = asked.plan if rows[name].needs_plan else None
        recipe.train([asked.db], run, plan=plan, config=rows[name])
        if not (model / "model.json").exists():
            export.export(run, model)
        methods.append(f"{label(name)}={model}")
    found = evaluate_stitch(asked.lafan1, methods, asked.out, lengths=(FRAMES,), offset=40)
    text = table(found, names)
    (asked.out / "table6.md").write_text(text)
    print(text)


if __name__ == "__main__":
    main()
