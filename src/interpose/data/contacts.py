"""Contacts of the four foot joints with the ground, and foot slide.

Positions are metres, Y up; the floor is at y = 0, so a foot on a box is not in contact.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import median_filter

from interpose.skeleton import HUMANOID

CONTACT_JOINTS = ("LeftFoot", "LeftToe", "RightFoot", "RightToe")
"""The joints of the four columns, here and in a database."""
CONTACT_INDICES = tuple(HUMANOID.index(name) for name in CONTACT_JOINTS)
REST_HEIGHTS = np.array([0.075, 0.015, 0.075, 0.015])
"""Height of each joint above the floor when the foot is flat on it, metres."""
BENCHMARK_SPEED = float(np.sqrt(0.02) / 100.0 * 30.0)
"""Metres a second: the LaFAN1 benchmark's squared 0.02 cm^2 a frame at 30 Hz (Harvey et al. 2020)."""
SLIDE_HEIGHT = 0.025
"""H of foot slide, metres: a toe higher than this is not in contact."""
CONTACT_SPEED = 0.15
"""Metres a second: looser than the benchmark's, so that a foot that rolls stays in contact."""
CONTACT_CLEARANCE = 0.03
"""Metres above the joint's resting height: a foot that is held still in the air is not in contact."""
CONTACT_MEDIAN_FRAMES = 5


def detect(positions: Float[ndarray, "frame 22 3"], rate: float) -> Bool[ndarray, "frame 4"]:
    """Contacts for training, from global positions at ``rate`` Hz: slow and low, then a median over five frames.

    A single frame is judged by its heights alone.
    """
    feet = positions[:, CONTACT_INDICES]
    step = np.gradient(feet, axis=0) if len(feet) > 1 else np.zeros_like(feet)
    speed = np.linalg.norm(step, axis=-1) * rate
    down = (speed < CONTACT_SPEED) & (feet[..., 1] < REST_HEIGHTS + CONTACT_CLEARANCE)
    return median_filter(down.astype(np.uint8), size=(CONTACT_MEDIAN_FRAMES, 1), mode="nearest").astype(bool)


def slide_weight(height: Float[ndarray, "*batch"]) -> Float[ndarray, "*batch"]:
    """``2 - 2^(h/H)`` with h clipped to [0, H] metres: one at and below the floor, zero from H upwards."""
    return np.asarray(2.0 - np.exp2(np.clip(height / SLIDE_HEIGHT, 0.0, 1.0)))


def foot_slide(toes: Float[ndarray, "*batch frame toe 3"]) -> tuple[Float[ndarray, "*batch"], Int[ndarray, "*batch"]]:
    """The toes' weighted travel in centimetres, and the number of samples in contact; their ratio is the foot slide.

    ``toes``: global positions in metres. A sample is a toe in a frame after the first; its travel is the 3-D
    displacement since the frame before, weighted by height: v (2 - 2^(h/H)) of Zhang et al. 2018 (`Mode-Adaptive Neural
    Networks`), averaged as in RSMT (Tang et al. 2023) over the samples of a weight above zero.
    """
    weight = slide_weight(toes[..., 1:, :, 1])
    travel = 100.0 * np.linalg.norm(np.diff(toes, axis=-3), axis=-1) * weight
    return np.asarray(travel.sum(axis=(-2, -1))), np.asarray(np.count_nonzero(weight, axis=(-2, -1)))
