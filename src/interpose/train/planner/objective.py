"""The planner of DC-MoE in training: what it is told of a row's gap, what it should say, and plans for roll-outs.

The network is the conditional variational autoencoder of `interpose.models.planner`. Beside the motion that a latent
of the posterior stands for, the likeliest one, the prior's mean, is held to the truth by itself: that is what a user
gets first.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.features import RATE
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.models.planner import LONGEST, Ends, GapPlan, divergence
from interpose.stitch_layout import ANCHORS
from interpose.train.common.frames import Frames, interpolation
from interpose.train.common.gaps import anchor_times
from interpose.train.dcmoe.sequences import Rows, Sampling, draw, poses, root_keys


@dataclass(frozen=True)
class Planning:
    """How the planner is trained, before the steps are, and how the steps use it.

    steps, rows, learning_rate: of its own part of the training. likeliest: weight of the prior's mean held to the
    truth. divergence: of the KL term. posterior: share of the roll-outs along a plan of the posterior; the others
    follow the likeliest one.
    """

    steps: int
    rows: int
    learning_rate: float = 1e-3
    likeliest: float = 1.0
    divergence: float = 1e-4
    posterior: float = 0.4


@dataclass(frozen=True)
class Anchors:
    """A motion at a gap's anchors, world frame."""

    hips: Float[Tensor, "row anchor 3"]
    rotations: Float[Tensor, "row anchor 22 6"]
    positions: Float[Tensor, "row anchor 22 3"]


def true_anchors(data: Frames, rows: Rows) -> Anchors:
    """What really happens there, linear between frames."""
    at = anchor_times(data.hips) * rows.total[:, None]
    low = torch.minimum(at.floor().long(), rows.total[:, None] - 1)
    share = (at - low)[..., None]
    turned, placed = poses(data, rows.start, rows.total, rows.keys, torch.cat([low, low + 1], dim=1))
    hips = data.hips[rows.start[:, None] + low], data.hips[rows.start[:, None] + low + 1]

    def mixed(values: Tensor, share: Tensor) -> Tensor:
        return torch.lerp(values[:, :ANCHORS], values[:, ANCHORS:], share)

    return Anchors(torch.lerp(*hips, share), mixed(turned, share[..., None]), mixed(placed, share[..., None]))


def ends(data: Frames, rows: Rows) -> Ends:
    """What a planner is told of the rows' gaps; their paths are the true roots'."""
    turned, placed = poses(
        data, rows.start, rows.total, rows.keys, torch.stack([torch.zeros_like(rows.total), rows.total], dim=1)
    )
    target = rows.start + rows.total
    before, beyond = (rows.start - 1).clamp_min(0), (target + 1).clamp_max(len(data) - 1)
    leaving = (data.positions[rows.start] - data.positions[before]) * (RATE * rows.start_known[..., None])
    arriving = (data.positions[beyond] - data.positions[target]) * (RATE * rows.target_known[..., None])
    at = anchor_times(data.hips) * rows.total[:, None]
    low = torch.minimum(at.floor().long(), rows.total[:, None] - 1)
    index = rows.start[:, None] + low
    way = torch.lerp(root_keys(data, index), root_keys(data, index + 1), (at - low)[..., None])[..., :4]
    facing = torch.nn.functional.normalize(way[..., 2:], dim=-1)
    return Ends(
        *(data.hips[rows.start], turned[:, 0], placed[:, 0], leaving, rows.start_known),
        *(data.hips[target], turned[:, 1], placed[:, 1], arriving, rows.target_known),
        steps=rows.total[:, None].float(),
        style=rows.style,
        path=torch.cat([way[..., :2], facing], dim=-1),
        path_known=rows.path_known,
    )


def _naive(data: Frames, rows: Rows) -> Float[Tensor, "row anchor pose"]:
    """Interpolation at the anchors."""
    target, keys = rows.start + rows.total, rows.keys
    parts = anchor_times(data.hips).expand(len(target), -1)
    return interpolation(data.hips[rows.start], keys.start_local, data.hips[target], keys.target_local, parts)


def _residual(true: Anchors, base: Float[Tensor, "row anchor pose"]) -> Float[Tensor, "row anchor pose"]:
    return torch.cat([true.hips, true.rotations.flatten(2)], dim=-1) - base


def reconstruction(
    made: Float[Tensor, "row anchor pose"],
    true: Anchors,
    keys: tuple[Float[Tensor, "row 22 3"], Float[Tensor, "row 22 3"]],
) -> dict[str, Float[Tensor, ""]]:
    """L1 of positions (metres), of rotations (6-D) and of the joints' way from anchor to anchor, keys included."""
    matrices = to_matrix(made[..., 3:].unflatten(-1, (22, 6)))
    positions = joint_positions(made[..., :3].flatten(0, 1), matrices.flatten(0, 1)).unflatten(0, made.shape[:2])
    first, last = (key[:, None] for key in keys)
    step, true_step = (torch.cat([first, x, last], dim=1).diff(dim=1) for x in (positions, true.positions))
    return {
        "plan position": (positions - true.positions).abs().mean(),
        "plan rotation": (to_six(matrices) - true.rotations).abs().mean(),
        "plan displacement": (step - true_step).abs().mean(),
    }


WEIGHTS = {"plan position": 3.0, "plan rotation": 1.0, "plan displacement": 2.0}
"""Of :func:`reconstruction`'s terms."""


def weighed(terms: dict[str, Float[Tensor, ""]]) -> Float[Tensor, ""]:
    """Their weighted sum."""
    return torch.stack([WEIGHTS[name] * value for name, value in terms.items()]).sum()


def loss(
    planner: GapPlan, data: Frames, rows: Rows, noise: Float[Tensor, "row unit"], config: Planning
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """On the rows' gaps: reconstruction from the posterior, of the latents that ``noise`` gives, and from the prior's
    mean, and their divergence."""
    base, true, told = _naive(data, rows), true_anchors(data, rows), ends(data, rows)
    keys = told.start_positions, told.target_positions
    x, frame = planner(told)
    q, p = planner.recognise(x, frame, _residual(true, base)), planner.expect(x)
    each = reconstruction(base + planner.decode(x, frame, q.at(noise)), true, keys)
    nats = divergence(q, p).sum(dim=-1).mean()
    total = weighed(each) + config.divergence * nats
    if config.likeliest:
        likeliest = reconstruction(base + planner.decode(x, frame, p.mean), true, keys)
        total = total + config.likeliest * weighed(likeliest)
        each |= {name.replace("plan", "likeliest"): value for name, value in likeliest.items()}
    return total, each | {"nats": nats}


@torch.no_grad()
def add_plans(planner: GapPlan, data: Frames, rows: Rows, posterior: float, generator: torch.Generator) -> None:
    """Gives each row its plan: of a latent of the posterior in that share of them, else of the prior's mean; none where
    the gap is longer than plans are trained for."""
    was = planner.training
    planner.eval()
    x, frame = planner(ends(data, rows))
    z = planner.expect(x).mean
    if posterior:
        q = planner.recognise(x, frame, _residual(true_anchors(data, rows), _naive(data, rows)))
        noise = torch.randn(z.shape, generator=generator, device=z.device)
        taken = torch.rand(len(z), 1, generator=generator, device=z.device) < posterior
        z = torch.where(taken, q.at(noise), z)
    within = (rows.total <= LONGEST).float()[:, None, None]
    rows.added = within * planner.decode(x, frame, z)
    planner.train(was)


def add_perfect_plans(data: Frames, rows: Rows) -> None:
    """Gives each row the plan that the truth would be: before any planner is trained, features are as large as they
    will be with one."""
    within = (rows.total <= LONGEST).float()[:, None, None]
    rows.added = within * _residual(true_anchors(data, rows), _naive(data, rows))


@torch.no_grad()
def set_statistics(
    planner: GapPlan, data: Frames, rule: Sampling, generator: torch.Generator, count: int = 8192
) -> None:
    """Means and deviations of the planner's input and output over gaps of the data, into its buffers."""
    rows = draw(data, count, planner.size.styles, rule, generator)
    told = ends(data, rows)
    x, frame = planner.numbers(told._replace(path_known=torch.ones_like(told.path_known)))
    planner.mean.copy_(x.mean(dim=0))
    planner.std.copy_(x.std(dim=0).clamp_min(1e-2))
    residual = _residual(true_anchors(data, rows), _naive(data, rows)).unflatten(-1, (-1, 3)) @ frame[:, None]
    planner.residual_std.copy_(residual.flatten(1).std(dim=0).clamp_min(1e-3))
