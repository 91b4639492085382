"""What a style is told from: windows of poses and velocities, each frame seen from its own root.

Joints are relative to the hips' place on the ground and to where the hips face (`interpose.data.root.pose_yaw`, which
needs one pose alone, so that generated frames are seen as recorded ones are), so neither place nor direction shows.
Velocities are those over the ground, in the same frame; the root's own motion is in them.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Float32, Int64
from numpy import ndarray

from interpose import skeleton as kinematics
from interpose.data.database import RATE, Database
from interpose.data.root import pose_yaw, turned
from interpose.skeleton import HUMANOID, MIRROR

CHANNELS = 2 * 3 * len(HUMANOID)
"""Of a frame: positions in metres, then velocities in metres a second."""
MIRRORED: list[int] = [66 * kind + 3 * joint + axis for kind in range(2) for joint in MIRROR for axis in range(3)]
"""The channels of a frame's mirror image, in order; :data:`SIGNS` turn what points sideways."""
SIGNS: list[float] = [-1.0, 1.0, 1.0] * (2 * len(HUMANOID))


def seen(
    root: Float[ndarray, "*batch frame 3"], local: Float[ndarray, "*batch frame 22 4"]
) -> Float32[ndarray, "*batch frame 132"]:
    """The channels of each frame of motions, hips positions and local rotations, of two frames or more.

    The first frame has the velocity of the second.
    """
    world = kinematics.global_rotations(local, HUMANOID.parents)
    positions = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)
    steps = np.diff(positions, axis=-3) * RATE
    velocities = np.concatenate([steps[..., :1, :, :], steps], axis=-3)
    back = -pose_yaw(world[..., 0, :])[..., None]
    placed = positions.copy()
    placed[..., ::2] = turned(positions[..., ::2] - root[..., None, ::2], back)
    velocities[..., ::2] = turned(velocities[..., ::2], back)
    both = np.stack([placed, velocities], axis=-3)
    return both.reshape(*both.shape[:-3], CHANNELS).astype(np.float32)


def seen_of(database: Database) -> Float32[ndarray, "frame 132"]:
    """The channels of every frame of a database; zeros for clips of one frame, which have no velocity."""
    out = np.zeros((database.frames, CHANNELS), dtype=np.float32)
    for start, stop in database.ranges.tolist():
        if stop - start > 1:
            motion = database.motion(start, stop)
            out[start:stop] = seen(motion.root_positions, motion.local_rotations)
    return out


def starts(ranges: list[tuple[int, int]], length: int, offset: int) -> Int64[ndarray, "window"]:
    """First frames of the windows in those ranges [start, stop): one each ``offset`` frames, and one flush with the
    end; none in a range that is shorter than a window."""
    found: list[int] = []
    for start, stop in ranges:
        if stop - start >= length:
            found += [*range(start, stop - length, offset), stop - length]
    return np.array(found, dtype=np.int64)
