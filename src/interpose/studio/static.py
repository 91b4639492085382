"""Serves the files of the built front end, and nothing else."""

from __future__ import annotations

import re
import stat
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.responses import Response

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
