"""The number parser against Python's float: the same value to the last bit, the same refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from interpose.io.bvh_text import parse_numbers

FORMS = ["{:.6f}", "{:g}", "{!r}", "{:+.3e}", "{:.0f}.", "{:.0f}"]
NUMBERS = st.builds(str.format, st.sampled_from(FORMS), st.floats(-1e6, 1e6))


@given(
    st.lists(st.lists(NUMBERS, min_size=1, max_size=6), min_size=1, max_size=6), st.sampled_from(["\n", "\r\n", "\r"])
)
def test_numbers_are_parsed_exactly(rows: list[list[str]], newline: str) -> None:
    parsed = parse_numbers(newline.join("\t ".join(row) for row in rows).encode())
    np.testing.assert_array_equal(parsed.ravel(), [float(text) for row in rows for text in row])


@given(
    st.integers(1, 17).flatmap(
        lambda k: st.lists(st.decimals(-(10**6), 10**6, places=k).map(lambda x: f"{x:.{k}f}"), min_size=1, max_size=20)
    )
)
def test_fixed_point_numbers_are_parsed_exactly(numbers: list[str]) -> None:
    np.testing.assert_array_equal(parse_numbers(" ".join(numbers).encode()).ravel(), [float(text) for text in numbers])


@pytest.mark.parametrize("text", ["1.2.7 9 ", "1.-5", "-.-5", "1.2. 7", "1-2.5", ".", "-.", "1.5 e", "--1.5", "1.5e"])
def test_what_is_not_a_number_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="could not convert"):
        parse_numbers(text.encode())
