"""Layers that several networks are made of."""

from __future__ import annotations

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F


class ExpertLinear(nn.Module):
    """K linear layers blended by the gate, as one product (batch, in) x (in, K out) and a weighted sum."""

    def __init__(self, experts: int, width_in: int, width_out: int, scale: float = 1.0) -> None:
        super().__init__()
        self.experts = experts
        self.linear = nn.Linear(width_in, experts * width_out)
        bound = scale * math.sqrt(6.0 / (width_in + width_out))
        nn.init.uniform_(self.linear.weight, -bound, bound)
        nn.init.zeros_(self.linear.bias)

    def forward(
        self, x: Float[Tensor, "batch wide"], gate: Float[Tensor, "batch expert"]
    ) -> Float[Tensor, "batch out"]:
        outputs = self.linear(x).unflatten(-1, (self.experts, -1))
        return (gate[:, None, :].to(outputs.dtype) @ outputs)[:, 0]


class Cell(nn.Module):
    """One step of a long short-term memory (Hochreiter and Schmidhuber 1997), its four gates as one product."""

    def __init__(self, width_in: int, width: int) -> None:
        super().__init__()
        self.linear = nn.Linear(width_in + width, 4 * width)
        with torch.no_grad():
            self.linear.bias[width : 2 * width] = 1.0  # remember at first

    def forward(
        self, x: Float[Tensor, "batch wide"], hidden: Float[Tensor, "batch out"], cell: Float[Tensor, "batch out"]
    ) -> tuple[Float[Tensor, "batch out"], Float[Tensor, "batch out"]]:
        """The new hidden state and the new cell state."""
        take, keep, give, new = self.linear(torch.cat([x, hidden.to(x.dtype)], dim=-1)).float().chunk(4, dim=-1)
        cell = keep.sigmoid() * cell + take.sigmoid() * new.tanh()
        return give.sigmoid() * cell.tanh(), cell


class Residual(nn.Module):
    """x + W2 dropout(SiLU(W1 norm(x))), the identity at first."""

    def __init__(self, width: int, dropout: float) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.first = nn.Linear(width, width)
        self.second = nn.Linear(width, width)
        self.dropout = nn.Dropout(dropout)
        nn.init.zeros_(self.second.weight)
        nn.init.zeros_(self.second.bias)

    def forward(self, x: Float[Tensor, "batch wide"]) -> Float[Tensor, "batch wide"]:
        return x + self.second(self.dropout(F.silu(self.first(self.norm(x)))))


def residual_mlp(width_in: int, width: int, width_out: int, depth: int, dropout: float = 0.0) -> nn.Sequential:
    """A linear layer in, ``depth`` residual blocks, and a linear layer out that says little at first."""
    last = nn.Linear(width, width_out)
    with torch.no_grad():
        last.weight *= 0.1
        last.bias.zero_()
    blocks = [Residual(width, dropout) for _ in range(depth)]
    return nn.Sequential(nn.Linear(width_in, width), *blocks, nn.LayerNorm(width), last)


def sinusoids(frames: Float[Tensor, "batch 1"], width: int = 128) -> Float[Tensor, "batch width"]:
    """The embedding of a number of frames, base 10,000 (Chu and Yang 2024, equation 2; Ren et al. 2024, equations 11
    and 12): sines and cosines interleaved."""
    index = torch.arange(width // 2, device=frames.device, dtype=frames.dtype)
    angle = frames * torch.exp(index * (-2.0 * math.log(10000.0) / width))
    return torch.stack([angle.sin(), angle.cos()], dim=-1).flatten(-2)
