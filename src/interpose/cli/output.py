"""Output files of a command: their names, and writing them all or none."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from interpose.errors import InputError
from interpose.io.registry import writer_of


def output_paths(out: str, variants: int, inputs: Sequence[str] = ()) -> list[Path]:
    """OUT.bvh for one variant, OUT-1.bvh, OUT-2.bvh, … for several.

    Raises InputError, before anything is generated, where the suffix is not known, the folder cannot be written to, or
    a file is one of the ``inputs``.
    """
    path = Path(out)
    writer_of(out)
    if not path.parent.is_dir():
        raise InputError(f"{out}: there is no folder {path.parent}; create it first")
    paths = [path] if variants == 1 else [path.with_stem(f"{path.stem}-{i}") for i in range(1, variants + 1)]
    for each in paths:
        if each.is_dir():
            raise InputError(f"{each} is a folder; name a file")
        if each.exists() and any(Path(name).exists() and each.samefile(name) for name in inputs):
            raise InputError(f"{each} is one of the inputs; name another file, or overwrite it with --force")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{out}: the folder {path.parent} cannot be written to")
    return paths


def write_all(paths: Sequence[Path], write: Callable[[int, Path], None]) -> None:
    """``write(i, path)`` for each path, all of them or none: temporaries beside them are renamed at the end.

    ``write`` itself leaves its file whole or absent, and raises InputError where it cannot be written.
    """
    if len(paths) == 1:
        write(0, paths[0])
        return
    temporaries = [p.with_name(f".{p.stem}.{os.getpid()}{p.suffix}") for p in paths]
    try:
        for i, (temporary, path) in enumerate(zip(temporaries, paths, strict=True)):
            try:
                write(i, temporary)
            except InputError as error:
                raise InputError(str(error).replace(str(temporary), str(path))) from error
        for temporary, path in zip(temporaries, paths, strict=True):
            os.replace(temporary, path)
    finally:
        for temporary in temporaries:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def show_progress(message: str) -> None:
    """On standard error."""
    print(message, file=sys.stderr, flush=True)
