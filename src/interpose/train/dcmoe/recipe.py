"""The recipe of DC-MoE: ``interpose train dcmoe --data DB -o RUN``.

What trains well (docs/method.md, D1 to D10, D26) is the default: a planner of whole gaps first, then the residual on
what it foresees, one-step training with noise on the input, then truncated back-propagation through the model's own
roll-outs, longer by stages. What each of these is worth is in docs/dcmoe-ablations.md. Preset ``paper`` is the recipe
of Chu and Yang 2024, section 5.1, as printed: absolute next pose, one step, AdamW 1e-4, batches of 32, losses of
equations 3 to 6 weighted 1 and 2.5. The run folder is that of `interpose.train.common.loop`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import cast

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from interpose.data import database
from interpose.data.database import Database
from interpose.errors import InputError
from interpose.features import EXPERT_INPUT, HISTORY, JOINTS, KEY_STEP, SIDE_KEYS
from interpose.models.dcmoe import BANK, HIPS_SCALE, ROTATION_SCALE, DCMoE, State
from interpose.models.planner import GapPlan
from interpose.train.common import checkpoint, loop
from interpose.train.common.frames import Frames, backwards, divided, origin
from interpose.train.common.parallel import ALONE, Group, processes
from interpose.train.dcmoe import losses, validation
from interpose.train.dcmoe.config import PRESETS, Config, Stage, size_of
from interpose.train.dcmoe.sequences import (
    PLAIN,
    Keys,
    Rows,
    base_window,
    control,
    draw,
    poses,
    replace_rows,
    truth,
)
from interpose.train.planner import objective as planning


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    phases: list[Path] | None = None,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    stages: tuple[Stage, ...] | None = None,
    foreign_keys: float | None = None,
    backward: bool = False,
    plan_from: Path | None = None,
    plan_steps: int | None = None,
    compiled: bool = False,
    config: Config | None = None,
) -> loop.Outcome:
    """Trains, or goes on where ``run_dir`` stopped; on all processes that ``torchrun`` started.

    data: prepared databases. phases: for each, the ``phases.npy`` that `interpose train pae` wrote for it, (2, frame,
    10, 3); without them phases are unknown throughout. foreign_keys: share of the rows whose keys get somebody else's
    upper body, which makes the style label matter (`interpose.train.dcmoe.sequences.poses`). backward: on motion that
    runs backwards, for stitching from both ends (`interpose.runtime.backends.dcmoe_both_ends`). plan_from: another run,
    of dcmoe or stitch, whose planner is taken. plan_steps: updates of the planner, by default the preset's, or none
    where it is taken. compiled: by ``torch.compile``. config: in place of the preset's. Raises InputError for an
    unknown preset, databases that do not load or are too short, phases that do not fit, a share that is none, a run
    without the planner that is asked for, batches that the processes cannot share, and a run folder of another config.
    """
    if preset not in PRESETS:
        raise InputError(f"no preset {preset!r}; there are {', '.join(PRESETS)}")
    if phases is not None and len(phases) != len(data):
        raise InputError(f"{len(phases)} files of phases for {len(data)} databases; give one each, in the same order")
    if foreign_keys is not None and not 0.0 <= foreign_keys <= 1.0:
        raise InputError(f"the share of foreign keys must be 0 to 1, got {foreign_keys}")
    loaded = [database.load(path) for path in data]
    chosen = config or PRESETS[preset]
    styles = tuple(sorted({s for d in loaded for s in d.styles}))
    if backward:
        chosen = replace(chosen, planner=None)  # two chains that meet cannot share a plan of one of them
    if chosen.planner is None and (plan_from is not None or plan_steps is not None):
        kind = "a training on motion that runs backwards" if backward else f"preset {chosen.preset!r}"
        raise InputError(f"{kind} has no planner; leave out what is asked of one")
    if plan_steps is not None and plan_steps < 0:
        raise InputError(f"the planner's updates must be 0 or more, got {plan_steps}")
    taken = None
    if plan_from is not None:
        taken = _taken(plan_from)
        plan_steps = plan_steps or 0
        chosen = replace(chosen, plan_from=plan_from.name)
    if plan_steps is not None:
        chosen = replace(chosen, planning=replace(chosen.planning, steps=plan_steps))
    if chosen.planner is not None:
        chosen = replace(chosen, planner=replace(chosen.planner, styles=len(styles)))
    if foreign_keys is not None:
        chosen = replace(chosen, sampling=replace(chosen.sampling, foreign_keys=foreign_keys))
    config = replace(
        chosen,
        seed=seed,
        stages=stages or chosen.stages,
        **origin(loaded),
        styles=styles,
        phases=phases is not None,
        backward=backward,
    )
    for of in loaded:
        if np.diff(of.ranges).max() < HISTORY:
            raise InputError(f"{of.path}: no clip is longer than a second; prepare longer ones")
    arrays = None if phases is None else [_phases(p, d) for p, d in zip(phases, loaded, strict=True)]
    training, held_out = divided(loaded, list(config.styles), arrays)
    if backward:
        training, held_out = backwards(training), backwards(held_out)
    with processes(device) as group:
        return run(config, training.to(device), held_out.to(device), run_dir, max_minutes, taken, group, compiled)


def _taken(run_dir: Path) -> dict[str, Tensor]:
    """The weights of another run's planner."""
    saved = checkpoint.load(run_dir)
    weights: dict[str, Tensor] = {} if saved is None else saved.get("ema", {})
    for place in ("module.planner.", "module.plan."):
        found = {k.removeprefix(place): v for k, v in weights.items() if k.startswith(place)}
        if found:
            return found
    raise InputError(f"{run_dir}: no run of 'interpose train dcmoe' or 'stitch' with a planner is there")


def run(
    config: Config,
    data: Frames,
    held_out: Frames,
    run_dir: Path,
    max_minutes: float | None,
    taken: Mapping[str, Tensor] | None = None,
    group: Group = ALONE,
    compiled: bool = False,
) -> loop.Outcome:
    """The training itself, on frames that are already on their device. taken: a planner's weights to start from."""
    device = data.hips.device
    torch.manual_seed(config.seed)
    model = DCMoE(size_of(asdict(config))).to(device)
    model.half_products = config.half
    generator = torch.Generator(device).manual_seed(config.seed)
    foreseeing = 0
    if model.planner is not None:
        foreseeing = config.planning.steps
        model.planner.half_products = config.half
        planning.set_statistics(model.planner, data, config.sampling, generator)
        if taken is not None:
            _take(model.planner, taken)
    set_statistics(model, data, config, generator)
    optimizer = torch.optim.AdamW(model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    average = loop.moving_average(model, config.average)
    state = checkpoint.State({"model": model, "optimizer": optimizer, "ema": average}, {"rows": generator})
    walking = sum(stage.steps for stage in config.stages)
    planned = Stage(foreseeing, 0, config.planning.rows)
    for stage in (planned, *config.stages):
        group.share(stage.rows if stage.steps else 0)
    if compiled:
        model.compile()
    objective: nn.Module = Objective(model, data, config, group)
    if group.size > 1:
        objective = nn.parallel.DistributedDataParallel(objective, find_unused_parameters=True)

    def update(step: int) -> Mapping[str, Tensor | float]:
        first = step < foreseeing
        at, of, rate = step, foreseeing, config.planning.learning_rate
        if not first:
            at, of, rate = step - foreseeing, walking, config.learning_rate
        factor = loop.cosine(at, of, config.warmup, floor=0.01) if config.warmup else 1.0
        loop.set_learning_rate(optimizer, rate * factor)
        if not group.first:  # what dropout hides is each process's own, after a resume as before
            torch.manual_seed(hash((config.seed, step, group.rank)))
        # The outer context, itself off, keeps the weights' half-precision copies from one frame to the next.
        with torch.autocast(device.type, torch.bfloat16, enabled=False):
            if first:
                rows = draw(data, planned.rows, len(config.styles), config.sampling, generator)
                drawn = _noise(config, generator)
                mine = group.share(planned.rows)
                total, each = objective(rows.part(mine), drawn[mine], 0)
            else:
                stage = _stage(config, at)
                rows = _rows(state.extra, cast(DCMoE, average.module).planner, data, stage, config, generator)
                drawn = target_mask(stage.rows, config, generator)
                mine = group.share(stage.rows)
                part = rows.part(mine)
                total, each = objective(part, drawn[mine], stage.unroll)
                rows.state = State(*(group.gathered(x) for x in part.state))
                rows.gone = group.gathered(part.gone)
                _keep(state.extra, rows)
        optimizer.zero_grad(set_to_none=True)
        total.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), config.clip)
        optimizer.step()
        average.update_parameters(model)
        scalars: dict[str, Tensor | float] = {"loss": total.detach(), **{k: v.detach() for k, v in each.items()}}
        if (at + 1) % 1000 == 0:
            scalars |= validation.ratios(cast(DCMoE, average.module), held_out, config.sampling, plan_alone=first)
        return scalars

    def samples(step: int) -> int:
        stage = planned if step < foreseeing else _stage(config, step - foreseeing)
        return stage.rows * max(stage.unroll, 1)

    return loop.run(
        run_dir,
        config,
        state,
        foreseeing + walking,
        update,
        samples_per_step=samples,
        checkpoint_every=500,
        max_minutes=max_minutes,
        group=group,
    )


class Objective(nn.Module):
    """An update's loss in one call, so that gradients can be averaged over processes: the planner's or a roll-out's."""

    def __init__(self, model: DCMoE, data: Frames, config: Config, group: Group) -> None:
        super().__init__()
        self.model, self.data, self.config, self.group = model, data, config, group

    def forward(
        self, rows: Rows, drawn: Float[Tensor, "row wide"], length: int
    ) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
        """:func:`unroll` by ``length`` frames, ``drawn`` hiding targets; by none the planner's loss, of such noise."""
        if length:
            return unroll(self.model, self.data, rows, length, self.config, drawn, self.group)
        assert self.model.planner is not None
        return planning.loss(self.model.planner, self.data, rows, drawn, self.config.planning)


def _noise(config: Config, generator: torch.Generator) -> Float[Tensor, "row unit"]:
    assert config.planner is not None
    return torch.randn(config.planning.rows, config.planner.latent, generator=generator, device=generator.device)


def _take(planner: GapPlan, weights: Mapping[str, Tensor]) -> None:
    try:
        planner.load_state_dict(weights)
    except RuntimeError as error:
        reason = str(error).splitlines()[-1].strip()
        raise InputError(f"the planner to start from does not fit ({reason}); give a run of the same size") from None


def unroll(
    model: DCMoE,
    data: Frames,
    rows: Rows,
    length: int,
    config: Config,
    mask: Float[Tensor, "row wide"],
    group: Group = ALONE,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """Rolls ``rows`` on by ``length`` frames from their own states and returns the mean loss; ``rows`` is moved on, cut
    off from the graph. mask: as :func:`target_mask` gives it."""
    sums: dict[str, Tensor] = {}
    total = torch.zeros((), device=data.hips.device)
    base = base_window(data, rows, length, config.planner is not None)
    steps = rows.gone[:, None] + torch.arange(length + 1, device=data.hips.device)
    whole = (steps[:, -1] <= rows.total).float()
    steps = torch.cat([steps, rows.total[:, None]], dim=1)
    turned, placed = poses(data, rows.start, rows.total, rows.keys, steps)
    way = [rows.state.positions]
    for i in range(length):
        here = rows.state.positions
        steer = control(data, rows, base[i], base[i + 1], turned[:, -1], placed[:, -1])
        after, said = model(rows.state, steer, mask)
        real = truth(data, rows, turned[:, i + 1], placed[:, i + 1], placed[:, i], said.frame, said.origin)
        here = (here - said.origin[:, None]) @ said.frame
        if config.absolute:
            loss, each = losses.paper(said, real, here, group=group)
        else:
            loss, each = losses.unrolled(said, real, here, config.weights, group)
        total = total + loss / length
        for name, value in each.items():
            sums[name] = sums.get(name, 0.0) + value.detach() / length
        rows.state = after
        way.append(after.positions)
        rows.gone = torch.minimum(rows.gone + 1, rows.total)
    if not config.absolute:
        loss, each = losses.windows(torch.stack(way, dim=1), placed[:, :-1], whole, config.weights, group)
        total = total + loss
        sums |= {name: value.detach() for name, value in each.items()}
    rows.state = State(*(x.detach() for x in rows.state))
    return total, sums


def target_mask(count: int, config: Config, generator: torch.Generator) -> Float[Tensor, "row wide"]:
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
def set_statistics(model: DCMoE, data: Frames, config: Config, generator: torch.Generator, count: int = 8192) -> None:
    """Means and deviations of features and outputs over a sample of rows, into the model's buffers."""
    rows = draw(data, count, len(config.styles), config.sampling, generator)
    if config.planner is not None:
        planning.add_perfect_plans(data, rows)
    base = base_window(data, rows, 1, config.planner is not None)
    steps = torch.stack([rows.gone, rows.gone + 1, rows.total], dim=1)
    turned, placed = poses(data, rows.start, rows.total, rows.keys, steps)
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
            model.out_std[block] = HIPS_SCALE if name == "hips" else ROTATION_SCALE
        elif name in measured:
            flat = measured[name].flatten(1)
            model.out_mean[block] = flat.mean(dim=0)
            model.out_std[block] = flat.std(dim=0).clamp_min(1e-2)
    centre = data.first + KEY_STEP * SIDE_KEYS
    able = torch.nonzero((torch.arange(len(data), device=centre.device) >= centre) & (data.last >= centre))[:, 0]
    chosen = able[torch.randint(len(able), (BANK, 1), generator=generator, device=able.device)]
    keys = KEY_STEP * torch.arange(-SIDE_KEYS, SIDE_KEYS + 1, device=able.device)
    model.phase_bank.copy_(data.phases[torch.minimum(chosen + keys, data.last[chosen])][..., :2])


def _stage(config: Config, step: int) -> Stage:
    for stage in config.stages:
        if step < stage.steps:
            return stage
        step -= stage.steps
    return config.stages[-1]


def _fresh(planner: GapPlan | None, data: Frames, count: int, config: Config, generator: torch.Generator) -> Rows:
    """Fresh rows, with their plans."""
    rows = draw(data, count, len(config.styles), config.sampling, generator)
    if planner is not None:
        planning.add_plans(planner, data, rows, config.planning.posterior, generator)
    return rows


def _rows(
    extra: dict, planner: GapPlan | None, data: Frames, stage: Stage, config: Config, generator: torch.Generator
) -> Rows:
    """The roll-outs of this update: those that go on, and fresh ones in place of those that ended and some others."""
    device = data.hips.device
    kept: dict | None = extra.get("rows")
    if kept is None or len(kept["start"]) != stage.rows or stage.unroll == 1:
        return _fresh(planner, data, stage.rows, config, generator)
    rows = Rows(
        **{k: kept[k].to(device) for k in PLAIN},
        keys=Keys(**{f.name: kept[f.name].to(device) for f in fields(Keys)}),
        state=State(*(kept[k].to(device) for k in State._fields)),
    )
    ended = rows.total - rows.gone <= 1
    drawn = torch.rand(stage.rows, generator=generator, device=device)
    wanted = max(int(ended.sum()), round(config.fresh * stage.rows))
    where = torch.argsort(drawn - ended.float())[:wanted]
    replace_rows(rows, _fresh(planner, data, wanted, config, generator), where)
    return rows


def _keep(extra: dict, rows: Rows) -> None:
    keys = {f.name: getattr(rows.keys, f.name) for f in fields(Keys)}
    extra["rows"] = {k: getattr(rows, k) for k in PLAIN} | keys | rows.state._asdict()


def _phases(path: Path, data: Database) -> Float[np.ndarray, "2 frame 10 3"]:
    try:
        phases = np.load(path, mmap_mode="r")
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no phases there ({error}); make them with 'interpose train pae'") from None
    if phases.shape != (2, data.frames, 10, 3):
        raise InputError(f"{path}: phases of shape {phases.shape}, the database needs {(2, data.frames, 10, 3)}")
    return phases
