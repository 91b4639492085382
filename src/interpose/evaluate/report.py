"""The files that an evaluation leaves, each whole or not at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from interpose.errors import InputError
from interpose.evaluate import figures, tables
from interpose.evaluate.tables import ResultRow
from interpose.io.files import write_whole


def write(rows: Sequence[ResultRow], folder: Path, markdown: str) -> None:
    """Write ``results.json``, ``.csv``, ``.md`` and, where it shows something, ``l2p.png``.

    Without matplotlib there is no figure. Raises InputError where the folder cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: the folder cannot be made: {(error.strerror or str(error)).lower()}") from None
    for suffix, text in {"json": tables.to_json(rows), "csv": tables.to_csv(rows), "md": markdown}.items():
        write_whole(folder / f"results.{suffix}", text.encode())
    ratios = [row for row in rows if row.metric == "L2P" and not math.isnan(row.ratio_to_interp)]
    if ratios:
        figures.draw_ratios(ratios, folder / "l2p.png")
