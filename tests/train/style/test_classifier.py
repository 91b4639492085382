"""The style classifier learns what can be told apart, in the mirror too, and nothing else."""

import numpy as np
import pytest
import torch

from interpose.data.style_windows import MIRROR_SIGNS, MIRRORED_CHANNELS, STYLE_CHANNELS
from interpose.train.style.classifier import Recipe, fit, probabilities

RECIPE = Recipe(20, steps=100, batch=32)


@pytest.fixture(scope="module")
def waves() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """600 frames of a little noise in which two joints swing slowly, then 600 in which they swing fast; 118 windows."""
    draw = np.random.default_rng(0)
    seen = draw.normal(0.0, 0.02, (1200, STYLE_CHANNELS)).astype(np.float32)
    time = np.arange(600)
    seen[:600, 12:18] += np.sin(0.2 * time)[:, None]
    seen[600:, 12:18] += np.sin(0.9 * time)[:, None]
    starts = np.arange(0, 1180, 10)
    return seen, starts, (starts >= 600).astype(np.int64)


@pytest.fixture(scope="module")
def model(waves):
    return fit(*waves, 2, RECIPE)


def test_windows_that_were_not_trained_on_are_told_apart(waves, model):
    seen, starts, label = waves
    said = probabilities(model, seen, starts[:-1] + 5)
    np.testing.assert_allclose(said.sum(axis=1), 1.0, atol=1e-6)
    assert (said.argmax(axis=1) == label[:-1]).mean() > 0.9


def test_a_mirror_image_is_the_same_style(waves, model):
    seen, starts, _ = waves
    mirrored = seen[:, MIRRORED_CHANNELS] * np.array(MIRROR_SIGNS, dtype=np.float32)
    np.testing.assert_allclose(probabilities(model, mirrored, starts), probabilities(model, seen, starts), atol=1e-5)


def test_labels_without_meaning_are_not_learned(waves):
    seen, starts, _ = waves
    label = np.random.default_rng(1).integers(0, 2, len(starts))
    said = probabilities(fit(seen, starts[::2], label[::2], 2, RECIPE), seen, starts[1::2])
    assert 0.2 < (said.argmax(axis=1) == label[1::2]).mean() < 0.8


def test_a_seed_decides_everything_and_leaves_torchs_own_draws_alone(waves):
    seen, starts, label = waves
    short = Recipe(20, steps=5)
    torch.manual_seed(5)
    untouched = torch.rand(1)
    torch.manual_seed(5)
    first = probabilities(fit(seen, starts, label, 2, short, 3), seen, starts)
    assert torch.rand(1) == untouched
    np.testing.assert_array_equal(probabilities(fit(seen, starts, label, 2, short, 3), seen, starts), first)
    assert not np.array_equal(probabilities(fit(seen, starts, label, 2, short, 4), seen, starts), first)


def test_even_draws_make_up_for_a_rare_style(waves):
    seen, starts, label = waves
    kept = np.concatenate([np.arange(20), [70, 80]])  # twenty windows of one, two of the other
    blind = seen * 0.0  # nothing to see: what is left is how often each was drawn
    even, plain = (
        probabilities(fit(blind, starts[kept], label[kept], 2, Recipe(20, steps=60, even=e)), blind, starts[:1])[0, 1]
        for e in (True, False)
    )
    assert even == pytest.approx(0.5, abs=0.1)
    assert plain < 0.35


def test_no_windows_have_no_verdicts(model, waves):
    assert probabilities(model, waves[0], np.zeros(0, dtype=np.int64)).shape == (0, 2)
