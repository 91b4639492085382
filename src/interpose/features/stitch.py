"""What stitching from both ends means, apart from any network: who makes which frame, led to what, and how two chains
become one (Ren et al. 2024, sections 3.2 and 3.3). Training and run time share it.

A gap has ``steps`` intervals: frame 0 is the start key, frame ``steps`` the target key. The forward chain makes the
frames up to the middle and ``buffer`` beyond, the backward chain those down to the middle and as many beyond, in turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import JOINTS, POSE

SEAM_FRAMES = 6
"""Frames to either side of the seam that are smoothed, less and less."""
STANDING = (0.13, 0.05, 0.13, 0.05)
"""Metres below which ankle and toe of a lone key count as in contact."""


@dataclass(frozen=True)
class Move:
    """One frame made. made: which. left: the frames from the one it follows to ``aim``, what it is led to.

    to_key: whether that is the other key, and not the newest frame of the other chain.
    """

    backward: bool
    made: int
    left: int
    aim: int
    to_key: bool


@dataclass(frozen=True)
class Seam:
    """Where the chains end. forward: the last frame that the forward chain makes. backward: the backward chain's.
    middle: L/2, where MMPE is measured (equation 13)."""

    forward: int
    backward: int
    middle: int

    @property
    def overlap(self) -> range:
        """The frames that both chains make."""
        return range(self.backward, self.forward + 1)


def seam(steps: int, buffer: int, both: bool = True) -> Seam:
    """Where the chains of a gap end; one chain alone makes everything.

    The buffer is at most a quarter of the gap. It is K of section 3.2: the chains share 2K frames.
    """
    middle = steps // 2
    if not both:
        return Seam(steps - 1, steps, middle)
    k = min(buffer, (steps + 1) // 4)
    return Seam(middle + k, middle - k + 1, middle)


@lru_cache
def schedule(steps: int, buffer: int, aligned: bool = True, both: bool = True) -> tuple[Move, ...]:
    """The frames of a gap in the order in which they are made.

    aligned: bi-directional aligning (equation 3): each chain is led to the newest frame of the other until it has
    passed that, then to the other key. Otherwise always to the other key. both: False for the forward chain alone.
    """
    ends = seam(steps, buffer, both)
    moves: list[Move] = []
    front, back = 0, steps
    while front < ends.forward or back > ends.backward:
        if front < ends.forward:
            to_key = not aligned or front >= back
            aim = steps if to_key else back
            moves.append(Move(False, front + 1, aim - front, aim, to_key or back == steps))
            front += 1
        if back > ends.backward:
            to_key = not aligned or back <= front
            aim = 0 if to_key else front
            moves.append(Move(True, back - 1, back - aim, aim, to_key or front == 0))
            back -= 1
    return tuple(moves)


@lru_cache
def shares(steps: int, buffer: int, both: bool = True) -> Float[ndarray, "frame"]:
    """How much of each frame from start to target is the backward chain's: 0, linear over the overlap, then 1."""
    ends = seam(steps, buffer, both)
    out = np.zeros(steps + 1)
    out[ends.forward + 1 :] = 1.0
    shared = list(ends.overlap)
    out[shared] = np.arange(1, len(shared) + 1) / (len(shared) + 1)
    return out


def smoothed(values: Float[ndarray, "batch frame *channel"], steps: int) -> Float[ndarray, "batch frame *channel"]:
    """Frames with both keys, smoothed where the chains meet: a binomial filter whose share, .6 at most, fades within
    :data:`SEAM_FRAMES` frames of the middle. Short gaps are left as they are."""
    if steps < 3 * SEAM_FRAMES:
        return values
    smooth = values.copy()
    around = [values[:, 2 + shift : values.shape[1] - 2 + shift] for shift in (-2, -1, 0, 1, 2)]
    smooth[:, 2:-2] = sum(w * v for w, v in zip((1 / 16, 4 / 16, 6 / 16, 4 / 16, 1 / 16), around, strict=True))
    away = np.abs(np.arange(steps + 1) - steps // 2 - 0.5) / SEAM_FRAMES
    share = 0.6 * np.cos(0.5 * np.pi * np.minimum(away, 1.0)) ** 2
    share = share.reshape(-1, *[1] * (values.ndim - 2))
    return values + share * (smooth - values)


def memory_shapes(encoder: int, decoder: int) -> dict[str, tuple[int, ...]]:
    """What the generators' LSTMs carry, without the batch axis."""
    return {
        "encoder_hidden": (encoder,),
        "encoder_cell": (encoder,),
        "decoder_hidden": (decoder,),
        "decoder_cell": (decoder,),
    }


DETAIL_SHAPES: dict[str, tuple[int, ...]] = {"hips": (-1, 3), "rotations": (-1, JOINTS, 6), "contacts": (-1, 4)}
"""The inputs of a detail transformer, without the batch axis: a motion of any length (-1) with both its keys."""


def network_shapes(network: dict[str, Any], styles: int) -> dict[str, dict[str, tuple[int, ...]]]:
    """The inputs of a model's networks by name, without the batch axis. network: what its `model.json` says of them.

    First comes a chain's newest frame, then what the step is led to: the aim's pose, the frames left to it, and the
    base (hips, 6-D) at the current frame, the next one and the aim. latent: z of the gap, or the frame's noise. share:
    gamma of equation 2. style: as in `interpose.features.plan`.
    """
    turn = 4 if network["form"] == "paper" else 6  # numbers of a joint's rotation
    step = {
        "hips": (3,),
        "rotations": (JOINTS, turn),
        "positions": (JOINTS, 3),
        "velocities": (JOINTS, 3),
        "known": (1,),
        "contacts": (4,),
        "phase": (4,),
        "aim_hips": (3,),
        "aim_rotations": (JOINTS, turn),
        "aim_positions": (JOINTS, 3),
        "left": (1,),
        "base_here": (POSE,),
        "base_following": (POSE,),
        "base_there": (POSE,),
        **memory_shapes(network["memory"], network["decoder_memory"]),
        "latent": (network["latent"],),
        "share": (1,),
        "style": (styles + 1,),
    }
    return {"front": step, "back": step}
