"""Pictures of a gallery after figures 3, 4 and 6 of Chu and Yang 2024, seen from above; drawn with matplotlib."""

from __future__ import annotations

import math
from pathlib import Path

from interpose.errors import InputError
from interpose.gallery.plots import canvas, distances, match, variants
from interpose.gallery.store import Gallery
from interpose.io.files import write_whole


def plot(gallery: Gallery, out: Path, *, style: str | None = None, distance: float = 2.0, seed: int = 0) -> list[Path]:
    """Writes the three pictures into the folder ``out``, created where missing, and returns their paths.

    style: the only one shown in `variants` and `match`, highlighted in `distances`. distance: of the queries from start
    to target, metres. Equal seeds give equal pictures. Raises InputError where matplotlib is not installed, for a style
    that the gallery lacks, a distance that is not positive or that no path covers, and where the folder cannot be
    written.
    """
    gallery.style_indices(style)
    if not (math.isfinite(distance) and distance > 0.0):
        raise InputError(f"the distance from start to target must be a length in metres above 0, got {distance:g}")
    canvas.need_matplotlib()
    shown = variants.variants(gallery, distance, style, seed)
    covered = distances.covered(gallery.tracks)
    matched = match.matched(gallery, distance, style, seed)
    pictures = {
        "variants.png": variants.draw(shown, distance, style),
        "distances.png": distances.draw(covered, style),
        "match.png": match.draw(matched),
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {out} cannot be created: {(error.strerror or str(error)).lower()}") from None
    for name, picture in pictures.items():
        write_whole(out / name, picture)
    return [out / name for name in pictures]
