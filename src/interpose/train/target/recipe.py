"""The recipe of the target completion: ``interpose train target --data DB -o RUN``.

Pairs of frames of one clip are drawn on the fly, the later one partly hidden, as users give targets: one group of
joints (`interpose.parts`), two, or any joints. The run folder is that of `interpose.train.common.loop`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from interpose import parts
from interpose.features import JOINTS, POSE, RATE
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.models.normal import Normal, divergence
from interpose.models.target_pose import LONGEST_TARGET_FRAMES, TargetInput, TargetPose, TargetSize, posed, residual
from interpose.train.common import checkpoint, loop, setup
from interpose.train.common.config import TrainingConfig, from_plain, preset_of
from interpose.train.common.frames import Frames
from interpose.train.common.optimize import fit


@dataclass(frozen=True)
class TargetConfig(TrainingConfig):
    """Everything that decides a training of the target completion."""

    completes: str = "target"
    """what the run adds to a model"""
    size: TargetSize = field(default_factory=lambda: TargetSize(hidden=768))
    steps: int = 40_000
    rows: int = 1024
    weight_decay: float = 1e-2
    warmup: int = 300
    divergence: float = 1e-3
    """the weight of a nat"""
    free_style: float = 0.3
    """share of the rows whose label is dropped"""
    at_speed: float = 0.5
    """share whose velocity at the start is known"""
    strayed: float = 0.2
    """share whose start is somewhere else: half a metre away, the usual deviation"""


PRESETS: dict[str, TargetConfig] = {
    "full": TargetConfig(),
    "small": TargetConfig(
        preset="small", size=TargetSize(hidden=512, depth=3), steps=3_000, rows=512, warmup=100, average=0.995
    ),
    "tiny": TargetConfig(preset="tiny", size=TargetSize(2, 16, 1), steps=4, rows=8, warmup=1, average=0.5, half=False),
}
"""``full`` is for a GPU, ``small`` is useful on one CPU core in eight minutes, ``tiny`` is for tests."""

_VALIDATION = TargetConfig(free_style=0.0, at_speed=0.0, strayed=0.0)
"""What validation draws with."""


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    config: TargetConfig | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped.

    config: in place of the preset's. Raises InputError for an unknown preset, databases that do not load, and a run
    folder of another config.
    """
    chosen = config or preset_of(PRESETS, preset)
    loaded, kept = setup.load(data)
    chosen = replace(chosen, size=replace(chosen.size, styles=len(kept["styles"])), seed=seed, **kept)
    return run(chosen, *setup.split(loaded, chosen.styles, device), run_dir, max_minutes)


def run(config: TargetConfig, data: Frames, held_out: Frames, run_dir: Path, max_minutes: float | None) -> loop.Outcome:
    """The training itself, on frames that are already on their device."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    model = TargetPose(config.size).to(device)
    generator = torch.Generator(device).manual_seed(config.seed)
    set_statistics(model, data, config, generator)
    model.half_products = config.half
    return fit(
        run_dir,
        config,
        config.steps,
        model,
        lambda step: losses(model, *draw(data, config, config.rows, generator), config, generator),
        lambda average: ratios(average, held_out, config),
        generator,
        samples_per_step=config.rows,
        max_minutes=max_minutes,
    )


def losses(
    model: TargetPose, known: TargetInput, true: Tensor, config: TargetConfig, generator: torch.Generator
) -> tuple[Tensor, dict[str, Tensor]]:
    """The loss and its terms; ``true``: the contacts of the target."""
    x, place = model(known)
    posterior = model.recognise(x, place, known)
    noise = torch.randn(posterior.mean.shape, generator=generator, device=x.device)
    made = model.decode(x, place, known, posterior.at(noise))
    nats = divergence(posterior, Normal(torch.zeros_like(posterior.mean), torch.zeros_like(posterior.mean)))
    wanted = joint_positions(known.target_hips, to_matrix(known.target_rotations))
    terms = {
        "position": F.l1_loss(joint_positions(made.hips, made.rotations), wanted),
        "rotation": F.l1_loss(to_six(made.rotations), known.target_rotations),
        "contact": F.binary_cross_entropy_with_logits(made.contacts, true),
        "nats": nats.sum(dim=-1).mean(),
    }
    total = 3.0 * terms["position"] + terms["rotation"] + 0.02 * terms["contact"] + config.divergence * terms["nats"]
    return total, {name: value.detach() for name, value in terms.items()}


def draw(
    data: Frames, config: TargetConfig, rows: int, generator: torch.Generator, given: parts.Parts | None = None
) -> tuple[TargetInput, Float[Tensor, "row 4"]]:
    """Pairs of frames with parts of the second given, and what stands in it. With ``given`` those parts in all rows."""
    device = data.hips.device

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator, device=device)

    target = torch.randint(len(data), (rows,), generator=generator, device=device)
    target = torch.maximum(target, torch.minimum(data.first[target] + 2, data.last[target]))
    frames = torch.exp(uniform(rows) * math.log(LONGEST_TARGET_FRAMES / 2.0) + math.log(2.0)).round().long()
    start = torch.maximum(target - frames, data.first[target])
    known = ((uniform(rows) < config.at_speed) & (start > data.first[start])).float()[:, None]
    velocity = (data.positions[start] - data.positions[(start - 1).clamp_min(0)]) * RATE
    label = data.style[target] * (uniform(rows) >= config.free_style)
    away = torch.randn(rows, 3, generator=generator, device=device) * (uniform(rows, 1) < config.strayed)
    joints, ground = masks(rows, generator, device) if given is None else _fixed(given, rows, device)
    known = TargetInput(
        data.hips[start] + away * torch.tensor([0.5, 0.0, 0.5], device=device),
        data.rotations[start],
        velocity * known[..., None],
        known,
        data.hips[target],
        data.rotations[target],
        joints,
        ground,
        (target - start).clamp_min(1).float()[:, None],
        F.one_hot(label, config.size.styles + 1).float(),
    )
    return known, data.contacts[target]


def masks(
    rows: int, generator: torch.Generator, device: torch.device
) -> tuple[Float[Tensor, "row joint"], Float[Tensor, "row 1"]]:
    """Given parts as users give them: a group in six rows of ten, two in three, any joints in one."""
    table = torch.zeros(len(parts.GROUPS) + 1, JOINTS + 1, device=device)
    for row, name in enumerate([*parts.GROUPS, parts.GROUND]):
        chosen = parts.parse(name)
        table[row, list(chosen.joints)] = 1.0
        table[row, JOINTS] = float(chosen.ground)
    first, second = torch.randint(len(table), (2, rows), generator=generator, device=device)
    kind = torch.rand(rows, 1, generator=generator, device=device)
    some = (torch.rand(rows, JOINTS + 1, generator=generator, device=device) < 0.15).float()
    out = torch.where(kind < 0.6, table[first], torch.maximum(table[first], table[second]))
    out = torch.where(kind < 0.9, out, torch.maximum(some, table[first] * (some.sum(dim=-1, keepdim=True) < 0.5)))
    return out[:, :JOINTS], out[:, JOINTS:]


def _fixed(given: parts.Parts, rows: int, device: torch.device) -> tuple[Tensor, Tensor]:
    joints = torch.zeros(rows, JOINTS, device=device)
    joints[:, list(given.joints)] = 1.0
    return joints, torch.full((rows, 1), float(given.ground), device=device)


@torch.no_grad()
def set_statistics(model: TargetPose, data: Frames, config: TargetConfig, generator: torch.Generator) -> None:
    """Means and deviations of the input and of what is added, into the model's buffers."""
    known, _ = draw(data, config, 8192, generator)
    x, place = model.numbers(known)
    model.mean.copy_(x.mean(dim=0))
    model.std.copy_(x.std(dim=0).clamp_min(1e-2))
    model.residual_std.copy_(residual(place, known).std(dim=0).clamp_min(1e-2))


@torch.no_grad()
def ratios(model: TargetPose, data: Frames, config: TargetConfig, rows: int = 1024) -> dict[str, float]:
    """On held-out pairs, for each group that may be given: the mean distance of the joints that are left free from the
    truth, over that of the start pose carried along."""
    model.eval()
    out = {}
    for name in [*parts.GROUPS, parts.GROUND]:
        given = parts.parse(name)
        generator = torch.Generator(data.hips.device).manual_seed(0)
        known, _ = draw(data, replace(_VALIDATION, size=config.size), rows, generator, given)
        x, place = model(known)
        likeliest = model.decode(x, place, known, x.new_zeros(rows, model.size.latent))
        carried = posed(place, known, x.new_zeros(rows, POSE))
        wanted = joint_positions(known.target_hips, to_matrix(known.target_rotations))
        free = [joint for joint in range(JOINTS) if joint not in given.joints]
        wrong = [
            (joint_positions(hips, turned) - wanted)[:, free].norm(dim=-1).mean()
            for hips, turned in (likeliest[:2], carried)
        ]
        out[f"free/{name}"] = float(wrong[0] / wrong[1])
    return out


def model_of(saved: Mapping[str, Any]) -> TargetPose:
    """The network of a checkpoint, ready to run."""
    model = TargetPose(from_plain(TargetConfig, saved["config"]).size)
    checkpoint.average_into(model, saved)
    return model
