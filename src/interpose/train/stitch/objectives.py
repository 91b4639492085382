"""What each part of the recipe of S-CVAE minimises: the phases' network, the generators."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.features import POSE, RATE
from interpose.features.stitch import seam
from interpose.models import discriminator
from interpose.models.discriminator import Discriminators
from interpose.models.geometry import to_matrix
from interpose.models.normal import Normal, divergence
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import StitchingCVAE
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import GapSampling, draw
from interpose.train.stitch import losses
from interpose.train.stitch.config import StitchConfig
from interpose.train.stitch.transitions import made_gaps, true_motion
from interpose.train.stitch.truth import TrueMotion


def phase_loss(
    model: StitchingCVAE, data: Frames, phases: Float[Tensor, "frame 4"], rows: int, generator: torch.Generator
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """The error of both phase networks one frame on. For half the frames the phase is unknown or blurred, as after a
    lone key."""
    device = data.hips.device
    total = torch.zeros((), device=device)
    still = torch.tensor([-1.0, 1.0, -1.0, 1.0], device=device)
    for backward, side in ((False, model.front), (True, model.back)):
        drawn = draw(data, rows, model.size.styles, GapSampling(path=0.0, velocity=0.0), generator, steps=2)
        true = true_motion(model, data, drawn, 2)
        before, now, after = (2, 1, 0) if backward else (0, 1, 2)
        body = Body(
            true.hips[:, now],
            true.rotations[:, now],
            true.positions[:, now],
            (true.positions[:, now] - true.positions[:, before]) * RATE,
            torch.ones(rows, 1, device=device),
            true.contacts[:, now],
            torch.zeros(rows, 4, device=device),
        )
        features = side.form.features(body, _aim(body, true, now))
        x = side.normalised("state", features.state)
        turned = still if backward else torch.ones_like(still)
        here, there = phases[drawn.start + now] * turned, phases[drawn.start + after] * turned
        known = torch.rand(rows, 1, generator=generator, device=device)
        blur = 0.1 * torch.randn(rows, 4, generator=generator, device=device)
        here = torch.where(known < 0.2, 0.0, here + torch.where(known < 0.6, blur, 0.0))
        total = total + (side.phases(x, here) - there).abs().mean()
    return total, {"phase": total}


def _aim(body: Body, true: TrueMotion, at: int) -> Aim:
    """An aim for features of the state alone."""
    nothing = torch.zeros(len(body.hips), POSE, device=body.hips.device)
    left = torch.ones_like(body.known)
    return Aim(true.hips[:, at], true.rotations[:, at], true.positions[:, at], left, nothing, nothing, nothing)


def stitch_loss(
    model: StitchingCVAE,
    critics: Discriminators,
    against: torch.optim.Optimizer,
    data: Frames,
    config: StitchConfig,
    gone: float,
    generator: torch.Generator,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """The generators' loss on stitched roll-outs, after a step of the discriminators. ``gone``: share of the part."""
    device, rows = data.hips.device, config.stitch.rows
    reach = config.shortest + 1 + (config.longest - config.shortest) * min(1.0, gone / max(config.growth, 1e-6))
    frames = int(torch.randint(config.shortest, int(reach), (1,), generator=generator, device=device))
    steps = frames - 1
    drawn = draw(data, rows, model.size.styles, config.sampling, generator, steps=steps)
    known = torch.ones(rows, device=device)
    made, true, latents = made_gaps(model, data, drawn, config, generator, known)
    overlap = list(seam(steps, config.chains.buffer, config.chains.both).overlap)
    each = losses.chains(made, true, overlap, known, config.weights.entropy)
    if latents:
        standard = Normal(torch.zeros_like(latents[0].mean), torch.zeros_like(latents[0].mean))
        each["divergence"] = torch.stack([divergence(one, standard).sum(dim=-1).mean() for one in latents]).mean()
    strength = config.weights.adversarial * min(1.0, max(0.0, gone - config.critics_from) / 0.1 + 1e-3)
    if strength > 0.0 and gone >= config.critics_from:
        turned = true.rotations[:, 0, 0]
        first = to_matrix(turned) if turned.shape[-1] == 6 else _still(turned)
        shown = discriminator.seen(made.positions, first)
        real = discriminator.seen(true.positions, first)
        lost = discriminator.critic_loss(critics, real, shown)
        against.zero_grad(set_to_none=True)
        lost.backward()
        torch.nn.utils.clip_grad_norm_(critics.parameters(), config.clip)
        against.step()
        each["adversarial"] = discriminator.generator_loss(critics, shown)
        each["critics"] = lost.detach()
    weights = config.weights
    total = sum(
        getattr(weights, name) * value for name, value in each.items() if name not in ("adversarial", "critics")
    )
    total = total + strength * each.get("adversarial", torch.zeros((), device=device))
    return torch.as_tensor(total), each


def _still(quaternions: Float[Tensor, "row 4"]) -> Float[Tensor, "row 3 3"]:
    """The paper's form is already in the start's frame."""
    return torch.eye(3, device=quaternions.device).expand(len(quaternions), 3, 3)
