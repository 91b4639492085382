"""The recipe of DC-MoE: ``interpose train dcmoe --data DB --plan PLANNER_RUN -o RUN``.

What trains well (docs/method.md) is the default: a residual on the planner's base, with noise on the input, then
truncated back-propagation through the model's own roll-outs, longer by stages. Preset ``paper`` is the recipe of Chu
and Yang 2024, section 5.1, as printed: absolute next pose, one step, AdamW 1e-4, batches of 32, losses of equations 3
to 6 weighted 1 and 2.5.
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from interpose.data.database import Database
from interpose.errors import InputError
from interpose.features import (
    EXPERT_INPUT,
    HISTORY,
    JOINTS,
    KEY_STEP,
    RESIDUAL_HIPS_SCALE,
    RESIDUAL_ROTATION_SCALE,
    SIDE_KEYS,
)
from interpose.models.dcmoe import PHASE_BANK_SIZE, DCMoE, State
from interpose.models.planner import Planner
from interpose.train.common import loop, setup
from interpose.train.common.config import preset_of
from interpose.train.common.frames import Frames, backwards
from interpose.train.common.gaps import Gaps, true_poses
from interpose.train.common.optimize import fit
from interpose.train.common.parallel import ALONE, Group, processes
from interpose.train.dcmoe import losses, validation
from interpose.train.dcmoe.config import PRESETS, DCMoEConfig, Stage
from interpose.train.dcmoe.sequences import Rows, base_window, control, draw, truth
from interpose.train.planner.objective import perfect_plans, plans
from interpose.train.planner.recipe import load_for


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    phases: list[Path] | None = None,
    plan: Path | None = None,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    backward: bool = False,
    compiled: bool = False,
    config: DCMoEConfig | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped; on all processes that ``torchrun`` started.

    data: prepared databases. phases: for each, the ``phases.npy`` that `interpose train pae` wrote for it, (2, frame,
    10, 3); without them phases are unknown throughout. plan: the run of `interpose train plan` whose planner the steps
    work along; without it they work along interpolation. backward: on motion that runs backwards, for stitching from
    both ends (`interpose.runtime.backends.dcmoe`). compiled: by ``torch.compile``. config: in place of the
    preset's. Raises InputError for an unknown preset, databases that do not load or are too short, phases that do not
    fit, a planner of other styles, batches that the processes cannot share, and a run folder of another config.
    """
    chosen = config or preset_of(PRESETS, preset)
    backward = backward or chosen.backward
    if phases is not None and len(phases) != len(data):
        raise InputError(f"{len(phases)} files of phases for {len(data)} databases; give one each, in the same order")
    if plan is not None and (backward or chosen.absolute):
        kind = "motion that runs backwards" if backward else "the paper's own form"
        raise InputError(f"--plan cannot be used with {kind}; leave it out")
    for missing, option in ((chosen.plan and not plan, "--plan RUN"), (chosen.phases and not phases, "--phases FILE")):
        if missing:
            raise InputError(f"the config is of a training with {option}; give {option} too")
    loaded, kept = setup.load(data)
    planner, planned = (None, None) if plan is None else load_for(plan, kept["styles"])
    chosen = replace(chosen, seed=seed, phases=phases is not None, backward=backward, plan=planned, **kept)
    for one in loaded:
        if np.diff(one.ranges).max() < HISTORY:
            raise InputError(f"{one.path}: no clip is longer than a second; prepare longer ones")
    arrays = None if phases is None else [_phases(p, d) for p, d in zip(phases, loaded, strict=True)]
    with processes(device) as group:
        training, held_out = setup.split(loaded, chosen.styles, device, arrays)
        if backward:
            training, held_out = backwards(training), backwards(held_out)
        return run(chosen, training, held_out, run_dir, max_minutes, planner, group, compiled)


def run(
    config: DCMoEConfig,
    data: Frames,
    held_out: Frames,
    run_dir: Path,
    max_minutes: float | None,
    planner: Planner | None = None,
    group: Group = ALONE,
    compiled: bool = False,
) -> loop.Outcome:
    """The training itself, on frames that are already on their device."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    model = DCMoE(config.size).to(device)
    model.half_products = config.half
    generator = torch.Generator(device).manual_seed(config.seed)
    if planner is not None and model.planner is not None:
        model.planner.load_state_dict(planner.state_dict())
        model.planner.requires_grad_(False).eval()
    set_statistics(model, data, config, generator)
    kept: dict[str, Any] = {}
    for stage in config.stages:
        group.share(stage.rows if stage.steps else 0)
    if compiled:
        model.compile()
    roll_out: nn.Module = RollOutLoss(model, data, config, group)
    if group.size > 1:
        roll_out = nn.parallel.DistributedDataParallel(roll_out)

    def loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        # The outer context, itself off, keeps the weights' half-precision copies from one frame to the next.
        with torch.autocast(device.type, torch.bfloat16, enabled=False):
            stage = _stage(config, step)
            rows = _rows(kept, model.planner, data, stage, config, generator)
            mask = target_mask(stage.rows, config, generator)
            mine = group.share(stage.rows)
            part = rows.part(mine)
            total, each = roll_out(part, mask[mine], stage.unroll)
            rows.state = State(*(group.gathered(x) for x in part.state))
            rows.gone = group.gathered(part.gone)
            _keep(kept, rows)
        return total, each

    def samples(step: int) -> int:
        stage = _stage(config, step)
        return stage.rows * stage.unroll

    return fit(
        run_dir,
        config,
        sum(stage.steps for stage in config.stages),
        model,
        loss,
        lambda average: validation.ratios(average, held_out, config.sampling.gaps.longest),
        generator,
        kept=kept,
        samples_per_step=samples,
        max_minutes=max_minutes,
        group=group,
    )


class RollOutLoss(nn.Module):
    """An update's loss in one call, so that gradients can be averaged over processes."""

    def __init__(self, model: DCMoE, data: Frames, config: DCMoEConfig, group: Group) -> None:
        super().__init__()
        self.model, self.data, self.config, self.group = model, data, config, group

    def forward(
        self, rows: Rows, mask: Float[Tensor, "row wide"], length: int
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        """:func:`unroll` by ``length`` frames."""
        return unroll(self.model, self.data, rows, length, self.config, mask, self.group)


def unroll(
    model: DCMoE,
    data: Frames,
    rows: Rows,
    length: int,
    config: DCMoEConfig,
    mask: Float[Tensor, "row wide"],
    group: Group = ALONE,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """Rolls ``rows`` on by ``length`` frames from their own states and returns the mean loss; ``rows`` is moved on, cut
    off from the graph. mask: as :func:`target_mask` gives it."""
    sums: dict[str, Tensor] = {}
    total = torch.zeros((), device=data.hips.device)
    base = base_window(data, rows, length)
    steps = rows.gone[:, None] + torch.arange(length + 1, device=data.hips.device)
    whole = (steps[:, -1] <= rows.gaps.steps).float()
    steps = torch.cat([steps, rows.gaps.steps[:, None]], dim=1)
    turned, placed = true_poses(data, rows.gaps, steps)
    made = [rows.state.positions]
    for i in range(length):
        here = rows.state.positions
        steer = control(data, rows, base[i], base[i + 1], turned[:, -1], placed[:, -1])
        after, prediction = model(rows.state, steer, mask)
        real = truth(data, rows, turned[:, i + 1], placed[:, i + 1], placed[:, i], prediction.frame, prediction.origin)
        here = (here - prediction.origin[:, None]) @ prediction.frame
        if config.absolute:
            loss, each = losses.paper(prediction, real, here, group=group)
        else:
            loss, each = losses.unrolled(prediction, real, here, config.weights, group)
        total = total + loss / length
        for name, value in each.items():
            sums[name] = sums.get(name, 0.0) + value.detach() / length
        rows.state = after
        made.append(after.positions)
        rows.gone = torch.minimum(rows.gone + 1, rows.gaps.steps)
    if not config.absolute:
        loss, each = losses.windows(torch.stack(made, dim=1), placed[:, :-1], whole, config.weights, group)
        total = total + loss
        sums |= {name: value.detach() for name, value in each.items()}
    rows.state = State(*(x.detach() for x in rows.state))
    return total, sums


def target_mask(count: int, config: DCMoEConfig, generator: torch.Generator) -> Float[Tensor, "row wide"]:
    """Hides the target position and rotation of random joints in some rows (section 5.1)."""
    device = generator.device
    hit = torch.rand(count, 1, generator=generator, device=device) < config.mask_target
    joints = (torch.rand(count, JOINTS, generator=generator, device=device) < config.mask_joint) & hit
    keep = 1.0 - joints.float()
    mask = torch.ones(count, EXPERT_INPUT.width, device=device)
    where = EXPERT_INPUT.slices()
    mask[:, where["target_position"]] = keep.repeat_interleave(3, dim=1)
    mask[:, where["target_rotation"]] = keep.repeat_interleave(6, dim=1)
    mask[:, where["speed_needed"]] = keep.repeat_interleave(3, dim=1)
    return mask


@torch.no_grad()
def set_statistics(
    model: DCMoE, data: Frames, config: DCMoEConfig, generator: torch.Generator, count: int = 8192
) -> None:
    """Means and deviations of features and outputs over a sample of rows, into the model's buffers."""
    rows = draw(data, count, len(config.styles), config.sampling, generator)
    if config.plan is not None:  # features are as large as they will be along a planner
        rows.plan = perfect_plans(data, rows.gaps)
    base = base_window(data, rows, 1)
    steps = torch.stack([rows.gone, rows.gone + 1, rows.gaps.steps], dim=1)
    turned, placed = true_poses(data, rows.gaps, steps)
    steer = control(data, rows, base[0], base[1], turned[:, 2], placed[:, 2])
    x, _, frame, origin = model.features(rows.state, steer)
    model.mean.copy_(x.mean(dim=0))
    deviation = x.std(dim=0)
    model.std.copy_(torch.where(deviation < 1e-4, 1.0, deviation.clamp_min(1e-2)))
    real = truth(data, rows, turned[:, 1], placed[:, 1], placed[:, 0], frame, origin)
    where = model.layout.slices()
    measured = {
        "velocity": real.velocities,
        "trajectory": real.trajectory,
        "phase": real.phases,
        "position": real.positions,
        "rotation": real.rotations,
    }
    for name, block in where.items():
        if not config.absolute and name in ("hips", "rotation"):
            model.out_std[block] = RESIDUAL_HIPS_SCALE if name == "hips" else RESIDUAL_ROTATION_SCALE
        elif name in measured:
            flat = measured[name].flatten(1)
            model.out_mean[block] = flat.mean(dim=0)
            model.out_std[block] = flat.std(dim=0).clamp_min(1e-2)
    centre = data.first + KEY_STEP * SIDE_KEYS
    able = torch.nonzero((torch.arange(len(data), device=centre.device) >= centre) & (data.last >= centre))[:, 0]
    chosen = able[torch.randint(len(able), (PHASE_BANK_SIZE, 1), generator=generator, device=able.device)]
    keys = KEY_STEP * torch.arange(-SIDE_KEYS, SIDE_KEYS + 1, device=able.device)
    model.phase_bank.copy_(data.phases[torch.minimum(chosen + keys, data.last[chosen])][..., :2])


def _stage(config: DCMoEConfig, step: int) -> Stage:
    for stage in config.stages:
        if step < stage.steps:
            return stage
        step -= stage.steps
    return config.stages[-1]


def _fresh(planner: Planner | None, data: Frames, count: int, config: DCMoEConfig, generator: torch.Generator) -> Rows:
    """Fresh rows, with their plans."""
    rows = draw(data, count, len(config.styles), config.sampling, generator)
    if planner is not None:
        rows.plan, _ = plans(planner, data, rows.gaps, config.posterior, generator)
    return rows


def _rows(
    extra: dict, planner: Planner | None, data: Frames, stage: Stage, config: DCMoEConfig, generator: torch.Generator
) -> Rows:
    """The roll-outs of this update: those that go on, and fresh ones in place of those that ended and some others."""
    device = data.hips.device
    kept: dict | None = extra.get("rows")
    if kept is None or len(kept["gone"]) != stage.rows or stage.unroll == 1:
        return _fresh(planner, data, stage.rows, config, generator)
    kept = {name: value.to(device) for name, value in kept.items()}
    gaps = Gaps(**{f.name: kept[f.name] for f in fields(Gaps)})
    rows = Rows(gaps, kept["gone"], State(*(kept[name] for name in State._fields)), kept.get("plan"))
    ended = gaps.steps - rows.gone <= 1
    drawn = torch.rand(stage.rows, generator=generator, device=device)
    wanted = max(int(ended.sum()), round(config.fresh * stage.rows))
    where = torch.argsort(drawn - ended.float())[:wanted]
    return rows.replaced(where, _fresh(planner, data, wanted, config, generator))


def _keep(extra: dict, rows: Rows) -> None:
    gaps = {f.name: getattr(rows.gaps, f.name) for f in fields(Gaps)}
    plan = {} if rows.plan is None else {"plan": rows.plan}
    extra["rows"] = gaps | {"gone": rows.gone} | plan | rows.state._asdict()


def _phases(path: Path, data: Database) -> Float[np.ndarray, "2 frame 10 3"]:
    try:
        phases = np.load(path, mmap_mode="r")
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no phases there ({error}); make them with 'interpose train pae'") from None
    if phases.shape != (2, data.frames, 10, 3):
        raise InputError(f"{path}: phases of shape {phases.shape}, the database needs {(2, data.frames, 10, 3)}")
    return phases
