"""The planner: a conditional variational autoencoder over a whole gap at once (docs/method.md).

One latent of the gap is decoded, before any frame is made, into eight poses as offsets from interpolation. Both methods
work along them. The posterior sees those poses of the true motion; the prior sees what is known at run time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from interpose.features import JOINTS, POSE, RATE
from interpose.features.plan import ANCHORS, LONGEST_PLAN_STEPS, SPLINE_PIECES
from interpose.models.geometry import facing, root_frame, to_matrix
from interpose.models.layers import residual_mlp, sinusoids
from interpose.models.normal import Normal, normal
from interpose.skeleton import MIRROR

TIME_WIDTH = 64
STYLE_WIDTH = 32
GAP_INPUT_WIDTH = 2 * (JOINTS * 12 + 1) + JOINTS * 3 + 2 + ANCHORS * 4 + 1 + 3
"""Numbers of the input that are normalised; time and style embeddings come beside."""
_FLIP = torch.tensor([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class PlannerSize:
    """The network's size."""

    latent: int = 16
    hidden: int = 768
    depth: int = 3
    dropout: float = 0.1
    styles: int = 0


class GapInput(NamedTuple):
    """What is known of a gap, a batch axis first; shapes and units in `interpose.features.plan.gap_shapes`."""

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


class Planner(nn.Module):
    """Prior, posterior and decoder. Statistics are buffers, set before training."""

    mean: Tensor
    std: Tensor
    residual_std: Tensor

    def __init__(self, size: PlannerSize) -> None:
        super().__init__()
        self.size = size
        self.half_products = False  # bfloat16 inside the networks, in training only
        wide = GAP_INPUT_WIDTH + TIME_WIDTH + STYLE_WIDTH
        self.style = nn.Linear(size.styles + 1, STYLE_WIDTH, bias=False)
        self.prior = residual_mlp(wide, 512, 2 * size.latent, 2, size.dropout)
        self.posterior = residual_mlp(wide + ANCHORS * POSE, 512, 2 * size.latent, 2)
        self.decoder = residual_mlp(wide + size.latent, size.hidden, ANCHORS * POSE, size.depth, size.dropout)
        self.register_buffer("mean", torch.zeros(GAP_INPUT_WIDTH))
        self.register_buffer("std", torch.ones(GAP_INPUT_WIDTH))
        self.register_buffer("residual_std", torch.ones(ANCHORS * POSE))

    def features(self, gap: GapInput) -> tuple[Float[Tensor, "batch wide"], Float[Tensor, "batch 3 3"]]:
        """The input before normalisation, in the start's root frame, and that frame."""
        frame = root_frame(facing(to_matrix(gap.start_rotations[:, 0])))
        ground = frame[:, ::2, ::2]
        origin = gap.start_hips * gap.start_hips.new_tensor([1.0, 0.0, 1.0])
        batch = gap.start_hips.shape[0]
        vectors = torch.cat(
            [
                gap.start_positions - origin[:, None],
                gap.start_rotations.reshape(batch, -1, 3),
                gap.start_velocities,
                gap.target_positions - origin[:, None],
                gap.target_rotations.reshape(batch, -1, 3),
                gap.target_velocities,
                (gap.target_positions - gap.start_positions) * (RATE / gap.steps[:, :, None]),
            ],
            dim=1,
        )
        vectors = (vectors @ frame).flatten(1)
        turned = (facing(to_matrix(gap.target_rotations[:, 0]))[:, None] @ ground)[:, 0]
        # The path enters as its offset from the straight line, at the anchors' times.
        share = torch.arange(1, ANCHORS + 1, device=frame.device, dtype=frame.dtype) / (ANCHORS + 1)
        straight = gap.start_hips[:, None, ::2] + share[:, None] * (gap.target_hips - gap.start_hips)[:, None, ::2]
        path = torch.cat([(gap.path[..., :2] - straight) @ ground, gap.path[..., 2:] @ ground], dim=-1)
        steps = gap.steps.clamp(max=LONGEST_PLAN_STEPS)
        return torch.cat(
            [
                vectors,
                gap.start_known,
                gap.target_known,
                turned,
                path.flatten(1) * gap.path_known,
                gap.path_known,
                steps / RATE,
                1.0 / steps,
                steps.log(),
            ],
            dim=-1,
        ), frame

    def encode(self, gap: GapInput) -> tuple[Float[Tensor, "batch wide"], Float[Tensor, "batch 3 3"]]:
        """The networks' input and the start's root frame."""
        x, frame = self.features(gap)
        x = ((x - self.mean) / self.std).clamp(-6.0, 6.0)
        time = sinusoids(gap.steps.clamp(max=LONGEST_PLAN_STEPS), TIME_WIDTH)
        return torch.cat([x, time, self.style(gap.style)], dim=-1), frame

    def expect(self, x: Float[Tensor, "batch wide"]) -> Normal:
        """The prior p(z | keys, time, style, path)."""
        return normal(self._run(self.prior, x))

    def recognise(
        self,
        x: Float[Tensor, "batch wide"],
        frame: Float[Tensor, "batch 3 3"],
        residual: Float[Tensor, "batch anchor pose"],
    ) -> Normal:
        """The posterior q(z | the same, the true poses at the anchors less interpolation's)."""
        local = (residual.unflatten(-1, (-1, 3)) @ frame[:, None]).flatten(1)
        return normal(self._run(self.posterior, torch.cat([x, (local / self.residual_std).clamp(-6.0, 6.0)], dim=-1)))

    def decode(
        self, x: Float[Tensor, "batch wide"], frame: Float[Tensor, "batch 3 3"], z: Float[Tensor, "batch unit"]
    ) -> Float[Tensor, "batch anchor pose"]:
        """The plan: offsets of the poses at the anchors from interpolation, hips in metres and 6-D, world frame."""
        out = self._run(self.decoder, torch.cat([x, z], dim=-1)) * self.residual_std
        out = out.unflatten(-1, (ANCHORS, POSE // 3, 3)) @ frame.transpose(-1, -2)[:, None]
        return out.flatten(2)

    def forward(
        self, gap: GapInput, noise: Float[Tensor, "batch unit"]
    ) -> tuple[Float[Tensor, "batch anchor pose"], Float[Tensor, "batch unit"]]:
        """The plan as it is used, and its latent.

        The data is mirrored in training, so the likeliest plan of the mirrored gap is as good as the likeliest plan,
        and their mean is better than either. A sample is moved by as much as that mean moves the likeliest plan.
        """
        batch = gap.steps.shape[0]  # len() would fix the batch when exported
        both = GapInput(*(torch.cat([a, b]) for a, b in zip(gap, mirrored(gap), strict=True)))
        x, frame = self.encode(both)
        prior = self.expect(x)
        z = Normal(prior.mean[:batch], prior.log_deviation[:batch]).at(noise)
        x, frame = torch.cat([x[:batch], x]), torch.cat([frame[:batch], frame])
        decoded = self.decode(x, frame, torch.cat([z, prior.mean])).reshape(3, -1, ANCHORS, POSE)
        sampled, likeliest, other = decoded[0], decoded[1], decoded[2]
        return sampled + 0.5 * (mirrored_poses(other) - likeliest), z

    def _run(self, network: nn.Module, x: Float[Tensor, "batch wide"]) -> Float[Tensor, "batch out"]:
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.half_products):
            return network(x).float()


def mirrored(gap: GapInput) -> GapInput:
    """The gap seen in a mirror at x = 0, left and right exchanged, as `interpose.motion.mirror` does."""
    out = gap._asdict()
    for end in ("start", "target"):
        out[f"{end}_hips"] = out[f"{end}_hips"] * _FLIP.to(gap.steps)
        for name in ("positions", "velocities"):
            out[f"{end}_{name}"] = out[f"{end}_{name}"][..., MIRROR, :] * _FLIP.to(gap.steps)
        out[f"{end}_rotations"] = _mirrored_six(out[f"{end}_rotations"])
    out["path"] = out["path"] * out["path"].new_tensor([-1.0, 1.0, -1.0, 1.0])
    return GapInput(**out)


def mirrored_poses(poses: Float[Tensor, "batch anchor pose"]) -> Float[Tensor, "batch anchor pose"]:
    """Poses or offsets of poses (hips, 6-D) in the same mirror."""
    six = _mirrored_six(poses[..., 3:].unflatten(-1, (JOINTS, 6))).flatten(-2)
    return torch.cat([poses[..., :3] * _FLIP.to(poses), six], dim=-1)


def _mirrored_six(six: Float[Tensor, "*batch joint 6"]) -> Float[Tensor, "*batch joint 6"]:
    return six[..., MIRROR, :] * torch.cat([-_FLIP, _FLIP]).to(six)


def anchor_weights_at(parts: Float[Tensor, "batch time"]) -> Float[Tensor, "batch time anchor"]:
    """`interpose.features.plan.anchor_weights` at any parts of a gap, 0 to 1; zero at and beyond both keys."""
    pieces = torch.as_tensor(SPLINE_PIECES).to(parts)
    count = pieces.shape[1]
    at = (parts * count).floor().clamp(0.0, count - 1.0)
    here = (parts - at / count)[..., None]
    powers = pieces.permute(1, 0, 2)[at.long()]
    cubic, square, linear, constant = powers.unbind(dim=-2)
    weights = ((cubic * here + square) * here + linear) * here + constant
    return weights * ((parts > 0.0) & (parts < 1.0))[..., None]
