"""Synthetic clips on LaFAN1's joint names, lying down so that the hips' +Y is not vertical, as LaFAN1's own is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from interpose import io, rotation
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

MakeClip = Callable[..., Motion]


def smooth_clip(frames: int, seed: int = 0) -> Motion:
    """Joints that swing by a few sines each, and a root that wanders: metres, 30 Hz."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames)[:, None, None] / 30.0
    joints = len(HUMANOID)
    swing = 0.3 * np.sin(rng.uniform(1.0, 5.0, (joints, 3)) * time + rng.uniform(0.0, 6.0, (joints, 3)))
    local = rotation.from_rotation_vector(swing)
    lying = rotation.from_rotation_vector(np.array([np.pi / 2.0, 0.0, 0.0]))
    local[:, 0] = rotation.multiply(local[:, 0], lying)
    root = np.cumsum(rng.normal(0.01, 0.01, (frames, 3)), axis=0) * np.array([1.0, 0.1, 1.0]) + np.array(
        [3.0, 0.9, -2.0]
    )
    return Motion(HUMANOID, root, local, 30.0)


@pytest.fixture
def make_clip() -> MakeClip:
    return smooth_clip


@pytest.fixture(scope="session")
def lafan1_like(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one training file and two test files."""
    folder = tmp_path_factory.mktemp("lafan1")
    for seed, (name, frames) in enumerate(
        [("walk1_subject1", 140), ("fall1_subject5", 150), ("ground1_subject5", 131)]
    ):
        io.write(folder / f"{name}.bvh", smooth_clip(frames, seed))
    return folder
