"""The gallery in pictures, after figures 3, 4 and 6 of Chu and Yang 2024; drawn with matplotlib.

`variants` shows how different the ways are that one query finds, `distances` how far each style goes in a given time,
`match` how one candidate is laid onto a query. Everything is seen from above; where a way has a straight line from end
to end, that line runs to the right.
"""

from __future__ import annotations

import math
from pathlib import Path

from interpose.errors import InputError
from interpose.gallery.plots import canvas, distances, match, variants
from interpose.gallery.store import Gallery
from interpose.io.files import write_whole

VARIANTS, DISTANCES, MATCH = "variants.png", "distances.png", "match.png"


def plot(gallery: Gallery, out: Path, *, style: str | None = None, distance: float = 2.0, seed: int = 0) -> list[Path]:
    """Writes the three pictures into the folder ``out``, made where it is missing, and gives their paths.

    style: whose ways are shown alone in `variants` and `match` and pointed out in `distances`. distance: of the queries
    from start to target, metres. With equal seeds the pictures are the same. Raises InputError where matplotlib is not
    installed, for a style that the gallery lacks, a distance that is none or that no way covers, and where the folder
    cannot be made or written.
    """
    gallery.style_indices(style)
    if not (math.isfinite(distance) and distance > 0.0):
        raise InputError(f"the distance from start to target must be a length in metres above 0, got {distance:g}")
    canvas.need_matplotlib()
    shown = variants.variants(gallery, distance, style, seed)
    covered = distances.covered(gallery.tracks)
    matched = match.matched(gallery, distance, style, seed)
    pictures = {
        VARIANTS: variants.draw(shown, distance, style),
        DISTANCES: distances.draw(covered, style),
        MATCH: match.draw(matched),
    }
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the folder {out} cannot be made: {(error.strerror or str(error)).lower()}") from None
    for name, picture in pictures.items():
        write_whole(out / name, picture)
    return [out / name for name in pictures]


__all__ = ["plot"]
