"""Diagonal normal distributions, as the variational autoencoders use them."""

from __future__ import annotations

from typing import NamedTuple

from jaxtyping import Float
from torch import Tensor


class Normal(NamedTuple):
    """A diagonal normal distribution: its mean and the logarithm of its deviation."""

    mean: Float[Tensor, "batch unit"]
    log_deviation: Float[Tensor, "batch unit"]

    def at(self, noise: Float[Tensor, "batch unit"]) -> Float[Tensor, "batch unit"]:
        """The sample that this standard noise makes."""
        return self.mean + self.log_deviation.exp() * noise


def divergence(q: Normal, p: Normal) -> Float[Tensor, "batch unit"]:
    """KL(q || p) of each unit, in nats."""
    apart = (q.mean - p.mean).square() + (2.0 * q.log_deviation).exp()
    return p.log_deviation - q.log_deviation + 0.5 * apart * (-2.0 * p.log_deviation).exp() - 0.5


def normal(out: Float[Tensor, "batch wide"]) -> Normal:
    """The distribution that a head predicts; deviations between e^-5 and e^3."""
    mean, log_deviation = out.float().chunk(2, dim=-1)
    return Normal(mean, log_deviation.clamp(-5.0, 3.0))
