"""Gaps made by a stitching model, and what must be measured of the data before it is trained."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.features import RATE
from interpose.models.geometry import joint_positions, to_matrix
from interpose.models.planner import POSE, Normal
from interpose.models.stitch_forms import Aim
from interpose.models.stitching_cvae import Generator, StitchingCVAE
from interpose.stitch_layout import schedule, spread
from interpose.train.common import gaps
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Gaps, Motion
from interpose.train.stitch.config import Config
from interpose.train.stitch.rollout import Stitched, roll

LENGTHS = (10, 30, 50)
"""Frames of the gaps that validation looks at, both keys counted."""


def made_gaps(
    model: StitchingCVAE,
    data: Frames,
    drawn: Gaps,
    config: Config,
    generator: torch.Generator,
    known: Float[Tensor, "row"] | None = None,
    noise: Float[Tensor, "row unit"] | None = None,
) -> tuple[Stitched, Motion, list[Normal]]:
    """Gaps of one length made by the model, the true motion, and the distributions of latents a frame.

    In training ``known`` takes how much each row is held to the truth. Otherwise all follow the prior at ``noise``.
    """
    steps = int(drawn.steps[0])
    true = true_motion(model, data, drawn, steps)
    front, back = gaps.bodies(data, drawn, true)
    rows, device = len(drawn.start), data.hips.device
    if model.size.form == "paper":
        base = torch.zeros(rows, steps + 1, POSE, device=device)
    else:
        parts = (torch.arange(steps + 1, device=device) / steps).expand(rows, -1)
        base = gaps.base(data, drawn, parts)
    z = None
    if model.plan is not None:
        with torch.no_grad():
            z, added = _planned(model, data, drawn, config, generator, known, noise)
        if model.size.planned:
            weights = torch.as_tensor(spread(steps), dtype=base.dtype, device=device)
            base = base + torch.einsum("ta,bac->btc", weights, added)
    if model.size.latents == "frame":
        moves = len(schedule(steps, config.course.buffer, config.course.aligned, config.course.both))
        z = torch.randn(rows, moves, model.size.latent, generator=generator, device=device)
        if known is None and noise is None:
            z = torch.zeros_like(z)
    assert z is not None
    made = roll(model, front, back, base, drawn.style, z, config.course)
    said = made.front.said + ([] if made.back is None else made.back.said)
    return made, true, said


def _planned(
    model: StitchingCVAE,
    data: Frames,
    drawn: Gaps,
    config: Config,
    generator: torch.Generator,
    known: Float[Tensor, "row"] | None,
    noise: Float[Tensor, "row unit"] | None,
) -> tuple[Float[Tensor, "row unit"], Float[Tensor, "row anchor pose"]]:
    """The latents of the gaps and what they add to interpolation at the anchors."""
    plan = model.plan
    assert plan is not None
    was = plan.training
    plan.eval()
    rows, device = len(drawn.start), data.hips.device
    x, frame = plan(gaps.ends(data, drawn))
    p = plan.expect(x)
    if known is None:
        z = p.mean if noise is None else p.at(noise)
    else:
        parts = gaps.anchor_times(data.hips).expand(rows, -1)
        q = plan.recognise(x, frame, gaps.residual(data, drawn, gaps.base(data, drawn, parts)))
        draws = torch.randn(2, rows, model.size.latent, generator=generator, device=device)
        first, second = round(config.posterior * rows), round((config.posterior + config.average_way) * rows)
        z = torch.cat([q.at(draws[0])[:first], p.mean[first:second], p.at(draws[1])[second:]])
        known[second:] = config.sampled
    added = plan.decode(x, frame, z)
    plan.train(was)
    return z, added


def true_motion(model: StitchingCVAE, data: Frames, drawn: Gaps, steps: int) -> Motion:
    """What really happened, as the model's form has it."""
    if model.size.form == "paper":
        return gaps.letter_motion(data, drawn, steps, model.mean_quaternions)
    return gaps.motion(data, drawn, steps)


@torch.no_grad()
def set_statistics(
    model: StitchingCVAE, data: Frames, config: Config, generator: torch.Generator, count: int = 256
) -> None:
    """Means and deviations of every network's inputs over gaps of the data, into the model's buffers."""
    styles = model.size.styles
    if model.size.form == "paper":
        model.mean_quaternions.copy_(gaps.mean_quaternions(data))
    collected: dict[tuple[int, str], list[Tensor]] = {}
    longest = config.longest - 1
    for steps in torch.linspace(config.shortest - 1, longest, 12).long().tolist():
        drawn = gaps.draw(data, count, styles, config.sampling, generator, steps=steps)
        true = true_motion(model, data, drawn, steps)
        keys = gaps.bodies(data, drawn, true)
        base = torch.zeros(count, steps + 1, POSE, device=data.hips.device)
        if model.size.form != "paper":
            base = gaps.base(data, drawn, (torch.arange(steps + 1, device=base.device) / steps).expand(count, -1))
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
    if model.plan is not None:
        drawn = gaps.draw(data, 32 * count, styles, config.sampling, generator)
        known = gaps.ends(data, drawn)
        known = known._replace(path_known=torch.ones_like(known.path_known))
        x, frame = model.plan.numbers(known)
        model.plan.mean.copy_(x.mean(dim=0))
        model.plan.std.copy_(x.std(dim=0).clamp_min(1e-2))
        parts = gaps.anchor_times(data.hips).expand(len(x), -1)
        residual = gaps.residual(data, drawn, gaps.base(data, drawn, parts)).unflatten(-1, (-1, 3)) @ frame[:, None]
        model.plan.residual_std.copy_(residual.flatten(1).std(dim=0).clamp_min(1e-3))


def _set(module: Generator, name: str, values: Float[Tensor, "row wide"]) -> None:
    deviation = values.std(dim=0)
    getattr(module, f"{name}_mean").copy_(values.mean(dim=0))
    getattr(module, f"{name}_std").copy_(torch.where(deviation < 1e-4, 1.0, deviation.clamp_min(1e-2)))


@torch.no_grad()
def ratios(model: StitchingCVAE, data: Frames, config: Config, count: int = 128) -> dict[str, float]:
    """Mean joint position error on held-out gaps over interpolation's, from the prior's mean, and how smooth it is."""
    out = {}
    was = model.training
    model.eval()
    for frames in LENGTHS:
        if frames > config.longest:
            continue
        steps = frames - 1
        drawn = gaps.evenly(data, steps, count, model.size.styles)
        generator = torch.Generator(data.hips.device).manual_seed(0)
        made, true, _ = made_gaps(model, data, drawn, config, generator)
        parts = (torch.arange(steps + 1, device=data.hips.device) / steps).expand(count, -1)
        base = gaps.base(data, drawn, parts)
        matrices = to_matrix(base[..., 3:].unflatten(-1, (22, 6))).flatten(0, 1)
        naive = joint_positions(base[..., :3].flatten(0, 1), matrices).unflatten(0, base.shape[:2])
        real = data.positions[drawn.start[:, None] + torch.arange(frames, device=data.hips.device)]
        wrong, apart = (made.positions - true.positions).norm(dim=-1).mean(), (naive - real).norm(dim=-1).mean()
        out[f"valid/{frames}"] = float(wrong / apart)
        shake, real_shake = (x.diff(n=3, dim=1).norm(dim=-1).mean() for x in (made.positions, true.positions))
        out[f"jerk/{frames}"] = float(shake / real_shake)
    model.train(was)
    return out
