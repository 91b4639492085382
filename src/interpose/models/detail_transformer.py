"""The detail transformer of Qin et al. 2022 (`Motion In-betweening via Two-stage Transformers`), on top of stitching.

It sees a whole rough transition with both its keys, a frame a token, and predicts what to add to it:
pre-normalised attention layers with learned relative positions and no absolute ones, so that any length goes. What it
adds is nil at both keys.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from interpose.features import JOINTS, RATE, RESIDUAL_HIPS_SCALE, RESIDUAL_ROTATION_SCALE
from interpose.models.geometry import facing, joint_positions, root_frame, to_matrix, to_six

TOKEN_WIDTH = JOINTS * 12 + 3 + 4 + 2
"""A token: hips, joint rotations as 6-D, positions and velocities, contacts, 1 for a key, and the seconds to the nearer
key."""
RELATIVE_REACH = 64
"""Frames apart from which on two frames are seen as so far apart."""


@dataclass(frozen=True)
class DetailSize:
    """The network's size; the defaults are the paper's."""

    width: int = 512
    layers: int = 6
    heads: int = 8


class Layer(nn.Module):
    """Attention and a perceptron, each on a normalised input and added to it."""

    def __init__(self, size: DetailSize) -> None:
        super().__init__()
        self.heads = size.heads
        self.before, self.between = nn.LayerNorm(size.width), nn.LayerNorm(size.width)
        self.ask = nn.Linear(size.width, 3 * size.width, bias=False)
        self.answer = nn.Linear(size.width, size.width)
        self.feed = nn.Sequential(nn.Linear(size.width, size.width), nn.ReLU(), nn.Linear(size.width, size.width))
        self.relative = nn.Sequential(nn.Linear(1, 64), nn.ReLU(), nn.Linear(64, size.heads))

    def forward(self, x: Float[Tensor, "row frame wide"], apart: Float[Tensor, "frame other 1"]) -> Tensor:
        count, frames, width = x.shape
        parts = self.ask(self.before(x)).reshape(count, frames, 3, self.heads, width // self.heads)
        query, key, value = parts.permute(2, 0, 3, 1, 4)
        bias = self.relative(apart).permute(2, 0, 1)[None].to(query.dtype)
        score = query @ key.transpose(-1, -2) * (width // self.heads) ** -0.5 + bias
        heard = (score.softmax(dim=-1) @ value).transpose(1, 2).reshape(count, frames, width)
        x = x + self.answer(heard)
        return x + self.feed(self.between(x))


class DetailTransformer(nn.Module):
    """See the module's text. Statistics of the tokens are buffers, set before training."""

    mean: Tensor
    std: Tensor

    def __init__(self, size: DetailSize) -> None:
        super().__init__()
        self.size = size
        self.half_products = False  # bfloat16 inside the network, in training only
        self.enter = nn.Sequential(nn.Linear(TOKEN_WIDTH, size.width), nn.PReLU(), nn.Linear(size.width, size.width))
        self.layers = nn.ModuleList([Layer(size) for _ in range(size.layers)])
        last = nn.Linear(size.width, 3 + JOINTS * 6 + 4)
        with torch.no_grad():
            last.weight *= 0.1
            last.bias.zero_()
        self.leave = nn.Sequential(nn.LayerNorm(size.width), last)
        self.register_buffer("mean", torch.zeros(TOKEN_WIDTH))
        self.register_buffer("std", torch.ones(TOKEN_WIDTH))

    def tokens(
        self,
        hips: Float[Tensor, "row frame 3"],
        rotations: Float[Tensor, "row frame 22 6"],
        contacts: Float[Tensor, "row frame 4"],
    ) -> tuple[Float[Tensor, "row frame wide"], Float[Tensor, "row 1 3 3"]]:
        """The tokens before normalisation, and the start's root frame, in which they are out."""
        count, frames = hips.shape[:2]
        frame = root_frame(facing(to_matrix(rotations[:, 0, 0])))[:, None]
        origin = hips[:, :1] * hips.new_tensor([1.0, 0.0, 1.0])
        flat = joint_positions(hips.flatten(0, 1), to_matrix(rotations).flatten(0, 1))
        positions = flat.reshape(count, frames, JOINTS, 3)
        step = (positions[:, 1:] - positions[:, :-1]) * RATE
        speeds = torch.cat([step, step[:, -1:]], dim=1)
        vectors = torch.cat(
            [
                (hips - origin)[:, :, None],
                rotations.reshape(count, frames, -1, 3),
                positions - origin[:, :, None],
                speeds,
            ],
            dim=2,
        )
        order = torch.arange(frames, device=hips.device, dtype=hips.dtype)
        near = torch.minimum(order, order.flip(0))[None, :, None].expand(count, -1, -1)
        place = torch.cat([(near < 0.5).to(hips.dtype), near.clamp(max=RELATIVE_REACH) / RATE], dim=-1)
        return torch.cat([(vectors @ frame).flatten(2), contacts, place], dim=-1), frame

    def forward(
        self,
        hips: Float[Tensor, "row frame 3"],
        rotations: Float[Tensor, "row frame 22 6"],
        contacts: Float[Tensor, "row frame 4"],
    ) -> tuple[Float[Tensor, "row frame 3"], Float[Tensor, "row frame 22 6"], Float[Tensor, "row frame 4"]]:
        """A rough motion with both keys refined: hips, rotations (proper again), and contact logits."""
        count, frames = hips.shape[:2]
        x, frame = self.tokens(hips, rotations, contacts)
        order = torch.arange(frames, device=hips.device, dtype=hips.dtype)
        apart = ((order[None] - order[:, None]).clamp(-RELATIVE_REACH, RELATIVE_REACH) / RATE)[..., None]
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.half_products):
            x = self.enter(((x - self.mean) / self.std).clamp(-6.0, 6.0))
            for layer in self.layers:
                x = layer(x, apart)
            out = self.leave(x).float()
        inside = (torch.minimum(order, order.flip(0)) > 0.5).to(out.dtype)[:, None]
        added = (out[..., :-4].reshape(count, frames, -1, 3) @ frame.transpose(-1, -2)).flatten(2) * inside
        six = rotations + RESIDUAL_ROTATION_SCALE * added[..., 3:].reshape(count, frames, JOINTS, 6)
        return hips + RESIDUAL_HIPS_SCALE * added[..., :3], to_six(to_matrix(six)), out[..., -4:]


def refined_loss(
    made: tuple[Tensor, Tensor, Tensor],
    true: tuple[Float[Tensor, "row frame 22 6"], Float[Tensor, "row frame 22 3"], Float[Tensor, "row frame 4"]],
    feet: tuple[int, ...],
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """L1 of rotations, of positions, of the joints' steps, cross-entropy of contacts, and the steps of feet that stand
    (Qin et al. 2022, section 4.3; the steps are ours). true: rotations, positions and contacts."""
    hips, rotations, out = made
    turned, placed, down = true
    shape = placed.shape
    positions = joint_positions(hips.flatten(0, 1), to_matrix(rotations).flatten(0, 1)).reshape(shape)
    step = positions[:, 1:] - positions[:, :-1]
    stands = (down[:, 1:] * down[:, :-1])[..., None]
    each = {
        "rotation": (rotations - turned).abs().mean(),
        "position": (positions - placed).abs().mean(),
        "displacement": (step - (placed[:, 1:] - placed[:, :-1])).abs().mean(),
        "contact": F.binary_cross_entropy_with_logits(out, down),
        "foot": (stands * step[:, :, list(feet)].abs()).mean(),
    }
    weights = {"rotation": 1.0, "position": 2.0, "displacement": 5.0, "contact": 0.05, "foot": 5.0}
    return torch.as_tensor(sum(weights[name] * value for name, value in each.items())), each
