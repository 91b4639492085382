"""The geometry inside the training graph: 6-D rotations, kinematics without a loop over joints, a pose's root frame.

Every function takes a batch axis first and holds no state, so that it exports to ONNX as a handful of nodes.
"""

from __future__ import annotations

import numpy as np
import roma
import torch
from jaxtyping import Float
from torch import Tensor

from interpose.skeleton import HUMANOID

PARENT_INDICES = torch.tensor([max(p, 0) for p in HUMANOID.parents])
OFFSETS = torch.tensor(HUMANOID.offsets, dtype=torch.float32)


def _ancestors() -> Tensor:
    """(joint, joint): 1 where the column's bone lies between the hips and the row's joint."""
    chain = np.zeros((len(HUMANOID), len(HUMANOID)), dtype=np.float32)
    for joint, parent in enumerate(HUMANOID.parents):
        if parent >= 0:
            chain[joint] = chain[parent]
            chain[joint, joint] = 1.0
    return torch.tensor(chain)


ANCESTORS = _ancestors()


def to_matrix(six: Float[Tensor, "*batch 6"]) -> Float[Tensor, "*batch 3 3"]:
    """Rotation matrices from 6-D by Gram-Schmidt (Zhou et al. 2019)."""
    return roma.special_gramschmidt(torch.stack([six[..., :3], six[..., 3:]], dim=-1))


def to_six(m: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 6"]:
    """The first two columns of a matrix, one after the other."""
    return torch.cat([m[..., 0], m[..., 1]], dim=-1)


def joint_positions(
    hips: Float[Tensor, "batch 3"], m: Float[Tensor, "batch joint 3 3"]
) -> Float[Tensor, "batch joint 3"]:
    """Forward kinematics from global rotations: a bone is its parent's rotation times a constant, and a joint the sum
    of the bones between the hips and it, which is one matrix product."""
    bones = (m[:, PARENT_INDICES] * OFFSETS[:, None, :].to(m)).sum(dim=-1)
    return hips[:, None] + ANCESTORS.to(m) @ bones


_FACING = torch.zeros(9, 2)
_FACING[2, 0], _FACING[6, 0], _FACING[0, 1], _FACING[8, 1] = 1.0, -1.0, 1.0, 1.0
_AHEAD = torch.tensor([0.0, 1e-8])
_FRAME = torch.zeros(2, 9)
_FRAME[0, 2], _FRAME[0, 6], _FRAME[1, 0], _FRAME[1, 8] = 1.0, -1.0, 1.0, 1.0
_UPRIGHT = torch.zeros(9)
_UPRIGHT[4] = 1.0


def facing(m: Float[Tensor, "*batch 3 3"]) -> Float[Tensor, "*batch 2"]:
    """The unit direction (x, z) in which hips of rotation ``m`` face: where their twist about the vertical turns +Z.

    The twist of R about y has cos ~ R00 + R22 and sin ~ R02 - R20: no branch, and sane for lying poses. A constant
    picks them out of the matrix in one product; another, too small to matter elsewhere, makes hips that are exactly
    upside down, which have no twist, face +Z as in `interpose.rotation.twist`.
    """
    direction = m.flatten(-2) @ _FACING.to(m) + _AHEAD.to(m)
    return direction / direction.norm(dim=-1, keepdim=True).clamp_min(1e-12)


def root_frame(direction: Float[Tensor, "*batch 2"]) -> Float[Tensor, "*batch 3 3"]:
    """The matrix whose product ``v @ m`` takes row vectors from the world into the frame that faces ``direction``:
    ((cos, 0, sin), (0, 1, 0), (-sin, 0, cos))."""
    return (direction @ _FRAME.to(direction) + _UPRIGHT.to(direction)).unflatten(-1, (3, 3))
