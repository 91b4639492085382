"""Inputs and outputs of S-CVAE's generators: the paper's form and our own, ``yaw``.

``paper`` (Ren et al. 2024, section 4.1): local quaternions, the root's velocity and contacts (95); the quaternions' and
the root's difference from the target (91); the target's quaternions (88); the network says what is added to the
current frame. Everything is in the frame of the gap.

``yaw``: the same things in the chain's own root frame at each step, with global rotations as 6-D, joint positions and
velocities, and the offset a frame; the network says what is added to where the base leads. With A the base (the plan's
poses on interpolation's) at the current frame c, at the next one and at the aim, k the frames to the aim, and D what a
pose differs by from its base,

    next = A(c+1) + D(c) + (D(aim) - D(c)) / k + min(1, (k-1) / 3) net.

The last step to an aim makes exactly the aim, so that the chains meet and keys stay keys; what the network adds fades
before it, so that they meet without a jolt.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import roma
import torch
from jaxtyping import Float
from torch import Tensor

from interpose.features import JOINTS, RATE, RESIDUAL_HIPS_SCALE, RESIDUAL_ROTATION_SCALE
from interpose.models.geometry import (
    OFFSETS,
    facing,
    joint_positions,
    root_frame,
    to_matrix,
    to_six,
)
from interpose.skeleton import HUMANOID

VELOCITY_SCALE = 0.02
QUATERNION_SCALE = 0.05
"""What one unit of the paper form's output means: metres a frame, quaternion components."""


class Body(NamedTuple):
    """A chain's newest frame; world frame, metres, seconds, in the chain's own direction of time.

    rotations: ``q_world_joint`` as 6-D in the yaw form, local quaternions in the paper's. velocities: of the joints;
    known: 0 where they are not. contacts: probabilities. phase: local phases.
    """

    hips: Float[Tensor, "batch 3"]
    rotations: Float[Tensor, "batch joint turn"]
    positions: Float[Tensor, "batch joint 3"]
    velocities: Float[Tensor, "batch joint 3"]
    known: Float[Tensor, "batch 1"]
    contacts: Float[Tensor, "batch 4"]
    phase: Float[Tensor, "batch 4"]


class Aim(NamedTuple):
    """What a step is led to. left: frames to it. here, following, there: the base (hips, 6-D) at the current frame, the
    next one and the aim; the paper's form has none and does not look at them."""

    hips: Float[Tensor, "batch 3"]
    rotations: Float[Tensor, "batch joint turn"]
    positions: Float[Tensor, "batch joint 3"]
    left: Float[Tensor, "batch 1"]
    here: Float[Tensor, "batch pose"]
    following: Float[Tensor, "batch pose"]
    there: Float[Tensor, "batch pose"]


class Features(NamedTuple):
    """The inputs of the three encoders before normalisation, and what :meth:`Form.advance` needs again."""

    state: Float[Tensor, "batch state"]
    offset: Float[Tensor, "batch offset"]
    target: Float[Tensor, "batch target"]
    frame: Float[Tensor, "batch 3 3"]
    led: Float[Tensor, "batch pose"]


class Form(Protocol):
    """Widths of the encoders' inputs and of the output, numbers of a joint's rotation, and the two functions."""

    state: int
    offset: int
    target: int
    output: int
    turn: int

    def features(self, body: Body, aim: Aim) -> Features:
        """What the encoders see."""
        ...

    def arrived(self, body: Body, aim: Aim) -> Body:
        """The chain as if it had arrived: the aim in place of its newest frame."""
        ...

    def advance(
        self, body: Body, aim: Aim, features: Features, out: Float[Tensor, "batch out"]
    ) -> tuple[Body, Float[Tensor, "batch 4"]]:
        """The next frame, its phase not yet moved on, and the logits of its contacts."""
        ...


class Yaw:
    """See the module's text."""

    state = JOINTS * 12 + 5
    offset = JOINTS * 3 + 2 * (3 + JOINTS * 6)
    target = JOINTS * 9
    output = 3 + JOINTS * 6 + 4
    turn = 6

    def features(self, body: Body, aim: Aim) -> Features:
        """Positions from the root on the ground, rotations and velocities; speed needed, rotation and base step left;
        the aim's positions and rotations; all in the root frame of the newest frame."""
        batch = body.hips.shape[0]  # len() would fix the batch when exported
        frame = root_frame(facing(to_matrix(body.rotations[:, 0])))
        origin = (body.hips * body.hips.new_tensor([1.0, 0.0, 1.0]))[:, None]
        pose = torch.cat([body.hips, body.rotations.flatten(1)], dim=-1)
        there = torch.cat([aim.hips, aim.rotations.flatten(1)], dim=-1)
        apart = pose - aim.here
        led = aim.following + apart + (there - aim.there - apart) / aim.left
        each = [
            body.positions - origin,
            body.rotations.reshape(batch, -1, 3),
            body.velocities,
            (aim.positions - body.positions) * (RATE / aim.left[:, :, None]),
            (there - pose).reshape(batch, -1, 3),
            (led - pose).reshape(batch, -1, 3),
            aim.positions - origin,
            aim.rotations.reshape(batch, -1, 3),
        ]
        sizes = [sum(part.shape[1] for part in each[i:j]) for i, j in ((0, 3), (3, 6), (6, 8))]
        state, offset, target = (torch.cat(each, dim=1) @ frame).split(sizes, dim=1)
        state = torch.cat([state.flatten(1), body.contacts, body.known], dim=-1)
        return Features(state, offset.flatten(1), target.flatten(1), frame, led)

    def arrived(self, body: Body, aim: Aim) -> Body:
        """At rest."""
        still = torch.zeros_like(body.velocities)
        nothing = torch.zeros_like(body.known)
        return body._replace(
            hips=aim.hips, rotations=aim.rotations, positions=aim.positions, velocities=still, known=nothing
        )

    def advance(
        self, body: Body, aim: Aim, features: Features, out: Float[Tensor, "batch out"]
    ) -> tuple[Body, Float[Tensor, "batch 4"]]:
        """Where the base leads, and what the network adds, which fades before the aim."""
        batch = body.hips.shape[0]
        moving = ((aim.left - 1.0) / 3.0).clamp(0.0, 1.0)
        added = (out[:, :-4].reshape(batch, -1, 3) @ features.frame.transpose(-1, -2)).flatten(1) * moving
        hips = features.led[:, :3] + RESIDUAL_HIPS_SCALE * added[:, :3]
        matrices = to_matrix((features.led[:, 3:] + RESIDUAL_ROTATION_SCALE * added[:, 3:]).reshape(batch, JOINTS, 6))
        positions = joint_positions(hips, matrices)
        after = body._replace(
            hips=hips,
            rotations=to_six(matrices),
            positions=positions,
            velocities=(positions - body.positions) * RATE,
            known=torch.ones_like(body.known),
            contacts=out[:, -4:].sigmoid(),
        )
        return after, out[:, -4:]


class Paper:
    """See the module's text. Root velocities are of the hips, metres a frame."""

    state = JOINTS * 4 + 3 + 4
    offset = JOINTS * 4 + 3
    target = JOINTS * 4
    output = JOINTS * 4 + 3 + 4
    turn = 4

    def features(self, body: Body, aim: Aim) -> Features:
        """The 95, 91 and 88 numbers of section 4.1."""
        turned = body.rotations.flatten(1)
        state = torch.cat([turned, body.velocities[:, 0] / RATE, body.contacts], dim=-1)
        offset = torch.cat([aim.rotations.flatten(1) - turned, aim.hips - body.hips], dim=-1)
        pose = torch.cat([body.hips, turned], dim=-1)
        still = torch.eye(3, dtype=turned.dtype, device=turned.device).expand(turned.shape[0], 3, 3)
        return Features(state, offset, aim.rotations.flatten(1), still, pose)

    def arrived(self, body: Body, aim: Aim) -> Body:
        """At rest."""
        still = torch.zeros_like(body.velocities)
        return body._replace(hips=aim.hips, rotations=aim.rotations, positions=aim.positions, velocities=still)

    def advance(
        self, body: Body, aim: Aim, features: Features, out: Float[Tensor, "batch out"]
    ) -> tuple[Body, Float[Tensor, "batch 4"]]:
        """Quaternion updates, added and normalised, and the root's velocity, integrated."""
        del aim, features
        batch = body.hips.shape[0]
        turned = body.rotations + QUATERNION_SCALE * out[:, : JOINTS * 4].reshape(batch, JOINTS, 4)
        turned = turned / turned.norm(dim=-1, keepdim=True).clamp_min(1e-6)
        hips = body.hips + VELOCITY_SCALE * out[:, JOINTS * 4 : JOINTS * 4 + 3]
        positions = chain_positions(hips, turned)
        after = body._replace(
            hips=hips,
            rotations=turned,
            positions=positions,
            velocities=(positions - body.positions) * RATE,
            known=torch.ones_like(body.known),
            contacts=out[:, -4:].sigmoid(),
        )
        return after, out[:, -4:]


FORMS: dict[str, Form] = {"yaw": Yaw(), "paper": Paper()}


def chain_positions(
    hips: Float[Tensor, "*batch 3"], local: Float[Tensor, "*batch joint 4"]
) -> Float[Tensor, "*batch joint 3"]:
    """Forward kinematics from local quaternions."""
    turned = roma.unitquat_to_rotmat(local)
    world, placed = [turned[..., 0, :, :]], [hips]
    for joint, parent in enumerate(HUMANOID.parents[1:], start=1):
        placed.append(placed[parent] + (world[parent] @ OFFSETS[joint].to(hips)[:, None])[..., 0])
        world.append(world[parent] @ turned[..., joint, :, :])
    return torch.stack(placed, dim=-2)
