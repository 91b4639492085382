"""`interpose prepare`: turns the files of a data set into a database of the 22 joints at 30 Hz.

Clips are prepared in parallel, each into a part file that is named by a hash of its source, its labels and the recipe;
a run that was stopped resumes from the parts. A file that cannot be used is skipped and reported.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import time
import zipfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from interpose import motion as motions
from interpose import retarget, rotation
from interpose.data import contacts, database, root, sources
from interpose.data.database import DATABASE_VERSION, ClipArrays, ClipInfo, Database
from interpose.data.sources import FRAME_CUTS_RATE, SourceClip
from interpose.errors import InputError
from interpose.io import parse
from interpose.io.files import write_whole
from interpose.motion import Motion
from interpose.skeleton import MODEL_RATE

MIN_CLIP_FRAMES = 2
FLOOR_TOLERANCE = 0.03
"""Metres: a floor that is off by less is left alone, since planted feet of good data vary by 2 cm."""
PARTS_FOLDER = ".parts"
REPORT_FILE = "report.md"
RECIPE_VERSION = 1
"""Part of every hash; raise it when the same file gives other frames than before."""


@dataclass(frozen=True, eq=False)
class Report:
    """The outcome of a run: it prepared ``read`` clips in ``seconds`` and took the others from an earlier run."""

    database: Database
    read: int
    seconds: float

    def markdown(self) -> str:
        """Clips, frames and minutes of each style, and every skipped file with the reason."""
        db = self.database
        lengths = db.ranges[:, 1] - db.ranges[:, 0]
        styles = sorted({clip.style for clip in db.clips})
        rows = [(style, lengths[[clip.style == style for clip in db.clips]]) for style in styles]
        lines = [
            f"# {db.dataset}: {len(db)} clips, {db.frames} frames, {_minutes(db.frames)} minutes at {MODEL_RATE:g} Hz",
            "",
            f"Licence of the data: {db.licence}. {self.read} clips read in {self.seconds:.0f} s"
            f" ({lengths.sum() / max(self.seconds, 1e-3):.0f} frames a second), {len(db) - self.read} taken from an"
            f" earlier run, {len(db.skipped)} files skipped.",
            "",
            "| style | clips | frames | minutes |",
            "|---|---:|---:|---:|",
            *(f"| {style or 'no label'} | {len(of)} | {of.sum()} | {_minutes(int(of.sum()))} |" for style, of in rows),
        ]
        moved = [clip for clip in db.clips if clip.raised]
        if moved:
            lines += ["", "| moved to the floor | by, cm |", "|---|---:|"]
            lines += [f"| {clip.name} | {100.0 * clip.raised:+.1f} |" for clip in moved]
        if db.skipped:
            lines += ["", "| skipped | reason |", "|---|---|", *(f"| {file} | {why} |" for file, why in db.skipped)]
        return "\n".join(lines) + "\n"


def prepare(
    dataset: str,
    from_sources: Sequence[Path | str],
    out: Path | str,
    *,
    split: str = "all",
    workers: int | None = None,
    progress: bool = True,
) -> Report:
    """Makes the database ``out`` from the folders, zip archives or files of one data set.

    dataset, split: see `interpose.data.sources.find`. workers: number of processes, one for each processor where None.
    progress: shown on standard error. A database that is up to date stays as it is. Raises InputError where a source
    cannot be read, nothing in it can be used, or ``out`` cannot be written.
    """
    begun = time.monotonic()
    out = Path(out)
    found = sources.find(dataset, from_sources, split)
    keys = [clip.key() for clip in found.clips]
    recipe = (RECIPE_VERSION, DATABASE_VERSION, keys, found.skipped)
    made_from = hashlib.sha256(repr(recipe).encode()).hexdigest()
    try:
        present = database.load(out)
    except InputError:
        present = None
    if present is not None and present.made_from == made_from:
        return Report(present, 0, time.monotonic() - begun)

    parts = [out / PARTS_FOLDER / f"{RECIPE_VERSION}-{key}.npz" for key in keys]
    try:
        (out / PARTS_FOLDER).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the database {out} cannot be written: {error.strerror or error}") from None
    jobs = [(clip, part) for clip, part in zip(found.clips, parts, strict=True) if not _is_whole(part)]
    failed = _make_parts(jobs, workers, progress)
    skipped = sorted([*found.skipped, *((clip.source.name, reason) for clip, reason in failed.items())])
    kept = [part for clip, part in zip(found.clips, parts, strict=True) if clip not in failed]
    if not kept:
        name, reason = skipped[0]
        raise InputError(f"none of the {len(skipped)} files could be used; the first, {name}: {reason}")
    made = database.write(
        out,
        [_info(part) for part in kept],
        _arrays(kept),
        dataset=dataset,
        licence=sources.DATASETS[dataset].licence,
        made_from=made_from,
        skipped=skipped,
    )
    shutil.rmtree(out / PARTS_FOLDER, ignore_errors=True)
    report = Report(made, len(jobs) - len(failed), time.monotonic() - begun)
    write_whole(out / REPORT_FILE, report.markdown().encode())
    return report


def convert(motion: Motion, clip: SourceClip) -> tuple[ClipInfo, ClipArrays]:
    """Cuts a clip, brings it to 30 Hz, retargets it, and finds its floor, roots and contacts.

    Raises InputError where it cannot be used.
    """
    mapping = retarget.map_skeleton(motion)
    start, stop = 0, len(motion)
    if clip.cut is not None:
        start, stop = (min(round(frame * motion.rate / FRAME_CUTS_RATE), len(motion)) for frame in clip.cut)
    kept = at_rate(motion[start:stop])
    if len(kept) < MIN_CLIP_FRAMES:
        raise InputError(
            f"{len(kept)} frames are left after the cut and at {MODEL_RATE:g} Hz, at least {MIN_CLIP_FRAMES} are needed"
        )
    humanoid = retarget.to_humanoid(kept, mapping)
    positions = humanoid.global_positions()
    height = floor_height(positions, MODEL_RATE)
    raised = -height if abs(height) > FLOOR_TOLERANCE else 0.0
    place, positions = humanoid.root_positions + raised * rotation.UP, positions + raised * rotation.UP
    arrays = ClipArrays(
        place.astype(np.float32),
        rotation.continuous(humanoid.local_rotations).astype(np.float32),
        root.trajectory(positions, MODEL_RATE).astype(np.float32),
        contacts.detect(positions, MODEL_RATE).astype(np.uint8),
    )
    info = ClipInfo(
        clip.name, clip.source.name, **vars(clip.labels), source_rate=float(motion.rate), source_frames=len(motion),
        cut=(start, stop), raised=raised,
    )  # fmt: skip
    return info, arrays


def at_rate(motion: Motion) -> Motion:
    """The motion at 30 Hz: every n-th frame of a rate that is a multiple (59.9988 counts as 60), else interpolated."""
    every = round(motion.rate / MODEL_RATE)
    if every >= 1 and abs(motion.rate / (every * MODEL_RATE) - 1.0) < 1e-3:
        return replace(motion[::every], rate=MODEL_RATE)
    return motions.resample(motion, MODEL_RATE)


def floor_height(positions: Float[ndarray, "frame 22 3"], rate: float) -> float:
    """Height of the floor that the feet stand on, metres above y = 0; 0 where they never rest.

    Ankles and toes each give an estimate, the 5th percentile of their heights while they are still. The smaller one
    counts: in some clips a foot lies on its side or rests on its toes throughout.
    """
    feet = positions[:, contacts.CONTACT_INDICES]
    still = np.linalg.norm(motions.velocities(feet, rate), axis=-1) < contacts.CONTACT_SPEED
    above = feet[..., 1] - contacts.REST_HEIGHTS
    heights = [np.percentile(above[:, part][still[:, part]], 5) for part in ([0, 2], [1, 3]) if still[:, part].any()]
    return float(min(heights, key=abs, default=0.0))


def _make_parts(jobs: Sequence[tuple[SourceClip, Path]], workers: int | None, progress: bool) -> dict[SourceClip, str]:
    """Prepares all clips, the largest files first; returns those that cannot be used, with the reasons."""
    jobs = sorted(jobs, key=lambda job: -job[0].source.size)
    workers = min(workers or os.cpu_count() or 1, max(len(jobs), 1))
    failed: dict[SourceClip, str] = {}
    total = sum(clip.source.size for clip, _ in jobs)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[done]}/{task.fields[clips]} clips"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), disable=not progress or not jobs) as bar:
        task = bar.add_task("preparing", total=total, done=0, clips=len(jobs))
        for done, (clip, reason) in enumerate(_results(jobs, workers), start=1):
            if reason is not None:
                failed[clip] = reason
                bar.console.print(f"skipped {clip.source.name}: {reason}", markup=False, highlight=False)
            bar.update(task, advance=clip.source.size, done=done)
    return failed


def _results(jobs: Sequence[tuple[SourceClip, Path]], workers: int) -> Iterator[tuple[SourceClip, str | None]]:
    if workers == 1:
        for clip, part in jobs:
            yield clip, _make_part(clip, part)
        return
    pool = ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
    try:
        waiting = {pool.submit(_make_part, clip, part): clip for clip, part in jobs}
        for future in as_completed(waiting):
            yield waiting[future], future.result()
    except BrokenProcessPool:
        raise InputError(
            "a worker process was killed, perhaps because memory ran out; run again with fewer workers, finished "
            "clips are kept"
        ) from None
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _make_part(clip: SourceClip, part: Path) -> str | None:
    """Prepares one clip into its part file; returns the reason where it cannot be used, raises where writing fails."""
    try:
        info, arrays = convert(parse(clip.source.read_bytes(), clip.source.name), clip)
        content = io.BytesIO()
        np.savez(content, info=np.array(json.dumps(asdict(info))), **vars(arrays))
    except InputError as error:
        return str(error)
    write_whole(part, content.getvalue())
    return None


def _is_whole(part: Path) -> bool:
    try:
        return _info(part)[1] > 0
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return False


def _info(part: Path) -> tuple[ClipInfo, int]:
    with open(part, "rb") as file, np.load(file) as content:
        return database.clip_info(json.loads(str(content["info"]))), len(content["root_positions"])


def _arrays(parts: Sequence[Path]) -> Iterator[ClipArrays]:
    for part in parts:
        with np.load(part) as content:
            yield ClipArrays(**{name: content[name] for name in content.files if name != "info"})


def _minutes(frames: int) -> str:
    return f"{frames / MODEL_RATE / 60.0:.1f}"
