"""`interpose evaluate lafan1`: methods on LaFAN1's test windows, each metric beside interpolation's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from interpose.errors import InputError
from interpose.evaluate import report, tables, windows
from interpose.evaluate.case import COMPARED, Case, check_lengths, scores, truth_scores
from interpose.evaluate.fill import INTERP, Contender, fill, parse
from interpose.evaluate.tables import TRUTH, ResultRow, rows_of
from interpose.evaluate.windows import KNOWN_FRAMES

LAFAN1_LENGTHS = (*windows.OFFICIAL_LENGTHS, 60, 90)
LAFAN1_METRICS = (
    *COMPARED, "foot_slide", "foot_slide_speed", "foot_slide_share", "arrival_position", "key_acceleration"
)  # fmt: skip
LAFAN1_HEADING = """# LaFAN1

Test windows of subject 5: the official protocol (`lafan1`) up to 45 frames, longer windows (`lafan1-extended`) beyond.
*Context* is the number of known frames before the gap. In brackets: the ratio to `interp` on the same windows. With
part of the data set's files only these ratios compare with other tables, not the values. Intervals (95 %, bootstrap
over windows) are in `results.json` and `results.csv`; `interpose.evaluate.metrics` defines each metric.
"""


def evaluate_lafan1(
    data: Path,
    methods: Sequence[str],
    out: Path,
    *,
    lengths: Sequence[int] = LAFAN1_LENGTHS,
    context_frames: int = 1,
    seed: int = 0,
    model: str | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> list[ResultRow]:
    """Run methods on LaFAN1's test windows and write ``results.json``, ``.csv``, ``.md`` and ``l2p.png`` to ``out``.

    data: the folder of LaFAN1's BVH files. methods: as `interpose.evaluate.fill.parse` takes them. lengths: of
    the gaps, in frames. context_frames: 1 to 10, how many frames the models know before the gap, the start key included
    (the baselines know the protocol's ten and use the last). Raises InputError for a method, a length, a context or a
    folder that cannot be served, before anything is written.
    """
    if not 1 <= context_frames <= KNOWN_FRAMES:
        raise InputError(f"the context has 1 to {KNOWN_FRAMES} frames, not {context_frames}")
    check_lengths(lengths, 2)
    chosen = parse(methods, model=model, context_frames=context_frames, reserved=(TRUTH,))
    progress(f"reading {data}")
    rows: list[ResultRow] = []
    for case in windows.cases(windows.read(data), lengths):
        rows += case_rows(case, chosen, seed, progress)
    report.write(rows, out, tables.to_markdown(rows, LAFAN1_HEADING))
    return rows


def case_rows(
    case: Case,
    methods: Sequence[Contender],
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[ResultRow]:
    """All metrics of the recorded motion and of every method on gaps of one length."""
    base = scores(case, fill(case, INTERP).motion, LAFAN1_METRICS)
    rows = rows_of(case.protocol, case.length, {TRUTH: truth_scores(case, LAFAN1_METRICS)}, base, seed, KNOWN_FRAMES)
    for method in methods:
        progress(f"{method.name}: {len(case)} gaps of {case.frames} frames")
        found = base if method is INTERP else scores(case, fill(case, method).motion, LAFAN1_METRICS)
        rows += rows_of(case.protocol, case.length, {method.name: found}, base, seed, method.context_frames)
    return rows
