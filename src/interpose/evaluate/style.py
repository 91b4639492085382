"""`interpose evaluate style`: does the motion show the style that was asked for? A classifier judges.

The judge is trained on frames that the generator never saw: the ends of clips that trainings hold out. Gaps are cut
where it was not trained, in the same clips' training parts, and a smaller set within the held-out ends themselves,
where the keys are new to the generator too: there two judges take turns, each trained on one half of every end, each
judging gaps of the other half. What is judged is the middle second of a gap, half a second or more from its keys.

A style is asked for between two keys that show it (`own`) and between two keys that show another one (`other`). Beside
the model's answers stand the recorded motion, the interpolation of the keys, and the model with its style left free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int, Int64
from numpy import ndarray

from interpose.data import style_windows
from interpose.data.database import Database
from interpose.data.split import Ranges, training_ranges
from interpose.errors import InputError
from interpose.evaluate import metrics, style_tables, tables
from interpose.evaluate.fill import INTERP, Contender, fill
from interpose.evaluate.tables import Row
from interpose.runtime.gap_batch import Batch
from interpose.runtime.methods import backend_of
from interpose.runtime.model_folder import Session
from interpose.runtime.request import MAX_STYLE_STRENGTH

LENGTHS = (60, 90)
WINDOW = 30
"""Frames that the judge sees: one second, the middle of a gap."""
GAPS, FEWEST = 120, 4
"""Gaps of one length in all, evenly over the styles and their clips, and of one style at least."""
OTHERS = 3
"""Styles that are asked for between keys of another one: so many of them a gap, by turns."""
JUDGE_OFFSET, KEY_OFFSET = 3, 10
"""Frames from one window to the next: of the judge's training, and of gaps to choose from."""
STEPS = 400
"""Updates of the judge's training."""
ROWS = 128
"""Gaps that are generated at once."""


@dataclass(frozen=True)
class Side:
    """A judge, and gaps for it. judge: what it is trained on. keys: where the gaps are. unseen: by the generator."""

    judge: Ranges
    keys: Ranges
    unseen: bool = False


@dataclass(frozen=True, eq=False)
class Gaps:
    """Gaps of one length, both keys included, the style that each shows, and the styles to ask for in its place."""

    root: Float[ndarray, "gap frame 3"]
    local: Float[ndarray, "gap frame 22 4"]
    shows: Int64[ndarray, "gap"]
    others: Int64[ndarray, "gap ask"]

    def __len__(self) -> int:
        return len(self.root)


@dataclass(frozen=True, eq=False)
class Verdicts:
    """What the judge called gaps of one kind: style indices asked for and called."""

    case: str
    method: str
    frames: int
    unseen: bool
    asked: Int64[ndarray, "gap"]
    called: Int64[ndarray, "gap"]


@dataclass(frozen=True, eq=False)
class Found:
    """All verdicts, and how a judge does on recorded windows: for each the style shown and the one called."""

    styles: list[str]
    verdicts: list[Verdicts]
    shown: Int64[ndarray, "window"]
    called: Int64[ndarray, "window"]


def evaluate_style(
    database: Database,
    session: Session,
    out: Path,
    *,
    strengths: Sequence[float] = (1.0,),
    lengths: Sequence[int] = LENGTHS,
    part: str = "held-out",
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[Row]:
    """Run the comparison of the module's text; ``results.json``, ``.csv``, ``.md`` and ``confusion.png`` in ``out``.

    strengths: of the style, as `--style-strength`. part: 'held-out', or 'all' for a database that the model was not
    trained on, or of clips so short that nothing is held out: then every clip has two halves that judge one another.
    Raises InputError for another part, strengths out of range, lengths below the judged second, and fewer than two
    styles that both database and model know and that can be judged.
    """
    if part not in ("all", "held-out"):
        raise InputError(f"unknown part '{part}' of a database; use all or held-out")
    if not strengths or not all(0.0 <= strength <= MAX_STYLE_STRENGTH for strength in strengths):
        raise InputError(
            f"a style's strength is 0 to {MAX_STYLE_STRENGTH:g}, got {', '.join(f'{s:g}' for s in strengths)}"
        )
    if not lengths or min(lengths) < WINDOW:
        raise InputError(f"gaps that are judged have {WINDOW} frames or more, got {', '.join(map(str, lengths))}")
    found = judged(database, session, sides(database, part), strengths, sorted(set(lengths)), seed, progress)
    rows = [row for verdicts in found.verdicts for row in _rows(verdicts, found.styles, seed)]
    style_tables.write(found, rows, session.name, out)
    return rows


def sides(database: Database, part: str) -> list[Side]:
    """Which frames train judges, and where they judge. Raises InputError where the database holds nothing out."""
    if part == "all":
        halves = [_halves([(a, b)]) for a, b in database.ranges.tolist() if b - a >= 2 * WINDOW]
        first, second = [h[0][0] for h in halves], [h[1][0] for h in halves]
        return [Side(first, second), Side(second, first)]
    training, ends = training_ranges(database)
    if ends[0] in training:
        raise InputError(f"{database.path}: its clips are too short to hold anything out; --part all judges by halves")
    spared = {start for start, _ in ends}
    first, second = _halves(ends)
    return [
        Side(ends, [(a, b) for a, b in training if b in spared]),
        Side(first, second, unseen=True),
        Side(second, first, unseen=True),
    ]


def judged(
    database: Database,
    session: Session,
    chosen: list[Side],
    strengths: Sequence[float],
    lengths: Sequence[int],
    seed: int,
    progress: Callable[[str], None],
) -> Found:
    """Every side's judge trained, every gap generated and judged."""
    from interpose.train.style.classifier import Recipe, fit, probabilities

    seen = style_windows.database_channels(database)
    styles = _styles(database, session, chosen)
    index = {style: i for i, style in enumerate(styles)}
    of_clip = np.array([index.get(clip.style, -1) for clip in database.clips])

    def labelled(ranges: Ranges, length: int, offset: int) -> tuple[Int64[ndarray, "window"], Int64[ndarray, "window"]]:
        starts = style_windows.window_starts(ranges, length, offset)
        label = of_clip[np.searchsorted(database.ranges[:, 0], starts, side="right") - 1]
        return starts[label >= 0], label[label >= 0]

    verdicts: list[Verdicts] = []
    shown: list[ndarray] = []
    said: list[ndarray] = []
    for number, side in enumerate(chosen):
        starts, label = labelled(side.judge, WINDOW, JUDGE_OFFSET)
        progress(f"training judge {number + 1} of {len(chosen)} on {len(starts)} windows")
        model = fit(seen, starts, label, len(styles), Recipe(WINDOW, steps=STEPS), seed)

        def call(windows: Float32[ndarray, "gap frame 132"], model=model) -> Int64[ndarray, "gap"]:
            flat = windows.reshape(-1, windows.shape[-1])
            return probabilities(model, flat, np.arange(len(windows)) * WINDOW).argmax(axis=1)

        if not side.unseen:
            starts, label = labelled(side.keys, WINDOW, 2 * KEY_OFFSET)
            shown.append(label)
            said.append(probabilities(model, seen, starts).argmax(axis=1))
        for frames in lengths:
            gaps = cut(database, *labelled(side.keys, frames + 2, KEY_OFFSET), frames, len(styles))
            if len(gaps):
                progress(f"{len(gaps)} gaps of {frames} frames{', keys unseen' if side.unseen else ''}")
                verdicts += _case(session, gaps, styles, strengths, seed, call, frames, side.unseen)
    return Found(styles, _joined(verdicts), np.concatenate(shown), np.concatenate(said))


def cut(
    database: Database, starts: Int64[ndarray, "window"], shows: Int64[ndarray, "window"], frames: int, styles: int
) -> Gaps:
    """At most :data:`GAPS` of the gaps that begin at ``starts``, as many of each style."""
    most = max(FEWEST, GAPS // styles)
    picked: list[int] = []
    for style in range(styles):
        mine = np.flatnonzero(shows == style)
        picked += mine[np.unique(np.linspace(0, len(mine) - 1, most).astype(int))].tolist() if len(mine) else []
    recorded = [database.motion(int(starts[i]), int(starts[i]) + frames + 2) for i in picked]
    asks = min(OTHERS, styles - 1)
    turn = np.arange(len(picked))[:, None] * asks + np.arange(asks)
    others = (shows[picked][:, None] + 1 + turn % (styles - 1)) % styles
    root = np.stack([m.root_positions for m in recorded]) if recorded else np.zeros((0, frames + 2, 3))
    local = np.stack([m.local_rotations for m in recorded]) if recorded else np.zeros((0, frames + 2, 22, 4))
    return Gaps(root, local, shows[picked], others)


def middle(
    root: Float[ndarray, "gap frame 3"], local: Float[ndarray, "gap frame 22 4"]
) -> Float32[ndarray, "gap _ 132"]:
    """What the judge sees of motions with both keys: their middle :data:`WINDOW` frames."""
    first = (root.shape[1] - WINDOW) // 2
    return style_windows.style_channels(root, local)[:, first : first + WINDOW]


def _case(
    session: Session,
    gaps: Gaps,
    styles: list[str],
    strengths: Sequence[float],
    seed: int,
    call: Callable[[ndarray], Int64[ndarray, "gap"]],
    frames: int,
    unseen: bool,
) -> list[Verdicts]:
    """Every method on gaps of one length, between their own style's keys and as other styles' keys."""
    every = np.arange(len(gaps))
    rows = np.repeat(every, gaps.others.shape[1])
    elsewhere = gaps.others.flatten()
    keys = (gaps.root[:, :1], gaps.local[:, :1]), (gaps.root[:, -1:], gaps.local[:, -1:])
    bare = fill(INTERP, *keys, frames).motion
    untold = {
        "recorded": call(middle(gaps.root, gaps.local)),
        "interp": call(middle(*_with_keys(gaps, every, bare))),
        "free": call(_filled(session, gaps, every, [None] * len(gaps), 1.0, seed)),
    }
    out = []
    for name, called in untold.items():
        out.append(Verdicts("own", name, frames, unseen, gaps.shows, called))
        out.append(Verdicts("other", name, frames, unseen, elsewhere, called[rows]))
    for strength in strengths:
        name = f"x{strength:g}"
        for case, asked, where in (("own", gaps.shows, every), ("other", elsewhere, rows)):
            made = _filled(session, gaps, where, [styles[i] for i in asked], strength, seed)
            out.append(Verdicts(case, name, frames, unseen, asked, call(made)))
    return out


def _filled(
    session: Session,
    gaps: Gaps,
    rows: Int[ndarray, "row"],
    asked: Sequence[str | None],
    strength: float,
    seed: int,
) -> Float32[ndarray, "row _ 132"]:
    """What the judge sees of those gaps filled by the model: one known frame, its own way, feet planted."""
    contender = Contender(session.name, backend_of(session.method), session)
    out = []
    for at in range(0, len(rows), ROWS):
        part = rows[at : at + ROWS]
        start, end = (gaps.root[part, :1], gaps.local[part, :1]), (gaps.root[part, -1:], gaps.local[part, -1:])
        made = fill(
            contender,
            start,
            end,
            gaps.root.shape[1] - 2,
            styles=list(asked[at : at + ROWS]),
            style_strength=strength,
        )
        out.append(middle(*_with_keys(gaps, part, made.motion)))
    return np.concatenate(out)


def _with_keys(gaps: Gaps, rows: Int[ndarray, "row"], made: Batch) -> Batch:
    """Filled frames between the gaps' keys."""
    root = np.concatenate([gaps.root[rows, :1], made[0], gaps.root[rows, -1:]], axis=1)
    return root, np.concatenate([gaps.local[rows, :1], made[1], gaps.local[rows, -1:]], axis=1)


def _styles(database: Database, session: Session, chosen: list[Side]) -> list[str]:
    """The styles that the model knows and every judge can learn. Raises InputError for fewer than two."""
    first = database.ranges[:, 0]
    taught = []
    for side in chosen:
        starts = style_windows.window_starts(side.judge, WINDOW, JUDGE_OFFSET)
        taught.append({database.clips[i].style for i in np.searchsorted(first, starts, side="right") - 1})
    styles = [style for style in database.styles if style in session.styles and all(style in t for t in taught)]
    if len(styles) < 2:
        raise InputError(
            f"{database.path}: of the styles of the model '{session.name}' ({', '.join(session.styles) or 'none'}) it "
            f"holds out {', '.join(styles) or 'none'}; judging needs two; --part all judges by the halves of all clips"
        )
    return styles


def _halves(ranges: Ranges) -> tuple[Ranges, Ranges]:
    return [(a, (a + b) // 2) for a, b in ranges], [((a + b) // 2, b) for a, b in ranges]


def _joined(verdicts: list[Verdicts]) -> list[Verdicts]:
    """Those of several judges on gaps of one kind as one."""
    kinds: dict[tuple[str, str, int, bool], list[Verdicts]] = {}
    for each in verdicts:
        kinds.setdefault((each.case, each.method, each.frames, each.unseen), []).append(each)
    return [
        Verdicts(*kind, np.concatenate([v.asked for v in same]), np.concatenate([v.called for v in same]))
        for kind, same in kinds.items()
    ]


def _rows(verdicts: Verdicts, styles: list[str], seed: int) -> list[Row]:
    """The share of gaps that were called what was asked for: over all styles, and for each."""
    right = (verdicts.asked == verdicts.called).astype(float)
    scores = {"style_called": metrics.mean(right[:, None])}
    for i, style in enumerate(styles):
        if np.any(verdicts.asked == i):
            scores[f"style_called/{style}"] = metrics.mean(right[verdicts.asked == i][:, None])
    protocol = f"style-{verdicts.case}-keys" + ("-unseen" if verdicts.unseen else "")
    return list(tables.scored(scores, {}, verdicts.method, protocol, verdicts.frames, 1, seed))
