"""What decides a training of DC-MoE: its config and the presets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from interpose.models.dcmoe import Size
from interpose.models.planner import PlanSize
from interpose.train.dcmoe import losses
from interpose.train.dcmoe.sequences import Sampling
from interpose.train.planner.objective import Planning


@dataclass(frozen=True)
class Stage:
    """A part of the training: ``steps`` updates of ``rows`` roll-outs, each ``unroll`` frames long."""

    steps: int
    unroll: int
    rows: int


@dataclass(frozen=True)
class Config:
    """Everything that decides a training, saved beside its weights."""

    preset: str = "full"
    experts: int = 16
    hidden: int = 512
    gate: tuple[int, int] = (512, 128)
    absolute: bool = False
    planner: PlanSize | None = field(default_factory=lambda: PlanSize(hidden=1024))
    planning: Planning = field(default_factory=lambda: Planning(40_000, 2048))
    stages: tuple[Stage, ...] = (Stage(60_000, 8, 256), Stage(30_000, 16, 256))
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 500
    average: float = 0.999
    clip: float = 1.0
    fresh: float = 0.6
    """share of the rows that start anew at each update"""
    mask_target: float = 0.1
    """probability that a row's target loses some of its joints (section 5.1)"""
    mask_joint: float = 0.3
    """of each joint of such a row"""
    half: bool = True
    """bfloat16 products"""
    sampling: Sampling = field(default_factory=lambda: Sampling(far=0.05))
    weights: losses.Weights = field(default_factory=losses.Weights)
    seed: int = 0
    databases: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    phases: bool = False
    backward: bool = False
    """on motion that runs backwards, for stitching from both ends"""
    licence: str = ""
    plan_from: str = ""


PRESETS: dict[str, Config] = {
    "full": Config(),
    "small": Config(
        preset="small",
        experts=8,
        hidden=256,
        gate=(256, 64),
        planner=PlanSize(),
        planning=Planning(12_000, 512),
        stages=(Stage(1_500, 8, 128), Stage(1_000, 12, 128)),
        average=0.996,
    ),
    "tiny": Config(
        preset="tiny",
        experts=2,
        hidden=32,
        gate=(32, 16),
        planner=PlanSize(hidden=32, depth=1),
        planning=Planning(10, 16),
        stages=(Stage(10, 1, 16), Stage(10, 3, 16)),
        warmup=2,
        average=0.5,
        half=False,
    ),
    "paper": Config(
        preset="paper",
        absolute=True,
        planner=None,
        stages=(Stage(300_000, 1, 32),),
        learning_rate=1e-4,
        warmup=0,
        average=0.0,
        fresh=1.0,
        mask_target=1.0,
        mask_joint=0.1,
        half=False,
        sampling=Sampling(
            lone_start=0.0,
            context_start=0.0,
            path=1.0,
            style_dropout=0.0,
            phase_known_inside=1.0,
            rotation_noise=0.0,
            hips_noise=0.0,
        ),
    ),
}
"""``full`` has the paper's size, ``small`` is useful on two CPU cores in about an hour, ``tiny`` is for tests,
``paper`` is the paper's recipe unchanged."""


def size_of(config: Mapping[str, Any]) -> Size:
    """The network's size that a saved config tells of."""
    plan = config.get("planner")
    return Size(
        config["experts"],
        config["hidden"],
        tuple(config["gate"]),
        config["absolute"],
        len(config["styles"]),
        None if plan is None else PlanSize(**plan),
    )
