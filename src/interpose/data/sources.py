"""What each data set looks like as its makers publish it: which files, and what their names and tables say.

    lafan1    the 77 BVH files or their zip, `walk1_subject5.bvh`; also excerpts of them, `walk1_subject5_turn.bvh`.
              The style is the theme of the take, without its number. Harvey et al. 2020 test on subject 5.
    100style  `Angry_FW.bvh` in a folder a style or all in one, with `Frame_Cuts.csv`: the frames to use, at 60 Hz.
              Mason, Starke and Komura 2022.
    bandai    `dataset-1_walk_angry_001.bvh`: content, then style. Bandai-Namco Research Motiondataset 1 and 2.
    amass     `CMU/01/01_01_poses.npz`: data set, subject, take, as the archives of AMASS unpack; the style is the data
              set. SMPL-H, SMPL-X and SMPL files; `shape.npz` and `*_stagei.npz` hold bodies and no motion. Mahmood et
              al. 2019.
    h36m      `S1/walking_1.txt`: the exponential maps of h3.6m.zip; the style is the action. Ionescu et al. 2014 test
              on subjects 9 and 11.
    o3de      `walk/walk1.bvh`: the motion-matching sample of O3DE; the style is the name of the sub-folder.
    cmu       `dance/05_02.bvh`: takes of Carnegie Mellon's database, likewise in a sub-folder a style.
    bvh       any folder; the style is the name of the sub-folder that a file is in.

A source is a folder, a zip archive, or a single file. Files are found at any depth.
"""

from __future__ import annotations

import csv
import hashlib
import io
import os
import re
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from interpose.errors import InputError

UNLABELLED = "unlabelled"
CUTS = "Frame_Cuts.csv"
CUT_RATE = 60.0

_LAFAN1 = re.compile(r"(?P<style>[A-Za-z]+)\d*_(?P<subject>subject\d+)(?:_(?P<content>.+?)\d*)?")
_STYLE100 = re.compile(r"(?P<style>[^_]+)_(?P<content>[A-Z]{2}\d?)")
_H36M = re.compile(r"(?P<style>[A-Za-z]+)_\d+")
_SUBJECT = re.compile(r"S\d+")
_SHAPE = re.compile(r"shape|.*_stagei", re.IGNORECASE)
_BANDAI = re.compile(r"dataset-\d+_(?P<content>[^_]+)_(?P<style>[^_]+)_\d+")


@dataclass(frozen=True)
class SourceFile:
    """A file of a source: on disk, or in a zip archive on disk (then ``member`` is its name there)."""

    name: str
    origin: Path
    member: str
    size: int
    stamp: int

    def read_bytes(self) -> bytes:
        """The whole file; raises InputError where it cannot be read."""
        try:
            if not self.member:
                return self.origin.read_bytes()
            with zipfile.ZipFile(self.origin) as archive:
                return archive.read(self.member)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError) as error:
            raise InputError(f"{self.origin / self.member} cannot be read: {error}") from None


@dataclass(frozen=True)
class SourceClip:
    """A clip to be prepared. ``cut`` is the range [start, stop) to keep, counted at ``CUT_RATE``; None keeps all."""

    name: str
    source: SourceFile
    style: str
    content: str
    subject: str
    cut: tuple[int, int] | None

    def key(self) -> str:
        """Changes when the file or anything else known of the clip does."""
        return hashlib.sha256(repr((self, self.source.origin.resolve())).encode()).hexdigest()


@dataclass(frozen=True)
class Findings:
    """The clips of some sources, sorted by name, and the files that are not used, each with the reason."""

    clips: tuple[SourceClip, ...]
    skipped: tuple[tuple[str, str], ...]


Labels = Mapping[str, str | None] | str
"""What the name of a file says: style, and where known content and subject; or why the file is not used."""


@dataclass(frozen=True)
class Kind:
    """A data set: its licence, what labels the name of a file carries, the files' suffix, and who is for testing.

    from_folders: the name begins with the folders that hold the source, so that a part of the data set may be given.
    licence: with the word NC where commercial use is not allowed (`interpose.export.licence` looks for it).
    """

    licence: str
    labels: Callable[[PurePosixPath], Labels]
    suffix: str = ".bvh"
    test_subjects: tuple[str, ...] = ()
    from_folders: bool = False


def _by_stem(expression: re.Pattern[str], form: str) -> Callable[[PurePosixPath], Labels]:
    def labels(name: PurePosixPath) -> Labels:
        found = expression.fullmatch(name.stem)
        return f"its name is not of the form {form}" if found is None else found.groupdict()

    return labels


def _amass(name: PurePosixPath) -> Labels:
    if _SHAPE.fullmatch(name.stem):
        return "it holds a body's shape and no motion"
    folders = [folder for folder in name.parent.parts if folder != "/"]
    return {"style": folders[-2] if len(folders) > 1 else (folders or [UNLABELLED])[-1], "subject": name.parent.name}


def _h36m(name: PurePosixPath) -> Labels:
    found = _H36M.fullmatch(name.stem)
    if found is None or not _SUBJECT.fullmatch(name.parent.name):
        return "its name is not of the form S1/walking_1.txt"
    return {"style": found["style"].lower(), "subject": name.parent.name}


def _by_folder(*styles: str) -> Callable[[PurePosixPath], Labels]:
    """The style is the name of the folder, where it is one of ``styles``; otherwise the clip has none."""

    def labels(name: PurePosixPath) -> Labels:
        folder = name.parent.name.lower()
        return {"style": folder.capitalize() if folder in styles else None}

    return labels


KINDS = {
    "lafan1": Kind(
        "CC BY-NC-ND 4.0 (non-commercial research only)",
        _by_stem(_LAFAN1, "walk1_subject1.bvh"),
        test_subjects=("subject5",),
    ),
    "100style": Kind("CC BY 4.0, Mason, Starke and Komura 2022", _by_stem(_STYLE100, "Angry_FW.bvh")),
    "bandai": Kind("CC BY-NC 4.0 (non-commercial only)", _by_stem(_BANDAI, "dataset-1_walk_angry_001.bvh")),
    "o3de": Kind(
        "Apache-2.0 or MIT, Open 3D Engine (O3DE) motion matching sample",
        _by_folder("crouch", "jog", "mixed", "push", "run", "turn", "walk"),
        from_folders=True,
    ),
    "cmu": Kind(
        "free for commercial and other use, but the data itself may not be sold; Carnegie Mellon University, "
        "mocap.cs.cmu.edu, funded by NSF EIA-0196217",
        _by_folder("basketball", "dance", "everyday", "fight", "jump", "run", "signals", "soccer", "swordplay", "walk"),
        from_folders=True,
    ),
    "amass": Kind("AMASS licence, NC (non-commercial research only)", _amass, ".npz", from_folders=True),
    "h36m": Kind(
        "Human3.6M licence, NC (academic research only)",
        _h36m,
        ".txt",
        test_subjects=("S9", "S11"),
        from_folders=True,
    ),
    "bvh": Kind("unknown", lambda name: {"style": name.parent.name or UNLABELLED}),
}


def find(kind: str, sources: Sequence[Path | str], split: str = "all") -> Findings:
    """The clips of one data set in some folders, archives or files.

    ``split`` is 'all', or where a data set has subjects for testing, 'train' (all others) or 'test' (only they). Raises
    InputError for an unknown kind or split, a source that cannot be read, and where no clip is found.
    """
    if kind not in KINDS:
        raise InputError(f"unknown data set '{kind}'; known are {', '.join(KINDS)}")
    if split not in ("all", "train", "test"):
        raise InputError(f"unknown split '{split}'; use all, train or test")
    chosen = KINDS[kind]
    if split != "all" and not chosen.test_subjects:
        able = " and ".join(name for name in KINDS if KINDS[name].test_subjects)
        raise InputError(f"only {able} have a split into train and test, {kind} has none; leave it at 'all'")
    if not sources:
        raise InputError("no source given; name at least one folder, zip archive or file")
    listings = [_listing(Path(source), (chosen.suffix, ".csv")) for source in sources]
    named: list[tuple[SourceFile, Mapping[str, str | None]]] = []
    skipped: list[tuple[str, str]] = []
    cuts: dict[str, tuple[int, int]] = {}
    for source, files in zip(sources, listings, strict=True):
        motions = [file for file in files if file.name.lower().endswith(chosen.suffix)]
        if not motions:
            raise InputError(f"{source} holds no {chosen.suffix} file")
        if kind == "100style":
            cuts |= _read_cuts(source, files)
        for file in motions:
            name = PurePosixPath(file.name)
            labels = chosen.labels(_folders(Path(source)) / name if chosen.from_folders else name)
            if isinstance(labels, str):
                skipped.append((file.name, labels))
            else:
                named.append((file, labels))
    repeated = Counter(file.name for file, _ in named)
    # By their contents where names are equal, so that the order of the sources does not matter.
    named.sort(key=lambda entry: (entry[0].name, entry[0].read_bytes() if repeated[entry[0].name] > 1 else b""))
    names = _unique_names([file.name for file, _ in named])
    whole = {name for name in names if name.count("_") == 1}
    clips: list[SourceClip] = []
    for name, (file, labels) in zip(names, named, strict=True):
        subject = labels.get("subject") or ""
        if split != "all" and (subject in chosen.test_subjects) != (split == "test"):
            continue
        if kind == "lafan1" and name.count("_") > 1 and name.rsplit("_", 1)[0] in whole:
            skipped.append((file.name, "the whole take that it is an excerpt of is there, too"))
        elif kind == "100style" and PurePosixPath(file.name).stem not in cuts:
            skipped.append((file.name, f"{CUTS} has no range for it"))
        else:
            cut = cuts.get(PurePosixPath(file.name).stem)
            clips.append(SourceClip(name, file, labels["style"] or "", labels.get("content") or "", subject, cut))
    if not clips:
        reason = f" ({skipped[0][0]}: {skipped[0][1]})" if skipped else f" of split '{split}'"
        raise InputError(f"no clip of {kind}{reason} in {', '.join(map(str, sources))}")
    return Findings(tuple(sorted(clips, key=lambda clip: clip.name)), tuple(sorted(skipped)))


def _listing(source: Path, suffixes: tuple[str, ...]) -> list[SourceFile]:
    """Every file of these suffixes below a folder, in an archive, or the file itself; names relative, with '/'."""
    try:
        if source.is_dir():
            found = []
            for folder, folders, files in os.walk(source):
                folders[:] = sorted(name for name in folders if not name.startswith("."))
                found += [Path(folder) / name for name in sorted(files) if _wanted(name, suffixes)]
            return [_plain(file, file.relative_to(source).as_posix()) for file in found]
        if source.suffix.lower() == ".zip":
            with zipfile.ZipFile(source) as archive:
                members = sorted(archive.infolist(), key=lambda member: member.filename)
            return [
                SourceFile(member.filename, source, member.filename, member.file_size, member.CRC)
                for member in members
                if _wanted(PurePosixPath(member.filename).name, suffixes)
                and not member.filename.startswith("__MACOSX/")
            ]
        return [_plain(source, source.name)]
    except FileNotFoundError:
        raise InputError(f"the source {source} does not exist") from None
    except (OSError, zipfile.BadZipFile) as error:
        raise InputError(f"the source {source} cannot be read: {error}") from None


def _wanted(name: str, suffixes: tuple[str, ...]) -> bool:
    return name.lower().endswith(suffixes) and not name.startswith(".")


def _folders(source: Path) -> PurePosixPath:
    """The folders that hold what is in a source, itself included where it is one; an archive counts as one."""
    whole = source.resolve()
    if whole.is_dir():
        return PurePosixPath(whole.as_posix())
    inside = whole.with_suffix("") if whole.suffix.lower() == ".zip" else whole.parent
    return PurePosixPath(inside.as_posix())


def _plain(file: Path, name: str) -> SourceFile:
    status = file.stat()
    return SourceFile(name, file, "", status.st_size, status.st_mtime_ns)


def _unique_names(files: Sequence[str]) -> list[str]:
    """Stems of the files; whole paths where two stems are equal, and numbers where even those are."""
    paths = [PurePosixPath(file).with_suffix("") for file in files]
    stems = [path.stem for path in paths]
    count = Counter(stems)
    names = [path.name if count[path.stem] == 1 else str(path) for path in paths]
    seen: dict[str, int] = {}
    for i, name in enumerate(names):
        seen[name] = seen.get(name, 0) + 1
        if seen[name] > 1:
            names[i] = f"{name}#{seen[name]}"
    return names


def _read_cuts(source: Path | str, files: Sequence[SourceFile]) -> dict[str, tuple[int, int]]:
    """The range [start, stop) at 60 Hz of each `Style_CONTENT` that Frame_Cuts.csv has one for."""
    tables = [file for file in files if PurePosixPath(file.name).name == CUTS]
    if not tables:
        raise InputError(f"{source} has no {CUTS}, the table of 100STYLE that says which frames to use; put it beside")
    text = tables[0].read_bytes().decode("utf-8-sig", errors="replace")
    cuts: dict[str, tuple[int, int]] = {}
    for line, row in enumerate(csv.DictReader(io.StringIO(text.replace("\0", ""))), start=2):
        style = (row.get("STYLE_NAME") or "").strip()
        for column in row:
            if not style or column is None or not column.endswith("_START"):
                continue
            content = column.removesuffix("_START")
            start, stop = _index(row[column]), _index(row.get(f"{content}_STOP"))
            if start is None or stop is None:
                continue
            if not 0 <= start < stop:
                raise InputError(f"{tables[0].name} line {line}: the range {start} to {stop} of {content} is empty")
            cuts[f"{style}_{content}"] = (start, stop)
    if not cuts:
        raise InputError(f"{tables[0].name} holds no range; expected columns STYLE_NAME, FW_START, FW_STOP, …")
    return cuts


def _index(text: str | None) -> int | None:
    try:
        return int(float(text or "nan"))
    except (ValueError, OverflowError):
        return None
