"""A target pose completed from the part of it that is given: hands, a foot, a place on the ground.

A conditional variational autoencoder (Sohn et al. 2015) of one pose. It sees the start pose, the given joints, the time
between and the style, and says the whole pose as what it differs by from the start pose, carried to where the given
part is. Its latent is what the given part leaves open: nil for the likeliest pose, noise for others. Joints that are
given keep their rotations, the hips their position; that other joints are where they should be is for the run time's
inverse kinematics (`interpose.runtime.ik.whole_body`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn

from interpose.data.contacts import CONTACT_JOINTS
from interpose.features import JOINTS, POSE, RATE
from interpose.models.geometry import facing, joint_positions, root_frame, to_matrix, to_six
from interpose.models.layers import residual_mlp
from interpose.models.normal import Normal, normal
from interpose.skeleton import HUMANOID

TARGET_OUTPUT_WIDTH = POSE + len(CONTACT_JOINTS)
LONGEST_TARGET_FRAMES = 300
"""Frames to the target; more are seen as these."""
TORSO_JOINTS = ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head")
LEG_JOINTS = ("LeftUpLeg", "RightUpLeg", "LeftFoot", "RightFoot", "LeftToe", "RightToe")
TURNED_BY = [HUMANOID.index(name) for name in (*TORSO_JOINTS, *LEG_JOINTS)]
"""Joints that show where the target faces, the surest first; without any of them it faces as the start does."""
TARGET_INPUT_WIDTH = 2 * JOINTS * 9 + JOINTS * 3 + 1 + JOINTS + 2 + 2 + 2 + 2 + 3
"""Numbers of the input that are normalised: start, its velocities and their flag, what is given, its flags, where the
start lies and looks, the speed needed, the time."""


@dataclass(frozen=True)
class TargetSize:
    """The network's size. styles: the labels it knows; label 0 is 'free'."""

    latent: int = 8
    hidden: int = 512
    depth: int = 4
    dropout: float = 0.1
    styles: int = 0


class TargetInput(NamedTuple):
    """What is known, a batch axis first; world frame, metres, seconds.

    start: hips, rotations as 6-D, joint velocities, and 1 where those are known (otherwise nil). target: any pose with
    the given parts; what is not given of it is not looked at. joints: 1 for those given. ground: 1 where the hips'
    place and facing are. frames: from start to target. style: weights over (free, style 1, ...).
    """

    start_hips: Float[Tensor, "batch 3"]
    start_rotations: Float[Tensor, "batch joint 6"]
    start_velocities: Float[Tensor, "batch joint 3"]
    velocity_known: Float[Tensor, "batch 1"]
    target_hips: Float[Tensor, "batch 3"]
    target_rotations: Float[Tensor, "batch joint 6"]
    joints: Float[Tensor, "batch joint"]
    ground: Float[Tensor, "batch 1"]
    frames: Float[Tensor, "batch 1"]
    style: Float[Tensor, "batch style"]


class Place(NamedTuple):
    """Where the given part is: a frame on the ground, and the start pose carried there.

    origin: on the ground. frame: row vectors times it are in the frame. hips, rotations: the start pose in the frame.
    """

    origin: Float[Tensor, "batch 3"]
    frame: Float[Tensor, "batch 3 3"]
    hips: Float[Tensor, "batch 3"]
    rotations: Float[Tensor, "batch joint 6"]


class Completed(NamedTuple):
    """A whole pose, world frame, and the logits of what stands in it (`interpose.data.contacts.CONTACT_JOINTS`)."""

    hips: Float[Tensor, "batch 3"]
    rotations: Float[Tensor, "batch joint 3 3"]
    contacts: Float[Tensor, "batch 4"]


_FLAT = torch.tensor([1.0, 0.0, 1.0])


class TargetPose(nn.Module):
    """Posterior and decoder; see the module's text. Statistics are buffers, set before training."""

    mean: Tensor
    std: Tensor
    residual_std: Tensor

    def __init__(self, size: TargetSize) -> None:
        super().__init__()
        self.size = size
        self.half_products = False  # bfloat16 inside the networks, in training only
        wide = TARGET_INPUT_WIDTH + 32
        self.style = nn.Linear(size.styles + 1, 32, bias=False)
        self.posterior = residual_mlp(wide + POSE, size.hidden, 2 * size.latent, 2)
        self.decoder = residual_mlp(wide + size.latent, size.hidden, TARGET_OUTPUT_WIDTH, size.depth, size.dropout)
        self.register_buffer("mean", torch.zeros(TARGET_INPUT_WIDTH))
        self.register_buffer("std", torch.ones(TARGET_INPUT_WIDTH))
        self.register_buffer("residual_std", torch.ones(POSE))

    def numbers(self, known: TargetInput) -> tuple[Float[Tensor, "batch wide"], Place]:
        """What is normalised of the input, and the frame that it is expressed in."""
        batch = known.start_hips.shape[0]
        start, target = to_matrix(known.start_rotations), to_matrix(known.target_rotations)
        here, there = joint_positions(known.start_hips, start), joint_positions(known.target_hips, target)
        flat = _FLAT.to(here)
        looks = facing(start[:, 0])
        # The given part's place: the hips' where they are given, else the middle of the joints that are.
        rooted = torch.maximum(known.ground, known.joints[:, :1])
        share = known.joints / known.joints.sum(dim=-1, keepdim=True).clamp_min(1.0)
        middle = (there * share[..., None]).sum(dim=1)
        origin = torch.where(rooted > 0.5, there[:, 0], middle) * flat
        # Its facing: that of the surest joint.
        sure = torch.cat([rooted, known.joints[:, TURNED_BY[1:]]], dim=-1)
        first = sure * (torch.cumsum(sure, dim=-1) < 1.5).to(sure)
        turned = (facing(target[:, TURNED_BY]) * first[..., None]).sum(dim=1)
        turned = turned + (1.0 - first.sum(dim=-1, keepdim=True)) * looks
        own, frame = root_frame(looks), root_frame(turned)
        ground = frame[:, ::2, ::2]

        begin = known.start_hips * flat
        rotations = known.start_rotations.reshape(batch, -1, 3) @ own
        given = known.joints[..., None]
        seen_position = ((there - origin[:, None]) @ frame) * given
        seen_rotation = (known.target_rotations.reshape(batch, -1, 3) @ frame).reshape(batch, JOINTS, 6) * given
        away = ((begin - origin)[:, None] @ frame)[:, 0, ::2]
        frames = known.frames.clamp(1.0, float(LONGEST_TARGET_FRAMES))
        x = torch.cat(
            [
                ((here - begin[:, None]) @ own).flatten(1),
                rotations.flatten(1),
                (known.start_velocities @ own).flatten(1),
                known.velocity_known,
                seen_position.flatten(1),
                seen_rotation.flatten(1),
                known.joints,
                known.ground,
                first.sum(dim=-1, keepdim=True),
                away,
                (looks[:, None] @ ground)[:, 0],
                away * (RATE / frames),
                frames / RATE,
                1.0 / frames,
                frames.log(),
            ],
            dim=-1,
        )
        hips = known.start_hips * torch.tensor([0.0, 1.0, 0.0]).to(here)
        return x, Place(origin, frame, hips, rotations.reshape(batch, JOINTS, 6))

    def forward(self, known: TargetInput) -> tuple[Float[Tensor, "batch wide"], Place]:
        """The networks' input, and the frame in which they speak."""
        x, place = self.numbers(known)
        x = ((x - self.mean) / self.std).clamp(-6.0, 6.0)
        return torch.cat([x, self.style(known.style)], dim=-1), place

    def recognise(self, x: Float[Tensor, "batch wide"], place: Place, known: TargetInput) -> Normal:
        """The posterior q(z | the same, the true target): that of ``known``, all of it."""
        true = residual(place, known) / self.residual_std
        return normal(self._run(self.posterior, torch.cat([x, true.clamp(-6.0, 6.0)], dim=-1)))

    def decode(
        self, x: Float[Tensor, "batch wide"], place: Place, known: TargetInput, z: Float[Tensor, "batch unit"]
    ) -> Completed:
        """The whole pose: given joints are turned as they should be, given hips are where they should be."""
        out = self._run(self.decoder, torch.cat([x, z], dim=-1))
        hips, rotations = posed(place, known, out[:, :POSE] * self.residual_std)
        return Completed(hips, rotations, out[:, POSE:])

    def _run(self, network: nn.Module, x: Float[Tensor, "batch wide"]) -> Float[Tensor, "batch out"]:
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.half_products):
            return network(x).float()


def posed(
    place: Place, known: TargetInput, added: Float[Tensor, "batch pose"]
) -> tuple[Float[Tensor, "batch 3"], Float[Tensor, "batch joint 3 3"]]:
    """Hips and rotations of the start pose carried along with so much added, the given parts as they are given."""
    batch = known.start_hips.shape[0]
    back = place.frame.transpose(-1, -2)
    six = place.rotations + added[:, 3:].reshape(batch, JOINTS, 6)
    free = to_matrix((six.reshape(batch, -1, 3) @ back).reshape(batch, JOINTS, 6))
    hips = ((place.hips + added[:, :3])[:, None] @ back)[:, 0] + place.origin
    hips = torch.where(known.joints[:, :1] > 0.5, known.target_hips, hips)
    level = torch.cat([place.origin[:, :1], hips[:, 1:2], place.origin[:, 2:]], dim=-1)
    hips = torch.where(known.ground > 0.5, level, hips)
    return hips, torch.where(known.joints[..., None, None] > 0.5, to_matrix(known.target_rotations), free)


def residual(place: Place, known: TargetInput) -> Float[Tensor, "batch pose"]:
    """What the target of ``known`` differs by from the start pose carried there: hips in metres, then 6-D."""
    hips = ((known.target_hips - place.origin)[:, None] @ place.frame)[:, 0] - place.hips
    turned = (known.target_rotations.reshape(hips.shape[0], -1, 3) @ place.frame).flatten(1)
    return torch.cat([hips, turned - place.rotations.flatten(1)], dim=-1)


class Complete(nn.Module):
    """The completion as it is exported: flat inputs, noise for the latent, 6-D rotations and contacts out."""

    def __init__(self, model: TargetPose) -> None:
        super().__init__()
        self.model = model

    def forward(self, *tensors: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        known = TargetInput(*tensors[:-1])
        x, place = self.model(known)
        made = self.model.decode(x, place, known, tensors[-1])
        return made.hips, to_six(made.rotations), made.contacts.sigmoid()
