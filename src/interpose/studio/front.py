"""The built front end: where it is, in the package or in a source checkout, and its files, served and nothing else."""

from __future__ import annotations

import importlib.util
import re
import stat
import sys
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.responses import Response

from interpose.errors import InputError

PACKAGED = Path(__file__).resolve().parent / "page"
BUILDER = Path(__file__).resolve().parents[3] / "web" / "build.py"
MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".ico": "image/x-icon",
    ".woff2": "font/woff2",
    ".wasm": "application/wasm",
    ".json": "application/json",
    ".map": "application/json",
    ".txt": "text/plain; charset=utf-8",
    ".glb": "model/gltf-binary",
}
_NAME = re.compile(r"[A-Za-z0-9_-][A-Za-z0-9_.-]*")
_HASHED = re.compile(r"assets/.*-[A-Za-z0-9_-]{8}\.\w+")
"""Files that Vite names after their contents."""


def find(packaged: Path = PACKAGED, builder: Path = BUILDER) -> Path:
    """The folder of the built front end. In a source checkout, `web/build.py` brings it up to date.

    Raises InputError if it cannot be built, or if neither it nor its sources exist.
    """
    if (packaged / "index.html").exists():
        return packaged
    if not builder.exists():
        raise InputError("the studio's front end is missing from this installation; reinstall Interpose")
    spec = importlib.util.spec_from_file_location("interpose_web_build", builder)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look themselves up there
    spec.loader.exec_module(module)
    try:
        return module.build()
    except (module.Failed, OSError) as error:
        raise InputError(f"the studio's front end could not be built: {error}") from None


def serve_file(folder: Path | None, path: str) -> Response:
    """The file at a URL path, index.html if it is empty. Raises HTTPException if there is none."""
    if folder is None:
        raise HTTPException(503, "the studio was started without its front end; start it with 'interpose studio'")
    path = path or "index.html"
    file = folder
    try:
        for name in path.split("/"):
            file = file / name
            if not _NAME.fullmatch(name) or file.is_symlink():
                raise HTTPException(404)
        regular = stat.S_ISREG(file.lstat().st_mode)
        data = file.read_bytes() if regular else b""
    except OSError:
        regular, data = False, b""
    if not regular or file.suffix not in MEDIA_TYPES:
        raise HTTPException(404)
    keep = "public, max-age=31536000, immutable" if _HASHED.fullmatch(path) else "no-cache"
    return Response(data, media_type=MEDIA_TYPES[file.suffix], headers={"cache-control": keep})
