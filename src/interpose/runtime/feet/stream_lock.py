"""Feet that stay where they stand, one frame at a time: for streams, which do not know what comes.

While the network says that a foot is in contact, what its toe (or its heel, where that stands alone) moves along the
ground is taken back; the hold comes within :data:`RAMP` frames and, once the foot is lifted, too much is asked or the
target is near, fades within :data:`RELEASE`. Both keep the foot's velocity free of jumps. Analytic inverse kinematics
of two bones moves the leg (`limb`); the foot keeps its direction. `feet` does more, knowing a whole transition.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.runtime.ik.two_bone import soft_reach, two_bone_ik
from interpose.skeleton import HUMANOID

ON, OFF = 0.6, 0.4
"""Probabilities at which a contact begins and ends."""
SLOW = 0.05
"""Metres a frame below which a foot must have come before it is held."""
RAMP = 3.0
RELEASE = 8.0
REACH = 0.12
"""Metres by which a foot is moved at most; farther, it is let go until its next contact."""

_CHAINS = np.array([[HUMANOID.index(s + n) for n in ("UpLeg", "Leg", "Foot", "Toe")] for s in ("Left", "Right")])
_HIPS = HUMANOID.index("Hips")
_LENGTH = float(np.linalg.norm(HUMANOID.offsets[_CHAINS[0, 1:3]], axis=1).sum())
_FORWARD, _GROUND = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 1.0])


class FootLock:
    """The feet of ``rows`` characters, and by how much they are moved."""

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
        """The next frame's local rotations with held feet; ``frames_left`` is that of the frame before."""
        world = kinematics.global_rotations(local, HUMANOID.parents)
        placed = kinematics.global_positions(hips, world, HUMANOID.parents, HUMANOID.offsets)
        legs = placed[:, _CHAINS]
        self._move(legs[:, :, 2:], contacts.reshape(-1, 2, 2), frames_left)
        rows, sides = np.nonzero(np.abs(self._moved).max(axis=-1) > 1e-6)
        if not len(rows):
            return local
        chains = _CHAINS[sides]
        hip, knee, ankle = (legs[rows, sides, i] for i in range(3))
        turned = world[rows[:, None], chains[:, :3]]
        way = ankle + self._moved[rows, sides] - hip
        wanted, present = np.linalg.norm(way, axis=-1), np.linalg.norm(ankle - hip, axis=-1)
        way = way * (soft_reach(wanted, present, _LENGTH) / np.maximum(wanted, 1e-9))[:, None]
        forward = rotation.rotate(turned[:, 0], np.broadcast_to(_FORWARD, hip.shape))
        turns = np.stack(two_bone_ik(hip, knee, ankle, hip + way, forward), axis=1)
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
        """By how much each foot is moved in this frame, from where ankles and toes are and the odds that they stand."""
        surest = contacts.max(axis=-1)
        down = np.where(self._down, surest > OFF, surest > ON)
        self._spent &= down
        late = frames_left[:, None] <= RELEASE
        point = np.where(contacts[..., 1] >= OFF, 1, 0)
        way = np.zeros_like(self._moved)
        if self._last is not None:
            way = np.take_along_axis(places - self._last, point[..., None, None], axis=2)[:, :, 0] * _GROUND
        slow = (self._hold > 0.0) | (np.linalg.norm(way, axis=-1) < SLOW)
        held = down & slow & ~self._spent & ~late
        self._hold = np.where(held, np.minimum(self._hold + 1.0 / RAMP, 1.0), 0.0)
        # Without a hold the correction follows the cubic to nil and rest.
        self._fade = np.where(held, RELEASE, np.minimum(self._fade, frames_left[:, None]))
        time = np.maximum(self._fade, 1.0)[..., None]
        bend = -(3.0 * self._moved + 2.0 * self._speed * time) / time**2
        turn = (2.0 * self._moved + self._speed * time) / time**3
        going = (self._fade > 1.0)[..., None]
        loose = np.where(going, self._speed + bend + turn, -self._moved)
        slower = np.where(going, self._speed + 2.0 * bend + 3.0 * turn, 0.0)
        hold = self._hold[..., None]
        moved = self._moved + hold * -way + (1.0 - hold) * loose
        self._speed = hold * -way + (1.0 - hold) * slower
        self._moved = moved
        self._fade = np.maximum(self._fade - 1.0, 0.0)
        self._spent |= held & (np.linalg.norm(moved, axis=-1) > REACH)
        self._down, self._last = down, places
