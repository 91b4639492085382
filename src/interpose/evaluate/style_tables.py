"""What the classifier of `interpose evaluate style` predicted, as tables and as confusion matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int64
from numpy import ndarray

from interpose.evaluate.tables import table

STYLE_GOALS = {"own": 0.85, "other": 0.70}
"""The share of gaps that the model should reach, by the keys that are given."""
KEY_KINDS = {"own": "of the requested style", "other": "of another style"}
STYLE_HEADING = """# Style

The share of gaps whose middle second a classifier recognises as the requested style; chance is {chance:.0%}. Model
`{model}`: *free* with the style left free, *x1* with the style at strength 1, and so on. *recorded* is the true motion
between the keys, *interp* their interpolation: what the keys alone show. Under *keys unseen* the model was not trained
on the keys either; the classifiers there are trained on half as much. Goals: {own:.0%} between keys of the style,
{other:.0%} between keys of another (✓ where reached); free between keys of another near chance or below.

The classifier recognises {right:.1%} of {windows} recorded windows, of other frames than it was trained on ({each}).
"""


@dataclass(frozen=True)
class StyleKind:
    """Gaps of one kind: between keys of the requested style ('own') or of another ('other'), filled by a method
    (recorded, interp, free, or the strength as x1), of one length, with keys that the generator was trained on or not.
    """

    keys: str
    method: str
    length: int
    unseen: bool

    @property
    def protocol(self) -> str:
        return f"style-{self.keys}-keys" + ("-unseen" if self.unseen else "")


@dataclass(frozen=True, eq=False)
class StyleResults:
    """The requested and the predicted style of all gaps, and the shown and the predicted one of recorded windows."""

    styles: list[str]
    predictions: dict[StyleKind, Int64[ndarray, "2 gap"]]
    recorded: Int64[ndarray, "2 window"]


def to_markdown(found: StyleResults, model: str) -> str:
    """The heading with the classifier's accuracy on recorded motion, a table over all styles, and one of each style."""
    right = np.equal(*found.recorded)
    accuracy = {style: right[found.recorded[0] == i] for i, style in enumerate(found.styles)}
    each = ", ".join(f"{style} {values.mean():.0%}" for style, values in accuracy.items() if len(values))
    heading = STYLE_HEADING.format(
        chance=1.0 / len(found.styles), model=model, right=right.mean(), windows=len(right), each=each, **STYLE_GOALS
    )
    columns = list(dict.fromkeys((kind.length, kind.unseen) for kind in found.predictions))
    rows = list(dict.fromkeys((k.keys, k.method) for k in sorted(found.predictions, key=lambda k: k.keys == "other")))
    shares = {kind: _share(kind, pairs) for kind, pairs in found.predictions.items()}
    whole = table(
        ["keys", "motion", *(f"{length} frames{', keys unseen' if unseen else ''}" for length, unseen in columns)],
        [[KEY_KINDS[row[0]], row[1], *(shares.get(StyleKind(*row, *c), "-") for c in columns)] for row in rows],
    )
    counts = [confusion(found, *row) for row in rows]
    by_style = table(
        ["style", *(f"{keys}: {method}" for keys, method in rows)],
        [[style, *(_diagonal(one[i], i) for one in counts)] for i, style in enumerate(found.styles)],
    )
    return f"{heading}\n## All styles\n\n{whole}\n## Each style, all gaps together\n\n{by_style}"


def confusion(found: StyleResults, keys: str, method: str) -> Float[ndarray, "style style"]:
    """How many gaps of all lengths for which the row's style was requested were recognised as the column's."""
    counts = np.zeros((len(found.styles), len(found.styles)))
    for kind, pairs in found.predictions.items():
        if (kind.keys, kind.method) == (keys, method):
            np.add.at(counts, tuple(pairs), 1.0)
    return counts


def matrices(found: StyleResults) -> list[dict[str, Float[ndarray, "style style"]]]:
    """The confusion matrices of every method by their titles, for each kind of keys."""
    methods = dict.fromkeys(kind.method for kind in found.predictions)
    return [{f"{method}, {keys} keys": confusion(found, keys, method) for method in methods} for keys in KEY_KINDS]


def _share(kind: StyleKind, pairs: Int64[ndarray, "2 gap"]) -> str:
    share = float(np.mean(np.equal(*pairs)))
    return f"{share:.0%}" + (" ✓" if kind.method.startswith("x") and share >= STYLE_GOALS[kind.keys] else "")


def _diagonal(counts: Float[ndarray, "style"], style: int) -> str:
    return f"{counts[style] / counts.sum():.0%}" if counts.sum() else "-"
