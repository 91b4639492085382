"""Foot locking one frame at a time, for streams, which do not know what comes.

Analytic inverse kinematics of two bones moves the leg; the foot keeps its direction.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.runtime.ik.two_bone import soft_reach, two_bone_ik
from interpose.skeleton import HUMANOID, LEG_CHAINS, LEG_LENGTH

CONTACT_ON, CONTACT_OFF = 0.6, 0.4
"""Probabilities at which a contact begins and ends."""
SLOWEST_SWING = 0.05
"""Metres a frame: a foot must move less before it is held."""
HOLD_FRAMES = 3.0
"""Frames in which a hold sets in."""
RELEASE_FRAMES = 8.0
"""Frames in which a correction fades once it is released."""
LONGEST_HOLD = 0.12
"""Metres: a foot that needs a longer correction is released until its next contact."""

_HIPS = HUMANOID.index("Hips")
_GROUND = np.array([1.0, 0.0, 1.0])


class FootLock:
    """The feet of ``rows`` characters and their corrections.

    While a foot is in contact, the motion of its toe along the ground is taken back (of its heel, where only that
    stands). The hold sets in within :data:`HOLD_FRAMES`. Once the foot is lifted, its correction is too long or the
    target is near, it fades within :data:`RELEASE_FRAMES`. Neither makes the foot's velocity jump.
    """

    def __init__(self, rows: int) -> None:
        self._moved = np.zeros((rows, 2, 3))
        self._speed = np.zeros((rows, 2, 3))
        self._fade = np.zeros((rows, 2))
        self._hold = np.zeros((rows, 2))
        self._down = np.zeros((rows, 2), dtype=bool)
        self._spent = np.zeros((rows, 2), dtype=bool)
        self._last: Float[ndarray, "row 2 2 3"] | None = None

    def step(
        self,
        hips: Float[ndarray, "row 3"],
        local: Float[ndarray, "row 22 4"],
        contacts: Float[ndarray, "row 4"],
        frames_left: Int[ndarray, "row"],
    ) -> Float[ndarray, "row 22 4"]:
        """The next frame's local rotations with its feet held.

        ``hips``: positions, metres. ``contacts``: probabilities for LeftFoot, LeftToe, RightFoot, RightToe.
        ``frames_left``: from the frame before to the target.
        """
        world = kinematics.global_rotations(local, HUMANOID.parents)
        placed = kinematics.global_positions(hips, world, HUMANOID.parents, HUMANOID.offsets)
        legs = placed[:, LEG_CHAINS]
        self._move(legs[:, :, 2:], contacts.reshape(-1, 2, 2), frames_left)
        rows, sides = np.nonzero(np.abs(self._moved).max(axis=-1) > 1e-6)
        if not len(rows):
            return local
        chains = LEG_CHAINS[sides]
        hip, knee, ankle = (legs[rows, sides, i] for i in range(3))
        turned = world[rows[:, None], chains[:, :3]]
        leg = ankle + self._moved[rows, sides] - hip
        wanted, present = np.linalg.norm(leg, axis=-1), np.linalg.norm(ankle - hip, axis=-1)
        leg = leg * (soft_reach(wanted, present, LEG_LENGTH) / np.maximum(wanted, 1e-9))[:, None]
        forward = rotation.rotate(turned[:, 0], np.broadcast_to(rotation.FORWARD, hip.shape))
        turns = np.stack(two_bone_ik(hip, knee, ankle, hip + leg, forward), axis=1)
        turned[:, :2] = rotation.multiply(turns, turned[:, :2])
        above = np.concatenate([world[rows, _HIPS][:, None], turned[:, :2]], axis=1)
        out = local.copy()
        out[rows[:, None], chains[:, :3]] = rotation.multiply(rotation.inverse(above), turned)
        return out

    def _move(
        self,
        places: Float[ndarray, "row 2 2 3"],
        contacts: Float[ndarray, "row 2 2"],
        frames_left: Int[ndarray, "row"],
    ) -> None:
        """Update the correction of each foot from the positions of its ankle and toe and their contacts."""
        surest = contacts.max(axis=-1)
        down = np.where(self._down, surest > CONTACT_OFF, surest > CONTACT_ON)
        self._spent &= down
        late = frames_left[:, None] <= RELEASE_FRAMES
        point = np.where(contacts[..., 1] >= CONTACT_OFF, 1, 0)
        slip = np.zeros_like(self._moved)
        if self._last is not None:
            slip = np.take_along_axis(places - self._last, point[..., None, None], axis=2)[:, :, 0] * _GROUND
        slow = (self._hold > 0.0) | (np.linalg.norm(slip, axis=-1) < SLOWEST_SWING)
        held = down & slow & ~self._spent & ~late
        self._hold = np.where(held, np.minimum(self._hold + 1.0 / HOLD_FRAMES, 1.0), 0.0)
        # Once released, the correction follows the cubic Hermite curve from its value and speed to zero and rest.
        self._fade = np.where(held, RELEASE_FRAMES, np.minimum(self._fade, frames_left[:, None]))
        time = np.maximum(self._fade, 1.0)[..., None]
        bend = -(3.0 * self._moved + 2.0 * self._speed * time) / time**2
        turn = (2.0 * self._moved + self._speed * time) / time**3
        going = (self._fade > 1.0)[..., None]
        loose = np.where(going, self._speed + bend + turn, -self._moved)
        slower = np.where(going, self._speed + 2.0 * bend + 3.0 * turn, 0.0)
        hold = self._hold[..., None]
        moved = self._moved + hold * -slip + (1.0 - hold) * loose
        self._speed = hold * -slip + (1.0 - hold) * slower
        self._moved = moved
        self._fade = np.maximum(self._fade - 1.0, 0.0)
        self._spent |= held & (np.linalg.norm(moved, axis=-1) > LONGEST_HOLD)
        self._down, self._last = down, places
