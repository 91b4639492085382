"""What the planner minimises, how well it performs on held-out gaps, and plans for the trainings that work along it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.models.normal import divergence
from interpose.models.planner import Planner, anchor_weights_at
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Anchors, Gaps, GapSampling, base, draw, evenly, gap_input, true_anchors
from interpose.train.planner.config import PlannerConfig

VALIDATION_FRAMES = (5, 15, 30, 45, 60, 90)
"""Frames of the gaps that validation looks at, the keys not counted."""


def reconstruction(
    poses: Float[Tensor, "row anchor pose"],
    true: Anchors,
    keys: tuple[Float[Tensor, "row 22 3"], Float[Tensor, "row 22 3"]],
) -> dict[str, Float[Tensor, ""]]:
    """L1 of joint positions (metres), of rotations (6-D), and of the joints' steps from anchor to anchor, keys
    included."""
    matrices = to_matrix(poses[..., 3:].unflatten(-1, (22, 6)))
    positions = joint_positions(poses[..., :3].flatten(0, 1), matrices.flatten(0, 1)).unflatten(0, poses.shape[:2])
    first, last = (key[:, None] for key in keys)
    step, true_step = (torch.cat([first, x, last], dim=1).diff(dim=1) for x in (positions, true.positions))
    return {
        "position": (positions - true.positions).abs().mean(),
        "rotation": (to_six(matrices) - true.rotations).abs().mean(),
        "displacement": (step - true_step).abs().mean(),
    }


def loss(
    planner: Planner, data: Frames, gaps: Gaps, noise: Float[Tensor, "row unit"], config: PlannerConfig
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """Reconstruction from the posterior, at the latents that ``noise`` gives, and from the prior's mean, which is what
    a user gets first; and the divergence of the two distributions."""
    true, known = true_anchors(data, gaps), gap_input(data, gaps)
    keys = known.start_positions, known.target_positions
    x, frame = planner.encode(known)
    q, p = planner.recognise(x, frame, true.residual), planner.expect(x)
    decoded = planner.decode(torch.cat([x, x]), torch.cat([frame, frame]), torch.cat([q.at(noise), p.mean]))
    posterior, likeliest = (reconstruction(true.base + half, true, keys) for half in decoded.chunk(2))
    nats = divergence(q, p).sum(dim=-1).mean()

    def weighted(terms: dict[str, Tensor]) -> Tensor:
        return torch.stack([getattr(config, name) * value for name, value in terms.items()]).sum()

    total = weighted(posterior) + config.likeliest * weighted(likeliest) + config.divergence * nats
    return total, posterior | {f"likeliest {name}": value for name, value in likeliest.items()} | {"nats": nats}


@torch.no_grad()
def set_statistics(
    planner: Planner, data: Frames, rule: GapSampling, generator: torch.Generator, count: int = 8192
) -> None:
    """Means and deviations of the planner's input and output over gaps of the data, into its buffers."""
    gaps = draw(data, count, planner.size.styles, rule, generator)
    known = gap_input(data, gaps)
    x, frame = planner.features(known._replace(path_known=torch.ones_like(known.path_known)))
    planner.mean.copy_(x.mean(dim=0))
    planner.std.copy_(x.std(dim=0).clamp_min(1e-2))
    residual = true_anchors(data, gaps).residual.unflatten(-1, (-1, 3)) @ frame[:, None]
    planner.residual_std.copy_(residual.flatten(1).std(dim=0).clamp_min(1e-3))


@torch.no_grad()
def plans(
    planner: Planner, data: Frames, gaps: Gaps, posterior: float, generator: torch.Generator
) -> tuple[Float[Tensor, "row anchor pose"], Float[Tensor, "row unit"]]:
    """A plan for each gap and its latent: of the posterior in that share of them, else of the prior's mean.

    Gaps that are longer than plans are trained for have none.
    """
    x, frame = planner.encode(gap_input(data, gaps))
    z = planner.expect(x).mean
    if posterior:
        q = planner.recognise(x, frame, true_anchors(data, gaps).residual)
        noise = torch.randn(z.shape, generator=generator, device=z.device)
        taken = torch.rand(len(z), 1, generator=generator, device=z.device) < posterior
        z = torch.where(taken, q.at(noise), z)
    return planner.decode(x, frame, z) * within(gaps), z


def perfect_plans(data: Frames, gaps: Gaps) -> Float[Tensor, "row anchor pose"]:
    """The plans that the truth would be."""
    return true_anchors(data, gaps).residual * within(gaps)


def within(gaps: Gaps) -> Float[Tensor, "row 1 1"]:
    """1 where a gap is no longer than plans are trained for."""
    return (gaps.steps <= LONGEST_PLAN_STEPS).float()[:, None, None]


def planned_base(
    data: Frames,
    gaps: Gaps,
    plan: Float[Tensor, "row anchor pose"] | None,
    at: Int[Tensor, "row time"],
) -> Float[Tensor, "row time pose"]:
    """The base at the frames ``at`` after each start, clamped at the target: interpolation, and with a ``plan`` its
    spline, the root on the true path where that is given. As `interpose.runtime.planner` makes it."""
    at = torch.minimum(at, gaps.steps[:, None])
    parts = at / gaps.steps[:, None]
    poses = base(data, gaps, parts)
    if plan is not None:
        poses = poses + anchor_weights_at(parts) @ plan
        path = data.hips[gaps.start[:, None] + at.long()]
        poses[..., [0, 2]] += gaps.path_known[..., None] * (path - poses[..., :3])[..., [0, 2]]
    return poses


def placed(poses: Float[Tensor, "row time pose"]) -> Float[Tensor, "row time 22 3"]:
    """Joint positions of poses as (hips, global 6-D)."""
    flat = poses.flatten(0, 1)
    return joint_positions(flat[:, :3], to_matrix(flat[:, 3:].unflatten(1, (22, 6)))).unflatten(0, poses.shape[:2])


@torch.no_grad()
def ratios(planner: Planner, data: Frames, count: int = 128) -> dict[str, float]:
    """Mean joint position error of the likeliest plans over interpolation's on held-out gaps that are long enough:
    ``valid/30`` from two keys alone, ``path/30`` along the true path."""
    out = {}
    generator = torch.Generator(data.hips.device).manual_seed(0)
    for name, gaps, at, real, naive in validation_gaps(data, LONGEST_PLAN_STEPS, count, planner.size.styles):
        plan, _ = plans(planner, data, gaps, 0.0, generator)
        wrong = (placed(planned_base(data, gaps, plan, at)) - real).norm(dim=-1).mean()
        out[f"{name}/{at.shape[1]}"] = float(wrong / naive)
    return out


def validation_gaps(
    data: Frames, longest: int, count: int, styles: int
) -> Iterator[tuple[str, Gaps, Int[Tensor, "row time"], Float[Tensor, "row time 22 3"], Float[Tensor, ""]]]:
    """``count`` gaps of each length up to ``longest`` steps for which the clips have room, without a path (``valid``)
    and along the true one (``path``): the frames between the keys, the true joints there, interpolation's error."""
    for frames in VALIDATION_FRAMES:
        if frames + 1 > min(int((data.last - data.first).max()), longest):
            continue
        gaps = evenly(data, frames + 1, count, styles)
        at = torch.arange(1, frames + 1, device=gaps.start.device).expand(count, -1)
        real = data.positions[gaps.start[:, None] + at]
        naive = (placed(planned_base(data, gaps, None, at)) - real).norm(dim=-1).mean()
        for name in ("valid", "path"):
            yield (
                name,
                replace(gaps, path_known=torch.full_like(gaps.path_known, float(name == "path"))),
                at,
                real,
                naive,
            )
