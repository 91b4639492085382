"""Frames of a database whose style label is probably wrong: what confident learning needs besides the networks.

The DC-MoE paper distils LaFAN1 in this manner (section 5.1). `interpose.train.style.labels` labels the windows. The
result is ``labels-kept.npz`` in the database's folder; frames that it drops are trained without a style.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int64
from numpy import ndarray

from interpose.data.database import ClipInfo, Database
from interpose.errors import InputError
from interpose.io.files import write_whole

KEPT_LABELS_FILE = "labels-kept.npz"
PAPER_KEPT_SHARE = 0.7514
"""The share of LaFAN1 that the paper keeps."""


@dataclass(frozen=True, eq=False)
class JudgedWindows:
    """Windows and verdicts on their labels.

    starts: first frames, ascending. given, believed: style indices, as labelled and as predicted. issue: whether the
    label is probably wrong. doubt: one minus the probability of the given label.
    """

    length: int
    starts: Int64[ndarray, "window"]
    given: Int64[ndarray, "window"]
    believed: Int64[ndarray, "window"]
    issue: Bool[ndarray, "window"]
    doubt: Float[ndarray, "window"]


@dataclass(frozen=True)
class DroppedStretch:
    """Dropped frames [start, stop) of one clip, counted in the database, and the label predicted most often."""

    clip: int
    start: int
    stop: int
    believed: int
    doubt: float


def recording(clip: ClipInfo) -> str:
    """The recording of a clip: its file's name up to the subject. Several clips may be cut from one recording."""
    stem = Path(clip.file or clip.name).stem
    before, subject, _ = stem.partition(clip.subject) if clip.subject else (stem, "", "")
    return before + subject


def folds(database: Database, count: int) -> Int64[ndarray, "clip"]:
    """The fold that holds out each clip. All clips of a recording share one; the recordings of a style are spread.

    -1 for clips without a style, and for those of a style with a single recording, where nothing would be left to learn
    from.
    """
    names = [recording(clip) for clip in database.clips]
    frames = np.diff(database.ranges, axis=1)[:, 0]
    fold = np.full(len(database), -1, dtype=np.int64)
    filled = np.zeros(count)
    for style in database.styles:
        members = [i for i, clip in enumerate(database.clips) if clip.style == style]
        sizes: Counter[str] = Counter()
        for i in members:
            sizes[names[i]] += int(frames[i])
        mine = np.zeros(count)
        for name in sorted(sizes, key=lambda n: (-sizes[n], n)) if len(sizes) > 1 else ():
            chosen = min(range(count), key=lambda k: (mine[k], filled[k]))
            mine[chosen] += sizes[name]
            filled[chosen] += sizes[name]
            fold[[i for i in members if names[i] == name]] = chosen
    return fold


def dropped_frames(judged: JudgedWindows, frames: int) -> Bool[ndarray, "frame"]:
    """The frames for which more than half of the windows around them are issues."""
    issues, windows = np.zeros(frames + 1), np.zeros(frames + 1)
    for count, rows in ((windows, judged.starts), (issues, judged.starts[judged.issue])):
        np.add.at(count, rows, 1.0)
        np.add.at(count, rows + judged.length, -1.0)
    return (2.0 * np.cumsum(issues) > np.cumsum(windows))[:frames]


def stretches(database: Database, judged: JudgedWindows, dropped: Bool[ndarray, "frame"]) -> list[DroppedStretch]:
    """The runs of dropped frames; the believed label of a run is that of most issues in it."""
    out = []
    for clip, (start, stop) in enumerate(database.ranges.tolist()):
        edges = np.flatnonzero(np.diff(np.concatenate([[False], dropped[start:stop], [False]])))
        for first, last in (edges.reshape(-1, 2) + start).tolist():
            inside = judged.issue & (judged.starts + judged.length > first) & (judged.starts < last)
            most = int(np.argmax(np.bincount(judged.believed[inside], minlength=len(database.styles))))
            out.append(DroppedStretch(clip, first, last, most, float(judged.doubt[inside].mean())))
    return out


def save(database: Database, kept: Bool[ndarray, "frame"]) -> Path:
    """Writes the frames that keep their label into the database's folder, with the database's fingerprint."""
    data = io.BytesIO()
    np.savez_compressed(data, kept=kept, fingerprint=np.array(database.fingerprint))
    write_whole(database.path / KEPT_LABELS_FILE, data.getvalue())
    return database.path / KEPT_LABELS_FILE


def kept(database: Database) -> Bool[ndarray, "frame"] | None:
    """The frames that keep their label; None where `interpose labels` has not run on the database.

    Raises InputError for a file that is damaged or belongs to other contents of the database.
    """
    file = database.path / KEPT_LABELS_FILE
    try:
        with file.open("rb") as opened, np.load(opened, allow_pickle=False) as stored:
            mask, fingerprint = stored["kept"], str(stored["fingerprint"])
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{file} cannot be read ({error}); run 'interpose labels' again, or delete it") from None
    if mask.shape != (database.frames,) or mask.dtype != bool or fingerprint != database.fingerprint:
        raise InputError(f"{file} was made for other contents of this database; run 'interpose labels' again")
    return mask


def kept_summary(database: Database) -> str:
    """The share of frames that keep their label, with a digest; '' where `interpose labels` has not run."""
    mask = kept(database)
    if mask is None:
        return ""
    return f"labels kept {mask.mean():.4f} {hashlib.sha256(mask.tobytes()).hexdigest()[:8]}"


def report(
    database: Database, judged: JudgedWindows, fold: Int64[ndarray, "clip"], dropped: Bool[ndarray, "frame"]
) -> str:
    """The Markdown report on judged and dropped labels."""
    labels = np.repeat(database.style_indices(), np.diff(database.ranges, axis=1)[:, 0])
    share = 1.0 - dropped.mean()
    right = judged.given == judged.believed
    lines = [
        f"# Labels of {database.dataset}",
        "",
        f"{share:.2%} of {database.frames} frames keep their label; the DC-MoE paper keeps {PAPER_KEPT_SHARE:.2%} of "
        f"LaFAN1. {len(judged.starts)} windows of {judged.length} frames were judged, each by a network that was "
        f"trained without its recording. The prediction is the given label for {right.mean():.1%} of them; "
        f"{judged.issue.mean():.1%} are issues.",
        "",
        "| style | recordings | frames | judged | as labelled | kept | predicted instead, frames |",
        "|---|---|---|---|---|---|---|",
    ]
    runs = stretches(database, judged, dropped)
    covered = np.zeros(database.frames, dtype=bool)
    for start in judged.starts.tolist():
        covered[start : start + judged.length] = True
    for i, style in enumerate(database.styles):
        mine, given = labels == i, judged.given == i
        recordings = {recording(clip) for clip in database.clips if clip.style == style}
        instead = np.zeros(len(database.styles), dtype=np.int64)
        for run in runs:
            if labels[run.start] == i:
                instead[run.believed] += run.stop - run.start
        named = ", ".join(f"{database.styles[k]} {instead[k]}" for k in np.argsort(-instead)[:4] if instead[k])
        agreed = f"{right[given].mean():.0%}" if given.any() else "-"
        lines.append(
            f"| {style} | {len(recordings)} | {mine.sum()} | {covered[mine].mean():.0%} | {agreed} "
            f"| {1.0 - dropped[mine].mean():.1%} | {named or '-'} |"
        )
    alone = sorted({clip.style for clip, k in zip(database.clips, fold, strict=True) if k < 0 and clip.style})
    if alone:
        lines += ["", f"Kept without judging, since there is only one recording: {', '.join(alone)}."]
    short = sum(b - a < judged.length for a, b in database.ranges.tolist())
    if short:
        lines += ["", f"Kept without judging, since they are shorter than a window: {short} clips."]
    return "\n".join(lines) + "\n"
