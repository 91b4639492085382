"""The recipe of S-CVAE: ``interpose train stitch --data DB --plan PLANNER_RUN -o RUN``.

Two parts, one after the other: the local phases' networks, then the two generators, on their own stitched roll-outs of
growing length, along plans of the posterior, of the prior's mean and of its samples. Preset ``paper`` is the recipe of
Ren et al. 2024 as printed: no plan, one latent a frame from an encoder that never sees the truth, no base.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor

from interpose.errors import InputError
from interpose.models.discriminator import Discriminators
from interpose.models.planner import Planner
from interpose.models.stitching_cvae import StitchingCVAE
from interpose.train.common import checkpoint, loop, setup
from interpose.train.common.config import from_plain, preset_of
from interpose.train.common.frames import Frames
from interpose.train.common.optimize import descend, scalars
from interpose.train.planner.recipe import load_for
from interpose.train.stitch.config import PRESETS, StitchConfig, ablations
from interpose.train.stitch.objectives import phase_loss, stitch_loss
from interpose.train.stitch.phase_targets import phase_targets
from interpose.train.stitch.transitions import ratios, set_statistics


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    plan: Path | None = None,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    without: str | None = None,
    config: StitchConfig | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped.

    data: prepared databases. plan: the run of `interpose train plan` whose planner the generators work along. without:
    a row of table 6, as :func:`ablations` names it. config: in place of the preset's. Raises InputError for an unknown
    preset or ablation, databases that do not load or are too short, no planner where one is needed, one of other styles
    or none where none is used, and a run folder of another config.
    """
    chosen = config or preset_of(PRESETS, preset)
    if without is not None:
        rows = ablations(chosen)
        if without not in rows:
            raise InputError(f"no ablation {without!r}; there are {', '.join(rows)}")
        chosen = rows[without]
    if chosen.needs_plan and plan is None:
        raise InputError("the generators work along a planner; give --plan RUN, a run of 'interpose train plan'")
    if not chosen.needs_plan and plan is not None:
        raise InputError(f"preset {chosen.preset!r} uses no planner; leave out --plan")
    loaded, kept = setup.load(data)
    planner, planned = (None, None) if plan is None else load_for(plan, kept["styles"])
    size = replace(chosen.size, styles=len(kept["styles"]), plan=None if planned is None else planned.size)
    if planned is not None and size.latents == "gap":
        size = replace(size, latent=planned.size.latent)
    chosen = replace(chosen, size=size, seed=seed, plan=planned, **kept)
    training, held_out = setup.split(loaded, chosen.styles, device)
    for frames, what in ((training, "training"), (held_out, "validation")):
        if int((frames.last - frames.first).max()) < chosen.longest - 1:
            raise InputError(f"{data[0]}: no clip has {chosen.longest} frames for {what}; prepare longer ones")
    return run(chosen, training, held_out, run_dir, max_minutes, planner)


def run(
    config: StitchConfig,
    data: Frames,
    held_out: Frames,
    run_dir: Path,
    max_minutes: float | None,
    planner: Planner | None = None,
) -> loop.Outcome:
    """The training itself, on frames that are already on their device."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    model = StitchingCVAE(config.size).to(device)
    model.halve(config.half)
    if planner is not None and model.plan is not None:
        model.plan.load_state_dict(planner.state_dict())
        model.plan.requires_grad_(False).eval()
    generator = torch.Generator(device).manual_seed(config.seed)
    set_statistics(model, data, config, generator)
    critics = Discriminators().to(device)
    phases = phase_targets(data)
    settings = {"lr": 1e-3, "betas": config.betas, "weight_decay": config.weight_decay}
    optimizer = torch.optim.AdamW([p for p in model.parameters() if p.requires_grad], **settings)
    against = torch.optim.AdamW(critics.parameters(), **settings)
    average = loop.moving_average(model, config.average)
    parts = {"model": model, "optimizer": optimizer, "ema": average, "critics": critics, "against": against}
    state = checkpoint.TrainingState(parts, {"rows": generator})
    before = config.phases.steps

    def update(step: int) -> Mapping[str, Tensor | float]:
        first = step < before
        part, step = (config.phases, step) if first else (config.stitch, step - before)
        factor = loop.cosine(step, part.steps, config.warmup, floor=0.01) if config.warmup else 1.0
        loop.set_learning_rate(optimizer, part.learning_rate * factor)
        # The outer context, itself off, keeps the weights' half-precision copies from one frame to the next.
        with torch.autocast(device.type, torch.bfloat16, enabled=False):
            if first:
                total, each = phase_loss(model, data, phases, part.rows, generator)
            else:
                loop.set_learning_rate(against, 0.1 * part.learning_rate * factor)
                total, each = stitch_loss(model, critics, against, data, config, step / part.steps, generator)
        descend(total, (model.front, model.back), optimizer, average, model, config.clip)
        out = scalars(total, each)
        if not first and (step + 1 == part.steps or (step + 1) % 200 == 0):
            out |= ratios(cast(StitchingCVAE, average.module), held_out, config)
        return out

    return loop.run(
        run_dir,
        config,
        state,
        before + config.stitch.steps,
        update,
        samples_per_step=lambda step: config.phases.rows if step < before else config.stitch.rows,
        checkpoint_every=200,
        max_minutes=max_minutes,
    )


def model_of(saved: Mapping[str, Any]) -> StitchingCVAE:
    """The networks of a checkpoint, ready to run: the moving average of their weights.

    Raises InputError where the weights do not fit the config, as those of an older program may not.
    """
    model = StitchingCVAE(from_plain(StitchConfig, saved["config"]).size)
    checkpoint.average_into(model, saved)
    return model
