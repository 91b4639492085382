"""The recipe of S-CVAE: ``interpose train stitch --data DB -o RUN``.

Three parts, one after the other: the local phases' network, the plan of a gap (a conditional variational autoencoder
over whole gaps, which needs no roll-out and sees thousands of them a second), and the two generators, on their own
stitched roll-outs of growing length, along plans of the posterior, of the prior's mean and of its samples. Preset
``paper`` is the recipe of Ren et al. 2024 as printed: no plan, one latent a frame from an encoder that never sees the
truth, no base. The run folder is that of `interpose.train.common.loop`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor

from interpose.data import database
from interpose.errors import InputError
from interpose.models.discriminator import Discriminators
from interpose.models.stitching_cvae import StitchingCVAE
from interpose.train.common import checkpoint, loop
from interpose.train.common.frames import Frames, divided, origin
from interpose.train.stitch.config import PRESETS, Config, ablations, size_of
from interpose.train.stitch.objectives import phase_loss, plan_loss, stitch_loss
from interpose.train.stitch.phase_targets import phase_targets
from interpose.train.stitch.transitions import ratios, set_statistics


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    without: str | None = None,
    plan_from: Path | None = None,
    config: Config | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped.

    data: prepared databases. without: a row of table 6, as :func:`ablations` names it. plan_from: a finished run whose
    phases and plan are taken, so that the generators alone are trained. config: in place of the preset's.
    Raises InputError for an unknown preset or ablation, databases that do not load or are too short, a run without the
    plan that is asked for, and a run folder of another config.
    """
    if preset not in PRESETS:
        raise InputError(f"no preset {preset!r}; there are {', '.join(PRESETS)}")
    chosen = config or PRESETS[preset]
    if without is not None:
        rows = ablations(chosen)
        if without not in rows:
            raise InputError(f"no ablation {without!r}; there are {', '.join(rows)}")
        chosen = rows[without]
    loaded = [database.load(path) for path in data]
    styles = tuple(sorted({s for d in loaded for s in d.styles}))
    plan = replace(chosen.size.plan, styles=len(styles))
    taken = None
    if plan_from is not None:
        taken = _taken(plan_from)
        chosen = replace(chosen, phases=replace(chosen.phases, steps=0), plan=replace(chosen.plan, steps=0))
    chosen = replace(
        chosen,
        size=replace(chosen.size, plan=plan),
        seed=seed,
        styles=styles,
        **origin(loaded),
        plan_from="" if plan_from is None else plan_from.name,
    )
    training, held_out = divided(loaded, list(styles))
    for frames, what in ((training, "training"), (held_out, "validation")):
        if int((frames.last - frames.first).max()) < chosen.longest - 1:
            raise InputError(f"{data[0]}: no clip has {chosen.longest} frames for {what}; prepare longer ones")
    return run(chosen, training.to(device), held_out.to(device), run_dir, max_minutes, taken)


def _taken(run_dir: Path) -> dict[str, Tensor]:
    """The weights of phases and plan in another run."""
    saved = checkpoint.load(run_dir)
    if saved is None or "ema" not in saved:
        raise InputError(f"{run_dir}: no finished run of 'interpose train stitch' is there")
    weights = {k.removeprefix("module."): v for k, v in saved["ema"].items() if k.startswith("module.")}
    return {
        k: v for k, v in weights.items() if k.startswith("plan.") or ".phases." in k or k.endswith(("_mean", "_std"))
    }


def run(
    config: Config,
    data: Frames,
    held_out: Frames,
    run_dir: Path,
    max_minutes: float | None,
    taken: dict[str, Tensor] | None = None,
) -> loop.Outcome:
    """The training itself, on frames that are already on their device."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    model = StitchingCVAE(config.size).to(device)
    model.halve(config.half)
    generator = torch.Generator(device).manual_seed(config.seed)
    set_statistics(model, data, config, generator)
    if taken is not None:
        own = model.state_dict()
        odd = [name for name, value in taken.items() if name not in own or own[name].shape != value.shape]
        if odd or not taken:
            what = odd[0] if odd else "it has none"
            raise InputError(f"the plan to start from does not fit this one ({what}); give a run of the same size")
        model.load_state_dict(taken, strict=False)
    critics = Discriminators().to(device)
    phases = phase_targets(data)
    groups = {"lr": 1e-3, "betas": config.betas, "weight_decay": config.weight_decay}
    optimizer = torch.optim.AdamW(model.parameters(), **groups)
    against = torch.optim.AdamW(critics.parameters(), **groups)
    average = loop.moving_average(model, config.average)
    parts = {"model": model, "optimizer": optimizer, "ema": average, "critics": critics, "against": against}
    state = checkpoint.State(parts, {"rows": generator})
    order = [config.phases, config.plan, config.stitch]

    def update(step: int) -> Mapping[str, Tensor | float]:
        number = 0
        while step >= order[number].steps:
            step -= order[number].steps
            number += 1
        part = order[number]
        factor = loop.cosine(step, part.steps, config.warmup, floor=0.01) if config.warmup else 1.0
        loop.set_learning_rate(optimizer, part.learning_rate * factor)
        # The outer context, itself off, keeps the weights' half-precision copies from one frame to the next.
        with torch.autocast(device.type, torch.bfloat16, enabled=False):
            if number == 0:
                total, each = phase_loss(model, data, phases, part.rows, generator)
            elif number == 1:
                total, each = plan_loss(model, data, config, part.rows, generator)
            else:
                loop.set_learning_rate(against, 0.1 * part.learning_rate * factor)
                total, each = stitch_loss(model, critics, against, data, config, step / part.steps, generator)
        optimizer.zero_grad(set_to_none=True)
        total.backward()
        for module in model.children():
            torch.nn.utils.clip_grad_norm_(module.parameters(), config.clip)
        optimizer.step()
        average.update_parameters(model)
        scalars: dict[str, Tensor | float] = {"loss": total.detach(), **{k: v.detach() for k, v in each.items()}}
        last = step + 1 == part.steps
        if number == 2 and (last or (step + 1) % 200 == 0):
            scalars |= ratios(cast(StitchingCVAE, average.module), held_out, config)
        return scalars

    steps = sum(part.steps for part in order)
    rows = round(sum(part.steps * part.rows for part in order) / steps)
    return loop.run(
        run_dir, config, state, steps, update, samples_per_step=rows, checkpoint_every=200, max_minutes=max_minutes
    )


def model_of(saved: Mapping[str, Any]) -> StitchingCVAE:
    """The networks of a checkpoint, ready to run: the moving average of their weights.

    Raises InputError where the weights do not fit the config, as those of an older program may not.
    """
    model = StitchingCVAE(size_of(saved["config"]["size"]))
    checkpoint.average_into(model, saved)
    return model
