"""The losses of DC-MoE (Chu and Yang 2024, equations 3 to 6) and those that train on roll-outs (docs/method.md).

All take a :class:`~interpose.models.dcmoe.Prediction` and the :class:`~interpose.train.dcmoe.sequences.Truth` of the
same step, in the root frame of the step's start, and return scalars: means over the rows that are still inside their
gap. Where several processes share the rows (``group``), the mean over the processes is that over all rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from interpose.data.contacts import CONTACT_INDICES, SLIDE_HEIGHT
from interpose.features import RATE
from interpose.models.dcmoe import Prediction
from interpose.train.common.parallel import ALONE, Group
from interpose.train.dcmoe.sequences import Truth

_FOOT_JOINTS = list(CONTACT_INDICES)
_TOE_JOINTS = [CONTACT_INDICES[1], CONTACT_INDICES[3]]
JERK_FRAMES = 6
"""Frames over which jerk is compared."""


def _mean(weight: Float[Tensor, "*row"], group: Group) -> Callable[[Float[Tensor, "*row"]], Float[Tensor, ""]]:
    """What takes the mean so weighted; of several processes' rows a share of it, whose mean over them it is."""
    count = group.total(weight.sum()).clamp_min(1.0)
    return lambda x: (x * weight).sum() * group.size / count


def _means(truth: Truth, group: Group) -> tuple[Callable[[Tensor], Tensor], Callable[[Tensor], Tensor]]:
    """Those over the rows inside their gap, and over their keys inside it."""
    return _mean(truth.alive, group), _mean(truth.within * truth.alive[:, None], group)


def terms(
    prediction: Prediction, truth: Truth, here: Float[Tensor, "row joint 3"], group: Group = ALONE
) -> dict[str, Float[Tensor, ""]]:
    """Every term of equations 3, 4 and 5 by its name in the paper; ``here`` are the joints at the step's start."""
    mean, keys = _means(truth, group)

    def joints(x: Float[Tensor, "row joint c"]) -> Float[Tensor, ""]:
        return mean(x.norm(dim=-1).mean(dim=-1))

    contact = prediction.contacts.sigmoid()
    foot_velocity = contact[:, 0, :, None] * prediction.velocities[:, _FOOT_JOINTS]
    led = here + prediction.velocities / RATE - prediction.raw_positions
    return {
        "pos": joints(prediction.raw_positions - truth.positions),
        "rot": joints(prediction.rotations - truth.rotations),
        "vel": joints(prediction.velocities - truth.velocities),
        "contacts": keys((contact - truth.contacts).norm(dim=-1)),
        "traj": keys((prediction.trajectory - truth.trajectory).norm(dim=-1)),
        "phase": keys((prediction.phases - truth.phases).flatten(2).norm(dim=-1)),
        "contacts'": joints(foot_velocity),
        "pos'": mean(led.square().sum(dim=-1).mean(dim=-1)),
    }


def paper(
    prediction: Prediction,
    truth: Truth,
    here: Float[Tensor, "row joint 3"],
    reconstruct: float = 1.0,
    consist: float = 2.5,
    group: Group = ALONE,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """Equation 6, with the weights of section 5.1."""
    each = terms(prediction, truth, here, group)
    consistency = {"contacts'", "pos'"}
    total = sum((consist if name in consistency else reconstruct) * value for name, value in each.items())
    return torch.as_tensor(total), each


@dataclass(frozen=True)
class RollOutWeights:
    """Weights of :func:`unrolled` and :func:`windows`."""

    position: float = 3.0
    rotation: float = 1.0
    displacement: float = 10.0
    foot: float = 2.0
    contact: float = 0.02
    velocity: float = 0.05
    trajectory: float = 0.05
    phase: float = 0.05
    consistency: float = 0.5
    skate: float = 10.0
    energy: float = 0.05


def unrolled(
    prediction: Prediction,
    truth: Truth,
    here: Float[Tensor, "row joint 3"],
    weights: RollOutWeights,
    group: Group = ALONE,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """The terms of equations 3 to 5 in the form that trains on roll-outs: L1 on what forward kinematics gives, the
    displacement since ``here``, and the feet held still where they truly stand."""
    mean, keys = _means(truth, group)

    def rows(x: Float[Tensor, "row *rest"]) -> Float[Tensor, ""]:
        return mean(x.abs().flatten(1).mean(dim=-1))

    moved = prediction.positions - here
    planted = truth.contacts[:, 0, :, None] * moved[:, _FOOT_JOINTS]
    cross_entropy = F.binary_cross_entropy_with_logits(prediction.contacts, truth.contacts, reduction="none")
    predicted = prediction.contacts[:, 0].sigmoid()[..., None] * prediction.velocities[:, _FOOT_JOINTS] / RATE
    each = {
        "position": rows(prediction.positions - truth.positions),
        "rotation": rows(prediction.rotations - truth.rotations),
        "displacement": rows(moved - truth.velocities / RATE),
        "foot": mean(planted.norm(dim=-1).mean(dim=-1)),
        "contact": keys(cross_entropy.mean(dim=-1)),
        "velocity": rows(prediction.velocities - truth.velocities),
        "trajectory": keys((prediction.trajectory - truth.trajectory).abs().mean(dim=-1)),
        "phase": keys((prediction.phases - truth.phases).abs().flatten(2).mean(dim=-1)),
        "consistency": rows(predicted) + rows(here + prediction.velocities / RATE - prediction.positions),
    }
    total = sum(getattr(weights, name) * value for name, value in each.items())
    return torch.as_tensor(total), each


def windows(
    made: Float[Tensor, "row frame 22 3"],
    true: Float[Tensor, "row frame 22 3"],
    whole: Float[Tensor, "row"],
    weights: RollOutWeights,
    group: Group = ALONE,
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """What only several frames together show: :func:`skate` and :func:`energy`, of the rows (``whole``, 1 or 0) whose
    gap is not over."""
    mean = _mean(whole, group)
    each = {"skate": mean(skate(made)), "energy": mean(energy(made, true))}
    return torch.as_tensor(weights.skate * each["skate"] + weights.energy * each["energy"]), each


def skate(positions: Float[Tensor, "row frame 22 3"]) -> Float[Tensor, "row"]:
    """How far the toes move in a frame while they are low, metres: the tables' foot slide as a loss, 2 - 2^(h/H) being
    the weight of a toe at height h."""
    toes = positions[:, :, _TOE_JOINTS]
    weight = 2.0 - torch.exp2((toes[:, 1:, :, 1] / SLIDE_HEIGHT).clamp(0.0, 1.0))
    return (weight * _length(toes.diff(dim=1))).flatten(1).mean(dim=-1)


def _length(x: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch"]:
    """The norm, with a gradient at nil."""
    return (x.square().sum(dim=-1) + 1e-10).sqrt()


def energy(made: Float[Tensor, "row frame 22 3"], true: Float[Tensor, "row frame 22 3"]) -> Float[Tensor, "row"]:
    """| log of the joints' mean jerk over the truth's |, in every :data:`JERK_FRAMES` frames of each joint by itself,
    so that it cannot be made up for elsewhere; below 1 mm a frame^3 the truth counts as still."""
    if made.shape[1] < 5:
        return made.new_zeros(len(made))
    span = min(JERK_FRAMES, made.shape[1] - 3)
    here, there = (
        F.avg_pool1d(_length(x.diff(n=3, dim=1)).flatten(2).transpose(1, 2), span, max(1, span // 2)) + 1e-3
        for x in (made, true)
    )
    return (here / there).log().abs().flatten(1).mean(dim=-1)
