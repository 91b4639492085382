"""The recipe of the planner: ``interpose train plan --data DB -o RUN``; both methods then train along it.

A conditional variational autoencoder over whole gaps needs no roll-out, so it sees thousands of gaps a second.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from interpose.errors import InputError
from interpose.models.planner import Planner
from interpose.train.common import checkpoint, loop, setup
from interpose.train.common.config import from_plain, preset_of
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Gaps, draw
from interpose.train.common.optimize import fit
from interpose.train.common.parallel import ALONE, Group, processes
from interpose.train.planner import objective
from interpose.train.planner.config import PRESETS, PlannerConfig


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    config: PlannerConfig | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped; on all processes that ``torchrun`` started.

    data: prepared databases. config: in place of the preset's. Raises InputError for an unknown preset, databases that
    do not load, batches that the processes cannot share, and a run folder of another config.
    """
    chosen = config or preset_of(PRESETS, preset)
    loaded, kept = setup.load(data)
    chosen = replace(chosen, size=replace(chosen.size, styles=len(kept["styles"])), seed=seed, **kept)
    with processes(device) as group:
        return run(chosen, *setup.split(loaded, chosen.styles, device), run_dir, max_minutes, group)


def run(
    config: PlannerConfig,
    data: Frames,
    held_out: Frames,
    run_dir: Path,
    max_minutes: float | None,
    group: Group = ALONE,
) -> loop.Outcome:
    """The training itself, on frames that are already on their device."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    planner = Planner(config.size).to(device)
    planner.half_products = config.half
    generator = torch.Generator(device).manual_seed(config.seed)
    objective.set_statistics(planner, data, config.sampling, generator)
    mine = group.share(config.rows)
    objective_of: nn.Module = Loss(planner, data, config)
    if group.size > 1:
        objective_of = nn.parallel.DistributedDataParallel(objective_of)

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        if not group.first:  # dropout differs from process to process, after a resume as before
            torch.manual_seed(hash((config.seed, step, group.rank)))
        gaps = draw(data, config.rows, len(config.styles), config.sampling, generator)
        noise = torch.randn(config.rows, config.size.latent, generator=generator, device=device)
        return objective_of(gaps.part(mine), noise[mine])

    return fit(
        run_dir,
        config,
        config.steps,
        planner,
        loss,
        lambda average: objective.ratios(average, held_out),
        generator,
        samples_per_step=config.rows,
        max_minutes=max_minutes,
        group=group,
    )


class Loss(nn.Module):
    """The loss in one call, so that gradients can be averaged over processes."""

    def __init__(self, planner: Planner, data: Frames, config: PlannerConfig) -> None:
        super().__init__()
        self.planner, self.data, self.config = planner, data, config

    def forward(self, gaps: Gaps, noise: Tensor) -> tuple[Tensor, dict[str, Tensor]]:
        return objective.loss(self.planner, self.data, gaps, noise, self.config)


def load_for(run_dir: Path, styles: tuple[str, ...]) -> tuple[Planner, PlannerConfig]:
    """The planner of a run for a training with those styles, and the config that it was trained by.

    Raises InputError where there is no such run, where its weights do not fit its config, and for other styles.
    """
    saved = checkpoint.load(run_dir)
    if saved is None or "displacement" not in saved["config"]:
        raise InputError(f"{run_dir}: no run of 'interpose train plan' is there")
    config = from_plain(PlannerConfig, saved["config"])
    if config.styles != styles:
        raise InputError(
            f"{run_dir}: the planner's styles are {', '.join(config.styles) or 'none'}, the data's "
            f"{', '.join(styles) or 'none'}; train both on the same databases"
        )
    return model_of(saved), config


def model_of(saved: Mapping[str, Any]) -> Planner:
    """The planner of a checkpoint: the moving average of its weights, frozen."""
    planner = Planner(from_plain(PlannerConfig, saved["config"]).size)
    checkpoint.average_into(planner, saved)
    return planner.requires_grad_(False)
