"""What the tests of training, export and run time share: a database of marching people, networks of random weights.

The networks are small and loud: their last layers have weights as large as a trained network's, so that a wrong
feature, frame or state shows in their output.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor, nn

from interpose import rotation
from interpose.data import database, root
from interpose.data.database import ClipArrays, ClipInfo, Database
from interpose.features import CHANNELS, RATE
from interpose.models.dcmoe import Control, DCMoE
from interpose.models.layers import Residual
from interpose.models.planner import Planner, PlannerSize
from interpose.motion import Motion
from interpose.skeleton import HUMANOID
from interpose.train.common import checkpoint, loop
from interpose.train.common.frames import Frames, load_frames
from interpose.train.common.gaps import true_poses
from interpose.train.dcmoe import recipe
from interpose.train.dcmoe.config import DCMoEConfig
from interpose.train.dcmoe.sequences import Rows, Truth, base_window, control, truth
from interpose.train.planner import objective
from interpose.train.planner.config import PlannerConfig

STYLES = ("Old", "Young")
LENGTHS = (150, 90, 120)
"""Frames of the clips: Old, Young, Old."""
PLANNER = PlannerConfig(
    preset="tiny",
    size=PlannerSize(latent=8, hidden=32, depth=1, styles=len(STYLES)),
    databases=("synthetic 1234",),
    styles=STYLES,
    licence="CC BY 4.0",
)
"""What a run of the planner on this database keeps."""
CONFIG = DCMoEConfig(
    preset="tiny",
    experts=2,
    hidden=16,
    gate=(16, 8),
    databases=PLANNER.databases,
    styles=STYLES,
    phases=True,
    licence=PLANNER.licence,
)
"""The same of DC-MoE, without a planner."""
PLANNED = replace(CONFIG, plan=PLANNER)
"""The same with one."""


def march(frames: int, hertz: float, heading: float) -> Motion:
    """Legs and arms swing, the trunk sways, on a path that bends from ``heading``."""
    seconds = np.arange(frames) / RATE
    swing = np.sin(2.0 * np.pi * hertz * seconds)
    turned = np.tile(rotation.IDENTITY, (frames, len(HUMANOID), 1))
    axes = {"LeftUpLeg": (0.5, 0, 0), "RightUpLeg": (-0.5, 0, 0), "LeftArm": (-0.3, 0, 1), "RightArm": (0.3, 0.2, 0)}
    for name, axis in (axes | {"Spine": (0.1, 0.2, 0.0), "LeftLeg": (0.4, 0.0, 0.1)}).items():
        turned[:, HUMANOID.index(name)] = rotation.from_rotation_vector(swing[:, None] * np.array(axis))
    yaw = heading + 0.8 * np.sin(0.9 * seconds)
    upright = rotation.from_rotation_vector(yaw[:, None] * np.array([0.0, 1.0, 0.0]))
    lean = rotation.from_rotation_vector(np.stack([0.1 + 0.1 * swing, 0.0 * swing, 0.05 * swing], axis=-1))
    turned[:, 0] = rotation.multiply(upright, lean)
    step = 1.2 * hertz / RATE * np.stack([np.sin(yaw), 0.0 * yaw, np.cos(yaw)], axis=-1)
    place = np.cumsum(step, axis=0) + np.array([0.3, 0.0, -0.2])
    place[:, 1] = 0.93 + 0.03 * swing
    return Motion(HUMANOID, place, turned, RATE)


def write_database(folder: Path, lengths: tuple[int, ...] = LENGTHS, licence: str = "CC BY 4.0") -> Database:
    """Clips of those lengths, styles by turns, feet that stand by turns."""
    motions = [march(count, 0.8 + 0.3 * i, 2.0 * i) for i, count in enumerate(lengths)]
    infos = [
        ClipInfo(f"march{i}", "", STYLES[i % len(STYLES)], "", "", RATE, len(m), (0, len(m)), 0.0)
        for i, m in enumerate(motions)
    ]
    stands = [np.arange(len(m))[:, None] // 8 % 2 == [0, 0, 1, 1] for m in motions]
    arrays = [
        ClipArrays(
            m.root_positions.astype(np.float32),
            m.local_rotations.astype(np.float32),
            root.trajectory(m.global_positions(), RATE).astype(np.float32),
            stand.astype(np.uint8),
        )
        for m, stand in zip(motions, stands, strict=True)
    ]
    announced = [(info, len(m)) for info, m in zip(infos, motions, strict=True)]
    return database.write(folder, announced, arrays, dataset="synthetic", licence=licence)


def phases_of(data: Database) -> Float[ndarray, "2 frame 10 3"]:
    """Channels that turn at .5, .6, ... Hz at amplitudes of their own; half a turn later in the mirror."""
    frequency = 0.5 + 0.1 * np.arange(CHANNELS)
    turns = np.arange(data.frames)[:, None] / RATE * frequency
    angle = 2.0 * math.pi * np.stack([turns, turns + 0.5])
    size = 0.5 + 0.1 * np.arange(CHANNELS)
    rate = np.broadcast_to(frequency, angle.shape)
    return np.stack([size * np.sin(angle), size * np.cos(angle), rate], axis=-1).astype(np.float32)


def frames_of(data: Database) -> Frames:
    """Every frame of the database, with its phases and mirror images."""
    return load_frames(data, phases_of(data), list(STYLES), [(int(a), int(b)) for a, b in data.ranges])


def network_for(data: Frames, absolute: bool = False, config: DCMoEConfig = CONFIG) -> DCMoE:
    """A loud network of random weights, its features normalised for ``data``."""
    config = replace(config, absolute=absolute)
    torch.manual_seed(3)
    model = DCMoE(config.size)
    with torch.no_grad():
        model.network.experts[2].linear.weight.mul_(1.0 if absolute else 8.0)
        model.network.experts[2].linear.bias.normal_(std=0.3)
        model.network.gate[-1].weight.mul_(20.0)
    generator = torch.Generator().manual_seed(0)
    if model.planner is not None and config.plan is not None:
        loud_planner(model.planner)
        objective.set_statistics(model.planner, data, config.plan.sampling, generator, count=512)
    recipe.set_statistics(model, data, config, generator, count=512)
    return model.eval().requires_grad_(False)


def planner_for(data: Frames, config: PlannerConfig = PLANNER, seed: int = 3) -> Planner:
    """A loud planner of random weights, its features normalised for ``data``."""
    torch.manual_seed(seed)
    planner = loud_planner(Planner(config.size))
    objective.set_statistics(planner, data, config.sampling, torch.Generator().manual_seed(0), count=512)
    return planner.eval().requires_grad_(False)


def loud_planner(planner: Planner) -> Planner:
    """Random weights where a network begins with none, and louder last layers."""
    with torch.no_grad():
        for module in planner.modules():
            if isinstance(module, Residual):
                module.second.weight.normal_(std=0.1)
        for network in (planner.prior, planner.posterior, planner.decoder):
            network[-1].weight.mul_(3.0)
    return planner


def silence(model: DCMoE) -> DCMoE:
    """The same network with its last layer at zero: its output is the means that its buffers hold."""
    with torch.no_grad():
        model.network.experts[2].linear.weight.zero_()
        model.network.experts[2].linear.bias.zero_()
    return model


def write_run(folder: Path, model: nn.Module, config: object = CONFIG, step: int = 20) -> Path:
    """A run folder as a training of ``model`` leaves it."""
    folder.mkdir()
    parts = {"model": model, "ema": loop.moving_average(model, 0.9)}
    checkpoint.save(folder, checkpoint.TrainingState(parts), step, config)
    return folder


def steering(data: Frames, rows: Rows) -> Control:
    """What steers the next step of each row."""
    base = base_window(data, rows, 1)
    turned, placed = true_poses(data, rows.gaps, rows.gaps.steps[:, None])
    return control(data, rows, base[0], base[1], turned[:, 0], placed[:, 0])


def coming(data: Frames, rows: Rows, frame: Tensor, origin: Tensor) -> Truth:
    """What the next step of each row should give, in its root frame."""
    turned, placed = true_poses(data, rows.gaps, torch.stack([rows.gone, rows.gone + 1], dim=1))
    return truth(data, rows, turned[:, 1], placed[:, 1], placed[:, 0], frame, origin)
