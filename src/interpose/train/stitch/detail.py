"""The recipe of the detail transformer: ``interpose train detail --data DB --refines STITCH_RUN -o RUN``.

The stitching model of another run, which stays as it is, makes rough transitions of the training gaps: the likeliest
ones, and some along plans of the posterior; the transformer learns to bring them nearer to the truth. The run folder is
that of `interpose.train.common.loop`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from interpose.data.contacts import CONTACT_INDICES
from interpose.errors import InputError
from interpose.models.detail_transformer import DetailSize, DetailTransformer, refined_loss
from interpose.models.geometry import joint_positions, to_matrix
from interpose.models.stitching_cvae import StitchingCVAE
from interpose.train.common import checkpoint, loop, setup
from interpose.train.common.config import TrainingConfig, from_plain, preset_of
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Gaps, draw, evenly
from interpose.train.common.optimize import fit
from interpose.train.stitch import recipe
from interpose.train.stitch.config import StitchConfig
from interpose.train.stitch.rollout import Stitched
from interpose.train.stitch.rollout import joined as joined_chains
from interpose.train.stitch.transitions import VALIDATION_LENGTHS, made_gaps


@dataclass(frozen=True)
class DetailConfig(TrainingConfig):
    """Everything that decides a training of the detail transformer."""

    size: DetailSize = field(default_factory=DetailSize)
    steps: int = 30_000
    rows: int = 256
    learning_rate: float = 2.8e-4
    weight_decay: float = 1e-2
    posterior: float = 0.5
    """of the rows, how many follow a plan of the posterior; the rest follow the prior's mean"""
    refines: str = ""
    stitch: dict[str, Any] = field(default_factory=dict)
    """the config of the stitching model"""


PRESETS: dict[str, DetailConfig] = {
    "full": DetailConfig(),
    "small": DetailConfig(
        preset="small", size=DetailSize(192, 4, 6), steps=1_200, rows=96, learning_rate=1e-3, warmup=100, average=0.995
    ),
    "tiny": DetailConfig(preset="tiny", size=DetailSize(16, 1, 2), steps=4, rows=8, warmup=1, average=0.5, half=False),
}
"""``full`` has the paper's size, ``small`` is useful on one CPU core in ten minutes, ``tiny`` is for tests."""


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    refines: Path | None = None,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    config: DetailConfig | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped.

    refines: the run of the stitching model. config: in place of the preset's. Raises InputError for an unknown preset,
    databases that do not load, no run to refine or one of other styles, and a run folder of another config.
    """
    chosen = config or preset_of(PRESETS, preset)
    saved = None if refines is None else checkpoint.load(refines)
    if refines is None or saved is None or "stitch" not in saved["config"] or "steps" in saved["config"]:
        raise InputError(f"{refines or '--refines'}: give a finished run of 'interpose train stitch' to refine")
    rough = recipe.model_of(saved).to(device)
    if rough.size.form == "paper":
        raise InputError(f"{refines}: the paper's own form is not refined; give a run of another preset")
    loaded, kept = setup.load(data)
    kept["styles"] = tuple(saved["config"]["styles"])
    chosen = replace(chosen, seed=seed, refines=refines.name, stitch=saved["config"], **kept)
    return run(chosen, rough, *setup.split(loaded, chosen.styles, device), run_dir, max_minutes)


def run(
    config: DetailConfig, rough: StitchingCVAE, data: Frames, held_out: Frames, run_dir: Path, max_minutes: float | None
) -> loop.Outcome:
    """The training itself, on frames that are already on their device."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    stitch = from_plain(StitchConfig, config.stitch)
    stitch = replace(stitch, posterior=config.posterior, likeliest=1.0 - config.posterior)
    rough.halve(config.half)
    model = DetailTransformer(config.size).to(device)
    model.half_products = config.half
    generator = torch.Generator(device).manual_seed(config.seed)
    set_statistics(model, rough, data, stitch, generator)

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        steps = int(torch.randint(stitch.shortest - 1, stitch.longest, (1,), generator=generator, device=device))
        with torch.autocast(device.type, torch.bfloat16, enabled=False):
            made, true = transitions(rough, data, stitch, steps, config.rows, generator)
            return refined_loss(model(*made), true, CONTACT_INDICES)

    return fit(
        run_dir,
        config,
        config.steps,
        model,
        loss,
        lambda average: ratios(average, rough, held_out, stitch),
        generator,
        samples_per_step=config.rows,
        validate_every=200,
        max_minutes=max_minutes,
    )


Transition = tuple[Tensor, Tensor, Tensor]


@torch.no_grad()
def transitions(
    rough: StitchingCVAE,
    data: Frames,
    stitch: StitchConfig,
    steps: int,
    rows: int,
    generator: torch.Generator,
    fixed: Gaps | None = None,
) -> tuple[Transition, Transition]:
    """Rough transitions with both keys (hips, rotations, contacts), and the truth (rotations, positions, contacts).

    With ``fixed`` gaps they are the likeliest ones of those.
    """
    drawn = fixed or draw(data, rows, rough.size.styles, stitch.sampling, generator, steps=steps)
    known = None if fixed is not None else torch.ones(rows, device=data.hips.device)
    made, true, _ = made_gaps(rough, data, drawn, stitch, generator, known)
    hips, rotations, contacts = whole(made, stitch, steps)
    hips = torch.cat([true.hips[:, :1], hips, true.hips[:, -1:]], dim=1)
    rotations = torch.cat([true.rotations[:, :1], rotations, true.rotations[:, -1:]], dim=1)
    contacts = torch.cat([contacts[:, :1], contacts, contacts[:, -1:]], dim=1)
    return (hips, rotations, contacts), (true.rotations, true.positions, true.contacts)


def whole(made: Stitched, stitch: StitchConfig, steps: int) -> Transition:
    """Both chains as one, as the run time joins them: hips, 6-D and contact probabilities of the frames between."""
    front, back = made.front, made.back

    def both(name: str) -> Tensor:
        values = [None if chain is None else getattr(chain, name) for chain in (front, back)]
        if name == "contacts":
            values = [None if value is None else value.sigmoid() for value in values]
        assert values[0] is not None
        return joined_chains(values[0], values[1], steps, stitch.chains)

    return both("hips"), both("rotations"), both("contacts")


@torch.no_grad()
def set_statistics(
    model: DetailTransformer,
    rough: StitchingCVAE,
    data: Frames,
    stitch: StitchConfig,
    generator: torch.Generator,
) -> None:
    """Means and deviations of the tokens, into the model's buffers."""
    seen = []
    for steps in {stitch.shortest, (stitch.shortest + stitch.longest) // 2, stitch.longest - 1}:
        made, _ = transitions(rough, data, stitch, steps, 64, generator)
        seen.append(model.tokens(*made)[0].flatten(0, 1))
    joined_ = torch.cat(seen)
    model.mean.copy_(joined_.mean(dim=0))
    model.std.copy_(joined_.std(dim=0).clamp_min(1e-2))


@torch.no_grad()
def ratios(
    model: DetailTransformer, rough: StitchingCVAE, data: Frames, stitch: StitchConfig, count: int = 128
) -> dict[str, float]:
    """Mean joint position error of the refined likeliest transitions on held-out gaps over that of the rough ones."""
    out = {}
    for frames in VALIDATION_LENGTHS:
        if frames > stitch.longest:
            continue
        steps = frames - 1
        fixed = evenly(data, steps, count, rough.size.styles)
        generator = torch.Generator(data.hips.device).manual_seed(0)
        made, (_, placed, _) = transitions(rough, data, stitch, steps, count, generator, fixed)
        refined = model(*made)
        wrong = [(_placed(*m[:2]) - placed).norm(dim=-1).mean() for m in (refined, made)]
        out[f"refined/{frames}"] = float(wrong[0] / wrong[1])
    return out


def _placed(hips: Tensor, rotations: Tensor) -> Tensor:
    """Joint positions of whole motions."""
    flat = joint_positions(hips.flatten(0, 1), to_matrix(rotations).flatten(0, 1))
    return flat.unflatten(0, hips.shape[:2])
