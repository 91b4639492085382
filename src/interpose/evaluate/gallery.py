"""`interpose evaluate gallery`: how well the paths and durations of a gallery perform on gaps that it has not seen.

The model fills each gap along paths of the true duration: none, a straight one, the trajectory that `--path gallery`
takes, a direct candidate drawn at random (the paper's Algorithm 1), and the true root's. docs/evaluation.md has more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.data.database import Database
from interpose.data.split import Ranges, training_ranges
from interpose.errors import InputError
from interpose.evaluate import metrics, report, tables
from interpose.evaluate.case import Case, database_windows, scores, truth_scores
from interpose.evaluate.fill import INTERP, Contender, fill, guided_paths
from interpose.evaluate.metrics import Scores
from interpose.evaluate.tables import TRUTH, ResultRow, rows_of
from interpose.gallery import matching, paths, proposals
from interpose.gallery.paths import query_of
from interpose.gallery.proposals import PathRequest, Unreachable
from interpose.gallery.store import Gallery
from interpose.gallery.weighing import NOTHING_KNOWN, gather
from interpose.gallery.windows import select
from interpose.runtime.backends.backend import backend_of
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path as RootPath
from interpose.runtime.request import Request
from interpose.runtime.transition import path_deviation

GALLERY_LENGTHS = (30, 45, 60, 90)
GAP_OFFSET, HELD_OUT_GAP_OFFSET = 40, 12
"""Frames from one window to the next; fewer where only the ends of clips are used."""
MOST_GALLERY_GAPS = 400
"""Gaps of one length at most, evenly spaced."""
GALLERY_VARIANTS, DIVERSITY_GAPS = 7, 40
"""Variants of a gap, and gaps of a length, for the diversity."""
GALLERY_METRICS = ("L2P", "ADE", "foot_slide", "jerk_ratio")
GALLERY_HEADING = """# Paths and durations

One start frame, paths of the true duration, feet locked. In brackets: the ratio to `interp` on the same windows. L2P is
scaled by the deviation of each coordinate over these windows, so only its ratios compare with other tables. *none* is
without a path, *gallery* along the trajectory that `--path gallery` takes, *random* along a direct candidate as
Algorithm 1 of the paper draws it, *phases* variants that differ by their start phases alone. Intervals (95 %, bootstrap
over windows) are in `results.json` and `results.csv`.
"""


def evaluate_gallery(
    database: Database,
    gallery: Gallery,
    session: Session,
    out: Path,
    *,
    part: str = "all",
    lengths: Sequence[int] = GALLERY_LENGTHS,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[ResultRow]:
    """Write ``results.json``, ``.csv``, ``.md`` and ``l2p.png`` to ``out``.

    part: 'all' of the database, or 'held-out', the ends of the clips that trainings hold out. Raises InputError for
    another part and where no clip is long enough.
    """
    if part not in ("all", "held-out"):
        raise InputError(f"unknown part '{part}' of a database; use all or held-out")
    ranges = [(int(a), int(b)) for a, b in database.ranges] if part == "all" else training_ranges(database)[1]
    rows: list[ResultRow] = []
    errors = []
    for frames in sorted(set(lengths)):
        case = cut(database, ranges, frames, GAP_OFFSET if part == "all" else HELD_OUT_GAP_OFFSET)
        progress(f"{len(case)} gaps of {frames} frames")
        rows += case_rows(case, gallery, session, seed)
        errors.append(duration_errors(case, gallery, seed))
        rows += _duration_rows(errors[-1], frames, seed)
    rows += _duration_rows(np.concatenate(errors), 0, seed)
    report.write(rows, out, tables.to_markdown(rows, GALLERY_HEADING))
    return rows


def cut(database: Database, ranges: Ranges, frames: int, offset: int) -> Case:
    """The gaps of ``frames`` frames in those ranges, one each ``offset`` frames, :data:`MOST_GALLERY_GAPS` at most.

    Each is moved so that the mean of its root is the origin of the ground, and turned to begin facing +Z. Raises
    InputError where there is none.
    """
    starts = np.array([s for a, b in ranges for s in range(a, b - frames - 1, offset)], dtype=np.int64)
    if not len(starts):
        raise InputError(f"{database.path}: no range of it holds a gap of {frames} frames; use shorter gaps")
    starts = starts[np.unique(np.linspace(0, len(starts) - 1, MOST_GALLERY_GAPS).astype(int))]
    recorded = database_windows(database, starts.tolist(), frames + 2)
    root, local = recorded.batch
    turn = rotation.inverse(rotation.twist(local[:, 0, 0], np.array([0.0, 1.0, 0.0])))[:, None]
    root = rotation.rotate(turn, root - root.mean(axis=1, keepdims=True) * [1.0, 0.0, 1.0])
    local[:, :, 0] = rotation.multiply(turn, local[:, :, 0])
    windows = replace(recorded, root=root, local=local)
    return Case("gallery", frames, windows, 0, frames + 1, scale=windows.positions.std(axis=(0, 1)) + 1e-6)


def case_rows(case: Case, gallery: Gallery, session: Session, seed: int = 0) -> list[ResultRow]:
    """All rows of one length but those of the durations."""
    contender = Contender(session.name, backend_of(session.method), session)
    steps, true = case.frames + 1, case.true_paths
    matched = Request(session.method, session, gallery=gallery, path="gallery", seed=seed)
    kinds: dict[str, Sequence[RootPath | None]] = {
        "none": [None] * len(case),
        "straight": [paths.straight(query_of(path), steps) for path in true],
        "random": [_random(gallery, path, seed + row) for row, path in enumerate(true)],
        "gallery": guided_paths(case, matched),
        "true": true,
    }
    base = scores(case, fill(case, INTERP).motion, GALLERY_METRICS)
    found = {"interp": base, TRUTH: truth_scores(case, GALLERY_METRICS)}
    for name, chosen in kinds.items():
        made = fill(case, contender, paths=chosen).motion
        found[name] = scores(case, made, GALLERY_METRICS)
        away = [path_deviation(root, path) for root, path in zip(made.root, chosen, strict=True) if path is not None]
        if away:
            found[name]["path_deviation"] = metrics.mean(np.array(away)[:, None])
    return rows_of(case.protocol, case.length, found, base, seed) + rows_of(
        case.protocol, case.length, _diversity(case, gallery, contender, seed), {}, seed
    )


def _random(gallery: Gallery, true: RootPath, seed: int) -> RootPath | None:
    """A direct candidate of about the true duration, drawn at random (Algorithm 1, line 25)."""
    draw, steps = np.random.default_rng(seed), len(true) - 1
    query, lengths = query_of(true), (int(steps / 1.1), int(np.ceil(steps * 1.1)))
    pool = gather(gallery, query, NOTHING_KNOWN, lengths, None, draw)
    if not len(pool):
        return None
    (trace,) = matching.traces(select(pool.found, draw.integers(len(pool), size=1)))
    return paths.retime(paths.place(gallery.tracks, trace, query), steps)


def duration_errors(case: Case, gallery: Gallery, seed: int = 0) -> Float[ndarray, "gap"]:
    """How far the suggested duration is from the true one, as a share of it; infinite where none can be suggested."""
    steps, away = case.frames + 1, []
    for path, gap in zip(case.true_paths, case.gaps, strict=True):
        try:
            away.append(abs(proposals.suggestion(gallery, query_of(path), gap.ends, None, seed).steps - steps) / steps)
        except Unreachable:
            away.append(np.inf)
    return np.array(away)


def _duration_rows(away: Float[ndarray, "gap"], frames: int, seed: int) -> list[ResultRow]:
    """Median error and share within 20 %; ``frames`` 0 stands for all lengths together."""
    drawn = away[np.random.default_rng(seed).integers(0, len(away), size=(1000, len(away)))]
    found = {
        "duration_error_median": (float(np.median(away)), np.median(drawn, axis=1)),
        "duration_within_20": (float(np.mean(away <= 0.2)), np.mean(drawn <= 0.2, axis=1)),
    }
    none = float("nan")
    return [
        ResultRow("gallery", "gallery", frames, name, value, none, *metrics.interval(draws), 1, none, none)
        for name, (value, draws) in found.items()
    ]


def _diversity(case: Case, gallery: Gallery, contender: Contender, seed: int) -> dict[str, dict[str, Scores]]:
    """Mean distance between the generated roots of seven variants, metres: along proposals, and from start phases."""
    apart: dict[str, list[float]] = {"gallery": [], "phases": []}
    for row in np.unique(np.linspace(0, len(case) - 1, DIVERSITY_GAPS).astype(int)).tolist():
        request, found = PathRequest(case.frames + 1), []
        try:
            query, ends = query_of(case.true_paths[row]), case.gaps[row].ends
            found = proposals.propose(gallery, query, request, ends, count=GALLERY_VARIANTS, seed=seed)
        except Unreachable:
            pass
        kinds = {"gallery": [one.path for one in found], "phases": [None] * GALLERY_VARIANTS}
        for name, variants in kinds.items():
            if len(variants) < 2:
                apart[name].append(0.0)
                continue
            made = fill(case.take([row] * len(variants)), contender, paths=variants, seed=seed + 1).motion
            ground = made.root * [1.0, 0.0, 1.0]
            apart[name].append(metrics.apd(ground[:, None, :, None]).value)
    return {name: {"diversity": metrics.mean(np.array(values)[:, None])} for name, values in apart.items()}
