"""The plan of a gap: a few poses, evenly spaced in time, as offsets from interpolation, and the spline through them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.interpolate import CubicSpline

from interpose.features import JOINTS

ANCHORS = 8
"""Poses of a plan, the two keys not counted."""
LONGEST_PLAN_STEPS = 92
"""Steps from start to target that the planner is trained for."""

_SPLINE = CubicSpline(np.linspace(0.0, 1.0, ANCHORS + 2), np.eye(ANCHORS + 2)[:, 1:-1], axis=0, bc_type="natural")
SPLINE_PIECES: Float[ndarray, "power piece anchor"] = _SPLINE.c
"""Coefficients of the spline, the cubic's first, over the time since a piece's beginning; a gap has length 1."""


@lru_cache
def anchor_weights(steps: int) -> Float[ndarray, "frame anchor"]:
    """Weights that carry values at the anchors to all ``steps + 1`` frames of a gap, keys included: a natural cubic
    spline that is zero at both keys."""
    out = np.asarray(_SPLINE(np.arange(steps + 1) / steps))
    out[[0, -1]] = 0.0
    return out


def gap_shapes(styles: int) -> dict[str, tuple[int, ...]]:
    """What the planner knows of a gap, without the batch axis; world frame, metres, seconds.

    For start and target: hips position, joint rotations as 6-D, joint positions, joint velocities, and 1 where the
    velocities are known. steps: from start to target. style: weights over (free, style 1, ...). path: root x and z and
    facing (x, z) at the anchors; path_known: 0 where no path is given.
    """
    key = {"hips": (3,), "rotations": (JOINTS, 6), "positions": (JOINTS, 3), "velocities": (JOINTS, 3), "known": (1,)}
    return {
        **{f"{end}_{name}": shape for end in ("start", "target") for name, shape in key.items()},
        "steps": (1,),
        "style": (styles + 1,),
        "path": (ANCHORS, 4),
        "path_known": (1,),
    }


def planner_shapes(latent: int, styles: int) -> dict[str, tuple[int, ...]]:
    """The inputs of `plan.onnx`, without the batch axis: the gap, standard noise for the latents, and the frames,
    counted from the start, at which the plan is wanted (any number of them)."""
    return gap_shapes(styles) | {"noise": (latent,), "frames": (-1,)}
