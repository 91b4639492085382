"""The plan of a gap: a conditional variational autoencoder over a whole gap at once (docs/method.md, S2).

Both generators of a stitched gap share one latent z (METHOD.md, part F). Here it is decoded once, before any frame is
made, into eight poses evenly spaced in time, as what they differ by from interpolation. The generators then work their
way along. The posterior sees those eight poses of the true motion; the prior sees what the run time knows: the keys,
the time, and style, path and velocities where they are given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from interpose.features import JOINTS, RATE
from interpose.models.geometry import facing, root_frame, to_matrix
from interpose.models.layers import residual_mlp, sinusoids
from interpose.stitch_layout import ANCHORS, LONGEST_PLAN

POSE = 3 + JOINTS * 6
TIME = 64
LONGEST = LONGEST_PLAN
"""Steps from start to target; more are seen as these."""


@dataclass(frozen=True)
class PlanSize:
    """The network's size."""

    latent: int = 16
    hidden: int = 768
    depth: int = 3
    dropout: float = 0.1
    styles: int = 0


class Ends(NamedTuple):
    """What is known of a gap, a batch axis first; world frame, metres, seconds.

    start, target: hips positions, joint rotations as 6-D, joint positions and joint velocities, and 1 where those are
    known (otherwise nil). steps: from start to target. style: weights over (free, style 1, ...). path: root x and z
    and facing (x, z) at the anchors; path_known: 0 where none is given.
    """

    start_hips: Float[Tensor, "batch 3"]
    start_rotations: Float[Tensor, "batch joint 6"]
    start_positions: Float[Tensor, "batch joint 3"]
    start_velocities: Float[Tensor, "batch joint 3"]
    start_known: Float[Tensor, "batch 1"]
    target_hips: Float[Tensor, "batch 3"]
    target_rotations: Float[Tensor, "batch joint 6"]
    target_positions: Float[Tensor, "batch joint 3"]
    target_velocities: Float[Tensor, "batch joint 3"]
    target_known: Float[Tensor, "batch 1"]
    steps: Float[Tensor, "batch 1"]
    style: Float[Tensor, "batch style"]
    path: Float[Tensor, "batch anchor 4"]
    path_known: Float[Tensor, "batch 1"]


class Normal(NamedTuple):
    """A diagonal normal distribution: its mean and the logarithm of its deviation."""

    mean: Float[Tensor, "batch unit"]
    log_deviation: Float[Tensor, "batch unit"]

    def at(self, noise: Float[Tensor, "batch unit"]) -> Float[Tensor, "batch unit"]:
        """The sample that so much standard noise makes."""
        return self.mean + self.log_deviation.exp() * noise


def divergence(q: Normal, p: Normal) -> Float[Tensor, "batch unit"]:
    """KL(q || p) of each unit, in nats."""
    apart = (q.mean - p.mean).square() + (2.0 * q.log_deviation).exp()
    return p.log_deviation - q.log_deviation + 0.5 * apart * (-2.0 * p.log_deviation).exp() - 0.5


def normal(out: Float[Tensor, "batch wide"]) -> Normal:
    """The distribution that a head says; deviations between e^-5 and e^3."""
    mean, log_deviation = out.float().chunk(2, dim=-1)
    return Normal(mean, log_deviation.clamp(-5.0, 3.0))


INPUT = 2 * (JOINTS * 12 + 1) + JOINTS * 3 + 2 + ANCHORS * 4 + 1 + 3
"""Numbers of the input that are normalised; times and style come beside."""


class GapPlan(nn.Module):
    """Prior, posterior and decoder; see the module's text. Statistics are buffers, set before training."""

    mean: Tensor
    std: Tensor
    residual_std: Tensor

    def __init__(self, size: PlanSize) -> None:
        super().__init__()
        self.size = size
        self.half_products = False  # bfloat16 inside the networks, in training only
        wide = INPUT + TIME + 32
        self.style = nn.Linear(size.styles + 1, 32, bias=False)
        self.prior = residual_mlp(wide, 512, 2 * size.latent, 2, size.dropout)
        self.posterior = residual_mlp(wide + ANCHORS * POSE, 512, 2 * size.latent, 2)
        self.decoder = residual_mlp(wide + size.latent, size.hidden, ANCHORS * POSE, size.depth, size.dropout)
        self.register_buffer("mean", torch.zeros(INPUT))
        self.register_buffer("std", torch.ones(INPUT))
        self.register_buffer("residual_std", torch.ones(ANCHORS * POSE))

    def numbers(self, ends: Ends) -> tuple[Float[Tensor, "batch wide"], Float[Tensor, "batch 3 3"]]:
        """What is normalised of the input, and the start's root frame, in which it is said."""
        frame = root_frame(facing(to_matrix(ends.start_rotations[:, 0])))
        ground = frame[:, ::2, ::2]
        origin = ends.start_hips * ends.start_hips.new_tensor([1.0, 0.0, 1.0])
        batch = ends.start_hips.shape[0]
        vectors = torch.cat(
            [
                ends.start_positions - origin[:, None],
                ends.start_rotations.reshape(batch, -1, 3),
                ends.start_velocities,
                ends.target_positions - origin[:, None],
                ends.target_rotations.reshape(batch, -1, 3),
                ends.target_velocities,
                (ends.target_positions - ends.start_positions) * (RATE / ends.steps[:, :, None]),
            ],
            dim=1,
        )
        vectors = (vectors @ frame).flatten(1)
        turned = (facing(to_matrix(ends.target_rotations[:, 0]))[:, None] @ ground)[:, 0]
        # The path as what it differs by from the straight line, whose weight the anchors' times are.
        share = torch.arange(1, ANCHORS + 1, device=frame.device, dtype=frame.dtype) / (ANCHORS + 1)
        line = ends.start_hips[:, None, ::2] + share[:, None] * (ends.target_hips - ends.start_hips)[:, None, ::2]
        way = torch.cat([(ends.path[..., :2] - line) @ ground, ends.path[..., 2:] @ ground], dim=-1)
        steps = ends.steps.clamp(max=LONGEST)
        return torch.cat(
            [
                vectors,
                ends.start_known,
                ends.target_known,
                turned,
                way.flatten(1) * ends.path_known,
                ends.path_known,
                steps / RATE,
                1.0 / steps,
                steps.log(),
            ],
            dim=-1,
        ), frame

    def forward(self, ends: Ends) -> tuple[Float[Tensor, "batch wide"], Float[Tensor, "batch 3 3"]]:
        """The networks' input and the start's root frame."""
        x, frame = self.numbers(ends)
        x = ((x - self.mean) / self.std).clamp(-6.0, 6.0)
        time = sinusoids(ends.steps.clamp(max=LONGEST), TIME)
        return torch.cat([x, time, self.style(ends.style)], dim=-1), frame

    def expect(self, x: Float[Tensor, "batch wide"]) -> Normal:
        """The prior p(z | keys, time, control)."""
        return normal(self._say(self.prior, x))

    def recognise(
        self,
        x: Float[Tensor, "batch wide"],
        frame: Float[Tensor, "batch 3 3"],
        residual: Float[Tensor, "batch anchor pose"],
    ) -> Normal:
        """The posterior q(z | the same, the true poses at the anchors less interpolation's)."""
        local = (residual.unflatten(-1, (-1, 3)) @ frame[:, None]).flatten(1)
        return normal(self._say(self.posterior, torch.cat([x, (local / self.residual_std).clamp(-6.0, 6.0)], dim=-1)))

    def decode(
        self, x: Float[Tensor, "batch wide"], frame: Float[Tensor, "batch 3 3"], z: Float[Tensor, "batch unit"]
    ) -> Float[Tensor, "batch anchor pose"]:
        """What the poses at the anchors differ by from interpolation's: hips in metres and 6-D, world frame."""
        out = self._say(self.decoder, torch.cat([x, z], dim=-1)) * self.residual_std
        out = out.unflatten(-1, (ANCHORS, POSE // 3, 3)) @ frame.transpose(-1, -2)[:, None]
        return out.flatten(2)

    def _say(self, network: nn.Module, x: Float[Tensor, "batch wide"]) -> Float[Tensor, "batch out"]:
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.half_products):
            return network(x).float()
