from __future__ import annotations

import numpy as np

from interpose import Motion, Skeleton, rotation
from interpose.skeleton import HUMANOID


def walk(frames: int = 20) -> Motion:
    """A character that glides 1.5 m along +Z and swings its legs."""
    turned = np.tile(rotation.IDENTITY, (frames, 22, 1))
    swing = 0.4 * np.sin(np.linspace(0.0, 2.0 * np.pi, frames))
    for name, sign in (("LeftUpLeg", 1.0), ("RightUpLeg", -1.0)):
        turned[:, HUMANOID.index(name)] = rotation.from_rotation_vector(sign * swing[:, None] * np.array([1.0, 0, 0]))
    root = np.stack([np.zeros(frames), np.full(frames, 0.952), np.linspace(0.0, 1.5, frames)], axis=1)
    return Motion(HUMANOID, root, turned, 30.0)


def snake(frames: int) -> Motion:
    """A chain of bones without limbs."""
    names = tuple(f"bone{k}" for k in range(6))
    skeleton = Skeleton(names, (-1, 0, 1, 2, 3, 4), np.array([[0.0, 0.0, 0.0], *[[0.0, 0.0, 0.3]] * 5]))
    bend = 0.3 * np.sin(np.arange(frames)[:, None] + np.arange(6)[None, :])
    turned = rotation.from_rotation_vector(bend[..., None] * np.array([0.0, 1.0, 0.0]))
    return Motion(skeleton, np.tile([0.0, 0.1, 0.0], (frames, 1)), turned, 24.0)
