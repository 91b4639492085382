"""Galleries on disk: a folder of memory-mapped arrays, or one small file that is bundled with a model."""

from __future__ import annotations

import io
import json
import os
import shutil
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.data.database import ArrayKinds, Database, check_kind, contiguous, load_arrays
from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import index as indexing
from interpose.gallery.index import Index, Progress
from interpose.gallery.matching import Search
from interpose.gallery.tracks import POSTURE_SIZE, Tracks, from_database
from interpose.io.files import write_whole

GALLERY_VERSION = 1
META_FILE = "meta.json"
QUANTILES = 1024
REMEDY = "build the gallery again"
_TRACK_ARRAYS: ArrayKinds = {
    "root": ((3,), np.float32),
    "posture": ((POSTURE_SIZE,), np.float16),
    "ranges": ((2,), np.int64),
    "clip_styles": ((), np.int64),
}
_INDEX_ARRAYS: ArrayKinds = {
    "start": ((), np.uint32),
    "steps": ((), np.uint8),
    "distance": ((), np.float32),
    "facing": ((2,), np.uint16),
    "cells": ((), np.uint32),
}


@dataclass(frozen=True, eq=False)
class Gallery:
    """A gallery that is ready to search. info: `made_from`, `licence`, and sizes."""

    index: Index
    info: dict[str, Any] = field(default_factory=dict)

    @property
    def tracks(self) -> Tracks:
        return self.index.tracks

    @property
    def styles(self) -> tuple[str, ...]:
        """The styles of its trajectories."""
        return self.tracks.styles

    @property
    def search(self) -> Search:
        """The best windows by the index."""
        return partial(indexing.best, self.index)

    @cached_property
    def distances(self) -> Float[ndarray, "quantile"]:
        """Quantiles of the length of v_p over all windows, ascending, metres."""
        step = max(1, len(self.index) // (64 * QUANTILES))
        return np.quantile(self.index.distance[::step].astype(float), np.linspace(0.0, 1.0, QUANTILES))

    @cached_property
    def fastest(self) -> float:
        """Metres a step of the fastest windows of at least a second (their 99.9th percentile)."""
        step = max(1, len(self.index) // (64 * QUANTILES))
        steps = self.index.steps[::step].astype(float)
        pace = (self.index.distance[::step] / steps)[steps >= min(RATE, steps.max())]
        return float(np.quantile(pace, 0.999))

    def style_indices(self, style: str | None) -> tuple[int, ...] | None:
        """The style as indices for :class:`~interpose.gallery.windows.WindowQuery`; None for any style.

        Raises InputError for a style that no trajectory has.
        """
        if style is None:
            return None
        if style not in self.styles:
            raise InputError(f"the gallery has no trajectory in style '{style}'; it has {', '.join(self.styles)}")
        return (self.styles.index(style),)


def of_tracks(
    tracks: Tracks, info: dict[str, Any] | None = None, progress: Progress = lambda done, total: None
) -> Gallery:
    """The gallery of some tracks. Raises InputError where no clip is long enough."""
    return Gallery(indexing.build(tracks, progress), info or {})


def build(database: Database, out: Path, part: str = "all", progress: Progress = lambda done, total: None) -> Gallery:
    """Builds the gallery of a database, writes it to the folder ``out``, and returns it.

    part: 'all' of the database, or 'train' without the ends of clips that trainings hold out. Raises InputError for
    another part, where no clip is long enough, and where ``out`` is not a gallery or cannot be written.
    """
    if part not in ("all", "train"):
        raise InputError(f"unknown part '{part}' of a database; use all or train")
    _check_free(out)
    tracks = from_database(database, None if part == "all" else training_ranges(database)[0])
    made_from = f"root tracks of {database.dataset} {database.fingerprint[:12]}, {part}".replace(" ,", ",")
    gallery = of_tracks(tracks, {"made_from": made_from, "licence": database.licence}, progress)
    save(gallery, out)
    return load(out)


def save(gallery: Gallery, out: Path) -> None:
    """Writes a gallery to a folder, whole or not at all; an existing gallery is replaced once the new one is complete.

    Raises InputError where ``out`` exists but is not a gallery, or cannot be written.
    """
    _check_free(out)
    meta = {
        "version": GALLERY_VERSION,
        "styles": gallery.styles,
        "frames": len(gallery.tracks),
        "windows": len(gallery.index),
        "bytes_a_window": round(gallery.index.nbytes / len(gallery.index), 2),
        **gallery.info,
    }
    temporary = out.with_name(f".{out.name}.{os.getpid()}")
    before = out.with_name(f".{out.name}.{os.getpid()}.before")
    try:
        temporary.mkdir(parents=True)
        for names, owner in ((_TRACK_ARRAYS, gallery.tracks), (_INDEX_ARRAYS, gallery.index)):
            for name in names:
                np.save(temporary / f"{name}.npy", getattr(owner, name))
        (temporary / META_FILE).write_text(json.dumps(meta, indent=1, ensure_ascii=False), encoding="utf-8")
        if out.exists():
            out.rename(before)
        temporary.rename(out)
    except OSError as error:
        raise InputError(f"the gallery {out} cannot be written: {error.strerror or error}") from None
    finally:
        if before.exists() and not out.exists():
            before.rename(out)
        for folder in (temporary, before):
            shutil.rmtree(folder, ignore_errors=True)


def _check_free(out: Path) -> None:
    # A prepared database has a meta.json too.
    if out.exists() and not ((out / META_FILE).exists() and (out / "cells.npy").exists()):
        raise InputError(f"{out} exists but is not a gallery; give another name")


def load(path: Path) -> Gallery:
    """Reads a gallery from a folder or a `gallery.npz`. Raises InputError where there is none, or it is damaged."""
    if path.suffix == ".npz":
        return _load_small(path)
    try:
        meta = json.loads((path / META_FILE).read_text(encoding="utf-8"))
        styles = tuple(str(style) for style in meta["styles"])
        version = meta["version"]
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path} is not a gallery: it has no {META_FILE}; use 'interpose gallery build'") from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path / META_FILE} cannot be read ({error!r}); build the gallery again") from None
    if version != GALLERY_VERSION:
        raise InputError(f"{path} has version {version}, this program needs {GALLERY_VERSION}; build the gallery again")
    arrays = load_arrays(path, _TRACK_ARRAYS | _INDEX_ARRAYS, REMEDY)
    tracks = _tracks(arrays, styles, path)
    held = {name: arrays[name] for name in _INDEX_ARRAYS}
    windows = len(held["start"])
    fit = all(len(held[name]) == windows for name in ("steps", "distance", "facing"))
    cells = len(styles) * indexing.DISTANCE_BINS * indexing.SECTOR_PAIRS + 1
    if not fit or len(held["cells"]) != cells or held["cells"][-1] != windows:
        raise InputError(f"the files of the gallery {path} do not fit together; build it again")
    return Gallery(Index(tracks, **held), meta)


def save_small(tracks: Tracks, info: dict[str, Any], out: Path) -> None:
    """Writes the small file that is bundled with a model: the tracks, whose index is rebuilt on loading."""
    held = io.BytesIO()
    facts = json.dumps({"version": GALLERY_VERSION, "styles": tracks.styles, **info}, ensure_ascii=False)
    np.savez_compressed(held, meta=np.array(facts), **{name: getattr(tracks, name) for name in _TRACK_ARRAYS})
    write_whole(out, held.getvalue())


def _load_small(path: Path) -> Gallery:
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as held:
            meta = json.loads(str(held["meta"]))
            arrays = {name: held[name] for name in _TRACK_ARRAYS}
        styles = tuple(str(style) for style in meta["styles"])
        version = meta["version"]
    except FileNotFoundError:
        raise InputError(f"{path}: no such gallery; make one with 'interpose gallery build'") from None
    except Exception as error:  # a damaged archive can make zipfile, zlib and numpy raise anything
        raise InputError(f"{path} is not a gallery ({error}); make one with 'interpose gallery build'") from None
    if version != GALLERY_VERSION:
        raise InputError(f"{path} has version {version}, this program needs {GALLERY_VERSION}; export the model again")
    for name, (row, kind) in _TRACK_ARRAYS.items():
        check_kind(arrays[name], row, kind, f"{name} of {path}", REMEDY)
    return of_tracks(_tracks(arrays, styles, path), meta)


def _tracks(arrays: dict[str, ndarray], styles: tuple[str, ...], path: Path) -> Tracks:
    root, posture, ranges, clip_styles = (arrays[name] for name in ("root", "posture", "ranges", "clip_styles"))
    if not (
        len(posture) == len(root)
        and len(clip_styles) == len(ranges) > 0
        and contiguous(ranges, len(root))
        and 0 <= clip_styles.min() <= clip_styles.max() < len(styles)
        and np.isfinite(root).all()
    ):
        raise InputError(f"the tracks of the gallery {path} do not fit together; build it again")
    return Tracks(root, posture, ranges, clip_styles, styles)
