"""`interpose evaluate dcmoe`: how DC-MoE fills LaFAN1's test windows from one start frame, along each kind of path.

The windows are the protocol's (`interpose.evaluate.lafan1`), up to gaps of 90 frames. Each model fills them without a
path, along the true root's path, along what `--path auto` takes, and as eight variants, of which the best counts.
Several models are several seeds of one training: their mean is shown, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from pathlib import Path

from interpose.errors import InputError
from interpose.evaluate import lafan1, metrics, run, tables
from interpose.evaluate.fill import INTERP, Carrier, Contender, fill, parse
from interpose.evaluate.metrics import Scores
from interpose.evaluate.run import Case
from interpose.evaluate.tables import Row
from interpose.gallery.tracks import track_of
from interpose.motion import Motion, concatenate
from interpose.render import sheet
from interpose.retarget import map_skeleton
from interpose.runtime import guidance
from interpose.runtime.gap_batch import Batch, Draw
from interpose.runtime.guidance import Gap
from interpose.runtime.poses import Path as RootPath
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID

PROTOCOL = "dcmoe"
LENGTHS = (5, 15, 30, 45, 60, 75, 90)
VARIANTS = 8
SHEETS, SHEET_LENGTHS = 20, (15, 30, 45, 60, 90)
"""Gaps that are drawn beside the truth, and their lengths in turn."""
BEST = ("L2P", "L2Q", "L2Q_aligned", "ADE", "NPSS")
HEADING = """# DC-MoE

LaFAN1's test windows of subject 5 from one start frame, a gap of n frames; in brackets the ratio to `interp` on the
same windows. A name alone is unconstrained; *true path* follows the true root; *auto* is what `--path auto` takes;
*best of 8* is the best of eight variants in each window and metric. *mean* is the mean of all models given, seeds of
one training. Feet are planted as in use. With part of the data set's files only ratios compare with other tables.
Intervals (95 %, bootstrap over windows) are in `results.json`.
"""


def evaluate_dcmoe(
    data: Path,
    named: Sequence[str],
    out: Path,
    *,
    lengths: Sequence[int] = LENGTHS,
    model: str | None = None,
    auto: bool = True,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[Row]:
    """Writes ``results.json``, ``.csv``, ``.md``, ``l2p.png`` and ``gaps-1.png`` and so on to ``out``.

    data: the folder of LaFAN1's BVH files. named: as `interpose.evaluate.fill.parse` takes them; ``interp`` is always
    there. auto: whether the gallery's paths are tried, which takes longest. Raises InputError for what cannot be
    served, before anything is written.
    """
    if not lengths or min(lengths) < 2:
        raise InputError(f"gaps have 2 frames or more, got {', '.join(map(str, lengths)) or 'none'}")
    subjects = [one for one in parse(named, model=model, reserved=(run.TRUTH, "mean")) if one is not INTERP]
    if not all(one.abilities.paths for one in subjects) or not subjects:
        raise InputError(f"--methods {','.join(named)}: name methods that follow paths, such as dcmoe or plan")
    source = lafan1.read(data)
    first = source.clips[0]
    carrier = Carrier(first.skeleton, first.rate, map_skeleton(first.skeleton))
    rows: list[Row] = []
    for window, group in groupby(sorted(set(lengths)), lafan1.window_length):
        windows = lafan1.cut(source.clips, window)
        for frames in group:
            case = Case(windows, frames, source.scale)
            rows += _case_rows(case, carrier, subjects, auto, seed, progress)
    tables.write(rows, out, HEADING)
    draw_gaps(source, carrier, subjects[0], out)
    return rows


def _case_rows(
    case: Case,
    carrier: Carrier,
    subjects: Sequence[Contender],
    auto: bool,
    seed: int,
    progress: Callable[[str], None],
) -> Iterator[Row]:
    base = run.scores(case, INTERP, carrier)
    yield from tables.scored(run.truth_scores(case), {}, run.TRUTH, PROTOCOL, case.frames, 1, seed)
    yield from tables.scored(base, base, "interp", PROTOCOL, case.frames, 1, seed)
    together: dict[str, list[dict[str, Scores]]] = {}
    for subject in subjects:
        progress(f"{subject.name}: {len(case.windows)} gaps of {case.frames} frames")
        for kind, found in _kinds(case, carrier, subject, auto, seed).items():
            together.setdefault(kind, []).append(found)
            yield from tables.scored(found, base, subject.name + kind, PROTOCOL, case.frames, 1, seed)
    if len(subjects) > 1:
        for kind, several in together.items():
            pooled = {name: metrics.pooled([each[name] for each in several]) for name in several[0]}
            yield from tables.scored(pooled, base, "mean" + kind, PROTOCOL, case.frames, 1, seed)


def _kinds(case: Case, carrier: Carrier, model: Contender, auto: bool, seed: int) -> dict[str, dict[str, Scores]]:
    """The scores of each kind of path, by what is added to a model's name."""
    true = _true_paths(case, carrier)
    out = {
        "": run.judged(case, *_filled(case, carrier, model, None)),
        " true path": run.judged(case, *_filled(case, carrier, model, true)),
    }
    if auto:
        out[" auto"] = run.judged(case, *_filled(case, carrier, model, _auto_paths(case, carrier, model, seed)))
    several = [run.judged(case, *_filled(case, carrier, model, None, 1 + seed + i)) for i in range(VARIANTS)]
    out[f" best of {VARIANTS}"] = {name: metrics.best([each[name] for each in several]) for name in BEST}
    return out


def _keys(case: Case) -> tuple[Batch, Batch]:
    """Start and target, one frame each."""
    w = case.windows
    at = (slice(case.start, case.start + 1), slice(case.target, case.target + 1))
    return (w.root[:, at[0]], w.local[:, at[0]]), (w.root[:, at[1]], w.local[:, at[1]])


def _filled(
    case: Case,
    carrier: Carrier,
    model: Contender,
    paths: Sequence[RootPath | None] | None,
    variant: int | None = None,
) -> Batch:
    """The frames between the keys on the data's skeleton, feet locked; ``variant``: the seed of one."""
    drawn: list[Draw] = [None if variant is None else (variant, row) for row in range(len(case.windows))]
    return fill(model, *_keys(case), case.frames, carrier=carrier, paths=paths, draws=drawn).motion


def _true_paths(case: Case, carrier: Carrier) -> list[RootPath]:
    """The true root's path in each window, keys included."""
    inner = slice(case.start, case.target + 1)
    root, local = carrier.onto((case.windows.root[:, inner], case.windows.local[:, inner]))
    return [track_of(Motion(HUMANOID, r, q, case.windows.rate)) for r, q in zip(root, local, strict=True)]


def _auto_paths(case: Case, carrier: Carrier, model: Contender, seed: int) -> list[RootPath | None]:
    """What `--path auto` takes in each window."""
    start, end = (carrier.onto(key) for key in _keys(case))
    pairs = zip(*start, *end, strict=True)
    gaps = [
        Gap(Motion(HUMANOID, a, b, case.windows.rate), Motion(HUMANOID, c, d, case.windows.rate))
        for a, b, c, d in pairs
    ]
    request = Request(model.backend.name, model.model, seed=seed)
    return [guidance.guide(request, gap, case.frames + 1, 1)[0].path for gap in gaps]


def draw_gaps(source: lafan1.Data, carrier: Carrier, model: Contender, out: Path) -> list[Path]:
    """Contact sheets of :data:`SHEETS` test gaps, spread over the files, each below the truth: five gaps a sheet."""
    rows: list[sheet.SheetRow] = []
    for number in range(SHEETS):
        frames = SHEET_LENGTHS[number % len(SHEET_LENGTHS)]
        windows = lafan1.cut(source.clips, lafan1.window_length(frames))
        at = (number * len(windows)) // SHEETS
        one = windows.one(at)
        case = Case(one, frames, source.scale)
        root, local = _filled(case, carrier, model, None)
        true = Motion(one.skeleton, one.root[0], one.local[0], one.rate)[case.start : case.target + 1]
        made = concatenate(true[0], Motion(one.skeleton, root[0], local[0], one.rate), true[-1])
        rows.append(sheet.SheetRow(true, f"gap {number + 1}: {frames} frames", ("the truth",)))
        rows.append(sheet.SheetRow(made, f"gap {number + 1}", (f"made by {model.name}",)))
    written = []
    for page in range(0, len(rows), 10):
        written.append(out / f"gaps-{page // 10 + 1}.png")
        sheet.contact_sheet(written[-1], rows[page : page + 10])
    return written
