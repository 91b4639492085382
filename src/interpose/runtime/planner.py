"""What a planner foresees of a gap, on ONNX Runtime: poses at the anchors, as what they differ by from interpolation.

Models of method stitch have one, and those of method dcmoe that were trained along one (docs/method.md, D26).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.features import JOINTS
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, Pose
from interpose.skeleton import MIRROR
from interpose.stitch_layout import ANCHORS

TEMPERATURE = 0.6
"""How far the variants' latents lie from the likeliest one, as a share of the prior's own deviation."""
FLIP = np.array([-1.0, 1.0, 1.0])


def noise(shape: tuple[int, ...], count: int, seed: int, vary: bool) -> Float[ndarray, "batch *unit"]:
    """Standard noise for latents of a shape, at :data:`TEMPERATURE`; a row's depends on the seed and the row alone.

    Without ``vary``, and in the first row of seed 0, there is none: that is the likeliest motion.
    """
    out = np.zeros((count, *shape))
    if vary:
        for row in range(0 if seed else 1, count):
            out[row] = TEMPERATURE * np.random.default_rng((seed, row)).standard_normal(shape)
    return out


def ends(
    start: Pose,
    leaving: Float[ndarray, "batch 22 3"] | None,
    target: Pose,
    arriving: Float[ndarray, "batch 22 3"] | None,
    steps: Sequence[int],
    style: Float[ndarray, "batch style"],
    paths: Sequence[Path | None],
    control: float,
) -> dict[str, ndarray]:
    """The inputs of a plan. steps: from start to target, a row each. leaving, arriving: velocities at the keys, where
    they are known."""
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
    way = np.zeros((count, ANCHORS, 4))
    known = np.array([[float(path is not None and control > 0.0)] for path in paths])
    for row, path in enumerate(paths):
        if path is not None:
            at = np.arange(1, ANCHORS + 1) / (ANCHORS + 1) * steps[row]
            x, z, yaw = (np.interp(at, np.arange(len(path)), path[:, i]) for i in range(3))
            way[row] = np.stack([x, z, np.sin(yaw), np.cos(yaw)], axis=-1)
    count_of = np.array(steps, dtype=float)[:, None]
    return out | {"steps": count_of, "style": style, "path": way, "path_known": known}


def plan(
    session: Session, told: dict[str, ndarray], drawn: Float[ndarray, "batch unit"]
) -> tuple[Float[ndarray, "batch anchor pose"], Float[ndarray, "batch unit"]]:
    """What the plan adds to interpolation at the anchors, and its latents.

    The data was mirrored in training, so that the plan of the mirror image is as good as the plan, and their mean is
    better: what both likeliest plans differ by is halved, in samples as well.
    """
    still = np.zeros_like(drawn)

    def say(seen: dict[str, ndarray]) -> dict[str, ndarray]:
        return session.run("plan", {name: value.astype(np.float32) for name, value in seen.items()})

    said = say(told | {"noise": drawn})
    own = say(told | {"noise": still})["added"] if drawn.any() else said["added"]
    other = say({name: mirrored(name, value) for name, value in told.items()} | {"noise": still})["added"]
    hips, turned = other[..., :3], other[..., 3:].reshape(*other.shape[:2], JOINTS, 6)
    back = [mirrored("hips", hips), mirrored("rotations", turned).reshape(*other.shape[:2], -1)]
    return said["added"] + 0.5 * (np.concatenate(back, axis=-1) - own), said["latent"]


def mirrored(name: str, value: ndarray) -> ndarray:
    """An input of the plan seen in a mirror at x = 0, left and right exchanged, as `interpose.motion.mirror` does."""
    kind = name.rpartition("_")[2]
    if kind == "hips":
        return value * FLIP
    if kind in ("positions", "velocities"):
        return value[..., MIRROR, :] * FLIP
    if kind == "rotations":
        return value[..., MIRROR, :] * np.concatenate([-FLIP, FLIP])
    return value * np.array([-1.0, 1.0, -1.0, 1.0]) if name == "path" else value


def laid(
    base: Float[ndarray, "batch time pose"], paths: Sequence[Path | None], control: float
) -> Float[ndarray, "batch time pose"]:
    """The base with its roots led onto their paths between the keys, by so much."""
    out = base.copy()
    for row, path in enumerate(paths):
        if path is not None:
            inner = slice(1, len(path) - 1)
            out[row, inner, 0] += control * (path[inner, 0] - out[row, inner, 0])
            out[row, inner, 2] += control * (path[inner, 1] - out[row, inner, 2])
    return out
