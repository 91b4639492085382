"""`interpose evaluate dcmoe`: how methods fill LaFAN1's test windows from one start frame, along each kind of path.

:data:`DCMOE_HEADING` names the kinds. Several models of one method are seeds of a training: their mean is shown, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from interpose.errors import InputError
from interpose.evaluate import metrics, report, tables, windows
from interpose.evaluate.case import Case, check_lengths, scores, truth_scores
from interpose.evaluate.fill import INTERP, Contender, fill, guided_paths, parse
from interpose.evaluate.lafan1 import LAFAN1_METRICS
from interpose.evaluate.metrics import Scores
from interpose.evaluate.tables import TRUTH, ResultRow, rows_of
from interpose.render.sheet import SheetRow, contact_sheet
from interpose.runtime.poses import Path as RootPath
from interpose.runtime.request import Request

DCMOE_LENGTHS = (5, 15, 30, 45, 60, 75, 90)
DCMOE_VARIANTS = 8
SHEET_GAPS, SHEET_LENGTHS = 20, (15, 30, 45, 60, 90)
"""Gaps that are drawn beside the truth, and their lengths in turn."""
SHEET_ROWS = 10
"""Rows of one contact sheet."""
BEST_VARIANT_METRICS = ("L2P", "L2Q", "L2Q_aligned", "ADE", "NPSS")
DCMOE_HEADING = """# DC-MoE

LaFAN1's test windows of subject 5 from one start frame, a gap of n frames; in brackets the ratio to `interp` on the
same windows. A name alone is unconstrained; *true path* follows the true root; *auto* is what `--path auto` takes;
*best of 8* is the best of eight variants in each window and metric. *mean* is the mean of several models of one method.
Feet are locked as in use. With part of the data set's files only ratios compare with other tables. Intervals (95 %,
bootstrap over windows) are in `results.json`.
"""


def evaluate_dcmoe(
    data: Path,
    named: Sequence[str],
    out: Path,
    *,
    lengths: Sequence[int] = DCMOE_LENGTHS,
    model: str | None = None,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[ResultRow]:
    """Write ``results.json``, ``.csv``, ``.md``, ``l2p.png`` and ``gaps-1.png`` and so on to ``out``.

    data: the folder of LaFAN1's BVH files. named: as `interpose.evaluate.fill.parse` takes them; ``interp`` is
    always included. Raises InputError for what cannot be served, before anything is written.
    """
    check_lengths(lengths, 2)
    chosen = [one for one in parse(named, model=model, reserved=(TRUTH, "mean")) if one is not INTERP]
    if not all(one.abilities.paths for one in chosen) or not chosen:
        raise InputError(f"--methods {','.join(named)}: name methods that follow paths, such as dcmoe or plan")
    source = windows.read(data)
    rows: list[ResultRow] = []
    for case in windows.cases(source, lengths, 1, "dcmoe"):
        base = scores(case, fill(case, INTERP).motion, LAFAN1_METRICS)
        found = {TRUTH: truth_scores(case, LAFAN1_METRICS), "interp": base}
        kinds: list[dict[str, dict[str, Scores]]] = []
        for one in chosen:
            progress(f"{one.name}: {len(case)} gaps of {case.frames} frames")
            kinds.append(path_scores(case, one, seed))
            found |= {one.name + kind: each for kind, each in kinds[-1].items()}
        if len(chosen) > 1 and len({one.backend.name for one in chosen}) == 1:
            found |= {"mean" + kind: metrics.mean_of_samples([each[kind] for each in kinds]) for kind in kinds[0]}
        rows += rows_of(case.protocol, case.length, found, base, seed)
    report.write(rows, out, tables.to_markdown(rows, DCMOE_HEADING))
    drawn = sheet_rows(source, chosen[0])
    for page, first in enumerate(range(0, len(drawn), SHEET_ROWS), 1):
        contact_sheet(out / f"gaps-{page}.png", drawn[first : first + SHEET_ROWS])
    return rows


def path_scores(case: Case, contender: Contender, seed: int) -> dict[str, dict[str, Scores]]:
    """The scores of each kind of path, by what is added to the contender's name."""
    automatic = Request(contender.backend.name, contender.model, seed=seed)
    kinds: dict[str, Sequence[RootPath | None] | None]
    kinds = {"": None, " true path": case.true_paths, " auto": guided_paths(case, automatic)}
    out = {
        kind: scores(case, fill(case, contender, paths=paths).motion, LAFAN1_METRICS) for kind, paths in kinds.items()
    }
    variants = [fill(case, contender, seed=1 + seed + i).motion for i in range(DCMOE_VARIANTS)]
    each = [scores(case, motion, BEST_VARIANT_METRICS) for motion in variants]
    return out | {f" best of {DCMOE_VARIANTS}": metrics.best_of_samples(each, BEST_VARIANT_METRICS)}


def sheet_rows(source: windows.LaFAN1, contender: Contender) -> list[SheetRow]:
    """:data:`SHEET_GAPS` test gaps, spread over the files, each filled one below the truth."""
    rows: list[SheetRow] = []
    for number in range(SHEET_GAPS):
        frames = SHEET_LENGTHS[number % len(SHEET_LENGTHS)]
        (case,) = windows.cases(source, [frames])
        case = case.take([number * len(case) // SHEET_GAPS])
        made = fill(case, contender).motion
        rows.append(
            SheetRow(case.with_keys(case.truth).motions[0], f"gap {number + 1}: {frames} frames", ("the truth",))
        )
        rows.append(SheetRow(case.with_keys(made).motions[0], f"gap {number + 1}", (f"made by {contender.name}",)))
    return rows
