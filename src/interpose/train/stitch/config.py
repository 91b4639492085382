"""What decides a training of S-CVAE: its config, the presets, and the rows of table 6 as changes of one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from interpose.models.stitching_cvae import StitchSize
from interpose.train.common.config import TrainingConfig
from interpose.train.common.gaps import GapSampling
from interpose.train.planner.config import PlannerConfig
from interpose.train.stitch.losses import PAPER_WEIGHTS, StitchWeights
from interpose.train.stitch.rollout import ChainLayout


@dataclass(frozen=True)
class TrainingPart:
    """A part of the training: ``steps`` updates of ``rows`` gaps (frames, for the phases)."""

    steps: int
    rows: int
    learning_rate: float = 1e-3


@dataclass(frozen=True)
class StitchConfig(TrainingConfig):
    """Everything that decides a training of S-CVAE."""

    size: StitchSize = field(default_factory=StitchSize)
    phases: TrainingPart = TrainingPart(6_000, 1024)
    stitch: TrainingPart = TrainingPart(60_000, 512)
    shortest: int = 5
    """frames of a gap, both keys counted; with ``longest`` the paper's 5 and 50"""
    longest: int = 50
    growth: float = 0.4
    """share of the generators' part over which the longest gap grows to ``longest``"""
    chains: ChainLayout = field(default_factory=ChainLayout)
    weights: StitchWeights = field(default_factory=StitchWeights)
    posterior: float = 0.5
    """share of the rows that follow a plan of the posterior"""
    likeliest: float = 0.3
    """share that follows the plan of the prior's mean; the rest follow samples of the prior"""
    sampled: float = 0.2
    """how much the rows of prior samples are held to the truth"""
    critics_from: float = 0.5
    """share of the generators' part after which the discriminators are let in, slowly"""
    betas: tuple[float, float] = (0.9, 0.999)
    weight_decay: float = 1e-2
    warmup: int = 200
    sampling: GapSampling = field(default_factory=lambda: GapSampling(path=0.3, velocity=0.3))
    plan: PlannerConfig | None = None
    """of the planner that the generators work along, as its run was trained"""

    @property
    def needs_plan(self) -> bool:
        """Whether the generators take their base or their latents from a planner."""
        return self.size.planned or self.size.latents == "gap"


SMALL_SIZE = StitchSize(encoder=(256, 128), memory=256, decoder_memory=256, hidden=(256, 256, 128))
PAPER_SIZE = StitchSize(form="paper", latents="frame", planned=False)
PRESETS: dict[str, StitchConfig] = {
    "full": StitchConfig(),
    "small": StitchConfig(
        preset="small",
        size=SMALL_SIZE,
        phases=TrainingPart(400, 512),
        stitch=TrainingPart(2_000, 160),
        average=0.995,
    ),
    "tiny": StitchConfig(
        preset="tiny",
        size=StitchSize(encoder=(16, 16), memory=16, decoder_memory=16, experts=2, hidden=(16, 16, 16), gate=(8, 8)),
        phases=TrainingPart(4, 16),
        stitch=TrainingPart(6, 8),
        longest=12,
        warmup=2,
        average=0.5,
        half=False,
        sampling=GapSampling(path=0.3, velocity=0.3, longest=20),
    ),
    "paper": StitchConfig(
        preset="paper",
        size=PAPER_SIZE,
        stitch=TrainingPart(100_000, 32, 1e-4),
        growth=0.9,
        chains=ChainLayout(buffer=5),
        weights=PAPER_WEIGHTS,
        critics_from=0.0,
        betas=(0.5, 0.9),
        weight_decay=1e-5,
        average=0.0,
        clip=0.5,
        warmup=0,
        half=False,
        sampling=GapSampling(path=0.0, velocity=0.0, style_dropout=1.0),
    ),
}
"""``full`` has the paper's size, ``small`` is useful on two CPU cores in an hour, ``tiny`` is for tests, ``paper``
is the paper's recipe unchanged."""


def ablations(config: StitchConfig) -> dict[str, StitchConfig]:
    """The seven of table 6, by its names, the paper's own latent in our recipe, no plan, and the paper's recipe.

    Our one latent a gap has nothing to interpolate, so latent interpolation is taken away from latents a frame.
    """

    def sized(**changes: object) -> StitchConfig:
        return replace(config, size=replace(config.size, **changes))  # type: ignore[arg-type]

    frame = sized(latents="frame")
    return {
        "ours": config,
        "w/o BS": replace(config, chains=replace(config.chains, both=False)),
        "w/o SL": replace(config, weights=replace(config.weights, stitch=0.0)),
        "w/o BA": replace(config, chains=replace(config.chains, aligned=False)),
        "w/o PM": sized(experts=1),
        "w/o D": replace(config, weights=replace(config.weights, adversarial=0.0)),
        "w/o LSTM": sized(recurrent=False),
        "z a frame": frame,
        "z a frame, w/o LI": replace(frame, size=replace(frame.size, interpolated=False)),
        "w/o plan": sized(planned=False),
        "as printed": _printed(config),
    }


def _printed(config: StitchConfig) -> StitchConfig:
    """The paper's recipe at another config's size and budget."""
    size = replace(config.size, form=PAPER_SIZE.form, latents=PAPER_SIZE.latents, planned=PAPER_SIZE.planned)
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
