"""What a picture needs to know of a motion: its mannequin, its poses, its floor and its direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose.data import contacts, root
from interpose.errors import InputError
from interpose.mannequin import SOLE, Mannequin, mannequin
from interpose.motion import Motion
from interpose.render.drawing import Actor, Colour
from interpose.retarget.mapping import map_skeleton
from interpose.retarget.transfer import to_humanoid


@dataclass(frozen=True, eq=False)
class Cast:
    """A motion with all that is drawn of it; positions and rotations are global, metres.

    coarse: the mesh that casts shadows. floor: its height. track: the root on the ground (x, z). facing: unit vectors
    (x, z). down: whether the left and the right foot are on the ground. The last two are None for a skeleton that is
    not a humanoid.
    """

    motion: Motion
    mannequin: Mannequin
    coarse: Mannequin
    positions: Float[ndarray, "frame joint 3"]
    rotations: Float[ndarray, "frame joint 4"]
    floor: float
    track: Float[ndarray, "frame 2"]
    facing: Float[ndarray, "frame 2"] | None
    down: Bool[ndarray, "frame 2"] | None

    def actor(self, frame: int, colour: Colour, moved: Float[ndarray, "3"]) -> Actor:
        """The character at a frame, moved by ``moved`` metres."""
        return Actor(self.mannequin, self.coarse, self.positions[frame] + moved, self.rotations[frame], colour)

    def heading(self) -> Float[ndarray, "3"]:
        """The direction that a camera should see as screen right: that of travel, turned a little towards the viewer.

        A character that stays within half a metre is seen from the front, somewhat from the side.
        """
        travel = self.track[-1] - self.track[0]
        if np.linalg.norm(travel) > 0.5:
            x, z = root.turned(travel, np.deg2rad(24.0))
        else:
            x, z = root.turned(np.array([0.0, 1.0]) if self.facing is None else self.facing[0], np.deg2rad(58.0))
        return np.array([x, 0.0, z]) / np.hypot(x, z)


def cast(motion: Motion) -> Cast:
    """Prepares a motion for drawing. Raises InputError for a motion without frames."""
    if len(motion) == 0:
        raise InputError("a motion without frames cannot be drawn; give at least one frame")
    positions = motion.global_positions()
    facing = down = None
    hips = 0
    try:
        found = map_skeleton(motion)
        human = to_humanoid(motion, found).global_positions()
    except InputError:
        pass
    else:
        hips = found.hips
        facing = root.facing(human)
        joints = contacts.detect(human, motion.rate)
        down = np.stack([joints[:, :2].any(axis=1), joints[:, 2:].any(axis=1)], axis=1)
    lowest = float(np.percentile(positions[..., 1].min(axis=1), 5)) - SOLE
    floor = 0.0 if abs(lowest) < 0.10 else lowest
    track = positions[:, hips][:, [0, 2]]
    shapes = mannequin(motion, detail=4), mannequin(motion, detail=2)
    return Cast(motion, *shapes, positions, motion.global_rotations(), floor, track, facing, down)
