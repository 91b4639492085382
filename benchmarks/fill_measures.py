"""Measures of a filled clip: whether its keys are kept, whether it pops at them, and how far its feet slide.

A pop is an acceleration around a key (mean over joints of the second difference) above that of every frame of the clip.
Foot slide is measured on the humanoid that the clip is retargeted to, so that any rig has toes and a floor; see
`interpose.evaluate.metrics` for the formula.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import retarget
from interpose.errors import InputError
from interpose.evaluate import metrics
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

FEET_RATE = 30.0
"""Foot slide is given in centimetres a frame of this rate, whatever the clip's."""


@dataclass(frozen=True, eq=False)
class FillQuality:
    """key_difference: largest difference of any number of a key frame (metres, quaternion components); 0 is identical.
    key_frames: the frames looked at for pops, each a key next to a gap or a generated frame next to a key.
    key_accelerations: (look,) m/s^2 in each of them. key_ranks: (look,) the share of the clip's own frames that
    accelerate less. foot_slide, clip_foot_slide: of the generated frames, and of the clip's own in the same places,
    cm a frame in contact, NaN where no toe is in contact.
    """

    key_difference: float
    key_frames: tuple[int, ...]
    key_accelerations: Float[ndarray, "look"]
    key_ranks: Float[ndarray, "look"]
    foot_slide: float
    clip_foot_slide: float

    @property
    def pops(self) -> tuple[int, ...]:
        """The frames around keys that accelerate more than any frame of the clip."""
        return tuple(f for f, rank in zip(self.key_frames, self.key_ranks, strict=True) if rank == 1.0)


def fill_quality(clip: Motion, filled: Motion, keys: Sequence[int]) -> FillQuality:
    """The quality of ``filled``, which has the frames of ``clip`` and keeps those of ``keys``.

    Raises InputError where the two do not fit, where there is no gap, or where the clip is no humanoid.
    """
    count = len(clip)
    if filled.skeleton.names != clip.skeleton.names or len(filled) != count:
        raise InputError(f"the filled clip has {len(filled)} frames, the clip {count}; both must share rig and frames")
    kept = np.zeros(count, dtype=bool)
    kept[list(keys)] = True
    generated = ~kept
    generated[: min(keys)] = generated[max(keys) + 1 :] = False
    if not generated.any():
        raise InputError("there is no generated frame between the keys")
    mapping = retarget.map_skeleton(clip)
    slides = [
        _foot_slide(retarget.to_humanoid(motion, mapping).global_positions(), generated, clip.rate)
        for motion in (filled, clip)
    ]
    look = np.flatnonzero(around_keys(kept, generated))
    found = metrics.acceleration(filled.global_positions(), clip.rate).mean(axis=-1)[look - 1]
    own = np.sort(metrics.acceleration(clip.global_positions(), clip.rate).mean(axis=-1))
    ranks = np.searchsorted(own, found, side="left") / len(own)
    return FillQuality(_difference(clip, filled, kept), tuple(look.tolist()), found, ranks, *slides)


def around_keys(kept: ndarray, generated: ndarray) -> ndarray:
    """Key frames next to a generated one and generated ones next to a key, the clip's first and last frame left out."""

    def beside(x: ndarray) -> ndarray:
        return np.append(x[1:], False) | np.append(False, x[:-1])

    look = (kept & beside(generated)) | (generated & beside(kept))
    look[[0, -1]] = False
    return look


def _difference(clip: Motion, filled: Motion, kept: ndarray) -> float:
    turned = metrics.align_signs(filled.local_rotations[kept][None], clip.local_rotations[kept][None])[0]
    return float(
        max(
            np.abs(filled.root_positions[kept] - clip.root_positions[kept]).max(),
            np.abs(turned - clip.local_rotations[kept]).max(),
        )
    )


def _foot_slide(positions: Float[ndarray, "frame 22 3"], generated: ndarray, rate: float) -> float:
    """Over the steps that lead to or from a generated frame."""
    toes = positions[:, [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")]]
    steps = np.flatnonzero(generated[1:] | generated[:-1])
    return metrics.foot_slide(np.stack([toes[steps], toes[steps + 1]], axis=1)).value * rate / FEET_RATE
