"""`interpose studio`: reads the given file, finds the front end, and serves."""

from __future__ import annotations

from pathlib import Path

from interpose import io
from interpose.cli.inputs import gallery_of
from interpose.errors import InputError
from interpose.io.files import encoding_of, read_whole
from interpose.studio import front, projects
from interpose.studio.methods import Offer
from interpose.studio.project_format import SourceFile
from interpose.studio.protocol import LARGEST_UPLOAD, Opened
from interpose.studio.rigs import RigStore
from interpose.studio.serve import serve

SUFFIXES = (".bvh", ".interpose")


def studio(clip: str | None, port: int | None, no_browser: bool, gallery: str | None = None) -> int:
    opened = read(clip)
    offer = Offer(gallery=None if gallery is None else gallery_of(gallery), gallery_name=gallery and Path(gallery).name)
    return serve(opened, front.find(), port, browse=not no_browser, offer=offer)


def read(clip: str | None) -> Opened:
    """The file for the browser to open. Raises InputError, before the server starts, if it cannot be opened."""
    if clip is None:
        return Opened(source=None, project=None)
    name = Path(clip).name.encode(errors="replace").decode()  # a file name may be any bytes
    if Path(clip).suffix.lower() not in SUFFIXES:
        raise InputError(f"{clip}: the studio opens {' and '.join(SUFFIXES)} files")
    data = read_whole(clip, LARGEST_UPLOAD)
    if Path(clip).suffix.lower() == ".interpose":
        return Opened(source=None, project=projects.read(data, RigStore(), clip))
    io.parse(data, clip)
    return Opened(source=SourceFile(name=name[:120], text=data.decode(encoding_of(data))), project=None)
