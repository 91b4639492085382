"""How far a model knows a gap, and how much of its motion is kept where it does not.

A small network of some numbers of the request and of what was made of it, fitted on whole data sets that the model
never saw (`benchmarks/confidence.py`, docs/method.md): the probability that the generated motion lies nearer to
the true one than interpolation does, and the share of it with which the error is least.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial.distance import cdist

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.errors import InputError
from interpose.features import RATE
from interpose.runtime import planner
from interpose.runtime.gap_batch import GapBatch, Generated
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import PARENTS, Pose, bases, local_of
from interpose.skeleton import HUMANOID, LEG_CHAINS

FEATURES = (
    "log seconds",
    "hips apart",
    "pose change",
    "turn",
    "speed at start",
    "speed at target",
    "start speed known",
    "target speed known",
    "lowest hips",
    "least upright",
    "start from known poses",
    "target from known poses",
    "away from interpolation",
    "spread of plans",
)
OUTSIDE = 5.0
"""Deviations from the mean of a number beyond which the fit says nothing."""
LOW = 0.35
"""Confidence below which a warning is given."""
_LEGS = list(LEG_CHAINS.ravel())
STEPS_FROM = (0.2, 0.6)
"""Metres between the hips of both keys from which a body begins to step, and surely does."""
TURNS_FROM = (0.5, 1.3)
"""Radians between the facings of both keys, likewise."""
FILE = "confidence.npz"
"""In the folder of a model whose confidence is known."""
SPREAD_DRAWS = 4
"""Plans that are drawn to see how far they differ."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """The small network: normalisation of the features, a hidden layer, and two outputs as logits.

    poses: of the model's training, as :func:`described`; a request far from all of them is one that it does not know.
    """

    poses: Float[ndarray, "pose coordinate"]
    mean: Float[ndarray, "feature"]
    std: Float[ndarray, "feature"]
    hidden: Float[ndarray, "feature unit"]
    hidden_bias: Float[ndarray, "unit"]
    out: Float[ndarray, "unit 2"]
    out_bias: Float[ndarray, "2"]

    def __call__(
        self, features: Float[ndarray, "batch feature"]
    ) -> tuple[Float[ndarray, "batch"], Float[ndarray, "batch"]]:
        """Confidence and the share to keep, both 0 to 1. What lies outside of all that the fit saw lowers both."""
        z = (features - self.mean) / self.std
        logits = np.tanh(np.clip(z, -3.0, 3.0) @ self.hidden + self.hidden_bias) @ self.out + self.out_bias
        outside = np.maximum(np.abs(z) - OUTSIDE, 0.0).sum(axis=-1, keepdims=True)
        made = np.exp(-0.5 * outside) / (1.0 + np.exp(-logits))
        return made[:, 0], made[:, 1]


@lru_cache(maxsize=16)
def calibration(folder: Path) -> Calibration | None:
    """That of the model in a folder, None where it has none. Raises InputError where it cannot be read."""
    file = folder / FILE
    if not file.exists():
        return None
    try:
        with np.load(file) as arrays:
            made = Calibration(**{f.name: arrays[f.name].astype(float) for f in fields(Calibration)})
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{file} cannot be read ({error}); export the model again") from None
    if made.mean.shape != (len(FEATURES),):
        raise InputError(f"{file} is of other features; export the model again")
    return made


def judged(model: Session | None, batch: GapBatch, made: Generated) -> tuple[Generated, Float[ndarray, "batch"] | None]:
    """What was made, as far as the model knows such gaps, and its confidence; None for a model without calibration.

    Where a style or a path was given it is kept whole, since interpolation has neither. Legs are kept where the body
    travels or turns, since it would glide otherwise.
    """
    known = None if model is None else calibration(model.path)
    if model is None or known is None or batch.longest == 0:
        return made, None
    numbers = features(model, batch, made, known.poses)
    sure, share = known(numbers)
    free = [style is None and path is None for style, path in zip(batch.styles, batch.paths, strict=True)]
    share = np.where(free, share, 1.0)
    root, local = kept(batch, made, share, np.maximum(share, travel(numbers)))
    return replace(made, root=root, local=local), sure


def travel(numbers: Float[ndarray, "batch feature"]) -> Float[ndarray, "batch"]:
    """Of :func:`features`: 1 where the body must step to come from key to key, 0 where it may stand, and between."""
    needed = [
        (numbers[:, FEATURES.index(name)] - low) / (high - low)
        for name, (low, high) in (("hips apart", STEPS_FROM), ("turn", TURNS_FROM))
    ]
    share = np.clip(np.max(needed, axis=0), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)


def warning(confidence: float) -> str:
    """What is said of a gap that the model does not know."""
    return f"the model does not know such gaps (confidence {confidence:.2f}); look at the result"


def interpolated(batch: GapBatch) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]:
    """Hips and local rotations of interpolation between the keys; after a shorter gap its target stands still."""
    between = bases(*batch.keys, list(batch.frames))[:, 1:-1]
    return between[..., :3], local_of(between[..., 3:].reshape(*between.shape[:2], len(HUMANOID), 6))


def described(pose: Pose) -> Float[ndarray, "batch coordinate"]:
    """Joint positions about the hips, seen from where they face, metres."""
    x, z = pose.facing[..., 0], pose.facing[..., 1]
    here = _about_hips(pose)
    ahead = here[..., 0] * x[:, None] + here[..., 2] * z[:, None]
    aside = here[..., 0] * z[:, None] - here[..., 2] * x[:, None]
    return np.stack([aside, here[..., 1], ahead], axis=-1).reshape(len(here), -1)


def features(
    model: Session, batch: GapBatch, made: Generated, poses: Float[ndarray, "pose coordinate"]
) -> Float[ndarray, "batch feature"]:
    """The numbers by the names of :data:`FEATURES`, metres, seconds and radians."""
    start, target = batch.start, batch.target
    seconds = (np.array(batch.frames) + 1.0) / RATE
    ends = [_about_hips(pose) for pose in (start, target)]
    speeds = [
        np.zeros(len(batch)) if v is None else np.linalg.norm(v, axis=-1).mean(axis=-1)
        for v in (batch.leaving, batch.arriving)
    ]
    known = [np.full(len(batch), float(v is not None)) for v in (batch.leaving, batch.arriving)]
    hips = [rotation.from_6d(pose.rotations[:, 0]) for pose in (start, target)]
    up = np.min([rotation.rotate(q, np.broadcast_to(rotation.UP, (len(batch), 3)))[:, 1] for q in hips], axis=0)
    return np.stack(
        [
            np.log(seconds),
            np.linalg.norm((target.hips - start.hips)[:, ::2], axis=-1),
            np.linalg.norm(ends[1] - ends[0], axis=-1).mean(axis=-1),
            np.arccos(np.clip(np.sum(start.facing * target.facing, axis=-1), -1.0, 1.0)),
            *speeds,
            *known,
            np.minimum(start.hips[:, 1], target.hips[:, 1]),
            up,
            *(_nearest(described(pose), poses) for pose in (start, target)),
            _away(batch, made),
            _spread(model, batch),
        ],
        axis=-1,
    )


def kept(
    batch: GapBatch, made: Generated, share: Float[ndarray, "batch"], legs: Float[ndarray, "batch"]
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]:
    """Hips and local rotations between interpolation, at share 0, and what was made, at 1; the legs and the hips'
    height by a share of their own, so that a body on a straighter line still steps."""
    root, local = interpolated(batch)
    of_joint = np.repeat(share[:, None], len(HUMANOID), axis=1)
    of_joint[:, _LEGS] = legs[:, None]
    of_root = np.stack([share, legs, share], axis=-1)[:, None]
    return root + of_root * (made.root - root), rotation.slerp(local, made.local, of_joint[:, None])


def _about_hips(pose: Pose) -> Float[ndarray, "batch 22 3"]:
    return pose.positions - pose.hips[:, None]


def _nearest(
    some: Float[ndarray, "batch coordinate"], poses: Float[ndarray, "pose coordinate"]
) -> Float[ndarray, "batch"]:
    """Metres of a joint, as a root mean square, from the nearest of ``poses``."""
    return cdist(some, poses).min(axis=1) / np.sqrt(len(HUMANOID))


def _away(batch: GapBatch, made: Generated) -> Float[ndarray, "batch"]:
    """Metres between the joints of what was made and of interpolation, on average over a gap's frames."""
    places = [_places(*motion) for motion in (interpolated(batch), (made.root, made.local))]
    apart = np.linalg.norm(places[0] - places[1], axis=-1).mean(axis=-1)  # nil after a shorter gap
    return apart.sum(axis=1) / np.maximum(np.array(batch.frames), 1)


def _places(root: Float[ndarray, "batch frame 3"], local: Float[ndarray, "batch frame 22 4"]) -> ndarray:
    return kinematics.global_positions(root, kinematics.global_rotations(local, PARENTS), PARENTS, HUMANOID.offsets)


def _spread(model: Session, batch: GapBatch) -> Float[ndarray, "batch"]:
    """Metres and 6-D by which the plans' middles differ from draw to draw; 0 without a planner."""
    if not model.has_planner:
        return np.zeros(len(batch))
    rows = np.repeat(np.arange(len(batch)), SPREAD_DRAWS)
    many = batch.take(rows.tolist())
    noise = planner.noise([(0, draw) for draw in range(SPREAD_DRAWS)] * len(batch), (model.plan_latent,))
    steps = [frames + 1 for frames in many.frames]
    style = model.style_weights(many.styles, many.style_strength)
    inputs = planner.gap_inputs(many.start, many.leaving, many.target, many.arriving, steps, style, many.paths)
    added = planner.predict(model, inputs, noise, many.longest + 2)[0]
    middle = added[np.arange(len(many)), np.array(steps) // 2].reshape(len(batch), SPREAD_DRAWS, -1)
    return np.asarray(middle.std(axis=1).mean(axis=-1))
