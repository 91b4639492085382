"""The true motion of gaps, in the numbers of each form of the generators, and the chains' first frames."""

from __future__ import annotations

from dataclasses import dataclass

import roma
import torch
from jaxtyping import Float
from torch import Tensor

from interpose.data.contacts import CONTACT_INDICES
from interpose.features.stitch import STANDING
from interpose.models.geometry import root_frame
from interpose.models.stitch_forms import Body
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Gaps, true_poses, velocities


@dataclass(frozen=True)
class TrueMotion:
    """The true motion of each gap, keys included; rotations in the form's own numbers."""

    hips: Float[Tensor, "row frame 3"]
    rotations: Float[Tensor, "row frame 22 turn"]
    positions: Float[Tensor, "row frame 22 3"]
    contacts: Float[Tensor, "row frame 4"]


def yaw_motion(data: Frames, gaps: Gaps, steps: int) -> TrueMotion:
    """What really happened in gaps of ``steps``, as the yaw form has it: the world frame, 6-D."""
    at = torch.arange(steps + 1, device=data.hips.device).expand(len(gaps), -1)
    index = gaps.start[:, None] + at
    return TrueMotion(data.hips[index], *true_poses(data, gaps, at), data.contacts[index])


def paper_motion(data: Frames, gaps: Gaps, steps: int, mean: Float[Tensor, "22 4"]) -> TrueMotion:
    """The same as the paper's form has it: in the start's root frame, local quaternions whose signs are ``mean``'s."""
    index = gaps.start[:, None] + torch.arange(steps + 1, device=data.hips.device)
    direction = data.facing[gaps.start]
    frame = root_frame(direction)[:, None]
    origin = (data.hips[gaps.start] * data.hips.new_tensor([1.0, 0.0, 1.0]))[:, None]
    turn = _unturned(direction)[:, None]
    local = data.local[index].clone()
    local[:, :, 0] = roma.quat_product(turn.expand(-1, steps + 1, -1), local[:, :, 0])
    hips = ((data.hips[index] - origin)[:, :, None] @ frame)[:, :, 0]
    positions = (data.positions[index] - origin[:, None]) @ frame
    return TrueMotion(hips, signed(local, mean), positions, data.contacts[index])


def _unturned(direction: Float[Tensor, "row 2"]) -> Float[Tensor, "row 4"]:
    """The rotation about the vertical that turns what faces ``direction`` (x, z) to face +Z."""
    half = -0.5 * torch.atan2(direction[:, 0], direction[:, 1])
    zero = torch.zeros_like(half)
    return torch.stack([zero, half.sin(), zero, half.cos()], dim=-1)


def signed(local: Float[Tensor, "*batch 22 4"], mean: Float[Tensor, "22 4"]) -> Float[Tensor, "*batch 22 4"]:
    """The quaternions with the signs nearest to ``mean``."""
    return torch.where((local * mean).sum(dim=-1, keepdim=True) < 0.0, -local, local)


def mean_quaternions(data: Frames) -> Float[Tensor, "22 4"]:
    """A mean pose to take signs from; the root's is in its own root frame."""
    local = data.local.clone()
    local[:, 0] = roma.quat_product(_unturned(data.facing), local[:, 0])
    mean = signed(local, local[0]).mean(dim=0)
    for _ in range(3):
        mean = signed(local, mean).mean(dim=0)
    return torch.nn.functional.normalize(mean, dim=-1)


def chain_ends(data: Frames, gaps: Gaps, true: TrueMotion) -> tuple[Body, Body]:
    """The chains' first frames: the start, and the target with time running backwards. Velocities are the world's."""
    front, back = (
        Body(
            true.hips[:, end],
            true.rotations[:, end],
            true.positions[:, end],
            velocities(data, at, side) * (-side * known[..., None]),
            known,
            standing(data.positions[at]),
            data.hips.new_zeros(len(gaps), 4),
        )
        for end, at, side, known in (
            (0, gaps.start, -1, gaps.start_known),
            (-1, gaps.target, 1, gaps.target_known),
        )
    )
    return front, back


def standing(positions: Float[Tensor, "row 22 3"]) -> Float[Tensor, "row 4"]:
    """Contacts of a lone key, by height."""
    return (positions[:, CONTACT_INDICES, 1] < positions.new_tensor(STANDING)).float()
