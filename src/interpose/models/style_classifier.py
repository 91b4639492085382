"""A small temporal convolution network that names the style of a window of motion."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn

from interpose.data.style_windows import STYLE_CHANNELS

FRAME_STEP = 2
"""Every second frame is looked at: 15 Hz, which holds what tells styles apart."""


class StyleClassifier(nn.Module):
    """Three convolutions over time, their mean and largest responses, and one linear layer.

    length: frames of a window at 30 Hz. Inputs are normalised by buffers that training sets.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, classes: int, length: int, hidden: int = 64, dropout: float = 0.3) -> None:
        super().__init__()
        self.length = length
        self.register_buffer("mean", torch.zeros(STYLE_CHANNELS))
        self.register_buffer("deviation", torch.ones(STYLE_CHANNELS))
        layers: list[nn.Module] = []
        for width, stride in ((STYLE_CHANNELS, 2), (hidden, 2), (hidden, 1)):
            layers += [nn.Conv1d(width, hidden, 5, stride, padding=2), nn.ReLU(), nn.Dropout(dropout)]
        self.body = nn.Sequential(*layers)
        self.head = nn.Linear(2 * hidden, classes)

    def forward(self, windows: Float[Tensor, "row time channel"]) -> Float[Tensor, "row style"]:
        """Scores before the softmax, from windows of every second frame (`interpose.data.style_windows`)."""
        out = self.body(((windows - self.mean) / self.deviation).transpose(1, 2))
        return self.head(torch.cat([out.mean(dim=2), out.amax(dim=2)], dim=1))
