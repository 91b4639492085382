"""DC-MoE: the dynamic conditional mixture of experts (Chu and Yang 2024, section 3), one step of it.

A step takes the state of a roll-out and what steers it, in world units, and returns the next state: features,
normalisation, network and geometry are all inside, so that training, ONNX and the run time cannot disagree.

The network is the paper's: expert layers blended by a gate that sees phases, style and time to arrival. Blending the
weights of linear layers and blending their outputs are the same thing; the latter is one large product. What it
predicts has two forms. ``absolute`` is the paper's: the next pose. The default is a residual on the interpolation base:
with A the interpolation from start to target, c the frames gone and k those left,

    next = A(c+1) + (k-1)/k (current - A(c)) + [k > 1] net,

in 6-D, so that what the network adds decays to nothing at the target and arrival is exact whatever it says.

With a planner (`interpose.models.planner`) A is its prediction of the whole gap, so that the steps only fill it in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from interpose.data.contacts import CONTACT_JOINTS
from interpose.features import (
    CHANNELS,
    EXPERT_INPUT,
    GATE_INPUT,
    JOINTS,
    KEY_STEP,
    KEYS,
    LONGEST_ARRIVAL,
    RATE,
    SIDE_KEYS,
    output_layout,
)
from interpose.models.geometry import facing, joint_positions, root_frame, to_matrix, to_six
from interpose.models.layers import ExpertLinear, sinusoids
from interpose.models.planner import Planner, PlannerSize

PHASE_BANK_SIZE = 256
"""Phase windows kept with the model."""


@dataclass(frozen=True)
class DCMoESize:
    """The network's size; the defaults are the paper's (section 3.1). plan: of the planner, None for none."""

    experts: int = 16
    hidden: int = 512
    gate: tuple[int, int] = (512, 128)
    absolute: bool = False
    styles: int = 0
    plan: PlannerSize | None = None


class State(NamedTuple):
    """What a roll-out carries; shapes in `interpose.features.state_shapes`, a batch axis first."""

    hips: Float[Tensor, "batch 3"]
    rotations: Float[Tensor, "batch joint 6"]
    positions: Float[Tensor, "batch joint 3"]
    velocities: Float[Tensor, "batch joint 3"]
    velocity_known: Float[Tensor, "batch 1"]
    track: Float[Tensor, "batch history 4"]
    phase_past: Float[Tensor, "batch frame channel 2"]
    phase_future: Float[Tensor, "batch key channel 2"]


class Control(NamedTuple):
    """What steers one step; shapes in `interpose.features.control_shapes`, a batch axis first."""

    target_hips: Float[Tensor, "batch 3"]
    target_rotations: Float[Tensor, "batch joint 6"]
    target_positions: Float[Tensor, "batch joint 3"]
    base: Float[Tensor, "batch pose"]
    base_next: Float[Tensor, "batch pose"]
    frames_left: Float[Tensor, "batch 1"]
    style: Float[Tensor, "batch style"]
    path: Float[Tensor, "batch key 6"]
    path_known: Float[Tensor, "batch 1"]


class Prediction(NamedTuple):
    """What a step says beside the next state. Positions, velocities and trajectory are in the root frame of the step's
    start (``frame``, ``origin``); contacts are logits; ``raw_positions`` are the paper's own p, where predicted."""

    positions: Float[Tensor, "batch joint 3"]
    raw_positions: Float[Tensor, "batch joint 3"]
    rotations: Float[Tensor, "batch joint 6"]
    velocities: Float[Tensor, "batch joint 3"]
    contacts: Float[Tensor, "batch key foot"]
    trajectory: Float[Tensor, "batch key 6"]
    phases: Float[Tensor, "batch key channel 3"]
    frame: Float[Tensor, "batch 3 3"]
    origin: Float[Tensor, "batch 3"]


def _paper_input() -> Tensor:
    """1 for the features that the paper has, 0 for ours, which the absolute form does not see."""
    seen = torch.zeros(EXPERT_INPUT.width)
    for name in ("position", "rotation", "velocity", "target_position", "target_rotation", "trajectory"):
        seen[EXPERT_INPUT.slices()[name]] = 1.0
    return seen


PAPER_INPUT = _paper_input()


class Network(nn.Module):
    """Experts of three layers and the gate of three, SiLU between them (section 3.1)."""

    def __init__(self, size: DCMoESize) -> None:
        super().__init__()
        out = output_layout(size.absolute).width
        k, h = size.experts, size.hidden
        self.gate = nn.Sequential(
            nn.Linear(GATE_INPUT.width, size.gate[0]),
            nn.SiLU(),
            nn.Linear(size.gate[0], size.gate[1]),
            nn.SiLU(),
            nn.Linear(size.gate[1], k),
        )
        last = 1.0 if size.absolute else 0.1
        self.experts = nn.ModuleList(
            [ExpertLinear(k, EXPERT_INPUT.width, h), ExpertLinear(k, h, h), ExpertLinear(k, h, out, last)]
        )

    def forward(
        self, x: Float[Tensor, "batch wide"], condition: Float[Tensor, "batch gate"]
    ) -> Float[Tensor, "batch out"]:
        gate = torch.softmax(self.gate(condition).float(), dim=-1)
        x = F.silu(self.experts[0](x, gate))
        x = F.silu(self.experts[1](x, gate))
        return self.experts[2](x, gate)


class DCMoE(nn.Module):
    """One step of the roll-out; see the module's text. Statistics of the features are buffers, set before training."""

    mean: Tensor
    std: Tensor
    out_mean: Tensor
    out_std: Tensor
    phase_bank: Tensor

    def __init__(self, size: DCMoESize) -> None:
        super().__init__()
        self.size = size
        self.half_products = False  # bfloat16 inside the network, in training only
        self.layout = output_layout(size.absolute)
        self.network = Network(size)
        self.planner = None if size.plan is None else Planner(size.plan)
        self.style = nn.Linear(size.styles + 1, 256, bias=False)  # a lookup table that also takes mixed labels
        nn.init.normal_(self.style.weight)
        self.register_buffer("mean", torch.zeros(EXPERT_INPUT.width))
        self.register_buffer("std", torch.ones(EXPERT_INPUT.width))
        self.register_buffer("out_mean", torch.zeros(self.layout.width))
        self.register_buffer("out_std", torch.ones(self.layout.width))
        self.register_buffer(
            "phase_bank", torch.zeros(PHASE_BANK_SIZE, KEYS, CHANNELS, 2)
        )  # real windows, to begin variants in

    def features(
        self, state: State, control: Control
    ) -> tuple[
        Float[Tensor, "batch wide"], Float[Tensor, "batch pose"], Float[Tensor, "batch 3 3"], Float[Tensor, "batch 3"]
    ]:
        """The experts' input before normalisation; where the base leads (world); the root frame and its origin."""
        batch = state.hips.shape[0]  # len() would fix the batch when exported
        frame = root_frame(facing(to_matrix(state.rotations[:, 0])))
        origin = state.hips * state.hips.new_tensor([1.0, 0.0, 1.0])
        k = control.frames_left
        pose = torch.cat([state.hips, state.rotations.flatten(1)], dim=-1)
        led = control.base_next + (k - 1.0) / k * (pose - control.base)
        here, there = state.positions, control.target_positions
        vectors = torch.cat(
            [
                here - origin[:, None],
                state.rotations.reshape(batch, -1, 3),
                state.velocities,
                there - origin[:, None],
                control.target_rotations.reshape(batch, -1, 3),
                (there - here) * (RATE / k[:, :, None]),
                (led - pose).reshape(batch, -1, 3),
            ],
            dim=1,
        )
        vectors = (vectors @ frame).flatten(1)
        j = JOINTS * 3
        body, needed = vectors[:, : 7 * j], vectors[:, 7 * j :]  # (pose and target), (speed_needed and base_step)
        time = torch.cat([k.clamp(max=LONGEST_ARRIVAL) / RATE, 1.0 / k], dim=-1)
        known = torch.cat([state.velocity_known, control.path_known], dim=-1)
        trajectory = self._trajectory(state, control, frame, origin)
        return torch.cat([body, trajectory, needed, time, known], dim=-1), led, frame, origin

    @staticmethod
    def _trajectory(
        state: State, control: Control, frame: Float[Tensor, "batch 3 3"], origin: Float[Tensor, "batch 3"]
    ) -> Float[Tensor, "batch wide"]:
        """X^R: 13 keys of root position, facing and velocity on the ground in the current root's frame; unknown = 0."""
        ground = frame[:, ::2, ::2]
        past = state.track[:, 1::KEY_STEP]
        velocity = (past[..., :2] - state.track[:, 0:-1:KEY_STEP, :2]) * RATE
        past = torch.cat([past, velocity], dim=-1)
        both = torch.cat([past, control.path], dim=1)
        centre = torch.cat([origin[:, ::2], torch.zeros_like(origin[:, :2]), torch.zeros_like(origin[:, :2])], dim=-1)
        both = ((both - centre[:, None]).reshape(both.shape[0], -1, 2) @ ground).reshape(both.shape)
        future = both[:, SIDE_KEYS + 1 :] * control.path_known[:, :, None]
        return torch.cat([both[:, : SIDE_KEYS + 1], future], dim=1).flatten(1)

    def forward(self, state: State, control: Control, mask: Tensor | None = None) -> tuple[State, Prediction]:
        """The next state and the prediction behind it. ``mask`` (batch, expert input) hides normalised features."""
        x, led, frame, origin = self.features(state, control)
        x = ((x - self.mean) / self.std).clamp(-6.0, 6.0)
        if self.size.absolute:
            x = x * PAPER_INPUT.to(x)
        if mask is not None:
            x = x * mask
        phases = torch.cat([state.phase_past[:, ::KEY_STEP], state.phase_future], dim=1)
        arrival = sinusoids(control.frames_left.clamp(max=LONGEST_ARRIVAL))
        condition = torch.cat([phases.flatten(1), self.style(control.style), arrival], dim=-1)
        if self.half_products:
            with torch.autocast(x.device.type, torch.bfloat16):
                out = self.network(x, condition).float()
        else:
            out = self.network(x, condition)
        out = out * self.out_std + self.out_mean
        return self._advance(state, control, led, frame, origin, out)

    def _advance(
        self, state: State, control: Control, led: Tensor, frame: Tensor, origin: Tensor, out: Tensor
    ) -> tuple[State, Prediction]:
        batch = out.shape[0]
        part = dict(zip((n for n, _ in self.layout.blocks), out.split(self.layout.sizes(), dim=-1), strict=True))
        back = frame.transpose(-1, -2)
        turned = part["rotation"].reshape(batch, -1, 3) @ back
        if self.size.absolute:
            raw = part["position"].reshape(batch, JOINTS, 3)
            hips = (raw[:, :1] @ back)[:, 0] + origin
            matrices = to_matrix(turned.reshape(batch, JOINTS, 6))
        else:
            moving = (control.frames_left > 1.5).to(out.dtype)
            moved = (part["hips"][:, None] @ back)[:, 0]
            hips = led[:, :3] + moving * moved
            delta = turned.reshape(batch, JOINTS, 6)
            matrices = to_matrix(led[:, 3:].reshape(batch, JOINTS, 6) + moving[..., None] * delta)
        rotations = to_six(matrices)
        positions = joint_positions(hips, matrices)
        local = (positions - origin[:, None]) @ frame
        phases = self._phases(state, part["phase"].reshape(batch, SIDE_KEYS + 1, CHANNELS, 3))
        track = torch.cat([hips[:, ::2], facing(matrices[:, 0])], dim=-1)
        after = State(
            hips=hips,
            rotations=rotations,
            positions=positions,
            velocities=(positions - state.positions) * RATE,
            velocity_known=torch.ones_like(state.velocity_known),
            track=torch.cat([state.track[:, 1:], track[:, None]], dim=1),
            phase_past=torch.cat([state.phase_past[:, 1:], phases[:, :1]], dim=1),
            phase_future=phases[:, 1:],
        )
        return after, Prediction(
            positions=local,
            raw_positions=part["position"].reshape(batch, JOINTS, 3) if self.size.absolute else local,
            rotations=(rotations.reshape(batch, -1, 3) @ frame).reshape(batch, JOINTS, 6),
            velocities=part["velocity"].reshape(batch, JOINTS, 3),
            contacts=part["contact"].reshape(batch, SIDE_KEYS + 1, len(CONTACT_JOINTS)),
            trajectory=part["trajectory"].reshape(batch, SIDE_KEYS + 1, 6),
            phases=part["phase"].reshape(batch, SIDE_KEYS + 1, CHANNELS, 3),
            frame=frame,
            origin=origin,
        )

    @staticmethod
    def _phases(state: State, predicted: Float[Tensor, "batch key channel 3"]) -> Float[Tensor, "batch key channel 2"]:
        """The phase update: each key's old phase, turned by its frequency, averaged in direction
        with the predicted one, at the predicted amplitude. Where the old one is unknown (nil), that one stands."""
        before = torch.cat([state.phase_past[:, -1:], state.phase_future], dim=1)
        angle = predicted[..., 2] * (2.0 * math.pi / RATE)
        sin, cos = before[..., 0], before[..., 1]
        turned = torch.stack([sin * angle.cos() + cos * angle.sin(), cos * angle.cos() - sin * angle.sin()], dim=-1)
        point = predicted[..., :2]
        size = point.norm(dim=-1, keepdim=True)
        both = turned / (turned.norm(dim=-1, keepdim=True) + 1e-2) + point / (size + 1e-2)
        return both / (both.norm(dim=-1, keepdim=True) + 1e-2) * size
