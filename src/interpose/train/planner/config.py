"""What decides a training of the planner: its config and the presets."""

from __future__ import annotations

from dataclasses import dataclass, field

from interpose.models.planner import PlannerSize
from interpose.train.common.gaps import GapSampling


@dataclass(frozen=True)
class PlannerConfig:
    """Everything that decides a training, saved beside its weights."""

    preset: str = "full"
    size: PlannerSize = field(default_factory=lambda: PlannerSize(hidden=1024))
    steps: int = 40_000
    rows: int = 2048
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 500
    average: float = 0.999
    clip: float = 1.0
    half: bool = True
    """bfloat16 products: faster on a GPU, slower on a CPU without AMX"""
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
    seed: int = 0
    databases: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    licence: str = ""


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
