"""Gaps made by a stitching model, and what must be measured of the data before it is trained."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.features import POSE, RATE
from interpose.features.plan import anchor_weights
from interpose.features.stitch import schedule
from interpose.models.normal import Normal
from interpose.models.planner import Planner
from interpose.models.stitch_forms import Aim
from interpose.models.stitching_cvae import Generator, StitchingCVAE
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Gaps, draw, evenly, gap_input, true_anchors
from interpose.train.common.gaps import base as interpolated
from interpose.train.planner.objective import placed
from interpose.train.stitch.config import StitchConfig
from interpose.train.stitch.rollout import Stitched, roll
from interpose.train.stitch.truth import TrueMotion, chain_ends, mean_quaternions, paper_motion, yaw_motion

VALIDATION_LENGTHS = (10, 30, 50)
"""Frames of the gaps that validation looks at, both keys counted."""


def made_gaps(
    model: StitchingCVAE,
    data: Frames,
    gaps: Gaps,
    config: StitchConfig,
    generator: torch.Generator,
    known: Float[Tensor, "row"] | None = None,
    noise: Float[Tensor, "row unit"] | None = None,
) -> tuple[Stitched, TrueMotion, list[Normal]]:
    """Gaps of one length made by the model, the true motion, and the distributions of latents a frame.

    In training ``known`` receives how much each row is held to the truth. Otherwise all follow the prior at ``noise``.
    """
    steps = int(gaps.steps[0])
    true = true_motion(model, data, gaps, steps)
    front, back = chain_ends(data, gaps, true)
    rows, device = len(gaps), data.hips.device
    if model.size.form == "paper":
        base = torch.zeros(rows, steps + 1, POSE, device=device)
    else:
        parts = (torch.arange(steps + 1, device=device) / steps).expand(rows, -1)
        base = interpolated(data, gaps, parts)
    z = None
    if model.plan is not None:
        with torch.no_grad():
            z, plan = _planned(model.plan, data, gaps, config, generator, known, noise)
        if model.size.planned:
            base = base + torch.as_tensor(anchor_weights(steps), dtype=base.dtype, device=device) @ plan
    if model.size.latents == "frame":
        moves = len(schedule(steps, config.chains.buffer, config.chains.aligned, config.chains.both))
        z = torch.randn(rows, moves, model.size.latent, generator=generator, device=device)
        if known is None and noise is None:
            z = torch.zeros_like(z)
    assert z is not None
    made = roll(model, front, back, base, gaps.style, z, config.chains)
    return made, true, made.front.latents + ([] if made.back is None else made.back.latents)


def _planned(
    planner: Planner,
    data: Frames,
    gaps: Gaps,
    config: StitchConfig,
    generator: torch.Generator,
    known: Float[Tensor, "row"] | None,
    noise: Float[Tensor, "row unit"] | None,
) -> tuple[Float[Tensor, "row unit"], Float[Tensor, "row anchor pose"]]:
    """The latents of the gaps and their plans: of the posterior, of the prior's mean and of its samples."""
    rows, device = len(gaps), data.hips.device
    x, frame = planner.encode(gap_input(data, gaps))
    p = planner.expect(x)
    if known is None:
        z = p.mean if noise is None else p.at(noise)
    else:
        q = planner.recognise(x, frame, true_anchors(data, gaps).residual)
        draws = torch.randn(2, rows, planner.size.latent, generator=generator, device=device)
        first, second = round(config.posterior * rows), round((config.posterior + config.likeliest) * rows)
        z = torch.cat([q.at(draws[0])[:first], p.mean[first:second], p.at(draws[1])[second:]])
        known[second:] = config.sampled
    return z, planner.decode(x, frame, z)


def true_motion(model: StitchingCVAE, data: Frames, gaps: Gaps, steps: int) -> TrueMotion:
    """What really happened, as the model's form has it."""
    if model.size.form == "paper":
        return paper_motion(data, gaps, steps, model.mean_quaternions)
    return yaw_motion(data, gaps, steps)


@torch.no_grad()
def set_statistics(
    model: StitchingCVAE, data: Frames, config: StitchConfig, generator: torch.Generator, count: int = 256
) -> None:
    """Means and deviations of every network's inputs over gaps of the data, into the model's buffers."""
    styles = model.size.styles
    if model.size.form == "paper":
        model.mean_quaternions.copy_(mean_quaternions(data))
    collected: dict[tuple[int, str], list[Tensor]] = {}
    longest = config.longest - 1
    for steps in torch.linspace(config.shortest - 1, longest, 12).long().tolist():
        drawn = draw(data, count, styles, config.sampling, generator, steps=steps)
        true = true_motion(model, data, drawn, steps)
        keys = chain_ends(data, drawn, true)
        base = torch.zeros(count, steps + 1, POSE, device=data.hips.device)
        if model.size.form != "paper":
            base = interpolated(data, drawn, (torch.arange(steps + 1, device=base.device) / steps).expand(count, -1))
        for number, side in enumerate((model.front, model.back)):
            for gone in {0, 1, max(1, (steps - 1) // 2)}:
                at, following, aim = gone, gone + 1, steps - gone
                before = gone - 1
                if number:
                    at, following, aim, before = steps - at, steps - following, steps - aim, steps - before
                body = keys[number]
                if gone:
                    moved = (true.positions[:, at] - true.positions[:, before]) * RATE
                    body = body._replace(
                        hips=true.hips[:, at],
                        rotations=true.rotations[:, at],
                        positions=true.positions[:, at],
                        velocities=moved,
                        known=torch.ones_like(body.known),
                        contacts=true.contacts[:, at],
                    )
                left = torch.full_like(body.known, float(abs(aim - at)))
                led = Aim(
                    true.hips[:, aim], true.rotations[:, aim], true.positions[:, aim], left,
                    base[:, at], base[:, following], base[:, aim],
                )  # fmt: skip
                features = side.form.features(body, led)
                for name in ("state", "offset", "target"):
                    collected.setdefault((number, name), []).append(getattr(features, name))
    for (number, name), values in collected.items():
        side = (model.front, model.back)[number]
        _set(side, name, torch.cat(values))


def _set(module: Generator, name: str, values: Float[Tensor, "row wide"]) -> None:
    deviation = values.std(dim=0)
    getattr(module, f"{name}_mean").copy_(values.mean(dim=0))
    getattr(module, f"{name}_std").copy_(torch.where(deviation < 1e-4, 1.0, deviation.clamp_min(1e-2)))


@torch.no_grad()
def ratios(model: StitchingCVAE, data: Frames, config: StitchConfig, count: int = 128) -> dict[str, float]:
    """Mean joint position error on held-out gaps over interpolation's, from the prior's mean, and how smooth it is."""
    out = {}
    was = model.training
    model.eval()
    for frames in VALIDATION_LENGTHS:
        if frames > config.longest:
            continue
        steps = frames - 1
        drawn = evenly(data, steps, count, model.size.styles)
        generator = torch.Generator(data.hips.device).manual_seed(0)
        made, true, _ = made_gaps(model, data, drawn, config, generator)
        parts = (torch.arange(steps + 1, device=data.hips.device) / steps).expand(count, -1)
        base = interpolated(data, drawn, parts)
        naive = placed(base)
        real = data.positions[drawn.start[:, None] + torch.arange(frames, device=data.hips.device)]
        wrong, apart = (made.positions - true.positions).norm(dim=-1).mean(), (naive - real).norm(dim=-1).mean()
        out[f"valid/{frames}"] = float(wrong / apart)
        shake, real_shake = (x.diff(n=3, dim=1).norm(dim=-1).mean() for x in (made.positions, true.positions))
        out[f"jerk/{frames}"] = float(shake / real_shake)
    model.train(was)
    return out
