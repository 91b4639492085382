"""What decides a training of S-CVAE: its config, the presets, and the rows of table 6 as changes of one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from interpose.models.planner import PlanSize
from interpose.models.stitching_cvae import Size
from interpose.train.common.gaps import Sampling
from interpose.train.stitch import losses
from interpose.train.stitch.losses import Weights
from interpose.train.stitch.rollout import Course


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
        weights=losses.PAPER,
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
"""``full`` has the paper's size, ``small`` is useful on two CPU cores in an hour, ``tiny`` is for tests, ``paper``
is the paper's recipe unchanged."""


def ablations(config: Config) -> dict[str, Config]:
    """The seven of table 6, by its names, the paper's own latent in our recipe, no plan, and the paper's letter.

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
        "as printed": _printed(config),
    }


def _printed(config: Config) -> Config:
    """The paper's letter at another config's size and budget."""
    size = replace(config.size, form=LETTER.form, latents=LETTER.latents, planned=LETTER.planned)
    return replace(
        PRESETS["paper"],
        preset=config.preset,
        size=size,
        phases=config.phases,
        stitch=config.stitch,
        average=config.average,
        warmup=config.warmup,
        half=config.half,
    )


def size_of(told: Mapping[str, Any]) -> Size:
    """The size that a saved config tells of."""
    plain: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in told.items()}
    plain["plan"] = PlanSize(**plain["plan"])
    return Size(**plain)


def config_of(told: Mapping[str, Any]) -> Config:
    """A config from the plain values that a run keeps of it."""
    plain: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in told.items()}
    kinds = {"phases": Part, "plan": Part, "stitch": Part, "course": Course, "weights": Weights, "sampling": Sampling}
    plain |= {name: kind(**plain[name]) for name, kind in kinds.items()}
    plain["size"] = size_of(plain["size"])
    return Config(**plain)
