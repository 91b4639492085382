"""Roll-outs drawn on the fly: the whole database as tensors on the device, a batch as index arrays.

A *row* is one roll-out in progress: a gap of the data, and where in it the roll-out is.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from interpose.features import HISTORY, KEY_STEP, RATE, SIDE_KEYS
from interpose.models.dcmoe import Control, State
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.train.common import gaps
from interpose.train.common.frames import Frames
from interpose.train.common.gaps import Gaps, GapSampling, true_poses
from interpose.train.planner.objective import planned_base


@dataclass
class Rows:
    """Roll-outs in progress. gone: frames since the start. plan: of the gap, None where the steps have no planner."""

    gaps: Gaps
    gone: Int[Tensor, "row"]
    state: State
    plan: Float[Tensor, "row anchor pose"] | None = None

    def __len__(self) -> int:
        return len(self.gaps)

    def part(self, where: slice) -> Rows:
        """Some of them, without the others."""
        plan = None if self.plan is None else self.plan[where]
        return Rows(self.gaps.part(where), self.gone[where], State(*(x[where] for x in self.state)), plan)

    def replaced(self, where: Int[Tensor, "index"], fresh: Rows) -> Rows:
        """With ``fresh`` at the indices ``where``."""
        plan = None
        if self.plan is not None and fresh.plan is not None:
            plan = self.plan.index_copy(0, where, fresh.plan)
        state = State(*(old.index_copy(0, where, new) for old, new in zip(self.state, fresh.state, strict=True)))
        gone = self.gone.index_copy(0, where, fresh.gone)
        return Rows(self.gaps.replaced(where, fresh.gaps), gone, state, plan)


@dataclass(frozen=True)
class RollOutSampling:
    """How rows are drawn. Probabilities unless stated otherwise.

    gaps: of the gaps. At a gap's start the frames before it are known where the gap's start velocity is, otherwise the
    past is clamped to the key, as at run time. inside: of rows that begin inside their gap.
    """

    gaps: GapSampling = field(default_factory=lambda: GapSampling(path=0.5, velocity=0.25))
    inside: float = 0.35
    phase_known_at_start: float = 0.4
    phase_known_inside: float = 0.7
    rotation_noise: float = 0.03
    hips_noise: float = 0.015
    """metres"""


def draw(data: Frames, count: int, styles: int, rule: RollOutSampling, generator: torch.Generator) -> Rows:
    """``count`` fresh rows without plans. Device and random numbers follow ``data`` and ``generator``."""
    device = data.hips.device

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator, device=device)

    drawn = gaps.draw(data, count, styles, rule.gaps, generator)
    inside = uniform(count) < rule.inside
    gone = torch.where(inside, (uniform(count) * (drawn.steps - 1)).long(), 0)
    now = drawn.start + gone
    past_known = (drawn.start_known[:, 0] > 0.0) | (inside & (uniform(count) < 0.5))
    lowest = torch.where(past_known, drawn.start - 10, torch.where(inside, drawn.start, now))
    lowest = torch.minimum(torch.maximum(lowest, data.first[drawn.start]), now)
    known_phase = uniform(count) < torch.where(inside, rule.phase_known_inside, rule.phase_known_at_start)
    noisy = inside.float() * uniform(count)
    around = torch.stack([(gone - 1).clamp_min(0), gone], dim=1)
    turned, placed = true_poses(data, drawn, around)

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, device=device) * noisy.view(-1, *[1] * (len(shape) - 1))

    hips = data.hips[now] + normal(count, 3) * rule.hips_noise
    matrices = to_matrix(turned[:, 1] + normal(count, 22, 6) * rule.rotation_noise)
    moved = (drawn.mixed & inside)[:, None, None]
    previous = torch.where(moved, placed[:, 0], data.positions[torch.maximum(now - 1, lowest)])
    return Rows(drawn, gone, fresh_state(data, now, lowest, hips, matrices, previous, known_phase))


def at_lone_start(data: Frames, drawn: Gaps) -> Rows:
    """Rows at the starts of those gaps, whose past and phases are unknown."""
    unknown = torch.zeros(len(drawn), dtype=torch.bool, device=drawn.start.device)
    matrices = to_matrix(data.rotations[drawn.start])
    here = data.positions[drawn.start]
    state = fresh_state(data, drawn.start, drawn.start, data.hips[drawn.start], matrices, here, unknown)
    return Rows(drawn, torch.zeros_like(drawn.start), state)


def fresh_state(
    data: Frames,
    now: Int[Tensor, "row"],
    lowest: Int[Tensor, "row"],
    hips: Float[Tensor, "row 3"],
    matrices: Float[Tensor, "row 22 3 3"],
    before: Float[Tensor, "row 22 3"],
    known_phase: Bool[Tensor, "row"],
) -> State:
    """The state at frame ``now`` of which frames from ``lowest`` on are known; earlier ones repeat it at rest.

    ``hips``, ``matrices``: the pose; ``before``: the joints one frame earlier.
    """
    device = data.hips.device
    back = torch.arange(HISTORY, -1, -1, device=device)
    index = torch.maximum(now[:, None] - back, lowest[:, None])
    track = torch.cat([data.hips[index][..., ::2], data.facing[index]], dim=-1)
    known = (lowest < now).float()[:, None]
    positions = joint_positions(hips, matrices)
    velocities = (positions - before) * (RATE * known[..., None])
    past = now[:, None] - back[1:]
    real = (past >= lowest[:, None]) & known_phase[:, None]
    phase_past = data.phases[torch.maximum(past, lowest[:, None])][..., :2] * real[..., None, None]
    ahead = now[:, None] + KEY_STEP * torch.arange(1, SIDE_KEYS + 1, device=device)
    ahead = torch.minimum(ahead, data.last[now][:, None])
    phase_future = data.phases[ahead][..., :2] * known_phase[:, None, None, None]
    return State(hips, to_six(matrices), positions, velocities, known, track, phase_past, phase_future)


def base_window(data: Frames, rows: Rows, length: int) -> Float[Tensor, "time row pose"]:
    """The base of each row at its present frame and the ``length`` next, clamped at the target, along its plan."""
    steps = rows.gone[:, None] + torch.arange(length + 1, device=rows.gone.device)
    return planned_base(data, rows.gaps, rows.plan, steps).transpose(0, 1).contiguous()


def control(
    data: Frames,
    rows: Rows,
    base: Float[Tensor, "row pose"],
    base_next: Float[Tensor, "row pose"],
    target_rotations: Float[Tensor, "row 22 6"],
    target_positions: Float[Tensor, "row 22 3"],
) -> Control:
    """What steers the next step of each row; the path is the true root's (clamped at the target), with its flag."""
    target = rows.gaps.target
    gone = torch.minimum(rows.gone, rows.gaps.steps - 1)
    now = rows.gaps.start + gone
    ahead = now[:, None] + KEY_STEP * torch.arange(1, SIDE_KEYS + 1, device=now.device)
    return Control(
        target_hips=data.hips[target],
        target_rotations=target_rotations,
        target_positions=target_positions,
        base=base,
        base_next=base_next,
        frames_left=(rows.gaps.steps - gone).float()[:, None],
        style=rows.gaps.style,
        path=root_keys(data, torch.minimum(ahead, target[:, None])),
        path_known=rows.gaps.path_known,
    )


def root_keys(data: Frames, index: Int[Tensor, "row key"]) -> Float[Tensor, "row key 6"]:
    """Root position, facing and velocity on the ground at those frames, world."""
    here = data.hips[index][..., ::2]
    before = data.hips[torch.maximum(index - 1, data.first[index])][..., ::2]
    return torch.cat([here, data.facing[index], (here - before) * RATE], dim=-1)


@dataclass(frozen=True)
class Truth:
    """The frame that a step should give, in the root frame of the step's start; keys are those of the 1 s ahead.

    alive: (row,) 1 where the step lies inside the gap. within: (row, key) 1 where the key is not beyond the target.
    """

    positions: Float[Tensor, "row joint 3"]
    rotations: Float[Tensor, "row joint 6"]
    velocities: Float[Tensor, "row joint 3"]
    contacts: Float[Tensor, "row key foot"]
    trajectory: Float[Tensor, "row key 6"]
    phases: Float[Tensor, "row key channel 3"]
    alive: Float[Tensor, "row"]
    within: Float[Tensor, "row key"]


def truth(
    data: Frames,
    rows: Rows,
    rotations: Float[Tensor, "row 22 6"],
    positions: Float[Tensor, "row 22 3"],
    before: Float[Tensor, "row 22 3"],
    frame: Float[Tensor, "row 3 3"],
    origin: Float[Tensor, "row 3"],
) -> Truth:
    """What really came next, for rows about to step from ``gone`` to ``gone + 1``.

    ``rotations``, ``positions``: of that frame, as :func:`~interpose.train.common.gaps.true_poses` gives them;
    ``before``: the positions one earlier.
    """
    target = rows.gaps.target
    now = torch.minimum(rows.gaps.start + rows.gone + 1, target)
    velocity = (positions - before) * RATE
    keys = now[:, None] + KEY_STEP * torch.arange(SIDE_KEYS + 1, device=now.device)
    index = torch.minimum(keys, data.last[now][:, None])
    trajectory = root_keys(data, index)
    trajectory[..., :2] -= origin[:, None, ::2]
    ground = frame[:, ::2, ::2]
    trajectory = (trajectory.reshape(len(now), -1, 2) @ ground).reshape(trajectory.shape)
    return Truth(
        positions=(positions - origin[:, None]) @ frame,
        rotations=(rotations.reshape(len(now), -1, 3) @ frame).reshape(len(now), 22, 6),
        velocities=velocity @ frame,
        contacts=data.contacts[index],
        trajectory=trajectory,
        phases=data.phases[index],
        alive=(rows.gaps.steps - rows.gone > 1).float(),
        within=(keys <= target[:, None]).float(),
    )
