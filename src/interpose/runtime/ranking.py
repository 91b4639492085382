"""How good a transition is: foot slide, jerk at the keys, and whether it arrives."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import retarget, rotation
from interpose.data import contacts
from interpose.motion import Motion, concatenate
from interpose.runtime.interpolate import aligned
from interpose.runtime.resampling import MODEL_RATE
from interpose.skeleton import HUMANOID

TOES = [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")]


def foot_slide(toes: Float[ndarray, "frame toe 3"], rate: float) -> float:
    """Centimetres a 30 Hz frame that the toes travel while they are low; zero where no toe is ever low.

    ``toes``: as `interpose.data.contacts.foot_slide` takes them.
    """
    travel, samples = contacts.foot_slide(toes)
    return float(travel / max(1, samples)) * rate / MODEL_RATE


def apart(one: Motion, other: Motion) -> tuple[float, float]:
    """The largest distance of a joint between two poses, metres, and the largest angle between rotations, degrees."""
    distance = np.linalg.norm(one.global_positions() - other.global_positions(), axis=-1)
    turn = rotation.multiply(rotation.inverse(one.global_rotations()), other.global_rotations())
    return float(distance.max()), float(np.degrees(rotation.angle(turn).max()))


def judge(
    starts: list[Motion], inner: list[Motion], target: Motion, mapping: retarget.Mapping | str
) -> tuple[list[float | None], list[float]]:
    """Foot slide and cost of each transition; without a mapping both are unknown.

    The cost is the foot slide and how much the joints' mean step changes at the two ends, in centimetres a 30 Hz frame.
    """
    if isinstance(mapping, str):
        return [None] * len(inner), [0.0] * len(inner)
    rate = starts[0].rate
    parts = []
    for start, made in zip(starts, inner, strict=True):
        keys = aligned(start[-2:], target[0])
        parts.append(concatenate(keys[0], aligned(keys[0], made)[1], keys[1]))
    whole = retarget.to_humanoid(concatenate(*parts), mapping).global_positions()
    key = min(len(starts[0]), 2) - 1
    slides, costs, begin = [], [], 0
    for part in parts:
        positions = whole[begin : begin + len(part)]
        begin += len(part)
        slides.append(foot_slide(positions[key:, TOES], rate))
        bends = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=-1).mean(axis=-1) * 100.0 * rate / MODEL_RATE
        costs.append(slides[-1] + float(bends[0] + bends[-1]) / 2.0)
    return slides, costs
