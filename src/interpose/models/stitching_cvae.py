"""S-CVAE: the generators of dual posture stitching (Ren et al. 2024, sections 3.3 and 4.1), one step of one of them.

A step takes the state of a chain, what it is led to and a latent z, and makes the chain's next frame: encoders, memory,
experts, phases and geometry are all inside, so that training, ONNX and the run time cannot disagree. The backward
generator is the same network with weights of its own, on motion that runs backwards.

Two forms (`interpose.models.stitch_forms`): ``paper`` as printed, and ``yaw``, our default (docs/method.md). A
latent is one for the whole gap (``gap``), from a :class:`~interpose.models.planner.Planner`, or one a frame
(``frame``), from the generator's own encoder with latent interpolation (equations 1 and 2), as printed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from interpose.features import JOINTS
from interpose.models.layers import Cell, ExpertLinear, sinusoids
from interpose.models.normal import Normal, normal
from interpose.models.planner import Planner, PlannerSize
from interpose.models.stitch_forms import FORMS, Aim, Body

LOCAL_PHASES = 4
"""A point on the circle for each foot's contacts (Starke et al. 2020), by its amplitude."""
LONGEST_CHAIN = 50.0
"""Frames to arrival that the generators are trained for (section 4.3); more are seen as these."""
CHAIN_STYLE_WIDTH = 16


@dataclass(frozen=True)
class StitchSize:
    """The networks' size and which parts they have; widths default to the paper's (section 4.1).

    encoder: hidden and output width of the three encoders. memory, decoder_memory: of the two LSTMs. hidden: of the
    experts' layers. latents: ``gap`` or ``frame``. interpolated: latent interpolation, for latents a frame. recurrent:
    an LSTM in the encoder; otherwise a layer. experts: 1 is a plain perceptron without phase modulation.
    """

    form: str = "yaw"
    encoder: tuple[int, int] = (512, 256)
    memory: int = 768
    latent: int = 16
    decoder_memory: int = 528
    experts: int = 4
    hidden: tuple[int, int, int] = (768, 512, 256)
    gate: tuple[int, int] = (64, 32)
    latents: str = "gap"
    interpolated: bool = True
    recurrent: bool = True
    planned: bool = True
    """whether the base is that of the planner's plan"""
    styles: int = 0
    plan: PlannerSize | None = None


class Memory(NamedTuple):
    """What the LSTMs of encoder and decoder carry."""

    encoder_hidden: Float[Tensor, "batch memory"]
    encoder_cell: Float[Tensor, "batch memory"]
    decoder_hidden: Float[Tensor, "batch decoder"]
    decoder_cell: Float[Tensor, "batch decoder"]


class Latent(NamedTuple):
    """Where z comes from. value: the gap's own z, or, with latents a frame, the noise of this one. share: gamma of
    equation 2, for latents a frame. style: weights over (free, style 1, ...)."""

    value: Float[Tensor, "batch unit"]
    share: Float[Tensor, "batch 1"]
    style: Float[Tensor, "batch style"]


class LocalPhase(nn.Module):
    """How the local phases go on from a frame (section 3.3, `Phase Modulation`), trained before the generators."""

    def __init__(self, state: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(state + LOCAL_PHASES, 256),
            nn.SiLU(),
            nn.Linear(256, 256),
            nn.SiLU(),
            nn.Linear(256, LOCAL_PHASES),
        )

    def forward(self, state: Float[Tensor, "batch wide"], phase: Float[Tensor, "batch 4"]) -> Float[Tensor, "batch 4"]:
        return phase + self.layers(torch.cat([state, phase], dim=-1)).float()


def _encoder(wide: int, hidden: int, out: int) -> nn.Sequential:
    layers = [nn.Linear(wide, hidden), nn.SiLU(), nn.Linear(hidden, hidden), nn.SiLU(), nn.Linear(hidden, out)]
    return nn.Sequential(*layers)


class Generator(nn.Module):
    """One of the two; see the module's text. Statistics of the features are buffers, set before training."""

    def __init__(self, size: StitchSize) -> None:
        super().__init__()
        self.size = size
        self.half_products = False  # bfloat16 inside the networks, in training only
        form = FORMS[size.form]
        self.form = form
        hidden, out = size.encoder
        self.state_encoder = _encoder(form.state, hidden, out)
        self.offset_encoder = _encoder(form.offset, hidden, out)
        self.target_encoder = _encoder(form.target, hidden, out)
        self.memory = Cell(3 * out, size.memory) if size.recurrent else nn.Linear(3 * out, size.memory)
        seen = size.latent + 2 * out
        if size.latents == "frame":
            self.current_head = nn.Sequential(
                nn.Linear(size.memory, size.memory), nn.SiLU(), nn.Linear(size.memory, 2 * size.latent)
            )
            self.arrived_head = nn.Sequential(
                nn.Linear(size.memory, size.memory), nn.SiLU(), nn.Linear(size.memory, 2 * size.latent)
            )
        else:  # what the encoder remembers would reach the decoder through z alone
            seen += size.memory
        if size.form != "paper":
            self.style = nn.Linear(size.styles + 1, CHAIN_STYLE_WIDTH, bias=False)
            seen += CHAIN_STYLE_WIDTH
        self.decoder_memory = Cell(seen, size.decoder_memory)
        gated = LOCAL_PHASES if size.form == "paper" else LOCAL_PHASES + 4 + size.latent + 1
        self.gate = nn.Sequential(
            nn.Linear(gated, size.gate[0]),
            nn.SiLU(),
            nn.Linear(size.gate[0], size.gate[1]),
            nn.SiLU(),
            nn.Linear(size.gate[1], size.experts),
        )
        widths = [size.decoder_memory, *size.hidden]
        layers = [ExpertLinear(size.experts, a, b) for a, b in pairwise(widths)]
        self.experts = nn.ModuleList([*layers, ExpertLinear(size.experts, widths[-1], form.output, 0.1)])
        self.phases = LocalPhase(form.state)
        for name in ("state", "offset", "target"):
            self.register_buffer(f"{name}_mean", torch.zeros(getattr(form, name)))
            self.register_buffer(f"{name}_std", torch.ones(getattr(form, name)))

    def begin(self, batch: int, like: Tensor) -> Memory:
        """Empty memories."""
        wide, narrow = self.size.memory, self.size.decoder_memory
        return Memory(*(like.new_zeros(batch, width) for width in (wide, wide, narrow, narrow)))

    def normalised(self, name: str, x: Float[Tensor, "batch wide"]) -> Float[Tensor, "batch wide"]:
        """Features by their statistics, clamped."""
        return ((x - getattr(self, f"{name}_mean")) / getattr(self, f"{name}_std")).clamp(-6.0, 6.0)

    def forward(
        self, body: Body, aim: Aim, memory: Memory, latent: Latent
    ) -> tuple[Body, Memory, Float[Tensor, "batch 4"], Normal | None]:
        """The next frame, the memories, the logits of its contacts, and with latents a frame their distribution."""
        features = self.form.features(body, aim)
        state = self.normalised("state", features.state)
        offset = self.normalised("offset", features.offset)
        target = self.normalised("target", features.target)
        left = aim.left.clamp(max=LONGEST_CHAIN)
        with torch.autocast(state.device.type, torch.bfloat16, enabled=self.half_products):
            time = sinusoids(left, self.size.encoder[1])
            seen = self.state_encoder(state) + time
            there = self.target_encoder(target) + time
            remembered, cell = self._remember([seen, self.offset_encoder(offset) + time, there], memory)
            distribution = None
            if self.size.latents == "frame":
                distribution = self._latent(remembered, there, memory, latent.share, body, aim)
                z = distribution.at(latent.value)
                parts = [z, seen, there]
            else:
                z = latent.value
                parts = [z, seen, there, remembered]
            if self.size.form != "paper":
                parts.append(self.style(latent.style))
            wide = torch.cat([part.float() for part in parts], dim=-1)
            hidden, decoder = self.decoder_memory(wide, memory.decoder_hidden, memory.decoder_cell)
            phase = self.phases(state, body.phase)
            gated = [phase] if self.size.form == "paper" else [phase, body.contacts, z, left / LONGEST_CHAIN]
            gate = torch.softmax(self.gate(torch.cat(gated, dim=-1)).float(), dim=-1)
            out = hidden
            for layer in self.experts[:-1]:
                out = F.silu(layer(out, gate))
            out = self.experts[-1](out, gate).float()
        after, contacts = self.form.advance(body, aim, features, out)
        after = after._replace(phase=phase)
        return after, Memory(remembered, cell, hidden, decoder), contacts, distribution

    def _remember(self, parts: list[Tensor], memory: Memory) -> tuple[Tensor, Tensor]:
        joined = torch.cat([part.float() for part in parts], dim=-1)
        if isinstance(self.memory, Cell):
            return self.memory(joined, memory.encoder_hidden, memory.encoder_cell)
        return F.silu(self.memory(joined).float()), memory.encoder_cell

    def _latent(
        self,
        remembered: Tensor,
        there: Tensor,
        memory: Memory,
        share: Tensor,
        body: Body,
        aim: Aim,
    ) -> Normal:
        """The distribution of this frame's latent: the current one, and towards the seam more and more that of
        having arrived (equation 1), for which the target stands in the current frame's place and the offset is nil."""
        now = normal(self.current_head(remembered))
        if not self.size.interpolated:
            return now
        features = self.form.features(self.form.arrived(body, aim), aim)
        state = self.normalised("state", features.state)
        offset = self.normalised("offset", torch.zeros_like(features.offset))
        again = [self.state_encoder(state), self.offset_encoder(offset), there]
        arrived, _ = self._remember(again, memory)
        then = normal(self.arrived_head(arrived))
        return Normal(*(a + share * (b - a) for a, b in zip(now, then, strict=True)))


class StitchingCVAE(nn.Module):
    """Both generators and the plan that they share."""

    mean_quaternions: Tensor

    def __init__(self, size: StitchSize) -> None:
        super().__init__()
        self.size = size
        self.front = Generator(size)
        self.back = Generator(size)
        self.plan = None if size.plan is None else Planner(size.plan)
        self.register_buffer("mean_quaternions", torch.zeros(JOINTS, 4))  # whose signs the paper's form keeps

    def halve(self, on: bool) -> None:
        """bfloat16 products in the generators, or not."""
        self.front.half_products = self.back.half_products = on
        if self.plan is not None:
            self.plan.half_products = on
