"""What every recipe begins with: databases, what its config keeps of them, and their frames on a device."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from interpose.data import database, label_issues
from interpose.data.database import Database
from interpose.data.split import training_ranges
from interpose.train.common.frames import Frames, joined, load_frames


def load(paths: list[Path]) -> tuple[list[Database], dict[str, Any]]:
    """The databases, and the fields of a config that come from them: names and fingerprints, styles, licences.

    Raises InputError where one does not load.
    """
    loaded = [database.load(path) for path in paths]
    return loaded, {
        "databases": tuple(f"{d.dataset} {d.fingerprint} {label_issues.kept_summary(d)}".strip() for d in loaded),
        "styles": joined_styles(loaded),
        "licence": "; ".join(dict.fromkeys(d.licence for d in loaded)),
    }


def joined_styles(databases: list[Database]) -> tuple[str, ...]:
    """The styles of all databases, sorted. Names that differ in case alone are one style, spelled as in the first."""
    spelled: dict[str, str] = {}
    for style in (style for data in databases for style in data.styles):
        spelled.setdefault(style.casefold(), style)
    return tuple(sorted(spelled.values()))


def split(
    databases: list[Database],
    styles: tuple[str, ...],
    device: str = "cpu",
    phases: list[Float[np.ndarray, "2 frame 10 3"]] | None = None,
) -> tuple[Frames, Frames]:
    """The frames to train on and those held out, of all databases; ``phases``: one a database, where there are any."""
    given = phases or [None] * len(databases)
    training, held_out = (
        joined([load_frames(d, p, list(styles), training_ranges(d)[i]) for d, p in zip(databases, given, strict=True)])
        for i in (0, 1)
    )
    return training.to(device), held_out.to(device)
