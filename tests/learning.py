"""What the tests of training, export and run time share: a database of marching figures, networks of random weights.

The networks are small and loud: their last layer is as wide awake as that of a trained one, so that a wrong feature,
frame or state shows in what they say.
"""

from __future__ import annotations

import math
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from numpy import ndarray
from torch import Tensor

from interpose import rotation
from interpose.data import database, root
from interpose.data.database import ClipArrays, ClipInfo, Database
from interpose.features import CHANNELS, RATE
from interpose.models.dcmoe import Control, DCMoE
from interpose.models.layers import Residual
from interpose.models.planner import GapPlan, PlanSize
from interpose.motion import Motion
from interpose.skeleton import HUMANOID
from interpose.train.common import checkpoint, loop
from interpose.train.common.frames import Frames, load_frames
from interpose.train.dcmoe import recipe
from interpose.train.dcmoe.config import size_of
from interpose.train.dcmoe.sequences import Rows, Truth, base_window, control, poses, truth
from interpose.train.planner import objective

STYLES = ("Old", "Young")
LENGTHS = (150, 90, 120)
"""Frames of the clips: Old, Young, Old."""
CONFIG = recipe.Config(
    preset="tiny",
    experts=2,
    hidden=16,
    gate=(16, 8),
    planner=None,
    databases=("synthetic 1234",),
    styles=STYLES,
    phases=True,
    licence="CC BY 4.0",
)
PLANNED = replace(CONFIG, planner=PlanSize(latent=8, hidden=32, depth=1, styles=len(STYLES)))
"""The same with a planner."""


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


def network_for(data: Frames, absolute: bool = False, config: recipe.Config = CONFIG) -> DCMoE:
    """A loud network of random weights, its features normalised for ``data``."""
    torch.manual_seed(3)
    model = DCMoE(replace(size_of(asdict(config)), absolute=absolute))
    with torch.no_grad():
        model.network.experts[2].linear.weight.mul_(1.0 if absolute else 8.0)
        model.network.experts[2].linear.bias.normal_(std=0.3)
        model.network.gate[-1].weight.mul_(20.0)
    generator = torch.Generator().manual_seed(0)
    if model.planner is not None:
        _wake(model.planner)
        objective.set_statistics(model.planner, data, config.sampling, generator, count=512)
    recipe.set_statistics(model, data, config, generator, count=512)
    return model.eval().requires_grad_(False)


def _wake(planner: GapPlan) -> None:
    """Random weights where a network begins with none, and louder last layers."""
    with torch.no_grad():
        for module in planner.modules():
            if isinstance(module, Residual):
                module.second.weight.normal_(std=0.1)
        for network in (planner.prior, planner.posterior, planner.decoder):
            network[-1].weight.mul_(3.0)


def silence(model: DCMoE) -> DCMoE:
    """The same network with its last layer at zero: it says the means that its buffers hold."""
    with torch.no_grad():
        model.network.experts[2].linear.weight.zero_()
        model.network.experts[2].linear.bias.zero_()
    return model


def write_run(folder: Path, model: DCMoE, config: recipe.Config = CONFIG, step: int = 20) -> Path:
    """A run folder as a training of ``model`` leaves it."""
    folder.mkdir()
    parts = {"model": model, "ema": loop.moving_average(model, 0.9)}
    checkpoint.save(folder, checkpoint.State(parts), step, config)
    return folder


def steering(data: Frames, rows: Rows) -> Control:
    """What steers the next step of each row."""
    base = base_window(data, rows, 1)
    turned, placed = poses(data, rows.start, rows.total, rows.keys, rows.total[:, None])
    return control(data, rows, base[0], base[1], turned[:, 0], placed[:, 0])


def coming(data: Frames, rows: Rows, frame: Tensor, origin: Tensor) -> Truth:
    """What the next step of each row should give, in its root frame."""
    turned, placed = poses(data, rows.start, rows.total, rows.keys, torch.stack([rows.gone, rows.gone + 1], dim=1))
    return truth(data, rows, turned[:, 1], placed[:, 1], placed[:, 0], frame, origin)
