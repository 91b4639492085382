"""`interpose labels`: confident learning on a database's style labels (Chu and Yang 2024, section 5.1).

Windows of two seconds, five folds of whole recordings, a small network trained on four of them that labels the fifth;
cleanlab (Northcutt et al. 2021) finds the labels that its probabilities contradict (docs/training.md).
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from cleanlab.filter import find_label_issues
from jaxtyping import Float, Float32, Int64
from numpy import ndarray

from interpose.data import database as databases
from interpose.data import label_issues, style_windows
from interpose.data.database import Database
from interpose.data.label_issues import DroppedStretch, JudgedWindows
from interpose.errors import InputError
from interpose.io.files import write_whole
from interpose.motion import Motion
from interpose.render.sheet import SheetRow, contact_sheet
from interpose.skeleton import MODEL_RATE
from interpose.train.style.classifier import Recipe, fit, probabilities

FOLDS = 5
WINDOW_FRAMES, WINDOW_OFFSET = 60, 12
FOLD_STEPS = 500
"""Updates of a fold's network."""
DROPPED_SHARE = 0.6
"""The share of the estimated label errors that is dropped: with it LaFAN1 keeps what the paper kept of it."""
OTHER_SHARES = (0.25, 0.5, 0.75, 1.0)
"""Of these the report says what they would keep; 1 is plain confident learning."""
PICTURES, PICTURE_ROWS = 6, 6
"""Contact sheets at most, one a style, and stretches on each."""
DRAWN_FRAMES = 90
"""Frames of a stretch that are drawn at most, around its middle."""


@dataclass(frozen=True, eq=False)
class Opinions:
    """Windows that can be judged: first frames, labels, which styles of the database these count, and what networks
    that never saw their recordings make of them."""

    starts: Int64[ndarray, "window"]
    label: Int64[ndarray, "window"]
    known: Int64[ndarray, "style"]
    likelihoods: Float[ndarray, "window style"]


def distil(
    path: Path,
    out: Path | None = None,
    *,
    noise: float = DROPPED_SHARE,
    steps: int = FOLD_STEPS,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> str:
    """Judges the labels of a database, writes ``labels-kept.npz`` into it, and the report into ``out``, DB/labels where
    left out: ``report.md``, ``labels.json``, ``dropped-STYLE.png``. Returns the report.

    noise: the share of the estimated label errors to drop, cleanlab's ``frac_noise``. Raises InputError where it is
    not in (0, 1], and where fewer than two styles have two recordings of a window's length.
    """
    if not 0.0 < noise <= 1.0:
        raise InputError(f"--noise must be above 0 and at most 1, got {noise:g}")
    data = databases.load(path)
    out = data.path / "labels" if out is None else out
    fold = label_issues.folds(data, FOLDS)
    opinions = ask(data, fold, steps, seed, progress)
    judged = verdicts(opinions, noise)
    dropped = label_issues.dropped_frames(judged, data.frames)
    text = label_issues.report(data, judged, fold, dropped)
    kept = {n: 1.0 - label_issues.dropped_frames(verdicts(opinions, n), data.frames).mean() for n in OTHER_SHARES}
    listed = ", ".join(f"{share:.1%} with `--noise {n:g}`" for n, share in kept.items())
    text += f"\nDropped: {noise:g} of the estimated label errors. Others would keep {listed}.\n"
    runs = label_issues.stretches(data, judged, dropped)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: the folder cannot be made: {(error.strerror or str(error)).lower()}") from None
    progress("drawing what was dropped")
    for old in out.glob("dropped-*.png"):
        old.unlink()
    drawn = draw(data, runs, out)
    text += "".join(f"\n![dropped]({file.name})\n" for file in drawn)
    write_whole(out / "report.md", text.encode())
    write_whole(out / "labels.json", (json.dumps(summary(data, runs, dropped, noise), indent=1) + "\n").encode())
    label_issues.save(data, ~dropped)
    return text


def ask(
    data: Database, fold: Int64[ndarray, "clip"], steps: int, seed: int, progress: Callable[[str], None]
) -> Opinions:
    """What a network that was trained without its recording makes of every window. Raises as :func:`distil` does."""
    ranges = [(a, b) for (a, b), k in zip(data.ranges.tolist(), fold, strict=True) if k >= 0]
    starts = style_windows.window_starts(ranges, WINDOW_FRAMES, WINDOW_OFFSET)
    clip = np.searchsorted(data.ranges[:, 0], starts, side="right") - 1
    known, label = np.unique(data.style_indices()[clip], return_inverse=True)
    held = fold[clip]
    spread = [len(np.unique(held[label == i])) for i in range(len(known))]
    if len(known) < 2 or min(spread) < 2:
        raise InputError(
            f"{data.path}: labels are judged by other recordings of the same styles; at least two styles need two "
            f"recordings each with clips of {WINDOW_FRAMES} frames or more"
        )
    seen = style_windows.database_channels(data)
    likelihoods = out_of_sample(
        seen, starts, label, held, len(known), Recipe(WINDOW_FRAMES, steps=steps, even=False), seed, progress
    )
    return Opinions(starts, label, known, likelihoods)


def verdicts(opinions: Opinions, noise: float) -> JudgedWindows:
    """Which windows have an issue, by cleanlab; ``noise`` is the share of the estimated errors that is taken."""
    label, likelihoods, known = opinions.label, opinions.likelihoods, opinions.known
    issue = find_label_issues(label, likelihoods, filter_by="prune_by_noise_rate", frac_noise=noise, n_jobs=1)
    doubt = 1.0 - likelihoods[np.arange(len(label)), label]
    return JudgedWindows(
        WINDOW_FRAMES,
        opinions.starts,
        known[label],
        known[likelihoods.argmax(axis=1)],
        np.asarray(issue, dtype=bool),
        doubt,
    )


def out_of_sample(
    seen: Float32[ndarray, "frame 132"],
    starts: Int64[ndarray, "window"],
    label: Int64[ndarray, "window"],
    held: Int64[ndarray, "window"],
    classes: int,
    recipe: Recipe,
    seed: int,
    progress: Callable[[str], None],
) -> Float[ndarray, "window style"]:
    """The probabilities of each window's labels by the network of its fold, trained on all other folds."""
    out = np.zeros((len(starts), classes))
    for k in np.unique(held).tolist():
        progress(f"fold {k + 1} of {FOLDS}: judging {np.sum(held == k)} windows by {np.sum(held != k)} others")
        model = fit(seen, starts[held != k], label[held != k], classes, recipe, seed + k)
        out[held == k] = probabilities(model, seen, starts[held == k])
    return out


def summary(data: Database, runs: list[DroppedStretch], dropped: ndarray, noise: float) -> dict[str, object]:
    """What `labels.json` says: the share kept, and every stretch that was dropped, in frames of its clip."""
    listed = []
    for run in runs:
        first = int(data.ranges[run.clip, 0])
        info = data.clips[run.clip]
        listed.append(
            asdict(run)
            | {"clip": info.name, "start": run.start - first, "stop": run.stop - first}
            | {"given": info.style, "believed": data.styles[run.believed], "doubt": round(run.doubt, 3)}
        )
    kept = {
        style: round(1.0 - float(np.mean(np.concatenate([dropped[a:b] for (a, b), c in pairs(data) if c == style]))), 4)
        for style in data.styles
    }
    return {
        "database": f"{data.dataset} {data.fingerprint}".strip(),
        "kept": round(1.0 - float(dropped.mean()), 4),
        "paper_kept": label_issues.PAPER_KEPT_SHARE,
        "noise": noise,
        "kept_by_style": kept,
        "dropped": listed,
    }


def pairs(data: Database) -> list[tuple[tuple[int, int], str]]:
    """The ranges of the clips, each with its style."""
    return [((a, b), clip.style) for (a, b), clip in zip(data.ranges.tolist(), data.clips, strict=True)]


def draw(data: Database, runs: list[DroppedStretch], out: Path) -> list[Path]:
    """Contact sheets of the styles of which most was dropped: their longest stretches, no two of one clip before every
    clip has had one."""
    lost: dict[str, list[DroppedStretch]] = {}
    for run in sorted(runs, key=lambda run: run.start - run.stop):
        lost.setdefault(data.clips[run.clip].style, []).append(run)
    files = []
    for style in sorted(lost, key=lambda s: -sum(r.stop - r.start for r in lost[s]))[:PICTURES]:
        turns: dict[int, int] = {}
        order = []
        for run in lost[style]:
            turns[run.clip] = turns.get(run.clip, 0) + 1
            order.append((turns[run.clip], len(order)))
        chosen = [lost[style][k] for _, k in sorted(order)[:PICTURE_ROWS]]
        frames = sum(r.stop - r.start for r in lost[style])
        files.append(out / f"dropped-{style}.png")
        heading = f"{style}: {frames} frames lose this label"
        longest = f"at most {DRAWN_FRAMES / MODEL_RATE:g} s of each"
        contact_sheet(files[-1], [_row(data, run) for run in chosen], heading, longest)
    return files


def _row(data: Database, run: DroppedStretch) -> SheetRow:
    first, info = int(data.ranges[run.clip, 0]), data.clips[run.clip]
    middle = (run.start + run.stop) // 2
    start, stop = max(run.start, middle - DRAWN_FRAMES // 2), min(run.stop, middle + DRAWN_FRAMES // 2)
    motion: Motion = data.motion(start, stop)
    notes = (
        f"{info.name}",
        f"frames {run.start - first} to {run.stop - first}",
        f"given {info.style}, doubt {run.doubt:.2f}",
    )
    return SheetRow(motion, f"believed: {data.styles[run.believed]}", notes)
