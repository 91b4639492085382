"""The planner at run time: a gap's base, which interpolation and the plan's spline make together, and its latent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features.plan import ANCHORS
from interpose.runtime.gap_batch import Draw, GapBatch
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, Pose, bases

PLAN_TEMPERATURE = 0.6
"""How far the variants' latents lie from the likeliest one, as a share of the prior's own deviation."""


def noise(
    draws: Sequence[Draw], shape: tuple[int, ...], temperature: float = PLAN_TEMPERATURE
) -> Float[ndarray, "batch *unit"]:
    """Standard noise for latents of a shape, times the temperature; zero for the likeliest motion."""
    out = np.zeros((len(draws), *shape))
    for row, draw in enumerate(draws):
        if draw is not None:
            out[row] = temperature * np.random.default_rng(draw).standard_normal(shape)
    return out


def gap_inputs(
    start: Pose,
    leaving: Float[ndarray, "batch 22 3"] | None,
    target: Pose,
    arriving: Float[ndarray, "batch 22 3"] | None,
    steps: Sequence[int],
    style: Float[ndarray, "batch style"],
    paths: Sequence[Path | None],
    control: float = 1.0,
) -> dict[str, ndarray]:
    """What the planner knows of gaps, as `interpose.features.plan.gap_shapes` names it. steps: from start to target.
    leaving, arriving: the joints' velocities at the keys, where they are known. style: weights."""
    count = len(start.hips)
    out: dict[str, ndarray] = {}
    for name, pose, speed in (("start", start, leaving), ("target", target, arriving)):
        out |= {
            f"{name}_hips": pose.hips,
            f"{name}_rotations": pose.rotations,
            f"{name}_positions": pose.positions,
            f"{name}_velocities": np.zeros_like(pose.positions) if speed is None else speed,
            f"{name}_known": np.full((count, 1), float(speed is not None)),
        }
    at_anchors = np.zeros((count, ANCHORS, 4))
    known = np.array([[float(path is not None and control > 0.0)] for path in paths])
    for row, path in enumerate(paths):
        if path is not None:
            at = np.arange(1, ANCHORS + 1) / (ANCHORS + 1) * steps[row]
            x, z, yaw = (np.interp(at, np.arange(len(path)), path[:, i]) for i in range(3))
            at_anchors[row] = np.stack([x, z, np.sin(yaw), np.cos(yaw)], axis=-1)
    total = np.array(steps, dtype=float)[:, None]
    return out | {"steps": total, "style": style, "path": at_anchors, "path_known": known}


def predict(
    session: Session, inputs: dict[str, ndarray], noise: Float[ndarray, "batch unit"], frames: int
) -> tuple[Float[ndarray, "batch time pose"], Float[ndarray, "batch unit"]]:
    """What the plan adds to interpolation at the first ``frames`` frames of each gap, the start key included, and its
    latents. At and beyond the target it is zero."""
    times = np.tile(np.arange(frames, dtype=np.float32), (len(noise), 1))
    feed = {name: value.astype(np.float32) for name, value in inputs.items()}
    out = session.run("plan", feed | {"noise": noise.astype(np.float32), "frames": times})
    return out["added"].astype(float), out["latent"].astype(float)


def base(
    session: Session, batch: GapBatch, noise: Float[ndarray, "batch unit"] | None, longest: int | None = None
) -> tuple[Float[ndarray, "batch time pose"], Float[ndarray, "batch unit"] | None]:
    """The base of each gap, keys included, and the plan's latent: interpolation, the plan's spline, and the root on the
    path where one is given. After a shorter gap its target stands still.

    noise: of the latents; None for interpolation without a plan. longest: steps beyond which a gap has no plan.
    """
    out = bases(*batch.keys, list(batch.frames))
    latent = None
    if noise is not None:
        steps = [frames + 1 for frames in batch.frames]
        style = session.style_weights(batch.styles, batch.style_strength)
        ends = batch.start, batch.leaving, batch.target, batch.arriving
        inputs = gap_inputs(*ends, steps, style, batch.paths, batch.path_control)
        added, latent = predict(session, inputs, noise, out.shape[1])
        planned = [longest is None or n <= longest for n in steps]
        out += added * np.array(planned, dtype=float)[:, None, None]
    for row, path in enumerate(batch.paths):
        if path is not None:
            inner = slice(1, len(path) - 1)
            out[row, inner, 0] += batch.path_control * (path[inner, 0] - out[row, inner, 0])
            out[row, inner, 2] += batch.path_control * (path[inner, 1] - out[row, inner, 2])
    return out, latent
