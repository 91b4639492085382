"""The data sets that `interpose prepare` reads, one entry each, and the clips in their folders and archives.

A source is a folder, a zip archive or a single file. Files are found at any depth.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from interpose.errors import InputError
from interpose.io.files import MAX_BYTES

FRAME_CUTS = "Frame_Cuts.csv"
FRAME_CUTS_RATE = 60.0
"""Hertz: the rate at which the table counts frames."""


@dataclass(frozen=True)
class ClipLabels:
    """What the path of a file says of its clip; '' where it does not say. A clip without a style trains as free."""

    style: str = ""
    content: str = ""
    subject: str = ""


LabelReader = Callable[[PurePosixPath], ClipLabels | str]
"""The labels of a file from its path, or the reason why the file is not used."""


@dataclass(frozen=True)
class Dataset:
    """A data set as its makers publish it.

    licence: with the word NC where commercial use is not allowed (`interpose.export.folder.licence` looks for it), and
    the credit that it asks for. labels: reads them from a file's path. suffix: of the motion files.
    test_subjects: their clips are split 'test', all others 'train'. from_folders: labels depend on the folders above a
    source, so that a part of the data set may be given. frame_cuts: a table gives the frames of each clip to use.
    excerpts: a name may be that of a take with the name of an excerpt appended; it is skipped beside the whole take.
    """

    licence: str
    labels: LabelReader
    suffix: str = ".bvh"
    test_subjects: tuple[str, ...] = ()
    from_folders: bool = False
    frame_cuts: bool = False
    excerpts: bool = False


def _by_name(expression: str, example: str) -> LabelReader:
    """Labels are the named groups of an expression that the whole stem of a file matches."""
    pattern = re.compile(expression)

    def labels(path: PurePosixPath) -> ClipLabels | str:
        found = pattern.fullmatch(path.stem)
        if found is None:
            return f"its name is not of the form {example}"
        return ClipLabels(**{label: value or "" for label, value in found.groupdict().items()})

    return labels


def _by_folder(*styles: str) -> LabelReader:
    """The style is the folder's name where it is one of ``styles``; other clips have none."""

    def labels(path: PurePosixPath) -> ClipLabels:
        folder = path.parent.name.lower()
        return ClipLabels(folder.capitalize() if folder in styles else "")

    return labels


def _amass(path: PurePosixPath) -> ClipLabels | str:
    """`CMU/01/01_01_poses.npz`: the style is the data set in AMASS, the folder above that of the subject."""
    if re.fullmatch(r"shape|.*_stagei", path.stem, re.IGNORECASE):
        return "it holds a body's shape and no motion"
    folders = [folder for folder in path.parent.parts if folder != "/"]
    return ClipLabels("".join(folders[-2:][:1]), subject=path.parent.name)


def _h36m(path: PurePosixPath) -> ClipLabels | str:
    """`S1/walking_1.txt`: the style is the action."""
    found = re.fullmatch(r"([A-Za-z]+)_\d+", path.stem)
    if found is None or not re.fullmatch(r"S\d+", path.parent.name):
        return "its name is not of the form S1/walking_1.txt"
    return ClipLabels(found[1].lower(), subject=path.parent.name)


DATASETS = {
    # Harvey et al. 2020, 77 files. The style is the theme of the take, without its number.
    "lafan1": Dataset(
        "CC BY-NC-ND 4.0 (non-commercial research only)",
        _by_name(
            r"(?P<style>[A-Za-z]+)\d*_(?P<subject>subject\d+)(?:_(?P<content>.+?)\d*)?", example="walk1_subject1.bvh"
        ),
        test_subjects=("subject5",),
        excerpts=True,
    ),
    # Mason, Starke and Komura 2022: a folder for each style, or all files in one.
    "100style": Dataset(
        "CC BY 4.0, Mason, Starke and Komura 2022",
        _by_name(r"(?P<style>[^_]+)_(?P<content>[A-Z]{2}\d?)", example="Angry_FW.bvh"),
        frame_cuts=True,
    ),
    # Bandai-Namco Research Motiondataset 1 and 2: content, then style.
    "bandai": Dataset(
        "CC BY-NC 4.0 (non-commercial only)",
        _by_name(r"dataset-\d+_(?P<content>[^_]+)_(?P<style>[^_]+)_\d+", example="dataset-1_walk_angry_001.bvh"),
    ),
    # Converted to BVH, a folder for each style: walk/walk1.bvh.
    "o3de": Dataset(
        "Apache-2.0 or MIT, Open 3D Engine (O3DE) motion matching sample",
        _by_folder("crouch", "jog", "mixed", "push", "run", "turn", "walk"),
        from_folders=True,
    ),
    # Converted to BVH, a folder for each style: dance/05_02.bvh.
    "cmu": Dataset(
        "free for commercial and other use, but the data itself may not be sold; Carnegie Mellon University, "
        "mocap.cs.cmu.edu, funded by NSF EIA-0196217",
        _by_folder("basketball", "dance", "everyday", "fight", "jump", "run", "signals", "soccer", "swordplay", "walk"),
        from_folders=True,
    ),
    # Mahmood et al. 2019: SMPL-H, SMPL-X and SMPL files, in the folders of AMASS's archives.
    "amass": Dataset("AMASS licence, NC (non-commercial research only)", _amass, ".npz", from_folders=True),
    # Ionescu et al. 2014: the exponential maps of h3.6m.zip.
    "h36m": Dataset(
        "Human3.6M licence, NC (academic research only)",
        _h36m,
        ".txt",
        test_subjects=("S9", "S11"),
        from_folders=True,
    ),
    # Any folder. The style is the name of the sub-folder that holds the file.
    "bvh": Dataset("unknown", lambda path: ClipLabels(path.parent.name)),
}


@dataclass(frozen=True)
class DatasetFile:
    """A file of a source: on disk, or in a zip archive on disk (then ``member`` is its name there)."""

    name: str
    origin: Path
    member: str
    size: int
    stamp: int

    def read_bytes(self) -> bytes:
        """The whole file; raises InputError where it cannot be read or is too large for a clip."""
        if self.size > MAX_BYTES:
            raise InputError(f"{self.name}: larger than {MAX_BYTES / 2**20:.0f} MB; cut it into shorter clips")
        try:
            if not self.member:
                return self.origin.read_bytes()
            with zipfile.ZipFile(self.origin) as archive:
                return archive.read(self.member)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError) as error:
            raise InputError(f"{self.origin / self.member} cannot be read: {error}") from None


@dataclass(frozen=True)
class SourceClip:
    """A clip to prepare. ``cut`` is the range [start, stop) to keep, at ``FRAME_CUTS_RATE``; None keeps all."""

    name: str
    source: DatasetFile
    labels: ClipLabels
    cut: tuple[int, int] | None

    def key(self) -> str:
        """A digest that changes with the file, its place, its labels and its cut."""
        return hashlib.sha256(repr((self, self.source.origin.resolve())).encode()).hexdigest()


@dataclass(frozen=True)
class SourceClips:
    """The clips of some sources, sorted by name, and the files that are not used, each with the reason."""

    clips: tuple[SourceClip, ...]
    skipped: tuple[tuple[str, str], ...]


def find(dataset: str, sources: Sequence[Path | str], split: str = "all") -> SourceClips:
    """The clips of a data set in some folders, archives or files, whatever the order of these.

    ``split`` is 'all', or for a data set with test subjects 'train' (all others) or 'test' (only they). Raises
    InputError for an unknown data set or split, a source that cannot be read, and where no clip is found.
    """
    chosen = _checked(dataset, split)
    if not sources:
        raise InputError("no source given; name at least one folder, zip archive or file")
    found: list[tuple[DatasetFile, ClipLabels, tuple[int, int] | None]] = []
    skipped: list[tuple[str, str]] = []
    for source in map(Path, sources):
        files = _files(source, (chosen.suffix, ".csv"))
        motions = [file for file in files if file.name.lower().endswith(chosen.suffix)]
        if not motions:
            raise InputError(f"{source} holds no {chosen.suffix} file")
        cuts = _read_frame_cuts(source, files) if chosen.frame_cuts else {}
        for file in motions:
            path = PurePosixPath(file.name)
            labels = chosen.labels(_folders(source) / path if chosen.from_folders else path)
            if isinstance(labels, str):
                skipped.append((file.name, labels))
            elif chosen.frame_cuts and path.stem not in cuts:
                skipped.append((file.name, f"{FRAME_CUTS} has no range for it"))
            else:
                found.append((file, labels, cuts.get(path.stem)))
    # Files of equal names are sorted by contents: the order of the sources must not matter.
    repeated = Counter(file.name for file, *_ in found)
    found.sort(key=lambda entry: (entry[0].name, entry[0].read_bytes() if repeated[entry[0].name] > 1 else b""))
    names = _unique_names([file.name for file, *_ in found])
    takes = {name for name in names if name.count("_") == 1} if chosen.excerpts else set()
    clips: list[SourceClip] = []
    for name, (file, labels, cut) in zip(names, found, strict=True):
        if split != "all" and (labels.subject in chosen.test_subjects) != (split == "test"):
            continue
        if name.count("_") > 1 and name.rsplit("_", 1)[0] in takes:
            skipped.append((file.name, "it is an excerpt of a take that is there as a whole"))
        else:
            clips.append(SourceClip(name, file, labels, cut))
    if not clips:
        reason = f" ({skipped[0][0]}: {skipped[0][1]})" if skipped else f" of split '{split}'"
        raise InputError(f"no clip of {dataset}{reason} in {', '.join(map(str, sources))}")
    return SourceClips(tuple(sorted(clips, key=lambda clip: clip.name)), tuple(sorted(skipped)))


def _checked(dataset: str, split: str) -> Dataset:
    if dataset not in DATASETS:
        raise InputError(f"unknown data set '{dataset}'; choose from {', '.join(DATASETS)}")
    if split not in ("all", "train", "test"):
        raise InputError(f"unknown split '{split}'; use all, train or test")
    if split != "all" and not DATASETS[dataset].test_subjects:
        with_split = " and ".join(name for name, entry in DATASETS.items() if entry.test_subjects)
        raise InputError(f"only {with_split} have a split into train and test; use all for {dataset}")
    return DATASETS[dataset]


def _files(source: Path, suffixes: tuple[str, ...]) -> list[DatasetFile]:
    """Every file of these suffixes below a folder, in an archive, or the file itself; names relative, with '/'."""
    try:
        if source.is_dir():
            found = []
            for folder, folders, files in os.walk(source):
                folders[:] = sorted(name for name in folders if not name.startswith("."))
                found += [Path(folder) / name for name in sorted(files) if _is_wanted(name, suffixes)]
            return [_file_on_disk(file, file.relative_to(source).as_posix()) for file in found]
        if source.suffix.lower() == ".zip":
            with zipfile.ZipFile(source) as archive:
                members = sorted(archive.infolist(), key=lambda member: member.filename)
            return [
                DatasetFile(member.filename, source, member.filename, member.file_size, member.CRC)
                for member in members
                if _is_wanted(PurePosixPath(member.filename).name, suffixes)
                and not member.filename.startswith("__MACOSX/")
            ]
        return [_file_on_disk(source, source.name)]
    except FileNotFoundError:
        raise InputError(f"the source {source} does not exist") from None
    except (OSError, zipfile.BadZipFile) as error:
        raise InputError(f"the source {source} cannot be read: {error}") from None


def _is_wanted(name: str, suffixes: tuple[str, ...]) -> bool:
    return name.lower().endswith(suffixes) and not name.startswith(".")


def _file_on_disk(file: Path, name: str) -> DatasetFile:
    status = file.stat()
    return DatasetFile(name, file, "", status.st_size, status.st_mtime_ns)


def _folders(source: Path) -> PurePosixPath:
    """The folders above the files of a source, itself included where it is one; an archive counts as a folder."""
    whole = source.resolve()
    if whole.is_dir():
        return PurePosixPath(whole.as_posix())
    inside = whole.with_suffix("") if whole.suffix.lower() == ".zip" else whole.parent
    return PurePosixPath(inside.as_posix())


def _unique_names(files: Sequence[str]) -> list[str]:
    """Stems of the files; whole paths where two stems are equal, and numbers where even those are."""
    paths = [PurePosixPath(file).with_suffix("") for file in files]
    count = Counter(path.name for path in paths)
    names = [path.name if count[path.name] == 1 else str(path) for path in paths]
    seen: Counter[str] = Counter()
    for i, name in enumerate(names):
        seen[name] += 1
        if seen[name] > 1:
            names[i] = f"{name}#{seen[name]}"
    return names


def _read_frame_cuts(source: Path, files: Sequence[DatasetFile]) -> dict[str, tuple[int, int]]:
    """The range [start, stop) at 60 Hz of each `Style_CONTENT` in the table; 'N/A' gives none."""
    tables = [file for file in files if PurePosixPath(file.name).name == FRAME_CUTS]
    if not tables:
        raise InputError(f"{source} has no {FRAME_CUTS}, the table of 100STYLE with the frames to use; add it there")
    text = tables[0].read_bytes().decode("utf-8-sig", errors="replace")
    cuts: dict[str, tuple[int, int]] = {}
    for number, row in enumerate(csv.DictReader(io.StringIO(text.replace("\0", ""))), start=2):
        style = (row.get("STYLE_NAME") or "").strip()
        for column in row:
            if not style or column is None or not column.endswith("_START"):
                continue
            content = column.removesuffix("_START")
            start, stop = _index(row[column]), _index(row.get(f"{content}_STOP"))
            if start is None or stop is None:
                continue
            if not 0 <= start < stop:
                raise InputError(f"{tables[0].name} line {number}: the range {start} to {stop} of {content} is empty")
            cuts[f"{style}_{content}"] = (start, stop)
    if not cuts:
        raise InputError(f"{tables[0].name} holds no range; expected columns STYLE_NAME, FW_START, FW_STOP, …")
    return cuts


def _index(text: str | None) -> int | None:
    try:
        return int(float(text or "nan"))
    except (ValueError, OverflowError):
        return None
