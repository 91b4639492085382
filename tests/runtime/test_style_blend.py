"""Style labels and blends of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import interpose as ip
from interpose.demo import poses
from interpose.errors import InputError
from interpose.runtime import model_folder, style_blend

NAMES = st.lists(st.sampled_from(["Angry", "Drunk", "In The Dark", "Old"]), min_size=1, max_size=4, unique=True)


def test_a_name_alone_is_the_whole() -> None:
    assert style_blend.shares("Angry") == {"Angry": 1.0}


def test_names_without_shares_have_equal_ones() -> None:
    assert style_blend.shares("Angry+Drunk") == {"Angry": 0.5, "Drunk": 0.5}


@given(NAMES, st.data())
def test_shares_are_relative_to_their_sum(names: list[str], data: st.DataObject) -> None:
    told = [data.draw(st.integers(1, 1000)) for _ in names]
    found = style_blend.shares(" + ".join(f"{name}:{share / 8}" for name, share in zip(names, told, strict=True)))
    assert list(found) == names
    assert list(found.values()) == pytest.approx([share / sum(told) for share in told])


def test_the_leading_style_is_the_one_with_most_and_the_first_of_equals() -> None:
    assert style_blend.leading("Angry:0.4+Drunk:0.6") == "Drunk"
    assert style_blend.leading("Angry+Drunk") == "Angry"
    assert style_blend.leading(None) is None


@pytest.mark.parametrize("label", ["", "Angry+", "Angry:much", "Angry:-1+Drunk", "Angry+Angry", "Angry:nan", "A:inf"])
def test_what_cannot_be_read_is_told(label: str) -> None:
    with pytest.raises(InputError, match="cannot be read; give a name"):
        style_blend.shares(label)


def test_shares_that_are_all_zero_are_told() -> None:
    with pytest.raises(InputError, match="are all zero"):
        style_blend.shares("Angry:0+Drunk:0")


def test_a_blend_reaches_the_network_as_shares() -> None:
    loaded = model_folder.load()
    (row,) = loaded.style_weights(["Angry:3+Drunk:1"])
    assert row.tolist() == [{"Angry": 0.75, "Drunk": 0.25}.get(name, 0.0) for name in ("", *loaded.styles)]


def test_an_unknown_style_in_a_blend_is_named() -> None:
    with pytest.raises(InputError, match="has no style 'Sad'"):
        ip.load_model().inbetween(STAND, AWAY, 20, style="Angry+Sad")


def test_a_blend_lies_between_its_styles() -> None:
    """Nearer to either style than the two are to one another, and equal to neither."""
    loaded = ip.load_model()

    def made(style: str) -> np.ndarray:
        (one,) = loaded.inbetween(STAND, AWAY, 50, style=style, path="straight")
        return one.motion.global_positions()

    first, second, both = made("Aeroplane"), made("Chicken"), made("Aeroplane+Chicken")

    def apart(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.linalg.norm(a - b, axis=-1).mean())

    assert 0.005 < apart(first, both) < apart(first, second)
    assert 0.005 < apart(second, both) < apart(first, second)


STAND = poses.pose(poses.STAND)
AWAY = poses.pose(poses.STAND, (0.3, 2.4))
