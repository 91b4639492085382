"""Batches of poses as the networks take them, and interpolation between two, on the 22 joints at 30 Hz."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.features import POSE
from interpose.rotation import FORWARD, UP
from interpose.skeleton import HUMANOID

PARENTS = HUMANOID.parents
Path = Float[ndarray, "_ 3"]
"""The root's path on the ground at 30 Hz: x, z in metres and yaw in radians, unwrapped, both keys included."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A batch of poses as the step takes them. rotations: ``q_world_joint`` as 6-D. facing: of the hips, (x, z)."""

    hips: Float[ndarray, "*batch 3"]
    rotations: Float[ndarray, "*batch 22 6"]
    positions: Float[ndarray, "*batch 22 3"]
    facing: Float[ndarray, "*batch 2"]


def pose_of(root: Float[ndarray, "*batch 3"], local: Float[ndarray, "*batch 22 4"]) -> Pose:
    """Poses of :data:`~interpose.skeleton.HUMANOID` from hips positions and local rotations."""
    world = kinematics.global_rotations(local, PARENTS)
    positions = kinematics.global_positions(root, world, PARENTS, HUMANOID.offsets)
    facing = rotation.rotate(rotation.twist(world[..., 0, :], UP), FORWARD)[..., ::2]
    return Pose(root, rotation.to_6d(world), positions, facing)


def interpolation(
    start: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: int,
) -> Float[ndarray, "batch time pose"]:
    """The base A from start to target, both included (frames + 2): hips linear, rotations SLERPed, as (hips, 6-D)."""
    t = np.linspace(0.0, 1.0, frames + 2)
    root = start[0][:, None] + t[:, None] * (target[0] - start[0])[:, None]
    local = rotation.slerp(start[1][:, None], target[1][:, None], t[:, None])
    six = rotation.to_6d(kinematics.global_rotations(local, PARENTS))
    return np.concatenate([root, six.reshape(*six.shape[:2], -1)], axis=-1)


def local_of(six: Float[ndarray, "*batch 22 6"]) -> Float[ndarray, "*batch 22 4"]:
    """Local rotations from global ones as 6-D."""
    return kinematics.local_rotations(rotation.from_6d(six), PARENTS)


def continued(
    start: Float[ndarray, "batch joint 4"], local: Float[ndarray, "batch frame joint 4"]
) -> Float[ndarray, "batch frame joint 4"]:
    """``local`` with signs that continue from the start key's without a jump."""
    whole = np.concatenate([start[:, None], local], axis=1)
    return rotation.continuous(whole.swapaxes(0, 1)).swapaxes(0, 1)[:, 1:]


def last(context: Pose) -> Pose:
    """The last frame of poses (batch, frame, ...)."""
    return Pose(context.hips[:, -1], context.rotations[:, -1], context.positions[:, -1], context.facing[:, -1])


def bases(
    start: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: list[int],
) -> Float[ndarray, "batch time pose"]:
    """Each row's :func:`interpolation`; after a shorter one its target stands still."""
    longest = max(frames, default=0)
    out = np.empty((len(frames), longest + 2, POSE))
    for length in set(frames):
        rows = [row for row, n in enumerate(frames) if n == length]
        made = interpolation((start[0][rows], start[1][rows]), (target[0][rows], target[1][rows]), length)
        out[rows, : length + 2] = made
        out[rows, length + 2 :] = made[:, -1:]
    return out
