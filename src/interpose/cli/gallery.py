"""`interpose gallery build`, `query`, `plot` and `generate`."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from json import dumps
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from tyro.conf import Positional, arg

from interpose import retarget
from interpose.cli.inputs import gallery_of, pose
from interpose.cli.options import OutFolder, unset
from interpose.data.database import load
from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import plots, proposals, store
from interpose.gallery.matching import Query
from interpose.gallery.proposals import PathRequest, Proposal
from interpose.gallery.speeds import Suggestion
from interpose.gallery.tracks import posture_of, track_of
from interpose.gallery.weighing import NOTHING_KNOWN, EndStates
from interpose.motion import Motion
from interpose.rotation import wrapped
from interpose.runtime import model_folder, model_gallery

_PLACE = re.compile(r"[^,:]+,[^,:]+,[^,:]+")


def build(
    database: Annotated[Positional[str], arg(metavar="DB")],
    /,
    out: OutFolder,
    part: Literal["all", "train"] = "all",
) -> int:
    """Index every stretch of 15 to 150 frames of a prepared database, and its mirror image, as a trajectory to match.

    Args:
        database: From `interpose prepare`.
        out: The gallery's folder.
        part: train leaves out the ends of the clips that trainings hold out.
    """
    loaded = load(database)
    with _progress("indexing", "windows") as report:
        made = store.build(loaded, Path(out), part, report)
    info = made.info
    print(
        f"{info['windows']:,} windows of {info['frames']:,} frames in {len(made.styles)} styles, and their mirror "
        f"images; {info['bytes_a_window']} bytes a window"
    )
    print(f"wrote {out}", file=sys.stderr)
    return 0


def generate(
    database: Annotated[Positional[str], arg(metavar="DB")],
    /,
    model: Annotated[str, arg(metavar="NAME|DIR")],
    frames: Annotated[int, arg(metavar="N")] = 18_000,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Give a model a gallery of its own motion, which can be bundled with it: no frame of the database is in it.

    Args:
        database: From `interpose prepare`; key poses are taken from it.
        model: An installed model or a model's folder; its gallery.npz is replaced.
        frames: Frames of motion to generate, over all styles of the database.
        seed: Random seed; the same seed gives the same gallery.
    """
    _check_seed(seed)
    chosen, loaded = model_folder.load(model), load(database)
    with _progress("generating", "gaps a chain") as report:
        made = model_gallery.add_gallery(chosen, loaded, frames, seed, report)
    frames, windows = len(made.tracks), len(made.index)
    print(f"{frames:,} frames in {len(made.styles)} styles: {windows:,} windows, and their mirror images")
    print(f"wrote {chosen.path / 'gallery.npz'}", file=sys.stderr)
    return 0


def query(
    gallery: Annotated[Positional[str], arg(metavar="GALLERY")],
    start: Annotated[Positional[str], arg(metavar="START")],
    target: Annotated[Positional[str], arg(metavar="TARGET")],
    /,
    frames: Annotated[int | None, unset("N")] = None,
    speed: Annotated[str | None, unset("fast|medium|slow")] = None,
    style: Annotated[str | None, unset("NAME")] = None,
    count: Annotated[int, arg(metavar="K")] = 7,
    seed: Annotated[int, arg(metavar="S")] = 0,
    json: bool = False,
) -> int:
    """Suggest durations and matching trajectories between two poses.

    Args:
        gallery: A gallery's folder, a gallery.npz, or a model's name.
        start: FILE or FILE:FRAME as for `between`, or a place X,Z,DEG: metres on the ground, facing about +Y from +Z.
        target: Likewise.
        frames: Frames between the two at 30 Hz; as many as suggested where left out.
        speed: In place of frames.
        style: One of the gallery's; any where left out.
        count: Number of different trajectories.
        seed: Random seed; the same seed gives the same answer.
        json: Print one JSON object.
    """
    if not 1 <= count <= 100:
        raise InputError(f"--count must be 1 to 100, got {count}")
    _check_seed(seed)
    chosen = gallery_of(gallery)
    wanted, ends = _query(start, target)
    steps = None if frames is None else frames + 1
    info = proposals.suggestion(chosen, wanted, ends, style, seed)
    found = proposals.propose(chosen, wanted, PathRequest(steps, speed, style), ends, count=count, seed=seed)
    rows = [_row(one) for one in found]
    if json:
        others = [{"speed": g.speed, "frames": g.steps - 1, "fit": round(g.fit, 3)} for g in info.groups]
        suggested = {"frames": info.steps - 1, "alternatives": others}
        whole = {"start": list(wanted.start), "target": list(wanted.target), "suggested": suggested, "found": rows}
        print(dumps(whole, ensure_ascii=False))
        return 0
    _print(wanted, info, rows)
    return 0


def plot(
    gallery: Annotated[Positional[str], arg(metavar="GALLERY")],
    /,
    out: OutFolder,
    style: Annotated[str | None, unset("NAME")] = None,
    distance: Annotated[float, arg(metavar="M")] = 2.0,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Draw the paper's figures 3, 4 and 6: paths for four turns, distances by style, a match step by step.

    Args:
        gallery: A gallery's folder, a gallery.npz, or a model's name.
        out: The folder for the figures.
        style: Of the paths and the match; any where left out.
        distance: Metres from start to target of the paths.
        seed: Random seed; the same seed gives the same figures.
    """
    if not 0.1 <= distance <= 100.0:
        raise InputError(f"--distance must be 0.1 to 100 m, got {distance:g}")
    for path in plots.plot(gallery_of(gallery), Path(out), style=style, distance=distance, seed=seed):
        print(f"wrote {path}", file=sys.stderr)
    return 0


def _check_seed(seed: int) -> None:
    if seed < 0:
        raise InputError(f"--seed must be 0 or more, got {seed}")


def _query(start: str, target: str) -> tuple[Query, EndStates]:
    places = [_place(text) if _PLACE.fullmatch(text) and not Path(text).exists() else None for text in (start, target)]
    if all(place is not None for place in places):
        return Query(*(place for place in places if place is not None)), NOTHING_KNOWN
    if any(place is not None for place in places):
        raise InputError("give two poses of files, or two places X,Z,DEG, not one of each")
    keys: list[Motion] = []
    for text, default in ((start, -1), (target, 0)):
        motion, _, _ = pose(text, default)
        keys.append(retarget.to_humanoid(motion, retarget.map_skeleton(motion)))
    a, b = (track_of(key)[0].tolist() for key in keys)
    return Query((a[0], a[1], a[2]), (b[0], b[1], b[2])), EndStates((posture_of(keys[0])[0], posture_of(keys[1])[0]))


def _place(text: str) -> tuple[float, float, float]:
    try:
        x, z, degrees = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"'{text}' is no place; give X,Z,DEG, as in 0,2.5,90") from None
    return x, z, float(np.radians(degrees))


def _row(one: Proposal) -> dict[str, Any]:
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
