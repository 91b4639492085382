"""What decides a training of the planner: its config and the presets."""

from __future__ import annotations

from dataclasses import dataclass, field

from interpose.models.planner import PlannerSize
from interpose.train.common.config import TrainingConfig
from interpose.train.common.gaps import GapSampling


@dataclass(frozen=True)
class PlannerConfig(TrainingConfig):
    """Everything that decides a training of the planner."""

    size: PlannerSize = field(default_factory=lambda: PlannerSize(hidden=1024))
    steps: int = 40_000
    rows: int = 2048
    position: float = 3.0
    """weight of the joint positions, metres"""
    rotation: float = 1.0
    displacement: float = 2.0
    """of the joints' steps from anchor to anchor, metres"""
    likeliest: float = 1.0
    """weight of the prior's mean, held to the truth by itself"""
    divergence: float = 1e-4
    """of a nat"""
    sampling: GapSampling = field(default_factory=GapSampling)


PRESETS: dict[str, PlannerConfig] = {
    "full": PlannerConfig(),
    "small": PlannerConfig(preset="small", size=PlannerSize(), steps=12_000, rows=512, average=0.998, half=False),
    "tiny": PlannerConfig(
        preset="tiny",
        size=PlannerSize(hidden=32, depth=1),
        steps=10,
        rows=16,
        warmup=2,
        average=0.5,
        half=False,
    ),
}
"""``full`` is for a GPU, ``small`` is useful on two CPU cores in about an hour, ``tiny`` is for tests."""
