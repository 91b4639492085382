"""`interpose evaluate style`: whether a classifier recognises the requested style in the generated motion.

It sees the middle second of a gap, half a second or more from the keys, which show the style (`own`) or another one
(`other`). Beside the model stand the recorded motion, interpolation, and the model with its style left free.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Int64
from numpy import ndarray

from interpose.data import style_windows
from interpose.data.database import Database
from interpose.data.split import Ranges, training_ranges
from interpose.errors import InputError
from interpose.evaluate import figures, metrics, report, style_tables
from interpose.evaluate.case import Case, Windows, check_lengths, database_windows
from interpose.evaluate.fill import INTERP, Contender, fill
from interpose.evaluate.style_tables import StyleKind, StyleResults
from interpose.evaluate.tables import ResultRow, rows_of
from interpose.runtime.backends.backend import backend_of
from interpose.runtime.model_folder import Session
from interpose.runtime.request import MAX_STYLE_STRENGTH

STYLE_LENGTHS = (60, 90)
CLASSIFIED_FRAMES = 30
"""Frames that the classifier sees: one second, the middle of a gap."""
MOST_STYLE_GAPS, FEWEST_STYLE_GAPS = 120, 4
"""Gaps of one length in all, evenly over the styles and their clips, and of one style at least."""
OTHER_STYLES = 3
"""Styles that are requested between keys of another one: so many of them a gap, by turns."""
TRAINING_OFFSET, STYLE_GAP_OFFSET = 3, 10
"""Frames from one window to the next: of the classifier's training, and of gaps to choose from."""
CLASSIFIER_STEPS = 400
"""Updates of the classifier's training."""


@dataclass(frozen=True)
class ClassifierSplit:
    """The frames that a classifier is trained on, and those of the gaps that it is tested on.

    unseen: whether the generator was not trained on the gaps' keys.
    """

    training: Ranges
    gaps: Ranges
    unseen: bool = False


@dataclass(frozen=True, eq=False)
class StyleGaps:
    """Gaps of one length, the style that each shows, and the styles to request in its place."""

    case: Case
    shown: Int64[ndarray, "gap"]
    others: Int64[ndarray, "gap other"]


def evaluate_style(
    database: Database,
    session: Session,
    out: Path,
    *,
    strengths: Sequence[float] = (1.0,),
    lengths: Sequence[int] = STYLE_LENGTHS,
    part: str = "held-out",
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[ResultRow]:
    """Write ``results.json``, ``.csv``, ``.md`` and ``confusion.png`` to ``out``.

    strengths: of the style, as `--style-strength`. part: 'held-out', or 'all' for a database that the model was not
    trained on, or of clips so short that nothing is held out: then classifiers are trained and tested on the halves of
    every clip. Raises InputError for another part, strengths out of range, lengths below the classified second, and
    fewer than two styles that both database and model know and that can be classified.
    """
    if part not in ("all", "held-out"):
        raise InputError(f"unknown part '{part}' of a database; use all or held-out")
    if not strengths or not all(0.0 <= strength <= MAX_STYLE_STRENGTH for strength in strengths):
        given = ", ".join(f"{strength:g}" for strength in strengths)
        raise InputError(f"a style's strength is 0 to {MAX_STYLE_STRENGTH:g}, got {given}")
    check_lengths(lengths, CLASSIFIED_FRAMES)
    chosen = splits(database, part)
    found = classify(database, session, chosen, strengths, sorted(set(lengths)), seed, progress)
    rows = [row for kind, pairs in found.predictions.items() for row in _rows(kind, pairs, found.styles, seed)]
    report.write(rows, out, style_tables.to_markdown(found, session.name))
    figures.draw_confusion(style_tables.matrices(found), found.styles, out / "confusion.png")
    return rows


def splits(database: Database, part: str) -> list[ClassifierSplit]:
    """Which frames train classifiers, and which test them. Raises InputError where the database holds nothing out.

    One is trained on the ends of clips that trainings hold out, which the generator never saw, and tested on the rest
    of these clips. Two take turns on the halves of the ends, where the keys are new to the generator too.
    """
    if part == "all":
        halves = [_halves([(a, b)]) for a, b in database.ranges.tolist() if b - a >= 2 * CLASSIFIED_FRAMES]
        first, second = [h[0][0] for h in halves], [h[1][0] for h in halves]
        return [ClassifierSplit(first, second), ClassifierSplit(second, first)]
    training, ends = training_ranges(database)
    if ends[0] in training:
        raise InputError(f"{database.path}: its clips are too short to hold anything out; --part all tests by halves")
    cut_at = {start for start, _ in ends}
    first, second = _halves(ends)
    return [
        ClassifierSplit(ends, [(a, b) for a, b in training if b in cut_at]),
        ClassifierSplit(first, second, unseen=True),
        ClassifierSplit(second, first, unseen=True),
    ]


def _halves(ranges: Ranges) -> tuple[Ranges, Ranges]:
    return [(a, (a + b) // 2) for a, b in ranges], [((a + b) // 2, b) for a, b in ranges]


def classify(
    database: Database,
    session: Session,
    chosen: list[ClassifierSplit],
    strengths: Sequence[float],
    lengths: Sequence[int],
    seed: int,
    progress: Callable[[str], None],
) -> StyleResults:
    """Train the classifier of every split, generate its gaps and classify them."""
    from interpose.train.style.classifier import Recipe, fit, probabilities

    channels = style_windows.database_channels(database)
    styles = _styles(database, session, chosen)
    index = {style: i for i, style in enumerate(styles)}
    contender = Contender(session.name, backend_of(session.method), session)

    def labelled(ranges: Ranges, length: int, offset: int) -> tuple[Int64[ndarray, "window"], Int64[ndarray, "window"]]:
        starts, shown = _styled_windows(database, ranges, length, offset)
        label = np.array([index.get(style, -1) for style in shown], dtype=np.int64)
        return starts[label >= 0], label[label >= 0]

    predictions: dict[StyleKind, list[Int64[ndarray, "2 gap"]]] = {}
    recorded: list[Int64[ndarray, "2 window"]] = []
    for number, split in enumerate(chosen):
        starts, label = labelled(split.training, CLASSIFIED_FRAMES, TRAINING_OFFSET)
        progress(f"training classifier {number + 1} of {len(chosen)} on {len(starts)} windows")
        model = fit(channels, starts, label, len(styles), Recipe(CLASSIFIED_FRAMES, steps=CLASSIFIER_STEPS), seed)

        def predict(motion: Windows, model=model) -> Int64[ndarray, "gap"]:
            flat = middle(motion).reshape(-1, style_windows.STYLE_CHANNELS)
            return probabilities(model, flat, np.arange(len(motion)) * CLASSIFIED_FRAMES).argmax(axis=1)

        if not split.unseen:
            starts, label = labelled(split.gaps, CLASSIFIED_FRAMES, 2 * STYLE_GAP_OFFSET)
            recorded.append(np.stack([label, probabilities(model, channels, starts).argmax(axis=1)]))
        for frames in lengths:
            gaps = cut(database, *labelled(split.gaps, frames + 2, STYLE_GAP_OFFSET), frames, len(styles))
            if len(gaps.case):
                progress(f"{len(gaps.case)} gaps of {frames} frames{', keys unseen' if split.unseen else ''}")
                for (keys, method), pairs in _predictions(contender, gaps, styles, strengths, predict).items():
                    predictions.setdefault(StyleKind(keys, method, frames, split.unseen), []).append(pairs)
    joined = {kind: np.concatenate(pairs, axis=1) for kind, pairs in predictions.items()}
    return StyleResults(styles, joined, np.concatenate(recorded, axis=1))


def cut(
    database: Database, starts: Int64[ndarray, "window"], shown: Int64[ndarray, "window"], frames: int, styles: int
) -> StyleGaps:
    """At most :data:`MOST_STYLE_GAPS` of the gaps that begin at ``starts``, as many of each style."""
    most = max(FEWEST_STYLE_GAPS, MOST_STYLE_GAPS // styles)
    picked: list[int] = []
    for style in range(styles):
        mine = np.flatnonzero(shown == style)
        picked += mine[np.unique(np.linspace(0, len(mine) - 1, most).astype(int))].tolist() if len(mine) else []
    others = min(OTHER_STYLES, styles - 1)
    turn = np.arange(len(picked))[:, None] * others + np.arange(others)
    windows = database_windows(database, starts[picked].tolist(), frames + 2)
    case = Case("style", frames, windows, 0, frames + 1)
    return StyleGaps(case, shown[picked], (shown[picked][:, None] + 1 + turn % (styles - 1)) % styles)


def middle(motion: Windows) -> Float32[ndarray, "gap _ 132"]:
    """What the classifier sees of motions with both keys: their middle :data:`CLASSIFIED_FRAMES` frames."""
    first = (motion.root.shape[1] - CLASSIFIED_FRAMES) // 2
    return style_windows.style_channels(*motion.batch)[:, first : first + CLASSIFIED_FRAMES]


def _predictions(
    contender: Contender,
    gaps: StyleGaps,
    styles: list[str],
    strengths: Sequence[float],
    predict: Callable[[Windows], Int64[ndarray, "gap"]],
) -> dict[tuple[str, str], Int64[ndarray, "2 gap"]]:
    """Requested and predicted styles of gaps of one length, by the keys and the method."""
    case = gaps.case
    rows = np.repeat(np.arange(len(case)), gaps.others.shape[1])
    others, repeated = gaps.others.flatten(), case.take(rows.tolist())
    without_style = {
        "recorded": predict(case.windows),
        "interp": predict(case.with_keys(fill(case, INTERP).motion)),
        "free": predict(case.with_keys(fill(case, contender).motion)),
    }
    out = {}
    for name, predicted in without_style.items():
        out["own", name] = np.stack([gaps.shown, predicted])
        out["other", name] = np.stack([others, predicted[rows]])
    for strength in strengths:
        for keys, requested, where in (("own", gaps.shown, case), ("other", others, repeated)):
            named = [styles[i] for i in requested]
            made = fill(where, contender, styles=named, style_strength=strength).motion
            out[keys, f"x{strength:g}"] = np.stack([requested, predict(where.with_keys(made))])
    return out


def _styled_windows(
    database: Database, ranges: Ranges, length: int, offset: int
) -> tuple[Int64[ndarray, "window"], list[str]]:
    """First frames of windows, and the style of the clip that each is of."""
    starts = style_windows.window_starts(ranges, length, offset)
    clips = np.searchsorted(database.ranges[:, 0], starts, side="right") - 1
    return starts, [database.clips[clip].style for clip in clips]


def _styles(database: Database, session: Session, chosen: list[ClassifierSplit]) -> list[str]:
    """The styles that the model knows and every classifier can learn. Raises InputError for fewer than two."""
    learned = [set(_styled_windows(database, s.training, CLASSIFIED_FRAMES, TRAINING_OFFSET)[1]) for s in chosen]
    styles = [style for style in database.styles if style in session.styles and all(style in one for one in learned)]
    if len(styles) < 2:
        raise InputError(
            f"{database.path}: of the styles of the model '{session.name}' ({', '.join(session.styles) or 'none'}) it "
            f"holds out {', '.join(styles) or 'none'}; a classifier needs two; --part all tests by the halves of all "
            f"clips"
        )
    return styles


def _rows(kind: StyleKind, pairs: Int64[ndarray, "2 gap"], styles: list[str], seed: int) -> list[ResultRow]:
    """The share of gaps whose predicted style is the requested one: over all styles, and for each."""
    requested, right = pairs[0], np.equal(*pairs).astype(float)[:, None]
    shares = {"style_accuracy": metrics.mean(right)}
    for i in np.unique(requested).tolist():
        shares[f"style_accuracy/{styles[i]}"] = metrics.mean(right[requested == i])
    return rows_of(kind.protocol, kind.length, {kind.method: shares}, {}, seed)
