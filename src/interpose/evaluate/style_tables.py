"""What the judge of `interpose evaluate style` said, as tables and as confusion matrices."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.evaluate import tables
from interpose.evaluate.tables import Row
from interpose.io.files import write_whole

if TYPE_CHECKING:
    from interpose.evaluate.style import Found, Verdicts

GOALS = {"own": 0.85, "other": 0.70}
"""The share that the model's answers should reach."""
CASES = {"own": "of the style asked for", "other": "of another style"}
HEADING = """# Style

The share of gaps whose middle second a classifier calls the style that was asked for; chance is {chance:.0%}.
Model `{model}`: *free* with the style left free, *x1* with the style at strength 1, and so on. *recorded* is the true
motion between the keys, *interp* their interpolation: what the keys alone show. Under *keys unseen* the model was not
trained on the keys either; the judges there know half as much. Goals: {own:.0%} between keys of the style, {other:.0%}
between keys of another (✓ where reached); free between keys of another near chance or below.

The judge names {right:.1%} of {windows} recorded windows, of other frames than it was trained on, as they are labelled
({each}).
"""


def write(found: Found, rows: list[Row], model: str, folder: Path) -> None:
    """``results.json``, ``.csv``, ``.md`` and, where matplotlib is installed, ``confusion.png``."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: the folder cannot be made: {(error.strerror or str(error)).lower()}") from None
    texts = {"json": tables.to_json(rows), "csv": tables.to_csv(rows), "md": to_markdown(found, model)}
    for suffix, text in texts.items():
        write_whole(folder / f"results.{suffix}", text.encode())
    draw(found, folder / "confusion.png")


def to_markdown(found: Found, model: str) -> str:
    """The heading with the judge's own record, a table over all styles, and one of each style."""
    right = found.shown == found.called
    each = ", ".join(
        f"{style} {right[found.shown == i].mean():.0%}"
        for i, style in enumerate(found.styles)
        if np.any(found.shown == i)
    )
    heading = HEADING.format(
        chance=1.0 / len(found.styles), model=model, right=right.mean(), windows=len(right), each=each, **GOALS
    )
    columns = list(dict.fromkeys((v.frames, v.unseen) for v in found.verdicts))
    kinds = list(dict.fromkeys((v.case, v.method) for v in sorted(found.verdicts, key=lambda v: v.case == "other")))
    shares = {(v.case, v.method, v.frames, v.unseen): _share(v) for v in found.verdicts}
    titles = [f"{frames} frames{', keys unseen' if unseen else ''}" for frames, unseen in columns]
    lines = ["| keys | motion | " + " | ".join(titles) + " |", "|---|---|" + "---|" * len(columns)]
    for case, method in kinds:
        cells = [shares.get((case, method, *column), "-") for column in columns]
        lines.append(f"| {CASES[case]} | {method} | " + " | ".join(cells) + " |")
    named = " | ".join(f"{case}: {method}" for case, method in kinds)
    by_style = [f"| style | {named} |", "|---|" + "---|" * len(kinds)]
    for i, style in enumerate(found.styles):
        cells = [_cell(confusion(found, case, method)[i], i) for case, method in kinds]
        by_style.append(f"| {style} | " + " | ".join(cells) + " |")
    sections = ("## All styles", lines), ("## Each style, all gaps together", by_style)
    return heading + "".join(f"\n{title}\n\n" + "\n".join(body) + "\n" for title, body in sections)


def confusion(found: Found, case: str, method: str) -> Float[ndarray, "style style"]:
    """How many gaps of all lengths, asked for as the row's style, were called the column's."""
    counts = np.zeros((len(found.styles), len(found.styles)))
    for verdicts in found.verdicts:
        if (verdicts.case, verdicts.method) == (case, method):
            np.add.at(counts, (verdicts.asked, verdicts.called), 1.0)
    return counts


def draw(found: Found, path: Path) -> bool:
    """The confusion matrices of every method, a row of pictures a kind of keys; False without matplotlib."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        return False
    kinds = list(dict.fromkeys(v.method for v in found.verdicts))
    size = 1.2 + 0.34 * len(found.styles)
    figure = Figure(figsize=(size * len(kinds), 2.1 * size), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    places = figure.subplots(2, len(kinds), squeeze=False, sharex=True, sharey=True)
    for row, case in enumerate(CASES):
        for axes, method in zip(places[row], kinds, strict=True):
            counts = confusion(found, case, method)
            shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
            axes.imshow(shares, vmin=0.0, vmax=1.0, cmap="Blues")
            if len(found.styles) <= 20:
                for (i, j), share in np.ndenumerate(shares):
                    if share >= 0.005:
                        dark = "white" if share > 0.5 else "black"
                        axes.text(j, i, f"{100 * share:.0f}", ha="center", va="center", fontsize=7, color=dark)
            axes.set_title(f"{method}, {case} keys", fontsize=9)
            axes.set_xticks(range(len(found.styles)), found.styles, rotation=90, fontsize=7)
            axes.set_yticks(range(len(found.styles)), found.styles, fontsize=7)
        places[row][0].set_ylabel("asked for", fontsize=8)
    figure.supxlabel("called, % of the row", fontsize=8)
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    write_whole(path, picture.getvalue())
    return True


def _share(verdicts: Verdicts) -> str:
    goal = GOALS[verdicts.case] if verdicts.method.startswith("x") else 0.0
    share = float(np.mean(verdicts.asked == verdicts.called))
    return f"{share:.0%}" + (" ✓" if goal and share >= goal else "")


def _cell(counts: Float[ndarray, "style"], style: int) -> str:
    return f"{counts[style] / counts.sum():.0%}" if counts.sum() else "-"
