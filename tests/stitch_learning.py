"""What the tests of stitching share: small, loud networks of random weights, as in `learning`, and gaps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import roma
import torch
from learning import PLANNER, STYLES, loud_planner
from learning import write_run as write_any
from torch import Tensor, nn

from interpose.features import RATE
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Latent, StitchingCVAE, StitchSize
from interpose.train.common import gaps
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import GapSampling
from interpose.train.planner import objective
from interpose.train.stitch.config import PAPER_SIZE, PRESETS, StitchConfig
from interpose.train.stitch.transitions import set_statistics
from interpose.train.stitch.truth import mean_quaternions, paper_motion, yaw_motion

T = TypeVar("T", bound=tuple)
_TINY = PRESETS["tiny"]
CONFIG = replace(
    _TINY,
    size=replace(_TINY.size, latent=PLANNER.size.latent, styles=len(STYLES), plan=PLANNER.size),
    plan=PLANNER,
    databases=PLANNER.databases,
    styles=STYLES,
    licence=PLANNER.licence,
)
"""What a run of preset ``tiny`` on `learning`'s database keeps."""


def paper_form(size: StitchSize) -> StitchSize:
    """The paper's form and latents at that size, without a planner."""
    changes = {"form": PAPER_SIZE.form, "latents": PAPER_SIZE.latents, "planned": PAPER_SIZE.planned}
    return replace(size, plan=None, **changes)


PAPER = replace(CONFIG, preset="paper", size=paper_form(CONFIG.size), plan=None, chains=PRESETS["paper"].chains)
"""Preset ``paper`` as small as ``tiny``."""


def loud(model: StitchingCVAE) -> StitchingCVAE:
    """The same model with every part audible: large last layers, gates that choose, biases everywhere."""
    with torch.no_grad():
        for module in model.modules():
            if isinstance(module, nn.Linear):
                module.weight.mul_(2.0)
                if module.bias is not None:
                    module.bias.add_(0.3 * torch.randn_like(module.bias))
        for side in (model.front, model.back):
            side.experts[-1].linear.weight.mul_(4.0)
            side.gate[-1].weight.mul_(2.0)
        if model.plan is not None:
            loud_planner(model.plan)
            model.plan.prior[-1].bias[model.size.latent :] -= 1.0
    return model


def network_for(data: Frames, config: StitchConfig = CONFIG, seed: int = 3) -> StitchingCVAE:
    """A loud model of random weights, its features normalised for ``data``."""
    torch.manual_seed(seed)
    model = loud(StitchingCVAE(config.size))
    if model.plan is not None:
        generator = torch.Generator().manual_seed(0)
        objective.set_statistics(model.plan, data, config.sampling, generator, count=512)
    set_statistics(model, data, config, torch.Generator().manual_seed(0), count=32)
    return model.eval().requires_grad_(False)


def write_run(folder: Path, model: StitchingCVAE, config: StitchConfig = CONFIG, step: int = 20) -> Path:
    """A run folder as a training of ``model`` leaves it."""
    return write_any(folder, model, config, step)


@dataclass(frozen=True)
class Elsewhere:
    """The world turned about the vertical and moved over the ground."""

    yaw: float = 2.1
    x: float = 3.0
    z: float = -1.5

    def vector(self, v: Tensor) -> Tensor:
        """Directions (..., 3)."""
        return v @ self._matrix(v).T

    def point(self, p: Tensor) -> Tensor:
        """Places (..., 3)."""
        return self.vector(p) + p.new_tensor([self.x, 0.0, self.z])

    def turned(self, six: Tensor) -> Tensor:
        """Rotations as 6-D (..., 6)."""
        return self.vector(six.unflatten(-1, (2, 3))).flatten(-2)

    def ground(self, v: Tensor) -> Tensor:
        """Directions on the ground (..., 2)."""
        return v @ self._matrix(v)[::2, ::2].T

    def pose(self, pose: Tensor) -> Tensor:
        """Hips and 6-D (..., 135)."""
        turned = self.turned(pose[..., 3:].unflatten(-1, (-1, 6))).flatten(-2)
        return torch.cat([self.point(pose[..., :3]), turned], dim=-1)

    def body(self, body: Body) -> Body:
        """The newest frame of a chain of the yaw form."""
        return body._replace(
            hips=self.point(body.hips),
            rotations=self.turned(body.rotations),
            positions=self.point(body.positions),
            velocities=self.vector(body.velocities),
        )

    def aim(self, aim: Aim) -> Aim:
        """What a step of the yaw form is led to."""
        return Aim(
            self.point(aim.hips),
            self.turned(aim.rotations),
            self.point(aim.positions),
            aim.left,
            *(self.pose(base) for base in aim[4:]),
        )

    def frames(self, data: Frames) -> Frames:
        """Everything that happened."""
        half = 0.5 * torch.tensor(self.yaw)
        turn = torch.stack([0.0 * half, half.sin(), 0.0 * half, half.cos()])
        local = data.local.clone()
        local[:, 0] = roma.quat_product(turn.expand(len(data), 4), local[:, 0].contiguous())
        return replace(
            data,
            hips=self.point(data.hips),
            rotations=self.turned(data.rotations),
            positions=self.point(data.positions),
            facing=self.ground(data.facing),
            local=local,
        )

    def _matrix(self, like: Tensor) -> Tensor:
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return like.new_tensor([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])


KNOWN = GapSampling(path=1.0, velocity=1.0, style_dropout=0.0)
"""Gaps of which everything is known."""


def drawn(data: Frames, count: int, steps: int | None = None, rule: GapSampling = KNOWN, seed: int = 0) -> gaps.Gaps:
    """Gaps of ``data``."""
    return gaps.draw(data, count, len(STYLES), rule, torch.Generator().manual_seed(seed), steps)


def double(values: T) -> T:
    """The same named tuple in double precision."""
    return type(values)(*(value.double() for value in values))


def situation(data: Frames, count: int = 6, steps: int = 12, form: str = "yaw", seed: int = 1) -> tuple[Body, Aim]:
    """A chain two frames from the start of gaps, led to the frame before their target; the base is interpolation,
    from which both are far."""
    chosen = drawn(data, count, steps, seed=seed)
    if form == "paper":
        true = paper_motion(data, chosen, steps, mean_quaternions(data))
    else:
        true = yaw_motion(data, chosen, steps)
    body = Body(
        true.hips[:, 2],
        true.rotations[:, 2],
        true.positions[:, 2],
        (true.positions[:, 2] - true.positions[:, 1]) * RATE,
        torch.ones(count, 1),
        true.contacts[:, 2] * 0.9 + 0.05,
        torch.randn(count, 4, generator=torch.Generator().manual_seed(seed)) * 0.4,
    )
    base = gaps.base(data, chosen, torch.tensor([2.0, 3.0, steps - 1.0]).expand(count, -1) / steps)
    left = torch.full((count, 1), steps - 3.0)
    there = true.hips[:, -2], true.rotations[:, -2], true.positions[:, -2]
    return body, Aim(*there, left, *base.unbind(dim=1))


def latent(size: StitchSize, count: int = 6, share: float = 0.4, seed: int = 2) -> Latent:
    """Noise, and styles by turns."""
    value = torch.randn(count, size.latent, generator=torch.Generator().manual_seed(seed))
    style = torch.eye(size.styles + 1)[torch.arange(count) % (size.styles + 1)]
    return Latent(value, torch.full((count, 1), share), style)
