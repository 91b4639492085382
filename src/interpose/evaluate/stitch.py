"""`interpose evaluate stitch`: table 1 of Ren et al. 2024, and the figures 6 and 8, from exactly two frames.

Windows of 50 frames of subject 5, one each 20, moved and turned by their first frame. A gap of n frames counts both its
keys, as in the paper: frame 0 is the start, frame n - 1 the target, and the n - 2 between are scored.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.evaluate import figures, metrics, report, tables, windows
from interpose.evaluate.case import COMPARED, Case, Windows, check_lengths, scores, truth_scores
from interpose.evaluate.fill import INTERP, Contender, fill, parse
from interpose.evaluate.metrics import Scores
from interpose.evaluate.tables import TRUTH, ResultRow, rows_of
from interpose.evaluate.windows import SCALE_WINDOW
from interpose.render.sheet import SheetRow, contact_sheet

STITCH_LENGTHS = (10, 30, 50)
"""Frames of a gap, both keys counted."""
STITCH_OFFSET = 20
STITCH_SAMPLES, SHEET_SAMPLES = 10, 6
"""Samples of each gap that are scored, and those of one gap that are drawn."""
STITCH_METRICS = (*COMPARED, "foot_slide", "arrival_position", "seam_speed", "seam_acceleration")
BEST_SAMPLE_METRICS = ("L2P", "L2Q_aligned", "ADE", "SLDE", "NPSS")
STITCH_HEADING = """# Stitching

From exactly two frames: windows of 50 frames of subject 5, one each 20; n frames count both keys (Ren et al. 2024,
table 1). In brackets: the ratio to `interp` on the same windows. *sample* is the mean of ten, *best* the best of the
ten in each window and metric, *worst* the one that slides most. Feet are locked as in use; `raw` is without. With part
of the data set's files only ratios compare with other tables. Intervals (95 %, bootstrap over windows) are in
`results.json`.
"""


def evaluate_stitch(
    data: Path,
    methods: Sequence[str],
    out: Path,
    *,
    model: str | None = None,
    lengths: Sequence[int] = STITCH_LENGTHS,
    samples: int = STITCH_SAMPLES,
    offset: int = STITCH_OFFSET,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[ResultRow]:
    """Run methods on gaps of which two frames are known; write ``results.json``, ``.csv``, ``.md`` and figures.

    data: the folder of LaFAN1's BVH files. methods: as `interpose.evaluate.fill.parse` takes them; those whose
    variants differ by their latents alone are shown with samples. Figure 6 (``errors.png``) shows all methods, figure 8
    (``samples.png``) the first with samples. Raises InputError for what cannot be served, before anything is written.
    """
    check_lengths(lengths, 4, SCALE_WINDOW)
    source = windows.read(data)
    recorded = windows.cut(source.clips, SCALE_WINDOW, offset, 1)
    chosen = parse(methods, model=model, reserved=(TRUTH,))
    sampled = [one for one in chosen if one.abilities.latent_variants]
    rows: list[ResultRow] = []
    errors: dict[str, list[Float[ndarray, "frame"]]] = {}
    cases = [Case("stitch", n, recorded, 0, n - 1, 1, source.mapping, source.scale) for n in sorted(set(lengths))]
    for case in cases:
        base = scores(case, fill(case, INTERP).motion, STITCH_METRICS)
        rows += rows_of(case.protocol, case.length, {TRUTH: truth_scores(case, STITCH_METRICS)}, base, seed)
        for method in chosen:
            count = samples if method in sampled else 0
            progress(f"{method.name}: {len(case)} gaps of {case.length} frames, {count} samples each")
            errors[method.name], found = sample_scores(case, method, count, seed)
            rows += rows_of(case.protocol, case.length, found, base, seed)
    report.write(rows, out, tables.to_markdown(rows, STITCH_HEADING))
    figures.draw_errors(errors, out / "errors.png")
    if sampled:
        heading = f"{sampled[0].name}: one gap of {max(lengths)} frames"
        contact_sheet(out / "samples.png", sheet_rows(cases[-1], sampled[0]), heading)
    return rows


def sample_scores(
    case: Case, method: Contender, samples: int, seed: int
) -> tuple[list[Float[ndarray, "frame"]], dict[str, dict[str, Scores]]]:
    """A method's errors over time, and its metrics; with samples, also those of their mean and of their best."""
    likeliest = fill(case, method)
    out = {method.name: scores(case, likeliest.motion, STITCH_METRICS)}
    if not samples:
        return [frame_errors(case, likeliest.motion)], out
    if likeliest.chain_distance is not None:
        out[method.name]["MMPE"] = metrics.mean(likeliest.chain_distance[:, None])
    out[f"{method.name} raw"] = scores(case, likeliest.raw, ("foot_slide", "jerk_ratio", "L2P"))
    made = [fill(case, method, seed=1 + seed * samples + i).motion for i in range(samples)]
    each = [scores(case, motion, STITCH_METRICS) for motion in made]
    apd = metrics.apd(np.stack([motion.positions for motion in made]))
    out[f"{method.name} sample"] = metrics.mean_of_samples(each) | {"APD": apd}
    out[f"{method.name} best of {samples}"] = metrics.best_of_samples(each, BEST_SAMPLE_METRICS)
    worst = max((one["foot_slide"] for one in each), key=lambda found: found.value)
    out[f"{method.name} worst of {samples}"] = {"foot_slide": worst}
    return [frame_errors(case, motion) for motion in made[:3]], out


def frame_errors(case: Case, made: Windows) -> Float[ndarray, "frame"]:
    """The mean displacement of the joints in each frame, metres."""
    return np.linalg.norm(made.positions - case.truth.positions, axis=-1).mean(axis=(0, 2))


def sheet_rows(case: Case, method: Contender) -> list[SheetRow]:
    """The likeliest motion and samples of one gap, and the truth.

    The gap is the one whose root goes as far as that of nine tenths of the windows.
    """
    root = case.windows.root
    far = np.linalg.norm(root[:, case.target] - root[:, case.start], axis=-1)
    one = case.take([int(np.argsort(far)[int(0.9 * (len(far) - 1))])])
    made = {"likeliest": fill(one, method).motion}
    made |= {f"sample {i}": fill(one, method, seed=i).motion for i in range(1, SHEET_SAMPLES + 1)}
    made["truth"] = one.truth
    notes = {"likeliest": ("the mean of the prior",)}
    return [SheetRow(one.with_keys(each).motions[0], name, notes.get(name, ())) for name, each in made.items()]
