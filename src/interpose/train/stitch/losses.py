"""The losses of S-CVAE (Ren et al. 2024, equations 4 to 7) and those that perform better (docs/method.md).

Those of the generators take a :class:`~interpose.train.stitch.rollout.Stitched` and the true motion of the same gaps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional as F

from interpose.data.contacts import CONTACT_INDICES
from interpose.train.dcmoe.losses import energy, skate
from interpose.train.stitch.rollout import Chain, Stitched
from interpose.train.stitch.truth import TrueMotion


@dataclass(frozen=True)
class StitchWeights:
    """Weights of the terms; see :func:`chains`."""

    position: float = 3.0
    rotation: float = 1.0
    displacement: float = 10.0
    foot: float = 8.0
    skate: float = 20.0
    contact: float = 0.15
    stitch: float = 1.5
    energy: float = 0.25
    root: float = 0.0
    adversarial: float = 0.05
    divergence: float = 0.0
    """of latents a frame; those of a gap are the planner's"""
    entropy: bool = True
    """contacts by cross-entropy; otherwise by L1, as printed"""


PAPER_WEIGHTS = StitchWeights(
    position=0.5,
    rotation=1.0,
    displacement=0.0,
    foot=0.0,
    skate=0.0,
    contact=0.1,
    stitch=0.5,
    energy=0.0,
    root=1.0,
    adversarial=0.1,
    divergence=1.0,
    entropy=False,
)
"""Section 4.3: beta 1, 1, 0.1; KL 1, stitching 0.5, FK 0.5, adversarial 0.1. Norms are means over what they are of."""


def chains(
    made: Stitched, true: TrueMotion, shared: list[int], known: Float[Tensor, "row"], entropy: bool = True
) -> dict[str, Float[Tensor, ""]]:
    """Every term by name. ``known``: how much each row is held to the truth, 0 to 1.

    position, rotation, contact, root: L1 (binary cross-entropy for contacts) over the frames that the generators made
    (equations 5 and 7). displacement: L1 of the joints' steps in the stitched motion. foot: the steps of feet that
    truly stand. skate, energy: see `interpose.train.dcmoe.losses`. stitch: L1 between the chains in the frames that
    both made (equation 4).
    """
    both = [made.front] if made.back is None else [made.front, made.back]
    weight = known / known.mean().clamp_min(1e-6)

    def rows(x: Float[Tensor, "row *rest"]) -> Float[Tensor, ""]:
        return (x.flatten(1).mean(dim=-1) * weight).mean()

    def over(of: str, what: Tensor) -> Float[Tensor, ""]:
        parts = [(getattr(chain, of) - what[:, chain.frames]).abs() for chain in both]
        return rows(torch.cat(parts, dim=1))

    logits = torch.cat([chain.contacts for chain in both], dim=1)
    down = torch.cat([true.contacts[:, chain.frames] for chain in both], dim=1)
    step, true_step = made.positions.diff(dim=1), true.positions.diff(dim=1)
    stands = true.contacts[:, 1:] * true.contacts[:, :-1]
    each = {
        "position": over("positions", true.positions),
        "rotation": over("rotations", true.rotations),
        "root": _root(both, true, rows),
        "contact": rows(
            F.binary_cross_entropy_with_logits(logits, down, reduction="none")
            if entropy
            else (logits.sigmoid() - down).abs()
        ),
        "displacement": rows((step - true_step).abs()),
        "foot": rows(stands[..., None] * step[:, :, CONTACT_INDICES].abs()),
        "skate": skate(made.positions).mean(),
        "energy": energy(made.positions, true.positions).mean(),
    }
    if made.back is not None and shared:
        each["stitch"] = made.apart(shared).abs().mean()
    return each


def _root(both: list[Chain], true: TrueMotion, rows: Callable[[Tensor], Tensor]) -> Float[Tensor, ""]:
    """L1 of the root's velocity, metres a frame, in each chain's own direction."""
    parts = []
    for chain in both:
        made = chain.hips.diff(dim=1)
        parts.append((made - true.hips[:, chain.frames].diff(dim=1)).abs())
    return rows(torch.cat(parts, dim=1))
