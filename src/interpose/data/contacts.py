"""Which of the four foot joints rest on the ground in each frame, and how far feet slide.

:func:`by_speed` is the rule of the LaFAN1 benchmark and of the RMIB family (docs/method.md, B1): a joint that moves by
less than a squared 0.02 cm^2 a frame is in contact, at whatever height. :func:`detect` is the rule for training
(docs/method.md, C2): slower than 0.15 m/s and within 3 cm of the joint's resting height, then the median of five
frames. It is looser in speed, so that a foot that rolls stays down, and stricter in height, so that a foot held still
in the air does not count.

:func:`foot_slide` is v (2 - 2^(h/H)), H = 2.5 cm, of Zhang et al. 2018 (`Mode-Adaptive Neural Networks`), averaged as
by RSMT (Tang et al. 2023): over the samples whose weight is above zero.

Heights are above the floor at y = 0; what stands on a box is not in contact. All positions are metres, Y up.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import median_filter

from interpose.skeleton import HUMANOID

JOINTS = ("LeftFoot", "LeftToe", "RightFoot", "RightToe")
"""The joints of the four columns, here and in a database."""

INDICES = tuple(HUMANOID.index(name) for name in JOINTS)

REST_HEIGHTS = np.array([0.075, 0.015, 0.075, 0.015])
"""Height of each joint above the floor when the foot is flat on it, metres."""

BENCHMARK_SPEED = float(np.sqrt(0.02) / 100.0 * 30.0)
"""0.1414 cm a frame at 30 Hz, as m/s."""

SLIDE_HEIGHT = 0.025
"""H of foot slide, metres: a toe higher than this is not in contact."""

SPEED = 0.15
CLEARANCE = 0.03
MEDIAN_FRAMES = 5


def by_speed(positions: Float[ndarray, "frame 22 3"], rate: float) -> Bool[ndarray, "frame 4"]:
    """The benchmark's contacts: speed to the next frame below 4.24 cm/s; the last frame repeats the one before it."""
    if len(positions) == 1:
        return np.ones((1, len(JOINTS)), dtype=bool)
    step = np.linalg.norm(np.diff(positions[:, INDICES], axis=0), axis=-1) * rate
    still = step < BENCHMARK_SPEED
    return np.concatenate([still, still[-1:]])


def detect(positions: Float[ndarray, "frame 22 3"], rate: float) -> Bool[ndarray, "frame 4"]:
    """Contacts for training, from global positions at ``rate`` Hz. A single frame is judged by its heights alone."""
    feet = positions[:, INDICES]
    step = np.gradient(feet, axis=0) if len(feet) > 1 else np.zeros_like(feet)
    speed = np.linalg.norm(step, axis=-1) * rate
    down = (speed < SPEED) & (feet[..., 1] < REST_HEIGHTS + CLEARANCE)
    return median_filter(down.astype(np.uint8), size=(MEDIAN_FRAMES, 1), mode="nearest").astype(bool)


def slide_weight(height: Float[ndarray, "*batch"]) -> Float[ndarray, "*batch"]:
    """``2 - 2^(h/H)`` with h kept in [0, H]: one at and below the floor, zero from H upwards. Metres."""
    return np.asarray(2.0 - np.exp2(np.clip(height / SLIDE_HEIGHT, 0.0, 1.0)))


def foot_slide(toes: Float[ndarray, "*batch frame toe 3"]) -> tuple[Float[ndarray, "*batch"], Int[ndarray, "*batch"]]:
    """The toes' weighted travel in centimetres, and the samples in contact; their ratio is centimetres a frame.

    ``toes``: global positions in metres over a floor at height 0. A sample is a toe in a frame after the first; it
    moves by its 3-D displacement since the frame before, weighted by its height.
    """
    weight = slide_weight(toes[..., 1:, :, 1])
    travel = 100.0 * np.linalg.norm(np.diff(toes, axis=-3), axis=-1) * weight
    return np.asarray(travel.sum(axis=(-2, -1))), np.asarray(np.count_nonzero(weight, axis=(-2, -1)))
