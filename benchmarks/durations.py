"""What a transition is like from a tenth of a second to twenty: `python benchmarks/durations.py DB MODEL [OUT]`.

Gaps of held-out motion at 30, 60 and 120 Hz, along the gallery's path and with none: the error at the target, the
acceleration at the keys and the jerk beside the truth's, how lively the body is (the joints' speed about the hips
beside the truth's, and in the quietest second), foot slide, how far the hips go beside the truth, wall time. OUT gets a
contact sheet of each.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from interpose import Motion, load_model
from interpose.data import database
from interpose.data.split import training_ranges
from interpose.motion import concatenate, resample
from interpose.render import SheetRow, contact_sheet

SECONDS = (0.1, 0.2, 0.5, 1.0, 3.0, 5.0, 10.0, 20.0)
CLIPS = 4
EDGE = 10


def main(db: Path, name: str, out: Path | None = None) -> None:
    """Prints a row for each duration, rate and kind of path; medians over the clips."""
    model, data = load_model(name), database.load(db)
    ranges = data.ranges.tolist() if "test" in db.name else training_ranges(data)[1]
    print("| seconds | Hz | path | arrival m | pop | jerk | lively | quietest s | slide | way | ms | fallback |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    for seconds in SECONDS:
        for rate in (30.0, 60.0, 120.0) if seconds in (0.1, 1.0, 20.0) else (30.0,):
            frames = round(seconds * rate) - 1
            spans = [(a, b) for a, b in ranges if (b - a) / 30.0 > seconds + 1.0] or _whole(data, seconds)
            chosen = [spans[i] for i in np.linspace(0, len(spans) - 1, min(CLIPS, len(spans))).astype(int)]
            need = round(30 * seconds) + 30
            begins = [(a, (a + b - need) // 2) for a, b in chosen]  # clips often begin and end at rest
            clips = [resample(data.motion(max(a, at), max(a, at) + need), rate) for a, at in begins]
            for path in ("auto", "none"):
                rows, figures, notes = [], [], set()
                for clip in clips:
                    began = time.perf_counter()
                    (made,) = model.inbetween(clip[EDGE], clip[EDGE + frames + 1], frames, path=path)
                    took = time.perf_counter() - began
                    whole = concatenate(clip[EDGE], made.motion, clip[EDGE + frames + 1])
                    truth = clip[EDGE : EDGE + frames + 2]
                    figures.append([made.info.arrival_position_error_m, *_figures(whole, truth), 1000.0 * took])
                    figures[-1].insert(5, made.info.foot_slide_cm_per_frame or 0.0)
                    notes |= {made.info.fallback} if made.info.fallback else set()
                    rows += [SheetRow(truth, "truth"), SheetRow(whole, f"made, {path}")]
                told = " | ".join(f"{x:.2g}" if i else f"{x:.0e}" for i, x in enumerate(np.median(figures, axis=0)))
                print(f"| {seconds:g} | {rate:g} | {path} | {told} | {'; '.join(sorted(notes))[:90]} |", flush=True)
                if out is not None and rate == 30.0:
                    out.mkdir(parents=True, exist_ok=True)
                    contact_sheet(out / f"{seconds:g}-{path}.png", rows, f"{name}, {seconds:g} s", path, poses=14)


def _whole(data: database.Database, seconds: float) -> list[tuple[int, int]]:
    """Whole clips that are long enough, where nothing that is held out is."""
    return [(a, b) for a, b in data.ranges.tolist() if (b - a) / 30.0 > seconds + 1.0]


def _figures(made: Motion, truth: Motion) -> list[float]:
    """Acceleration at the keys, jerk, liveliness, that of the quietest second, way of the hips; ratios to the truth."""
    ours, theirs = made.global_positions(), truth.global_positions()
    pop = [np.linalg.norm(np.diff(p, n=2, axis=0), axis=-1).mean(axis=-1) for p in (ours, theirs)]
    jerk = [np.linalg.norm(np.diff(p, n=3, axis=0), axis=-1).mean() if len(p) > 3 else np.nan for p in (ours, theirs)]
    bodies = [np.diff(p - p[:, :1], axis=0) for p in (ours, theirs)]
    lively = [np.linalg.norm(b, axis=-1).mean(axis=-1) for b in bodies]
    window = min(len(lively[0]), round(made.rate))
    quiet = min(np.convolve(lively[0], np.full(window, 1.0 / window), "valid"))
    way = [np.linalg.norm(np.diff(p[:, 0, ::2], axis=0), axis=-1).sum() for p in (ours, theirs)]
    ends = max(pop[0][0], pop[0][-1]) / max(np.quantile(pop[1], 0.95), 1e-9)
    return [
        float(ends),
        float(jerk[0] / jerk[1]),
        float(lively[0].mean() / lively[1].mean()),
        float(quiet / lively[1].mean()),
        float(way[0] / way[1]),
    ]


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]) if len(sys.argv) > 3 else None)
