"""A database: prepared clips of the 22 joints at 30 Hz, as a folder of memory-mapped arrays.

    root_positions.npy   (frame, 3) float32      hips, metres
    local_rotations.npy  (frame, 22, 4) float32  q_parent_joint of HUMANOID, scalar last, signs continuous in a clip
    root.npy             (frame, 4) float32      x, z, facing x, facing z (interpose.data.root)
    contacts.npy         (frame, 4) uint8        LeftFoot, LeftToe, RightFoot, RightToe (interpose.data.contacts)
    ranges.npy           (clip, 2) int64         frames [start, stop) of each clip
    meta.json            version, dataset, licence, rate, joints, styles, skipped files, and an entry for each clip

Clips follow one another without gaps. Mirror images are not stored. `meta.json` is written last: with it, a folder is
complete.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int64, UInt8
from numpy import ndarray

from interpose.errors import InputError
from interpose.motion import Motion
from interpose.skeleton import HUMANOID, MODEL_RATE

DATABASE_VERSION = 1
DATABASE_META = "meta.json"
ArrayKinds = dict[str, tuple[tuple[int, ...], type]]
"""The shape of a row, and the type, of each array."""
_ARRAYS: ArrayKinds = {
    "root_positions": ((3,), np.float32),
    "local_rotations": ((len(HUMANOID), 4), np.float32),
    "root": ((4,), np.float32),
    "contacts": ((4,), np.uint8),
    "ranges": ((2,), np.int64),
}


@dataclass(frozen=True)
class ClipInfo:
    """What is known of a clip beside its frames.

    name: unique in the database. file: the source file, relative to its source. style: the label for training.
    content: the action. subject: the performer. Each of these three is '' where unknown. source_rate, source_frames: of
    the file. cut: the frames [start, stop) of the file that were kept. raised: metres added to all heights to bring the
    floor to y = 0.
    """

    name: str
    file: str
    style: str
    content: str
    subject: str
    source_rate: float
    source_frames: int
    cut: tuple[int, int]
    raised: float


@dataclass(frozen=True, eq=False)
class ClipArrays:
    """The frames of one clip, as stored in a database."""

    root_positions: Float32[ndarray, "frame 3"]
    local_rotations: Float32[ndarray, "frame 22 4"]
    root: Float32[ndarray, "frame 4"]
    contacts: UInt8[ndarray, "frame 4"]

    def __len__(self) -> int:
        return len(self.root_positions)


@dataclass(frozen=True, eq=False)
class Database:
    """A database on disk; the arrays are read-only memory maps.

    fingerprint: a digest of the contents, see :func:`write`. made_from: identifies the source files and the recipe that
    prepared them, so that a database that is up to date is recognised; '' where it was not prepared from files.
    """

    path: Path
    dataset: str
    licence: str
    fingerprint: str
    made_from: str
    skipped: tuple[tuple[str, str], ...]
    clips: tuple[ClipInfo, ...]
    root_positions: Float32[ndarray, "frame 3"]
    local_rotations: Float32[ndarray, "frame 22 4"]
    root: Float32[ndarray, "frame 4"]
    contacts: UInt8[ndarray, "frame 4"]
    ranges: Int64[ndarray, "clip 2"]

    def __len__(self) -> int:
        """The number of clips."""
        return len(self.clips)

    @property
    def frames(self) -> int:
        return len(self.root_positions)

    @property
    def styles(self) -> tuple[str, ...]:
        """The styles of the clips, sorted, without the '' of clips that have no label."""
        return tuple(sorted({clip.style for clip in self.clips} - {""}))

    def style_indices(self) -> Int64[ndarray, "clip"]:
        """For each clip, the index of its style in :attr:`styles`; -1 where it has none."""
        index = {style: i for i, style in enumerate(self.styles)}
        return np.array([index.get(clip.style, -1) for clip in self.clips], dtype=np.int64)

    def clip(self, index: int) -> Motion:
        """One clip as a motion of the humanoid, in double precision."""
        return self.motion(*self.ranges[index].tolist())

    def motion(self, start: int, stop: int) -> Motion:
        """The frames [start, stop) as a motion of the humanoid, in double precision."""
        turned: Float[ndarray, "frame 22 4"] = self.local_rotations[start:stop].astype(float)
        turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
        return Motion(HUMANOID, self.root_positions[start:stop].astype(float), turned, MODEL_RATE)


def load(path: Path | str) -> Database:
    """The database in a folder; raises InputError where it is missing, incomplete, corrupt, or of another version."""
    path = Path(path)
    try:
        meta = json.loads((path / DATABASE_META).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(
            f"{path} is not a finished database: it has no {DATABASE_META}; make one with 'interpose prepare'"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path / DATABASE_META} cannot be read ({error}); prepare the database again") from None
    try:
        if meta["version"] != DATABASE_VERSION:
            raise InputError(f"{path} has version {meta['version']}, not {DATABASE_VERSION}; prepare it again")
        if tuple(meta["joints"]) != HUMANOID.names or meta["rate"] != MODEL_RATE:
            raise InputError(f"{path} does not hold the 22 joints at {MODEL_RATE:g} Hz; prepare it again")
        clips = tuple(clip_info(entry) for entry in meta["clips"])
        dataset, licence, fingerprint = (str(meta[name]) for name in ("dataset", "licence", "fingerprint"))
        made_from = str(meta.get("made_from", ""))
        skipped = tuple((str(file), str(reason)) for file, reason in meta["skipped"])
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path / DATABASE_META} is not that of a database ({error!r}); prepare it again") from None
    arrays = load_arrays(path, _ARRAYS, "prepare the database again")
    frames = len(arrays["root_positions"])
    fits = all(len(arrays[name]) == frames for name in _ARRAYS if name != "ranges")
    if not (fits and len(clips) == len(arrays["ranges"]) and contiguous(arrays["ranges"], frames)):
        raise InputError(f"the files of the database {path} do not fit together; prepare it again")
    return Database(path, dataset, licence, fingerprint, made_from, skipped, clips, **arrays)


def write(
    path: Path | str,
    clips: Sequence[tuple[ClipInfo, int]],
    arrays: Iterable[ClipArrays],
    *,
    dataset: str,
    licence: str,
    made_from: str = "",
    skipped: Sequence[tuple[str, str]] = (),
) -> Database:
    """Writes a database of the given clips, each with its number of frames, and returns it loaded.

    ``arrays`` yields the frames of each clip in the same order and is consumed one clip at a time. An earlier database
    in the folder stays intact until the new one is complete. The fingerprint covers each clip's name, labels and
    frames, in their order, and nothing of the source files. Raises InputError where the folder cannot be written.
    """
    path = Path(path)
    stops = np.cumsum([frames for _, frames in clips], dtype=np.int64)
    ranges = np.stack([stops - [frames for _, frames in clips], stops], axis=-1)
    meta = {
        "version": DATABASE_VERSION,
        "dataset": dataset,
        "licence": licence,
        "rate": MODEL_RATE,
        "joints": HUMANOID.names,
        "styles": sorted({info.style for info, _ in clips} - {""}),
        "frames": int(stops[-1]),
        "made_from": made_from,
        "clips": [asdict(info) for info, _ in clips],
        "skipped": list(skipped),
    }
    digest = hashlib.sha256()
    temporary = {name: path / f".{name}.npy.new" for name in _ARRAYS}
    try:
        path.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            files = {name: stack.enter_context(open(temporary[name], "wb")) for name in _ARRAYS}
            for name, (row, kind) in _ARRAYS.items():
                rows = len(clips) if name == "ranges" else int(stops[-1])
                header = {"descr": np.dtype(kind).str, "fortran_order": False, "shape": (rows, *row)}
                np.lib.format.write_array_header_1_0(files[name], header)
            files["ranges"].write(ranges.tobytes())
            for (info, frames), clip in zip(clips, arrays, strict=True):
                if len(clip) != frames:
                    raise ValueError(f"clip {info.name} has {len(clip)} frames, {frames} were announced")
                digest.update(repr((info.name, info.style, info.content, info.subject, frames)).encode())
                for field in fields(ClipArrays):
                    array = getattr(clip, field.name)
                    files[field.name].write(array.tobytes())
                    # Rounded to 0.1 mm, since the last bits of a float depend on the processor.
                    digest.update(np.rint(array * np.float64(1e4)).astype("<i4").tobytes())
        (path / DATABASE_META).unlink(missing_ok=True)
        for name, file in temporary.items():
            os.replace(file, path / f"{name}.npy")
        meta["fingerprint"] = digest.hexdigest()
        (path / f".{DATABASE_META}.new").write_text(json.dumps(meta, indent=1), encoding="utf-8")
        os.replace(path / f".{DATABASE_META}.new", path / DATABASE_META)
    except OSError as error:
        raise InputError(f"the database {path} cannot be written: {error.strerror or error}") from None
    finally:
        for file in filter(Path.exists, temporary.values()):
            file.unlink()
    return load(path)


def clip_info(entry: dict[str, Any]) -> ClipInfo:
    """A clip's entry in `meta.json`; raises KeyError, TypeError or ValueError for one that is incomplete."""
    values = {field.name: entry[field.name] for field in fields(ClipInfo)}
    start, stop = values["cut"]
    return ClipInfo(**{**values, "cut": (int(start), int(stop))})


def load_arrays(folder: Path, kinds: ArrayKinds, remedy: str) -> dict[str, ndarray]:
    """The arrays ``NAME.npy`` of a folder, mapped read-only. Raises InputError, which ends with ``remedy``, where one
    is missing, damaged, or of another kind."""
    out = {}
    for name in kinds:
        file = folder / f"{name}.npy"
        try:
            # A plain array, which stays mapped, is sliced much faster than np.memmap.
            out[name] = np.asarray(np.lib.format.open_memmap(file, mode="r"))
        except FileNotFoundError:
            raise InputError(f"{file} is missing; {remedy}") from None
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{file} cannot be read ({error}); {remedy}") from None
        check_kind(out[name], *kinds[name], str(file), remedy)
    return out


def check_kind(array: ndarray, row: tuple[int, ...], kind: type, name: str, remedy: str) -> None:
    """Raises InputError where an array has other rows, or another type."""
    if array.dtype != kind or array.ndim != 1 + len(row) or array.shape[1:] != row:
        expected = f"{np.dtype(kind)} ({', '.join(['…', *map(str, row)])})"
        raise InputError(f"{name} holds {array.dtype} {array.shape}, expected {expected}; {remedy}")


def contiguous(ranges: Int64[ndarray, "clip 2"], frames: int) -> bool:
    """Whether clips of at least one frame follow one another without gaps from 0 to ``frames``."""
    ends = np.concatenate([[0], ranges[:, 1]])
    return bool(np.array_equal(ranges[:, 0], ends[:-1]) and ends[-1] == frames and (np.diff(ends) > 0).all())
