"""The root of a frame: its position on the ground and the direction that it faces.

Ground coordinates are (x, z). A facing is a unit vector (x, z); yaw is the angle about +Y from +Z towards +X.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.lib.stride_tricks import sliding_window_view

from interpose import rotation
from interpose.skeleton import HUMANOID

SMOOTHING_SECONDS = 2.0

_LEFT = tuple(HUMANOID.index(name) for name in ("LeftUpLeg", "LeftArm"))
_RIGHT = tuple(HUMANOID.index(name) for name in ("RightUpLeg", "RightArm"))


def trajectory(positions: Float[ndarray, "frame 22 3"], rate: float) -> Float[ndarray, "frame 4"]:
    """Root of every frame, (x, z, facing x, facing z), from global positions in metres at ``rate`` Hz.

    As in AI4Animation's root module, which the DC-MoE paper builds on (section 3.1, the set X^R): the hips on the
    ground, and :func:`facing` smoothed over two seconds. Where a single pose has to do, use :func:`pose_yaw`.
    """
    return np.concatenate([positions[:, 0, [0, 2]], smooth(facing(positions), rate)], axis=-1)


def facing(positions: Float[ndarray, "*batch 22 3"]) -> Float[ndarray, "*batch 2"]:
    """The direction across hips and upper arms, rotated by 90 degrees and not smoothed.

    Its length, at most 1, is the part of that direction in the ground plane; 0 for a character that lies on its side.
    """
    across = positions[..., _LEFT, :] - positions[..., _RIGHT, :]
    side = np.mean(across / np.linalg.norm(across, axis=-1, keepdims=True), axis=-2)
    return np.stack([-side[..., 2], side[..., 0]], axis=-1)


def smooth(directions: Float[ndarray, "frame 2"], rate: float) -> Float[ndarray, "frame 2"]:
    """Unit directions, averaged over a window of two seconds that narrows as they turn faster.

    Gaussian weights are raised to the power of the turning rate: the sway of a standing character is averaged out, and
    a quick turn is followed. Unlike in AI4Animation, short directions count less, and beyond the ends of the clip the
    facing is reflected through the end point, so that a turn goes on there and the ends do not lag.
    """
    half = round(rate * SMOOTHING_SECONDS / 2.0)
    if half == 0:
        return _unit(directions)
    taps = np.arange(-half, half + 1)
    gaussian = np.exp(-((taps / (0.5 * half)) ** 2))

    angles = np.unwrap(yaw(directions))
    angles = np.pad(angles, half + 1, mode="reflect", reflect_type="odd")
    lengths = np.pad(np.linalg.norm(directions, axis=-1), half + 1, mode="reflect") + 1e-9
    rates = np.diff(angles)[:-1] * rate
    certain = np.minimum(lengths[1:-1], lengths[:-2])
    angles, lengths = angles[1:-1], lengths[1:-1]

    def windows(x: Float[ndarray, "padded"]) -> Float[ndarray, "frame tap"]:
        return sliding_window_view(x, len(taps))

    weights = windows(certain) * gaussian
    power = np.abs(np.sum(weights * windows(rates), axis=-1) / np.sum(weights, axis=-1))
    weights = windows(lengths) * gaussian ** power[:, None]
    mean = np.stack([np.sum(weights * windows(f(angles)), axis=-1) for f in (np.sin, np.cos)], axis=-1)
    vanishes = np.linalg.norm(mean, axis=-1) < 1e-6 * np.sum(weights, axis=-1)
    return _unit(np.where(vanishes[:, None], directions, mean))


def yaw(directions: Float[ndarray, "*batch 2"]) -> Float[ndarray, "*batch"]:
    """The angle about +Y of a ground direction (x, z), in (-pi, pi]; +Z is 0 and +X a quarter turn."""
    return np.asarray(np.arctan2(directions[..., 0], directions[..., 1]))


def turned(v: Float[ndarray, "*#batch 2"], yaw: Float[ndarray, "*#batch"] | float) -> Float[ndarray, "*batch 2"]:
    """Ground vectors (x, z) turned about +Y by ``yaw``. Shapes broadcast."""
    sin, cos = np.sin(yaw), np.cos(yaw)
    return np.stack([v[..., 0] * cos + v[..., 1] * sin, v[..., 1] * cos - v[..., 0] * sin], axis=-1)


def pose_yaw(q_hips_world: Float[ndarray, "*batch 4"]) -> Float[ndarray, "*batch"]:
    """The facing of a single pose in (-pi, pi]: the twist about +Y of the hips' global rotation.

    For joint frames as in :data:`~interpose.skeleton.HUMANOID`, where the identity looks along +Z. It is continuous
    while a character lies down and rolls over, and 0 for hips exactly upside down, which have no facing.
    """
    q = rotation.twist(q_hips_world, rotation.UP)
    angle = 2.0 * np.arctan2(q[..., 1], q[..., 3])
    return np.asarray(np.pi - np.remainder(np.pi - angle, 2.0 * np.pi))


def _unit(directions: Float[ndarray, "frame 2"]) -> Float[ndarray, "frame 2"]:
    angle = yaw(directions)
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)
