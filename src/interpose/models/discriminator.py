"""The pair of long and short discriminators of S-CVAE (Ren et al. 2024, section 4.1, after Harvey et al. 2020)."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from interpose.features import JOINTS
from interpose.models.geometry import facing, root_frame

LONG, SHORT = 10, 2
"""Frames that each sees at once."""


class Discriminators(nn.Module):
    """Two critics that slide over a motion; each is three layers, 512 and 256 wide, and says one number a window."""

    def __init__(self) -> None:
        super().__init__()
        self.critics = nn.ModuleList([_critic(LONG), _critic(SHORT)])

    def forward(self, motion: Float[Tensor, "row channel frame"]) -> list[Float[Tensor, "row"]]:
        """Each critic's mean over time; gaps shorter than the long window are shown to the short one alone."""
        frames = motion.shape[-1]
        return [c(motion).mean(dim=(1, 2)) for c, n in zip(self.critics, (LONG, SHORT), strict=True) if frames >= n]


def _critic(frames: int) -> nn.Sequential:
    slope = 0.2
    return nn.Sequential(
        nn.Conv1d(2 * JOINTS * 3, 512, frames),
        nn.LeakyReLU(slope),
        nn.Conv1d(512, 256, 1),
        nn.LeakyReLU(slope),
        nn.Conv1d(256, 1, 1),
    )


def seen(
    positions: Float[Tensor, "row frame 22 3"], hips: Float[Tensor, "row 3 3"]
) -> Float[Tensor, "row channel frame_"]:
    """What the critics see of a motion: joints from the root on the ground, and their velocities (a tenth of a metre a
    frame is one), in the start's root frame; ``hips`` is the start's hips rotation."""
    frame = root_frame(facing(hips))[:, None]
    origin = positions[:, 1:, :1] * positions.new_tensor([1.0, 0.0, 1.0])
    velocities = positions.diff(dim=1) @ frame * 10.0
    return torch.cat([(positions[:, 1:] - origin) @ frame, velocities], dim=2).flatten(2).transpose(1, 2)


def critic_loss(
    critics: Discriminators, real: Float[Tensor, "row channel frame"], made: Float[Tensor, "row channel frame"]
) -> Float[Tensor, ""]:
    """Equation 9 (least squares), over both critics."""
    pairs = zip(critics(real), critics(made.detach()), strict=True)
    return torch.stack([0.5 * F.mse_loss(a, torch.ones_like(a)) + 0.5 * b.square().mean() for a, b in pairs]).sum()


def generator_loss(critics: Discriminators, made: Float[Tensor, "row channel frame"]) -> Float[Tensor, ""]:
    """Equation 8, over both critics."""
    return torch.stack([0.5 * (score - 1.0).square().mean() for score in critics(made)]).sum()
