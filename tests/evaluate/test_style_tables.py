"""Tables and confusion matrices of predicted styles."""

from __future__ import annotations

import numpy as np

from interpose.evaluate.style_tables import StyleKind, StyleResults, confusion, matrices, to_markdown

OWN, LONGER, OTHER = (
    StyleKind("own", "x1", 60, False),
    StyleKind("own", "x1", 90, False),
    StyleKind("other", "x1", 90, False),
)
PREDICTED = np.array([[0, 0, 1, 2], [0, 1, 1, 2]])


def results(predictions: dict[StyleKind, np.ndarray]) -> StyleResults:
    return StyleResults(["A", "B", "C"], predictions, np.array([[0, 1, 2, 2], [0, 1, 2, 0]]))


def test_tables_count_what_was_recognised() -> None:
    both = results({OWN: PREDICTED, LONGER: PREDICTED, OTHER: np.array([[0, 1], [0, 2]])})
    np.testing.assert_array_equal(confusion(both, "own", "x1"), [[2, 2, 0], [0, 2, 0], [0, 0, 2]])
    own, other = matrices(both)
    assert (list(own), list(other)) == (["x1, own keys"], ["x1, other keys"])
    text = to_markdown(both, "mine")
    assert "recognises 75.0% of 4 recorded windows" in text
    assert "(A 100%, B 100%, C 50%)" in text
    assert "| of the requested style | x1 | 75% | 75% |" in text
    assert "| of another style | x1 | - | 50% |" in text
    assert "| A | 50% | 100% |" in text
    assert "| C | 100% | - |" in text
    sure = results({OWN: PREDICTED[[0, 0]]})
    assert "| of the requested style | x1 | 100% ✓ |" in to_markdown(sure, "mine")


def test_protocols_name_the_keys() -> None:
    assert StyleKind("other", "free", 60, True).protocol == "style-other-keys-unseen"
    assert OWN.protocol == "style-own-keys"
