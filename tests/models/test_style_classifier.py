"""The style classifier's shape."""

import pytest
import torch

from interpose.data.style_windows import STYLE_CHANNELS
from interpose.models.style_classifier import FRAME_STEP, StyleClassifier


@pytest.mark.parametrize("length", [30, 45, 60])
def test_scores_are_one_a_style(length):
    model = StyleClassifier(5, length).eval()
    assert model(torch.zeros(3, length // FRAME_STEP, STYLE_CHANNELS)).shape == (3, 5)


def test_inputs_are_normalised_by_the_buffers():
    torch.manual_seed(0)
    model = StyleClassifier(2, 30).eval()
    windows = torch.randn(4, 15, STYLE_CHANNELS)
    said = model(windows)
    model.mean.fill_(2.0)
    model.deviation.fill_(3.0)
    torch.testing.assert_close(model(3.0 * windows + 2.0), said)
