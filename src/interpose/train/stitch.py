"""The recipe of S-CVAE: ``interpose train stitch --data DB -o RUN``.

Three parts, one after the other: the local phases' network, the plan of a gap (a conditional variational autoencoder
over whole gaps, which needs no roll-out and sees thousands of them a second), and the two generators, on their own
stitched roll-outs of growing length, along plans of the posterior, of the prior's mean and of its samples. Preset
``paper`` is the recipe of Ren et al. 2024 as printed: no plan, one latent a frame from an encoder that never sees the
truth, no base. The run folder is that of `interpose.train.loop`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.data import database
from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.models import discriminator
from interpose.models.discriminator import Discriminators
from interpose.models.gap_plan import Normal, PlanSize, divergence
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Generator, Size, StitchingCVAE
from interpose.stitching import schedule, seam, spread
from interpose.train import checkpoint, gaps, loop, stitch_losses
from interpose.train.frames import Frames, joined, load_frames
from interpose.train.gaps import Gaps, Motion, Sampling
from interpose.train.phase_targets import phase_targets
from interpose.train.stitch_losses import Weights
from interpose.train.stitch_rollout import Course, Stitched, roll

LENGTHS = (10, 30, 50)
"""Frames of the gaps that validation looks at, both keys counted."""


@dataclass(frozen=True)
class Part:
    """A part of the training: ``steps`` updates of ``rows`` gaps (frames, for the phases)."""

    steps: int
    rows: int
    learning_rate: float = 1e-3


@dataclass(frozen=True)
class Config:
    """Everything that decides a training, saved beside its weights."""

    preset: str = "full"
    size: Size = field(default_factory=Size)
    phases: Part = Part(6_000, 1024)
    plan: Part = Part(40_000, 2048)
    stitch: Part = Part(60_000, 512)
    shortest: int = 5
    """frames of a gap, both keys counted; with ``longest`` the paper's 5 and 50"""
    longest: int = 50
    growth: float = 0.4
    """share of the last part over which the longest gap grows to ``longest``"""
    course: Course = field(default_factory=Course)
    weights: Weights = field(default_factory=Weights)
    posterior: float = 0.5
    """of the rows of the last part, how many follow a plan of the posterior"""
    average_way: float = 0.3
    """and how many the plan of the prior's mean; the rest follow samples of the prior"""
    sampled: float = 0.2
    """how much the rows of prior samples are held to the truth"""
    critics_from: float = 0.5
    """share of the last part after which the discriminators are let in, slowly"""
    betas: tuple[float, float] = (0.9, 0.999)
    weight_decay: float = 1e-2
    average: float = 0.999
    clip: float = 1.0
    warmup: int = 200
    half: bool = True
    sampling: Sampling = field(default_factory=Sampling)
    seed: int = 0
    databases: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    licence: str = ""
    plan_from: str = ""


SMALL = Size(encoder=(256, 128), memory=256, decoder_memory=256, hidden=(256, 256, 128))
LETTER = Size(form="paper", latents="frame", planned=False)
PRESETS: dict[str, Config] = {
    "full": Config(),
    "small": Config(
        preset="small",
        size=SMALL,
        phases=Part(400, 512),
        plan=Part(6_000, 512),
        stitch=Part(2_000, 160),
        average=0.995,
    ),
    "tiny": Config(
        preset="tiny",
        size=Size(
            encoder=(16, 16),
            memory=16,
            decoder_memory=16,
            experts=2,
            hidden=(16, 16, 16),
            gate=(8, 8),
            plan=PlanSize(latent=16, hidden=32, depth=1),
        ),
        phases=Part(4, 16),
        plan=Part(10, 16),
        stitch=Part(6, 8),
        longest=12,
        warmup=2,
        average=0.5,
        half=False,
        sampling=Sampling(longest=20),
    ),
    "paper": Config(
        preset="paper",
        size=LETTER,
        phases=Part(6_000, 1024),
        plan=Part(0, 32),
        stitch=Part(100_000, 32, 1e-4),
        growth=0.9,
        course=Course(buffer=5),
        weights=stitch_losses.PAPER,
        critics_from=0.0,
        betas=(0.5, 0.9),
        weight_decay=1e-5,
        average=0.0,
        clip=0.5,
        warmup=0,
        half=False,
        sampling=Sampling(path=0.0, velocity=0.0, style_dropout=1.0),
    ),
}
"""``full`` has the paper's size, ``small`` is useful on two CPU cores in half an hour, ``tiny`` is for tests, ``paper``
is the paper's recipe unchanged."""


def ablations(config: Config) -> dict[str, Config]:
    """The seven of table 6, by its names, and what the paper's own latent does in our recipe.

    Our one latent a gap has nothing to interpolate, so latent interpolation is taken away from latents a frame.
    """

    def sized(**changes: object) -> Config:
        return replace(config, size=replace(config.size, **changes))  # type: ignore[arg-type]

    frame = sized(latents="frame")
    return {
        "ours": config,
        "w/o BS": replace(config, course=replace(config.course, both=False)),
        "w/o SL": replace(config, weights=replace(config.weights, stitch=0.0)),
        "w/o BA": replace(config, course=replace(config.course, aligned=False)),
        "w/o PM": sized(experts=1),
        "w/o D": replace(config, weights=replace(config.weights, adversarial=0.0)),
        "w/o LSTM": sized(recurrent=False),
        "z a frame": frame,
        "z a frame, w/o LI": replace(frame, size=replace(frame.size, interpolated=False)),
        "w/o plan": sized(planned=False),
    }


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
    phases and plan are taken as they are, so that the generators alone are trained. config: in place of the preset's.
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
        databases=tuple(f"{d.dataset} {d.fingerprint}".strip() for d in loaded),
        styles=styles,
        licence="; ".join(dict.fromkeys(d.licence for d in loaded)),
        plan_from="" if plan_from is None else plan_from.name,
    )
    training, held_out = (
        joined([load_frames(d, None, list(styles), training_ranges(d)[i]) for d in loaded]) for i in (0, 1)
    )
    for frames, what in ((training, "training"), (held_out, "validation")):
        if int((frames.last - frames.first).max()) < chosen.longest:
            raise InputError(f"{data[0]}: no clip has {chosen.longest + 1} frames for {what}; prepare longer ones")
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
        odd = model.load_state_dict(taken, strict=False).unexpected_keys
        if odd:
            raise InputError(f"the plan to start from does not fit this one ({odd[0]}); give a run of the same size")
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


def phase_loss(
    model: StitchingCVAE, data: Frames, phases: Float[Tensor, "frame 4"], rows: int, generator: torch.Generator
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """How well both phase networks foresee the local phases one frame on; of half the frames the phase is unknown or
    blurred, as it is on the way from a lone key."""
    device = data.hips.device
    paper = model.size.form == "paper"
    total = torch.zeros((), device=device)
    still = torch.tensor([-1.0, 1.0, -1.0, 1.0], device=device)
    for backward, side in ((False, model.front), (True, model.back)):
        drawn = gaps.draw(data, rows, model.size.styles, Sampling(path=0.0, velocity=0.0), generator, steps=2)
        true = _true(model, data, drawn, 2)
        before, now, after = (2, 1, 0) if backward else (0, 1, 2)
        body = Body(
            true.hips[:, now],
            true.rotations[:, now],
            true.positions[:, now],
            (true.positions[:, now] - true.positions[:, before]) * 30.0,
            torch.ones(rows, 1, device=device),
            true.contacts[:, now],
            torch.zeros(rows, 4, device=device),
        )
        features = side.form.features(body, _aim(body, true, now, paper))
        x = side.normalised("state", features.state)
        turned = still if backward else torch.ones_like(still)
        here, there = phases[drawn.start + now] * turned, phases[drawn.start + after] * turned
        known = torch.rand(rows, 1, generator=generator, device=device)
        blur = 0.1 * torch.randn(rows, 4, generator=generator, device=device)
        here = torch.where(known < 0.2, 0.0, here + torch.where(known < 0.6, blur, 0.0))
        total = total + (side.phases(x, here) - there).abs().mean()
    return total, {"phase": total}


def plan_loss(
    model: StitchingCVAE, data: Frames, config: Config, rows: int, generator: torch.Generator
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """Reconstruction of the poses at the anchors and the divergence of the posterior from the prior."""
    plan = model.plan
    assert plan is not None
    device = data.hips.device
    drawn = gaps.draw(data, rows, model.size.styles, config.sampling, generator)
    parts = gaps.anchor_times(data.hips).expand(rows, -1)
    base = gaps.base(data, drawn, parts)
    residual = gaps.residual(data, drawn, base)
    x, frame = plan(gaps.ends(data, drawn))
    q, p = plan.recognise(x, frame, residual), plan.expect(x)
    noise = torch.randn(q.mean.shape, generator=generator, device=device)
    added = plan.decode(x, frame, q.at(noise))
    made = base + added
    matrices = to_matrix(made[..., 3:].unflatten(-1, (22, 6)))
    positions = joint_positions(made[..., :3].flatten(0, 1), matrices.flatten(0, 1)).unflatten(0, made.shape[:2])
    true = gaps.between(data.positions, drawn, parts[0])
    turned = gaps.between(data.rotations, drawn, parts[0])
    keys = data.positions[drawn.start][:, None], data.positions[drawn.target][:, None]
    step, true_step = (torch.cat([keys[0], x, keys[1]], dim=1).diff(dim=1) for x in (positions, true))
    nats = divergence(q, p).sum(dim=-1).mean()
    each = {
        "plan position": (positions - true).abs().mean(),
        "plan rotation": (to_six(matrices) - turned).abs().mean(),
        "plan displacement": (step - true_step).abs().mean(),
        "nats": nats,
    }
    total = 3.0 * each["plan position"] + each["plan rotation"] + 2.0 * each["plan displacement"]
    return total + config.weights.divergence * nats, each


def stitch_loss(
    model: StitchingCVAE,
    critics: Discriminators,
    against: torch.optim.Optimizer,
    data: Frames,
    config: Config,
    gone: float,
    generator: torch.Generator,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """The generators' loss on stitched roll-outs, after a step of the discriminators. ``gone``: share of the part."""
    device, rows = data.hips.device, config.stitch.rows
    reach = config.shortest + 1 + (config.longest - config.shortest) * min(1.0, gone / max(config.growth, 1e-6))
    frames = int(torch.randint(config.shortest, int(reach), (1,), generator=generator, device=device))
    steps = frames - 1
    drawn = gaps.draw(data, rows, model.size.styles, config.sampling, generator, steps=steps)
    known = torch.ones(rows, device=device)
    made, true, said = made_gaps(model, data, drawn, config, generator, known)
    overlap = list(seam(steps, config.course.buffer, config.course.both).overlap)
    each = stitch_losses.chains(made, true, overlap, known, config.weights.entropy)
    if said:
        standard = Normal(torch.zeros_like(said[0].mean), torch.zeros_like(said[0].mean))
        each["divergence"] = torch.stack([divergence(one, standard).sum(dim=-1).mean() for one in said]).mean()
    strength = config.weights.adversarial * min(1.0, max(0.0, gone - config.critics_from) / 0.1 + 1e-3)
    if strength > 0.0 and gone >= config.critics_from:
        turned = true.rotations[:, 0, 0]
        first = to_matrix(turned) if turned.shape[-1] == 6 else _still(turned)
        shown = discriminator.seen(made.positions, first)
        real = discriminator.seen(true.positions, first)
        lost = discriminator.critic_loss(critics, real, shown)
        against.zero_grad(set_to_none=True)
        lost.backward()
        torch.nn.utils.clip_grad_norm_(critics.parameters(), config.clip)
        against.step()
        each["adversarial"] = discriminator.generator_loss(critics, shown)
        each["critics"] = lost.detach()
    weights = config.weights
    names = ("position", "rotation", "displacement", "foot", "contact", "stitch", "energy", "root", "divergence")
    total = sum(getattr(weights, name) * each[name] for name in names if name in each)
    total = total + strength * each.get("adversarial", torch.zeros((), device=device))
    return torch.as_tensor(total), each


def _still(quaternions: Float[Tensor, "row 4"]) -> Float[Tensor, "row 3 3"]:
    """The paper's form is already in the start's frame."""
    return torch.eye(3, device=quaternions.device).expand(len(quaternions), 3, 3)


def made_gaps(
    model: StitchingCVAE,
    data: Frames,
    drawn: Gaps,
    config: Config,
    generator: torch.Generator,
    known: Float[Tensor, "row"] | None = None,
    noise: Float[Tensor, "row unit"] | None = None,
) -> tuple[Stitched, Motion, list[Normal]]:
    """Gaps of one length made by the model, the true motion, and the distributions of latents a frame.

    In training ``known`` takes how much each row is held to the truth. Otherwise all follow the prior at ``noise``.
    """
    steps = int(drawn.steps[0])
    true = _true(model, data, drawn, steps)
    front, back = gaps.bodies(data, drawn, true)
    rows, device = len(drawn.start), data.hips.device
    if model.size.form == "paper":
        base = torch.zeros(rows, steps + 1, 135, device=device)
    else:
        parts = (torch.arange(steps + 1, device=device) / steps).expand(rows, -1)
        base = gaps.base(data, drawn, parts)
    z = None
    if model.plan is not None:
        with torch.no_grad():
            z, added = _planned(model, data, drawn, config, base, generator, known, noise)
        if model.size.planned:
            weights = torch.as_tensor(spread(steps), dtype=base.dtype, device=device)
            base = base + torch.einsum("ta,bac->btc", weights, added)
    if model.size.latents == "frame":
        moves = len(schedule(steps, config.course.buffer, config.course.aligned, config.course.both))
        z = torch.randn(rows, moves, model.size.latent, generator=generator, device=device)
        if known is None and noise is None:
            z = torch.zeros_like(z)
    assert z is not None
    made = roll(model, front, back, base, drawn.style, z, config.course)
    said = made.front.said + ([] if made.back is None else made.back.said)
    return made, true, said


def _planned(
    model: StitchingCVAE,
    data: Frames,
    drawn: Gaps,
    config: Config,
    base: Float[Tensor, "row frame pose"],
    generator: torch.Generator,
    known: Float[Tensor, "row"] | None,
    noise: Float[Tensor, "row unit"] | None,
) -> tuple[Float[Tensor, "row unit"], Float[Tensor, "row anchor pose"]]:
    """The latents of the gaps and what they add to interpolation at the anchors."""
    plan = model.plan
    assert plan is not None
    was = plan.training
    plan.eval()
    rows, device = len(drawn.start), data.hips.device
    x, frame = plan(gaps.ends(data, drawn))
    p = plan.expect(x)
    if known is None:
        z = p.mean if noise is None else p.at(noise)
    else:
        parts = gaps.anchor_times(data.hips).expand(rows, -1)
        q = plan.recognise(x, frame, gaps.residual(data, drawn, gaps.base(data, drawn, parts)))
        draws = torch.randn(2, rows, model.size.latent, generator=generator, device=device)
        first, second = round(config.posterior * rows), round((config.posterior + config.average_way) * rows)
        z = torch.cat([q.at(draws[0])[:first], p.mean[first:second], p.at(draws[1])[second:]])
        known[second:] = config.sampled
    added = plan.decode(x, frame, z)
    plan.train(was)
    return z, added


def _true(model: StitchingCVAE, data: Frames, drawn: Gaps, steps: int) -> Motion:
    if model.size.form == "paper":
        return gaps.letter_motion(data, drawn, steps, model.mean_quaternions)
    return gaps.motion(data, drawn, steps)


def _aim(body: Body, true: Motion, at: int, paper: bool) -> Aim:
    """An aim for features of the state alone."""
    nothing = torch.zeros(len(body.hips), 135, device=body.hips.device)
    left = torch.ones_like(body.known)
    del paper
    return Aim(true.hips[:, at], true.rotations[:, at], true.positions[:, at], left, nothing, nothing, nothing)


@torch.no_grad()
def set_statistics(
    model: StitchingCVAE, data: Frames, config: Config, generator: torch.Generator, count: int = 256
) -> None:
    """Means and deviations of every network's inputs over gaps of the data, into the model's buffers."""
    styles = model.size.styles
    if model.size.form == "paper":
        model.mean_quaternions.copy_(gaps.mean_quaternions(data))
    collected: dict[tuple[int, str], list[Tensor]] = {}
    longest = config.longest - 1
    for steps in torch.linspace(config.shortest - 1, longest, 12).long().tolist():
        drawn = gaps.draw(data, count, styles, config.sampling, generator, steps=steps)
        true = _true(model, data, drawn, steps)
        keys = gaps.bodies(data, drawn, true)
        base = torch.zeros(count, steps + 1, 135, device=data.hips.device)
        if model.size.form != "paper":
            base = gaps.base(data, drawn, (torch.arange(steps + 1, device=base.device) / steps).expand(count, -1))
        for number, side in enumerate((model.front, model.back)):
            for gone in {0, 1, max(1, (steps - 1) // 2)}:
                at, following, aim = gone, gone + 1, steps - gone
                before = gone - 1
                if number:
                    at, following, aim, before = steps - at, steps - following, steps - aim, steps - before
                body = keys[number]
                if gone:
                    moved = (true.positions[:, at] - true.positions[:, before]) * 30.0
                    body = body._replace(
                        hips=true.hips[:, at],
                        rotations=true.rotations[:, at],
                        positions=true.positions[:, at],
                        velocities=moved,
                        known=torch.ones_like(body.known),
                        contacts=true.contacts[:, at],
                    )
                left = torch.full_like(body.known, float(abs(aim - at)))
                led = Aim(
                    true.hips[:, aim], true.rotations[:, aim], true.positions[:, aim], left,
                    base[:, at], base[:, following], base[:, aim],
                )  # fmt: skip
                features = side.form.features(body, led)
                for name in ("state", "offset", "target"):
                    collected.setdefault((number, name), []).append(getattr(features, name))
    for (number, name), values in collected.items():
        side = (model.front, model.back)[number]
        _set(side, name, torch.cat(values))
    if model.plan is not None:
        drawn = gaps.draw(data, 32 * count, styles, config.sampling, generator)
        known = gaps.ends(data, drawn)
        known = known._replace(path_known=torch.ones_like(known.path_known))
        x, frame = model.plan.numbers(known)
        model.plan.mean.copy_(x.mean(dim=0))
        model.plan.std.copy_(x.std(dim=0).clamp_min(1e-2))
        parts = gaps.anchor_times(data.hips).expand(len(x), -1)
        residual = gaps.residual(data, drawn, gaps.base(data, drawn, parts)).unflatten(-1, (-1, 3)) @ frame[:, None]
        model.plan.residual_std.copy_(residual.flatten(1).std(dim=0).clamp_min(1e-3))


def _set(module: Generator, name: str, values: Float[Tensor, "row wide"]) -> None:
    deviation = values.std(dim=0)
    getattr(module, f"{name}_mean").copy_(values.mean(dim=0))
    getattr(module, f"{name}_std").copy_(torch.where(deviation < 1e-4, 1.0, deviation.clamp_min(1e-2)))


@torch.no_grad()
def ratios(model: StitchingCVAE, data: Frames, config: Config, count: int = 128) -> dict[str, float]:
    """Mean joint position error on held-out gaps over interpolation's, from the prior's mean, and how smooth it is."""
    out = {}
    was = model.training
    model.eval()
    for frames in LENGTHS:
        if frames > config.longest:
            continue
        steps = frames - 1
        drawn = gaps.evenly(data, steps, count, model.size.styles)
        generator = torch.Generator(data.hips.device).manual_seed(0)
        made, true, _ = made_gaps(model, data, drawn, config, generator)
        parts = (torch.arange(steps + 1, device=data.hips.device) / steps).expand(count, -1)
        base = gaps.base(data, drawn, parts)
        matrices = to_matrix(base[..., 3:].unflatten(-1, (22, 6))).flatten(0, 1)
        naive = joint_positions(base[..., :3].flatten(0, 1), matrices).unflatten(0, base.shape[:2])
        real = data.positions[drawn.start[:, None] + torch.arange(frames, device=data.hips.device)]
        wrong, apart = (made.positions - true.positions).norm(dim=-1).mean(), (naive - real).norm(dim=-1).mean()
        out[f"valid/{frames}"] = float(wrong / apart)
        shake, real_shake = (x.diff(n=3, dim=1).norm(dim=-1).mean() for x in (made.positions, true.positions))
        out[f"jerk/{frames}"] = float(shake / real_shake)
    model.train(was)
    return out
