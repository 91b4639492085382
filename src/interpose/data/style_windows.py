"""The inputs of the style classifier: windows of joint positions and velocities, each frame relative to its own root.

The root is that of a single pose (`interpose.data.root.pose_yaw`), so that generated frames are treated like recorded
ones. Velocities are over the ground, turned into the root's frame, so they include the root's motion.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Int64
from numpy import ndarray

from interpose import skeleton as kinematics
from interpose.data.database import Database
from interpose.data.root import pose_yaw, turned
from interpose.skeleton import HUMANOID, MIRROR, MODEL_RATE

STYLE_CHANNELS = 2 * 3 * len(HUMANOID)
"""Of a frame: positions in metres, then velocities in metres a second."""
MIRRORED_CHANNELS = [66 * half + 3 * joint + axis for half in range(2) for joint in MIRROR for axis in range(3)]
"""The channels of a frame's mirror image, in order; :data:`MIRROR_SIGNS` flip the sideways axis."""
MIRROR_SIGNS = [-1.0, 1.0, 1.0] * (2 * len(HUMANOID))


def style_channels(
    root: Float[ndarray, "*batch frame 3"], local: Float[ndarray, "*batch frame 22 4"]
) -> Float32[ndarray, "*batch frame 132"]:
    """The channels of each frame, from hips positions and local rotations; at least two frames.

    The first frame has the velocity of the second.
    """
    world = kinematics.global_rotations(local, HUMANOID.parents)
    positions = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)
    steps = np.diff(positions, axis=-3) * MODEL_RATE
    velocities = np.concatenate([steps[..., :1, :, :], steps], axis=-3)
    back = -pose_yaw(world[..., 0, :])[..., None]
    placed = positions.copy()
    placed[..., ::2] = turned(positions[..., ::2] - root[..., None, ::2], back)
    velocities[..., ::2] = turned(velocities[..., ::2], back)
    both = np.stack([placed, velocities], axis=-3)
    return both.reshape(*both.shape[:-3], STYLE_CHANNELS).astype(np.float32)


def database_channels(database: Database) -> Float32[ndarray, "frame 132"]:
    """The channels of every frame of a database; zeros for clips of one frame, which have no velocity."""
    out = np.zeros((database.frames, STYLE_CHANNELS), dtype=np.float32)
    for start, stop in database.ranges.tolist():
        if stop - start > 1:
            motion = database.motion(start, stop)
            out[start:stop] = style_channels(motion.root_positions, motion.local_rotations)
    return out


def window_starts(ranges: list[tuple[int, int]], length: int, offset: int) -> Int64[ndarray, "window"]:
    """First frames of the windows in ranges [start, stop): one every ``offset`` frames, and one flush with the end.

    A range that is shorter than a window has none.
    """
    found: list[int] = []
    for start, stop in ranges:
        if stop - start >= length:
            found += [*range(start, stop - length, offset), stop - length]
    return np.array(found, dtype=np.int64)
