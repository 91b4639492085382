"""What stitching from both ends adds to DC-MoE: one network against two, trained alike with a small budget.

    python benchmarks/dual.py DB LAFAN1 OUT

DB: the training database. LAFAN1: the folder of LaFAN1's BVH files. A forward and a backward network of preset
``small`` (1,000 updates of eight steps) are runs in OUT/runs, resume where they were stopped, and are
exported to OUT/models: `one` has the forward network alone and arrives on its base, `two` has both. The tables of
`interpose evaluate stitch` are printed and written to OUT.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from interpose import export
from interpose.evaluate.stitch import evaluate_stitch
from interpose.train.dcmoe import recipe
from interpose.train.dcmoe.config import PRESETS, Stage


def main() -> None:
    parser = argparse.ArgumentParser(description="Trains and measures DC-MoE from one end and from both.")
    parser.add_argument("db", type=Path)
    parser.add_argument("lafan1", type=Path)
    parser.add_argument("out", type=Path)
    asked = parser.parse_args()
    config = replace(PRESETS["small"], stages=(Stage(1000, 8, 128),), average=0.99, warmup=50)
    runs, models = asked.out / "runs", asked.out / "models"
    for name, backward in (("front", False), ("back", True)):
        recipe.train([asked.db], runs / name, config=config, backward=backward)
    one = export.export(runs / "front", models / "one")
    two = export.export(runs / "back", models / "two", onto=one)
    evaluate_stitch(asked.lafan1, ["interp", f"one={one}", f"two={two}"], asked.out)
    print((asked.out / "results.md").read_text())


if __name__ == "__main__":
    main()
