"""From a user's frame rate to the model's and back, both ends of the gap kept.

A gap of n frames at rate r lasts T = (n + 1) / r seconds and takes m = round(30 T) steps of the model, at least one.
The model's frame k stands at k T / m, so that start and target lie on both grids at any rate: a step lasts T / m, which
differs from 1/30 s by at most 1 / (2 m) of itself. Back at the user's rate the frames are read from a cubic spline
through the model's frames (two continuous derivatives); where the two grids coincide they are taken as they are.
Rotations are splined as sign-continuous quaternions and normalised: at steps as small as those of 30 Hz this stands in
for a spline on the sphere, and one solve serves all joints.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import CubicSpline

from interpose import rotation
from interpose.motion import Motion, sample
from interpose.skeleton import MODEL_RATE

CONTEXT = 10
"""Known frames at that rate, the start key included, that a model is shown at most."""


def model_steps(frames: int, rate: float) -> int:
    """Steps of the model from start to target over a gap of ``frames`` frames at ``rate``; at least 1."""
    return max(1, int(np.floor(MODEL_RATE * (frames + 1) / rate + 0.5)))


def user_frames(steps: int, rate: float) -> int:
    """Frames of a gap at ``rate`` that last nearest to that many steps of the model; at least 1."""
    return max(1, round(steps * rate / MODEL_RATE) - 1)


def recent(motion: Motion, count: int) -> Motion:
    """The last frames of ``motion`` at the model's rate, at most ``count``, the last of them the last frame itself."""
    step = motion.rate / MODEL_RATE
    available = int(np.floor((len(motion) - 1) / step + 1e-6)) + 1
    times = len(motion) - 1 - np.arange(min(count, available))[::-1] * step
    near = np.round(times)
    return sample(motion, np.where(np.abs(times - near) < 1e-6, near, times))


def to_user_rate(
    root: Float[ndarray, "known 3"], local: Float[ndarray, "known joint 4"], context: int, frames: int, rate: float
) -> tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame joint 4"]]:
    """Start, the ``frames`` frames between and target at the user's rate: frames + 2 in all.

    ``root`` and ``local`` hold ``context`` frames before the start at 30 Hz, which give the spline its slope there, the
    start, the model's frames and the target.
    """
    steps = len(root) - context - 1
    if steps == frames + 1:
        return root[context:], local[context:]
    lasts = (frames + 1) / rate
    known = np.concatenate([np.arange(-context, 0) / MODEL_RATE, np.arange(steps + 1) * (lasts / steps)])
    times = np.arange(frames + 2) * (lasts / (frames + 1))
    between = CubicSpline(known, root)(times), CubicSpline(known, rotation.continuous(local))(times)
    turned = between[1] / np.linalg.norm(between[1], axis=-1, keepdims=True)
    # The ends are the keys themselves, free of the spline's rounding.
    between[0][[0, -1]], turned[[0, -1]] = root[[context, -1]], local[[context, -1]]
    return between[0], turned
