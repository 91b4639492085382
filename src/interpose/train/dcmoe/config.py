"""What decides a training of DC-MoE: its config and the presets."""

from __future__ import annotations

from dataclasses import dataclass, field

from interpose.models.dcmoe import DCMoESize
from interpose.train.common.config import TrainingConfig
from interpose.train.common.gaps import GapSampling
from interpose.train.dcmoe.losses import RollOutWeights
from interpose.train.dcmoe.sequences import RollOutSampling
from interpose.train.planner.config import PlannerConfig


@dataclass(frozen=True)
class Stage:
    """A part of the training: ``steps`` updates of ``rows`` roll-outs, each ``unroll`` frames long."""

    steps: int
    unroll: int
    rows: int


@dataclass(frozen=True)
class DCMoEConfig(TrainingConfig):
    """Everything that decides a training of DC-MoE."""

    experts: int = 16
    hidden: int = 512
    gate: tuple[int, int] = (512, 128)
    absolute: bool = False
    stages: tuple[Stage, ...] = (Stage(60_000, 8, 256), Stage(30_000, 16, 256))
    fresh: float = 0.6
    """share of the rows that start anew at each update"""
    mask_target: float = 0.1
    """probability that a row's target loses some of its joints (section 5.1)"""
    mask_joint: float = 0.3
    """of each joint of such a row"""
    sampling: RollOutSampling = field(default_factory=RollOutSampling)
    posterior: float = 0.4
    """share of the roll-outs along a plan of the posterior; the others follow the likeliest one"""
    weights: RollOutWeights = field(default_factory=RollOutWeights)
    phases: bool = False
    backward: bool = False
    """on motion that runs backwards, for stitching from both ends"""
    plan: PlannerConfig | None = None
    """of the planner that the steps work along, as its run was trained"""

    @property
    def size(self) -> DCMoESize:
        """The network's."""
        plan = None if self.plan is None else self.plan.size
        return DCMoESize(self.experts, self.hidden, self.gate, self.absolute, len(self.styles), plan)


PRESETS: dict[str, DCMoEConfig] = {
    "full": DCMoEConfig(),
    "small": DCMoEConfig(
        preset="small",
        experts=8,
        hidden=256,
        gate=(256, 64),
        stages=(Stage(1_500, 8, 128), Stage(1_000, 12, 128)),
        average=0.996,
    ),
    "tiny": DCMoEConfig(
        preset="tiny",
        experts=2,
        hidden=32,
        gate=(32, 16),
        stages=(Stage(10, 1, 16), Stage(10, 3, 16)),
        warmup=2,
        average=0.5,
        half=False,
    ),
    "paper": DCMoEConfig(
        preset="paper",
        absolute=True,
        stages=(Stage(300_000, 1, 32),),
        learning_rate=1e-4,
        warmup=0,
        average=0.0,
        fresh=1.0,
        mask_target=1.0,
        mask_joint=0.1,
        half=False,
        sampling=RollOutSampling(
            gaps=GapSampling(path=1.0, style_dropout=0.0),
            inside=1.0,
            phase_known_inside=1.0,
            rotation_noise=0.0,
            hips_noise=0.0,
        ),
    ),
}
"""``full`` has the paper's size, ``small`` is useful on two CPU cores in about an hour, ``tiny`` is for tests,
``paper`` is the paper's recipe unchanged."""
