"""Batches of whole gaps for the recipe of S-CVAE, drawn on the fly from frames that lie on the device."""

from __future__ import annotations

from dataclasses import dataclass

import roma
import torch
from jaxtyping import Float, Int
from torch import Tensor

from interpose.data.contacts import INDICES
from interpose.features import RATE
from interpose.models.geometry import root_frame
from interpose.models.planner import Ends
from interpose.models.stitch_forms import Body
from interpose.stitch_layout import ANCHORS, STANDING
from interpose.train.common.frames import Frames, interpolation


@dataclass(frozen=True)
class Sampling:
    """How gaps are drawn; probabilities of what is known of one."""

    shortest: int = 3
    """steps from start to target"""
    longest: int = 90
    longer: float = 1.5
    """above 1 the shorter ones are drawn more often"""
    path: float = 0.3
    velocity: float = 0.3
    """for each key by itself"""
    style_dropout: float = 0.3


@dataclass(frozen=True)
class Gaps:
    """Which frames: from ``start`` on, ``steps`` intervals each; and what is known of each gap."""

    start: Int[Tensor, "row"]
    steps: Int[Tensor, "row"]
    style: Float[Tensor, "row style"]
    path_known: Float[Tensor, "row 1"]
    start_known: Float[Tensor, "row 1"]
    target_known: Float[Tensor, "row 1"]

    @property
    def target(self) -> Int[Tensor, "row"]:
        return self.start + self.steps


def draw(
    data: Frames,
    count: int,
    styles: int,
    rule: Sampling,
    generator: torch.Generator,
    steps: int | None = None,
) -> Gaps:
    """``count`` gaps, all of ``steps`` where given. Clips that are too short give the longest that they have room for;
    with ``steps`` they give none."""
    device = data.hips.device

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator, device=device)

    if steps is None:
        span = rule.longest - rule.shortest + 1
        wanted = rule.shortest + (uniform(count) ** rule.longer * span).long()
        start = (uniform(count) * len(data)).long()
        start = torch.maximum(torch.minimum(start, data.last[start] - wanted), data.first[start])
        wanted = torch.minimum(wanted, data.last[start] - start).clamp_min(1)
    else:
        able = torch.nonzero(data.last - torch.arange(len(data), device=device) >= steps)[:, 0]
        start = able[(uniform(count) * len(able)).long()]
        wanted = torch.full_like(start, steps)
    label = torch.where(uniform(count) < rule.style_dropout, 0, data.style[start])
    style = torch.nn.functional.one_hot(label, styles + 1).float()
    return Gaps(
        start,
        wanted,
        style,
        (uniform(count, 1) < rule.path).float(),
        ((uniform(count, 1) < rule.velocity) & (start > data.first[start])[:, None]).float(),
        ((uniform(count, 1) < rule.velocity) & (start + wanted < data.last[start])[:, None]).float(),
    )


def evenly(data: Frames, steps: int, count: int, styles: int) -> Gaps:
    """``count`` evenly spaced gaps of which only the two keys are known, style free."""
    device = data.hips.device
    able = torch.nonzero(data.last - torch.arange(len(data), device=device) >= steps)[:, 0]
    start = able[torch.linspace(0, len(able) - 1, count, device=device).long()]
    style = torch.zeros(count, styles + 1, device=device)
    style[:, 0] = 1.0
    nothing = torch.zeros(count, 1, device=device)
    return Gaps(start, torch.full_like(start, steps), style, nothing, nothing, nothing)


def anchor_times(like: Tensor) -> Float[Tensor, "anchor"]:
    """The anchors' places in the gap, 0 to 1."""
    return torch.arange(1, ANCHORS + 1, device=like.device, dtype=torch.float32) / (ANCHORS + 1)


def between(values: Float[Tensor, "frame *rest"], gaps: Gaps, parts: Float[Tensor, "time"]) -> Tensor:
    """``values`` at those parts of each gap, linear between frames: (row, time, ...)."""
    at = parts * gaps.steps[:, None]
    low = torch.minimum(at.floor().long(), gaps.steps[:, None] - 1)
    share = (at - low).reshape(*at.shape, *[1] * (values.ndim - 1))
    index = gaps.start[:, None] + low
    return values[index] * (1.0 - share) + values[index + 1] * share


def ends(data: Frames, gaps: Gaps) -> Ends:
    """What a plan is told of the gaps."""
    start, target = gaps.start, gaps.target
    parts = anchor_times(data.hips)
    root = between(data.hips, gaps, parts)[..., ::2]
    turned = torch.nn.functional.normalize(between(data.facing, gaps, parts), dim=-1)
    return Ends(
        *_key(data, start, _velocities(data, start, -1) * gaps.start_known[..., None], gaps.start_known),
        *_key(data, target, _velocities(data, target, 1) * gaps.target_known[..., None], gaps.target_known),
        steps=gaps.steps[:, None].float(),
        style=gaps.style,
        path=torch.cat([root, turned], dim=-1),
        path_known=gaps.path_known,
    )


def _key(data: Frames, at: Int[Tensor, "row"], velocities: Tensor, known: Tensor) -> tuple[Tensor, ...]:
    return data.hips[at], data.rotations[at], data.positions[at], velocities, known


def _velocities(data: Frames, at: Int[Tensor, "row"], side: int) -> Float[Tensor, "row 22 3"]:
    """Of the joints at those frames by the frame before (-1) or the one after (1)."""
    other = torch.minimum(torch.maximum(at + side, data.first[at]), data.last[at])
    return (data.positions[at] - data.positions[other]) * (-side * RATE)


@dataclass(frozen=True)
class Motion:
    """The true motion of each gap, keys included; rotations in the form's own numbers."""

    hips: Float[Tensor, "row frame 3"]
    rotations: Float[Tensor, "row frame 22 turn"]
    positions: Float[Tensor, "row frame 22 3"]
    contacts: Float[Tensor, "row frame 4"]


def motion(data: Frames, gaps: Gaps, steps: int) -> Motion:
    """What really happened in gaps of ``steps``, as the yaw form has it: the world frame, 6-D."""
    index = gaps.start[:, None] + torch.arange(steps + 1, device=data.hips.device)
    return Motion(data.hips[index], data.rotations[index], data.positions[index], data.contacts[index])


def letter_motion(data: Frames, gaps: Gaps, steps: int, mean: Float[Tensor, "22 4"]) -> Motion:
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
    return Motion(hips, signed(local, mean), positions, data.contacts[index])


def _unturned(direction: Float[Tensor, "row 2"]) -> Float[Tensor, "row 4"]:
    """The rotation about the vertical that turns what faces ``direction`` (x, z) to face +Z."""
    half = -0.5 * torch.atan2(direction[:, 0], direction[:, 1])
    nothing = torch.zeros_like(half)
    return torch.stack([nothing, half.sin(), nothing, half.cos()], dim=-1)


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


def bodies(data: Frames, gaps: Gaps, true: Motion) -> tuple[Body, Body]:
    """The chains' first frames: the start, and the target with time running backwards. Velocities are the world's."""
    front, back = (
        Body(
            true.hips[:, end],
            true.rotations[:, end],
            true.positions[:, end],
            _velocities(data, at, side) * (-side * known[..., None]),
            known,
            standing(data.positions[at]),
            data.hips.new_zeros(len(at), 4),
        )
        for end, at, side, known in (
            (0, gaps.start, -1, gaps.start_known),
            (-1, gaps.target, 1, gaps.target_known),
        )
    )
    return front, back


def standing(positions: Float[Tensor, "row 22 3"]) -> Float[Tensor, "row 4"]:
    """Contacts of a lone key, by height."""
    return (positions[:, INDICES, 1] < positions.new_tensor(STANDING)).float()


def base(data: Frames, gaps: Gaps, parts: Float[Tensor, "row time"]) -> Float[Tensor, "row time pose"]:
    """Interpolation at those parts of each gap, as (hips, global 6-D)."""
    start, target = gaps.start, gaps.target
    return interpolation(data.hips[start], data.local[start], data.hips[target], data.local[target], parts)


def residual(data: Frames, gaps: Gaps, led: Float[Tensor, "row anchor pose"]) -> Float[Tensor, "row anchor pose"]:
    """What the true poses at the anchors differ by from ``led``."""
    parts = anchor_times(data.hips)
    true = torch.cat([between(data.hips, gaps, parts), between(data.rotations, gaps, parts).flatten(2)], dim=-1)
    return true - led
