"""Gaps drawn on the fly from frames that lie on the device: which frames, what is known of them, what really
happened."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from interpose import rotation
from interpose.features import JOINTS, RATE
from interpose.features.plan import ANCHORS
from interpose.models.geometry import joint_positions, to_six
from interpose.models.planner import GapInput
from interpose.skeleton import HUMANOID
from interpose.train.common.frames import Frames, interpolation, nlerp, world_matrices

FARTHEST_STEPS = 600
"""Steps from start to target at most, 20 s."""
UPPER_BODY = slice(HUMANOID.index("Spine"), len(HUMANOID))
"""Spine, head and arms: what mixed-style keys take from another clip."""
EASE_FRAMES = 15.0
"""Frames over which the upper body of a mixed-style key fades into the data's."""


def _relaxed() -> Tensor:
    """(22, 4): the T-pose with its arms hanging down, elbows a little bent."""
    turns = np.zeros((len(HUMANOID), 3))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        turns[HUMANOID.index(f"{side}Arm")] = (0.0, 0.0, -1.3 * sign)
        turns[HUMANOID.index(f"{side}ForeArm")] = (0.0, -0.3 * sign, 0.0)
    return torch.tensor(rotation.from_rotation_vector(turns), dtype=torch.float32)


RELAXED = _relaxed()


@dataclass(frozen=True)
class GapSampling:
    """How gaps are drawn. Probabilities unless stated otherwise.

    shortest, longest: steps from start to target. skew: above 1 short gaps are drawn more often. far: of gaps beyond
    ``longest``, up to :data:`FARTHEST_STEPS`. path: the true path is given. velocity: known, at each key by itself.
    mixed_keys: the keys' upper bodies are those of other clips (see :func:`true_poses`). balanced: starts are drawn by
    the frames' weights (`interpose.train.common.frames.balance`), not evenly.
    """

    shortest: int = 2
    longest: int = 91
    skew: float = 1.5
    far: float = 0.0
    path: float = 0.4
    velocity: float = 0.4
    style_dropout: float = 0.3
    mixed_keys: float = 0.0
    balanced: bool = False


@dataclass(frozen=True)
class Gaps:
    """Gaps of the data, a row each: first frame, steps to the target, and what is known.

    style: weights over (free, style 1, ...). path_known, start_known, target_known: 1 where the path or the velocities
    at a key are given. mixed: whether the keys' upper bodies are from other clips. start_local, target_local: the keys.
    """

    start: Int[Tensor, "row"]
    steps: Int[Tensor, "row"]
    style: Float[Tensor, "row style"]
    path_known: Float[Tensor, "row 1"]
    start_known: Float[Tensor, "row 1"]
    target_known: Float[Tensor, "row 1"]
    mixed: Bool[Tensor, "row"]
    start_local: Float[Tensor, "row 22 4"]
    target_local: Float[Tensor, "row 22 4"]

    def __len__(self) -> int:
        return len(self.start)

    @property
    def target(self) -> Int[Tensor, "row"]:
        return self.start + self.steps

    def part(self, rows: slice) -> Gaps:
        """Some of them."""
        return Gaps(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def replaced(self, rows: Int[Tensor, "index"], other: Gaps) -> Gaps:
        """With ``other`` in those rows."""
        return Gaps(**{f.name: getattr(self, f.name).index_copy(0, rows, getattr(other, f.name)) for f in fields(self)})


def draw(
    data: Frames, count: int, styles: int, rule: GapSampling, generator: torch.Generator, steps: int | None = None
) -> Gaps:
    """``count`` gaps, all of ``steps`` where given. Clips that are too short give the longest that they have room for;
    with ``steps`` they give none."""
    device = data.hips.device

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator, device=device)

    if steps is None:
        reach = torch.where(uniform(count) < rule.far, FARTHEST_STEPS, rule.longest)
        total = rule.shortest + (uniform(count) ** rule.skew * (reach - rule.shortest + 1)).long()
        if rule.balanced:
            reached = data.weight.double().cumsum(0)
            start = torch.searchsorted(reached, uniform(count).double() * reached[-1]).clamp_max(len(data) - 1)
        else:
            start = (uniform(count) * len(data)).long()
        start = torch.maximum(torch.minimum(start, data.last[start] - total), data.first[start])
        total = torch.minimum(total, data.last[start] - start).clamp_min(1)
    else:
        start = _able(data, steps)
        start = start[(uniform(count) * len(start)).long()]
        total = torch.full_like(start, steps)
    mixed = (uniform(count) < rule.mixed_keys) & (data.style[start] > 0)
    label = torch.where((uniform(count) < rule.style_dropout) & ~mixed, 0, data.style[start])
    before = (uniform(count) < rule.velocity) & (start > data.first[start]) & ~mixed
    beyond = (uniform(count) < rule.velocity) & (start + total < data.last[start]) & ~mixed
    keys = [data.local[start], data.local[start + total]]
    if rule.mixed_keys:
        upper = torch.zeros(JOINTS, 1, dtype=torch.bool, device=device)
        upper[UPPER_BODY] = True
        for i, key in enumerate(keys):
            donor = _donor(data, uniform(count), uniform(count, 1, 1))
            keys[i] = torch.where(mixed[:, None, None] & upper, donor, key)
    return Gaps(
        start,
        total,
        torch.nn.functional.one_hot(label, styles + 1).float(),
        (uniform(count, 1) < rule.path).float(),
        before.float()[:, None],
        beyond.float()[:, None],
        mixed,
        keys[0],
        keys[1],
    )


def evenly(data: Frames, steps: int, count: int, styles: int) -> Gaps:
    """``count`` evenly spaced gaps of which only the two keys are known, style free."""
    start = _able(data, steps)
    start = start[torch.linspace(0, len(start) - 1, count, device=start.device).long()]
    style = torch.zeros(count, styles + 1, device=start.device)
    style[:, 0] = 1.0
    path, before, beyond = torch.zeros(3, count, 1, device=start.device)
    mixed = torch.zeros(count, dtype=torch.bool, device=start.device)
    keys = data.local[start], data.local[start + steps]
    return Gaps(start, torch.full_like(start, steps), style, path, before, beyond, mixed, *keys)


def _able(data: Frames, steps: int) -> Int[Tensor, "frame"]:
    """The frames from which a gap of so many steps stays inside its clip."""
    return torch.nonzero(data.last - torch.arange(len(data), device=data.hips.device) >= steps)[:, 0]


def _donor(data: Frames, which: Float[Tensor, "row"], share: Float[Tensor, "row 1 1"]) -> Float[Tensor, "row 22 4"]:
    """Local rotations of random frames, blended with arms that hang down."""
    frame = (which * len(data)).long()
    return nlerp(data.local[frame], RELAXED.to(data.local).expand(len(frame), -1, -1), share)


def true_poses(
    data: Frames, gaps: Gaps, at: Int[Tensor, "row time"]
) -> tuple[Float[Tensor, "row time 22 6"], Float[Tensor, "row time 22 3"]]:
    """The true rotations (6-D) and joint positions, ``at`` frames after each start, clamped at the target.

    With mixed-style keys the upper body eases from the start key into the data's motion, over half a second at most,
    and out of it into the target key. So the label matters: the keys alone no longer show the style.
    """
    at = torch.minimum(at, gaps.steps[:, None])
    index = gaps.start[:, None] + at
    rotations, positions = data.rotations[index], data.positions[index]
    row = torch.nonzero(gaps.mixed)[:, 0]
    if len(row):
        since, whole = at[row].float(), gaps.steps[row, None].float()
        ramp = torch.clamp(whole / 2.0, max=EASE_FRAMES)
        into, out = _smoothstep(since / ramp), _smoothstep((whole - since) / ramp)
        local = data.local[index[row]]
        local = nlerp(gaps.start_local[row, None], local, into[..., None, None])
        local = nlerp(gaps.target_local[row, None], local, out[..., None, None])
        local[:, :, : UPPER_BODY.start] = data.local[index[row]][:, :, : UPPER_BODY.start]
        shape = local.shape[:2]
        matrices = world_matrices(local.flatten(0, 1))
        rotations[row] = to_six(matrices).unflatten(0, shape)
        positions[row] = joint_positions(data.hips[index[row]].flatten(0, 1), matrices).unflatten(0, shape)
    return rotations, positions


def _smoothstep(t: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    t = t.clamp(0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def velocities(data: Frames, at: Int[Tensor, "row"], side: int) -> Float[Tensor, "row 22 3"]:
    """Of the joints at those frames by the frame before (-1) or the one after (1), m/s; the clip's end stands still."""
    other = torch.minimum(torch.maximum(at + side, data.first[at]), data.last[at])
    return (data.positions[at] - data.positions[other]) * (-side * RATE)


def base(data: Frames, gaps: Gaps, parts: Float[Tensor, "row time"]) -> Float[Tensor, "row time pose"]:
    """Interpolation between the keys at those parts of each gap, as (hips, global 6-D)."""
    return interpolation(data.hips[gaps.start], gaps.start_local, data.hips[gaps.target], gaps.target_local, parts)


@dataclass(frozen=True)
class Anchors:
    """The true motion at the anchors, world frame, and interpolation there as (hips, 6-D)."""

    hips: Float[Tensor, "row anchor 3"]
    rotations: Float[Tensor, "row anchor 22 6"]
    positions: Float[Tensor, "row anchor 22 3"]
    base: Float[Tensor, "row anchor pose"]

    @property
    def residual(self) -> Float[Tensor, "row anchor pose"]:
        """What a perfect plan adds to interpolation."""
        return torch.cat([self.hips, self.rotations.flatten(2)], dim=-1) - self.base


def anchor_parts(like: Tensor) -> Float[Tensor, "anchor"]:
    """The anchors' places in a gap, 0 to 1."""
    return torch.arange(1, ANCHORS + 1, device=like.device, dtype=torch.float32) / (ANCHORS + 1)


def true_anchors(data: Frames, gaps: Gaps) -> Anchors:
    """What really happens at the anchors, linear between frames."""
    low, share = _between(data, gaps)
    turned, placed = true_poses(data, gaps, torch.cat([low, low + 1], dim=1))
    index = gaps.start[:, None] + low
    rotations, positions = (torch.lerp(x[:, :ANCHORS], x[:, ANCHORS:], share[..., None]) for x in (turned, placed))
    parts = anchor_parts(data.hips).expand(len(gaps), -1)
    hips = torch.lerp(data.hips[index], data.hips[index + 1], share)
    return Anchors(hips, rotations, positions, base(data, gaps, parts))


def gap_input(data: Frames, gaps: Gaps) -> GapInput:
    """What the planner knows of the gaps; their paths are the true roots'."""
    ends = torch.stack([torch.zeros_like(gaps.steps), gaps.steps], dim=1)
    turned, placed = true_poses(data, gaps, ends)
    low, share = _between(data, gaps)
    index = gaps.start[:, None] + low
    root, facing = (torch.lerp(x[index], x[index + 1], share) for x in (data.hips[:, ::2], data.facing))
    return GapInput(
        data.hips[gaps.start],
        turned[:, 0],
        placed[:, 0],
        velocities(data, gaps.start, -1) * gaps.start_known[..., None],
        gaps.start_known,
        data.hips[gaps.target],
        turned[:, 1],
        placed[:, 1],
        velocities(data, gaps.target, 1) * gaps.target_known[..., None],
        gaps.target_known,
        steps=gaps.steps[:, None].float(),
        style=gaps.style,
        path=torch.cat([root, torch.nn.functional.normalize(facing, dim=-1)], dim=-1),
        path_known=gaps.path_known,
    )


def _between(data: Frames, gaps: Gaps) -> tuple[Int[Tensor, "row anchor"], Float[Tensor, "row anchor 1"]]:
    """The frames after the start that each anchor lies behind, and how far it is on to the next."""
    at = anchor_parts(data.hips) * gaps.steps[:, None]
    low = torch.minimum(at.floor().long(), gaps.steps[:, None] - 1)
    return low, (at - low)[..., None]
