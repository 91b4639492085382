"""`interpose gallery build`, `query`, `plot` and `generate`."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from interpose import retarget
from interpose.cli.inputs import gallery_of, pose
from interpose.data import database
from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import plots, proposals, store
from interpose.gallery.matching import Query
from interpose.gallery.proposals import PathRequest, Proposal
from interpose.gallery.speeds import Suggestion
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import posture_of, track_of
from interpose.gallery.weighing import NOTHING_KNOWN, EndStates
from interpose.motion import Motion
from interpose.rotation import wrapped
from interpose.runtime import model_folder, model_gallery

_PLACE = re.compile(r"[^,:]+,[^,:]+,[^,:]+")


def build(source: str, out: str, part: str) -> int:
    loaded = database.load(source)
    with _progress("indexing", "windows") as report:
        made = store.build(loaded, Path(out), part, report)
    info = made.info
    print(
        f"{info['windows']:,} windows of {info['frames']:,} frames in {len(made.styles)} styles, and their mirror "
        f"images; {info['bytes_a_window']} bytes a window"
    )
    print(f"wrote {out}", file=sys.stderr)
    return 0


def generate(source: str, model: str, frames: int, seed: int) -> int:
    if seed < 0:
        raise InputError(f"--seed must be 0 or more, got {seed}")
    chosen, loaded = model_folder.load(model), database.load(source)
    with _progress("generating", "gaps a chain") as report:
        made = model_gallery.add_gallery(chosen, loaded, frames, seed, report)
    frames, windows = len(made.tracks), len(made.index)
    print(f"{frames:,} frames in {len(made.styles)} styles: {windows:,} windows, and their mirror images")
    print(f"wrote {chosen.path / 'gallery.npz'}", file=sys.stderr)
    return 0


def query(
    name: str,
    poses: tuple[str, str],
    request: tuple[int | None, str | None, str | None],
    count: int,
    seed: int,
    as_json: bool,
) -> int:
    if not 1 <= count <= 100:
        raise InputError(f"--count must be 1 to 100, got {count}")
    if seed < 0:
        raise InputError(f"--seed must be 0 or more, got {seed}")
    gallery = gallery_of(name)
    wanted, ends = _query(*poses)
    frames, speed, style = request
    steps = None if frames is None else frames + 1
    info = proposals.suggestion(gallery, wanted, ends, style, seed)
    found = proposals.propose(gallery, wanted, PathRequest(steps, speed, style), ends, count=count, seed=seed)
    rows = [_row(gallery, one) for one in found]
    if as_json:
        start, target = list(wanted.start), list(wanted.target)
        others = [{"speed": g.speed, "frames": g.steps - 1, "fit": round(g.fit, 3)} for g in info.groups]
        suggested = {"frames": info.steps - 1, "alternatives": others}
        whole = {"start": start, "target": target, "suggested": suggested, "found": rows}
        print(json.dumps(whole, ensure_ascii=False))
        return 0
    _print(wanted, info, rows)
    return 0


def plot(name: str, out: str, style: str | None, distance: float, seed: int) -> int:
    if not 0.1 <= distance <= 100.0:
        raise InputError(f"--distance must be 0.1 to 100 m, got {distance:g}")
    for path in plots.plot(gallery_of(name), Path(out), style=style, distance=distance, seed=seed):
        print(f"wrote {path}", file=sys.stderr)
    return 0


def _query(start: str, target: str) -> tuple[Query, EndStates]:
    places = [_place(text) if _PLACE.fullmatch(text) and not Path(text).exists() else None for text in (start, target)]
    if all(place is not None for place in places):
        return Query(*(place for place in places if place is not None)), NOTHING_KNOWN
    if any(place is not None for place in places):
        raise InputError("give two poses of files, or two places X,Z,DEG, not one of each")
    keys: list[Motion] = []
    for text, default in ((start, -1), (target, 0)):
        motion = pose(text, default).pose
        keys.append(retarget.to_humanoid(motion, retarget.map_skeleton(motion)))
    a, b = (track_of(key)[0].tolist() for key in keys)
    return Query((a[0], a[1], a[2]), (b[0], b[1], b[2])), EndStates((posture_of(keys[0])[0], posture_of(keys[1])[0]))


def _place(text: str) -> tuple[float, float, float]:
    try:
        x, z, degrees = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"'{text}' is no place; give X,Z,DEG, as in 0,2.5,90") from None
    return x, z, float(np.radians(degrees))


def _row(gallery: Gallery, one: Proposal) -> dict[str, Any]:
    """A trajectory as printed; `path` has x, z, yaw of every frame."""
    return {
        "frames": one.steps - 1,
        "seconds": round(one.steps / RATE, 3),
        "style": one.style,
        "fit": round(one.fit, 3),
        "facing_error_deg": round(float(np.degrees(one.trace.error)), 2),
        "length_m": round(float(np.linalg.norm(np.diff(one.path[:, :2], axis=0), axis=-1).sum()), 3),
        "parts": [asdict(part) for part in one.trace.parts],
        "path": np.round(one.path, 4).tolist(),
    }


def _print(wanted: Query, info: Suggestion, rows: list[dict[str, Any]]) -> None:
    turn = wrapped(wanted.target[2] - wanted.start[2])
    print(f"{wanted.distance:.2f} m, a turn of {np.degrees(turn):.0f} degrees")
    others = ", ".join(f"{g.speed} {g.steps - 1} ({g.fit:.0%})" for g in info.groups)
    print(f"{info.steps - 1} frames at 30 Hz suggested; {others}\n")
    print("| frames | seconds | style | fit | facing error, deg | length, m | windows |")
    print("|---:|---:|---|---:|---:|---:|---|")
    for row in rows:
        parts = " + ".join(f"{p['start']}:{p['steps']}{' mirrored' if p['mirrored'] else ''}" for p in row["parts"])
        print(
            f"| {row['frames']} | {row['seconds']:.2f} | {row['style']} | {row['fit']:.2f} | "
            f"{row['facing_error_deg']:.1f} | {row['length_m']:.2f} | {parts} |"
        )


@contextmanager
def _progress(doing: str, what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error, where that is a terminal; gives a function of how many are done, and of how
    many."""
    console = Console(stderr=True)
    columns = TextColumn(doing), BarColumn(), TextColumn(f"{{task.completed:,}} of {{task.total:,}} {what}")
    with Progress(
        *columns, TimeRemainingColumn(), TextColumn("left"), console=console, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task(doing, total=1)
        yield lambda done, total: bar.update(task, completed=done, total=total)
