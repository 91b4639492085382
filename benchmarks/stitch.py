"""What a stitched gap costs on the CPU, part by part.

    python benchmarks/stitch.py [--repeats N] [--model DIR ...]

A gap of 50 frames, both keys counted, with eight variants through :func:`interpose.runtime.inbetween.inbetween`, as in
`benchmarks/step.py`, by networks of random weights of the presets ``full`` (the paper's sizes) and ``small``, or by
the models given. The budget is 0.25 s.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from step import gap_rows

from interpose.runtime.model_folder import load

FRAMES = 48


def random_model(preset: str, folder: Path) -> Path:
    """The folder of a model of random weights, of the size of that preset and 100 styles."""
    from interpose import export
    from interpose.models.stitching_cvae import StitchingCVAE
    from interpose.train.common import checkpoint, loop
    from interpose.train.planner import config as planner_config
    from interpose.train.stitch.config import PRESETS

    styles = tuple(f"Style {i}" for i in range(100))
    planner = planner_config.PRESETS[preset]
    planner = replace(planner, size=replace(planner.size, styles=len(styles)), styles=styles)
    config = PRESETS[preset]
    size = replace(config.size, styles=len(styles), plan=planner.size)
    config = replace(config, size=size, styles=styles, plan=planner)
    model = StitchingCVAE(config.size)
    run = folder / f"run-{preset}"
    run.mkdir()
    parts = {"model": model, "ema": loop.moving_average(model, 0.9)}
    checkpoint.save(run, checkpoint.TrainingState(parts), 0, config)
    return export.export(run, folder / preset)


def main() -> None:
    parser = argparse.ArgumentParser(description="Times a stitched gap.")
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--model", nargs="+", default=[], help="names or folders of exported models")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for path in asked.model or [random_model(preset, Path(folder)) for preset in ("full", "small")]:
            gap_rows(load(path), 30.0, asked.repeats, FRAMES)


if __name__ == "__main__":
    main()
