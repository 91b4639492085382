"""Reads whole files up to a size limit; writes files whole or not at all."""

from __future__ import annotations

import codecs
import os
from pathlib import Path

from interpose.errors import InputError

MAX_BYTES = 256 * 1024 * 1024
"""Larger files are refused. An hour of 22 joints at 120 Hz, written with 9 digits, is 260 MB."""


def read_whole(path: str | os.PathLike[str], limit: int = MAX_BYTES) -> bytes:
    """The bytes of a file of at most ``limit`` bytes.

    Raises InputError where the file is missing, a folder, unreadable or larger.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(limit + 1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder; give a file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {_reason(error)}") from None
    if len(data) > limit:
        raise InputError(f"{path}: larger than {limit / 2**20:.0f} MB; cut it into shorter clips")
    return data


def encoding_of(text: bytes) -> str:
    """UTF-8, with a byte order mark where there is one, or Latin-1 for bytes that are not UTF-8."""
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig" if text.startswith(codecs.BOM_UTF8) else "utf-8"


def write_whole(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes ``data`` to a temporary file and renames it to ``path``, so that the file is whole or absent.

    Devices and pipes (``/dev/stdout``) are written directly. Raises InputError where the path cannot be written.
    """
    target = Path(path)
    try:
        target = Path(os.path.realpath(path))
        beside = target.with_name(f".interpose-{os.getpid()}-{os.urandom(4).hex()}.tmp")
        if target.is_dir():
            raise InputError(f"{path}: is a folder; give a file name")
        if target.exists() and not target.is_file():
            target.write_bytes(data)
            return
        try:
            with open(beside, "xb") as file:
                file.write(data)
            os.replace(beside, target)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise
    except FileNotFoundError:
        raise InputError(f"{path}: the folder {target.parent} does not exist; create it first") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be written: {_reason(error)}") from None


def _reason(error: OSError | ValueError) -> str:
    return (getattr(error, "strerror", None) or str(error)).lower()
