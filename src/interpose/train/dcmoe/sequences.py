"""Training sequences drawn on the fly: the whole database as tensors on the device, a batch as index arrays.

A *row* is one roll-out in progress: a start and a target frame of one clip, and where between them it has got to. The
rules of sampling (docs/method.md, D10): gaps up to 3 s, half of them short; a lone start pose whose past is clamped to
it and whose velocity is unknown, exactly as at run time; the path given in half of the draws, masked in the others.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from interpose import rotation
from interpose.features import HISTORY, JOINTS, KEY_STEP, LONGEST, RATE, SIDE_KEYS
from interpose.models.dcmoe import Control, State
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.models.planner import POSE
from interpose.skeleton import HUMANOID
from interpose.stitch_layout import ANCHORS, PIECES
from interpose.train.common.frames import Frames, interpolation, nlerp, world_matrices

UPPER = slice(HUMANOID.index("Spine"), len(HUMANOID))
"""Spine, head and arms: what may be somebody else's at the keys."""
FARTHEST = 600
"""Frames from start to target, 20 s."""
EASE = 15.0
"""Frames over which a foreign upper body gives way."""


def _at_ease() -> Tensor:
    """(22, 4): the T-pose with its arms hanging down, elbows a little bent."""
    turns = np.zeros((len(HUMANOID), 3))
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        turns[HUMANOID.index(f"{side}Arm")] = (0.0, 0.0, -1.3 * sign)
        turns[HUMANOID.index(f"{side}ForeArm")] = (0.0, -0.3 * sign, 0.0)
    return torch.tensor(rotation.from_rotation_vector(turns), dtype=torch.float32)


AT_EASE = _at_ease()


@dataclass(frozen=True)
class Keys:
    """The two key poses of each row: the database's, or with the upper body of somebody else (`foreign`)."""

    foreign: Bool[Tensor, "row"]
    start_local: Float[Tensor, "row 22 4"]
    target_local: Float[Tensor, "row 22 4"]


@dataclass
class Rows:
    """Roll-outs in progress; fields are rewritten row by row as gaps end.

    start, gone, total: first frame, frames gone and frames from start to target. path_known, style: what the row was
    told. start_known, target_known: whether a plan of the gap sees the velocities at the keys. added: what that plan
    adds to interpolation at its anchors.
    """

    start: Int[Tensor, "row"]
    gone: Int[Tensor, "row"]
    total: Int[Tensor, "row"]
    path_known: Float[Tensor, "row 1"]
    style: Float[Tensor, "row style"]
    start_known: Float[Tensor, "row 1"]
    target_known: Float[Tensor, "row 1"]
    added: Float[Tensor, "row anchor pose"]
    keys: Keys
    state: State

    def part(self, where: slice) -> Rows:
        """Some of them, without the others."""
        keys = Keys(**{f.name: getattr(self.keys, f.name)[where] for f in fields(Keys)})
        state = State(*(x[where] for x in self.state))
        return Rows(**{name: getattr(self, name)[where] for name in PLAIN}, keys=keys, state=state)


PLAIN = ("start", "gone", "total", "path_known", "style", "start_known", "target_known", "added")
"""The fields of :class:`Rows` that are one tensor each."""


@dataclass(frozen=True)
class Sampling:
    """How rows are drawn (docs/method.md, D10). Probabilities unless said otherwise."""

    lone_start: float = 0.5
    """at the gap's first frame, its past unknown: a user's two poses"""
    context_start: float = 0.15
    """at the gap's first frame with the frames before it known"""
    path: float = 0.5
    style_dropout: float = 0.3
    phase_known_at_start: float = 0.4
    phase_known_inside: float = 0.7
    rotation_noise: float = 0.03
    hips_noise: float = 0.015
    """metres"""
    longest: int = LONGEST
    """frames from start to target at most"""
    far: float = 0.0
    """of gaps beyond that, up to :data:`FARTHEST`"""
    target_velocity: float = 0.3
    """known to a plan; the start's is where the frames before it are, or, from inside a gap, as often"""
    foreign_keys: float = 0.0
    """of rows with a lone start or from inside a gap: the keys' upper bodies are somebody else's (see `poses`)"""


def draw(data: Frames, count: int, styles: int, rule: Sampling, generator: torch.Generator) -> Rows:
    """``count`` fresh rows. Device and random numbers follow ``data`` and ``generator``."""
    device = data.hips.device

    def uniform(*shape: int) -> Tensor:
        return torch.rand(*shape, generator=generator, device=device)

    short = uniform(count) < 0.5
    reach = torch.where(short, (rule.longest + 1) // 2, rule.longest)
    if rule.far:
        reach = torch.where(uniform(count) < rule.far, FARTHEST, reach)
    total = (2 + uniform(count) * (reach - 1)).long()
    start = (uniform(count) * len(data)).long()
    start = torch.maximum(torch.minimum(start, data.last[start] - total), data.first[start])
    total = torch.minimum(total, data.last[start] - start).clamp_min(1)
    kind = uniform(count)
    inside = kind >= rule.lone_start + rule.context_start
    lone = kind < rule.lone_start
    gone = torch.where(inside, (uniform(count) * (total - 1)).long(), 0)
    now = start + gone
    lowest = torch.where(inside & (uniform(count) < 0.5), start, start - 10)
    lowest = torch.where(lone, now, lowest)
    lowest = torch.minimum(torch.maximum(lowest, data.first[start]), now)
    known_phase = uniform(count) < torch.where(inside, rule.phase_known_inside, rule.phase_known_at_start)
    noisy = inside.float() * uniform(count)
    style = torch.zeros(count, styles + 1, device=device)
    label = torch.where(uniform(count) < rule.style_dropout, 0, data.style[start])
    style[torch.arange(count, device=device), label] = 1.0

    foreign = (uniform(count) < rule.foreign_keys) & (lone | inside) & (data.style[start] > 0)
    style[foreign] = torch.nn.functional.one_hot(data.style[start[foreign]], styles + 1).float()
    donors = torch.stack([_donor(data, uniform(count), uniform(count, 1, 1)) for _ in range(2)])
    upper = torch.zeros(JOINTS, 1, dtype=torch.bool, device=device)
    upper[UPPER] = True
    taken = foreign[:, None, None] & upper
    keys = Keys(
        foreign,
        torch.where(taken, donors[0], data.local[start]),
        torch.where(taken, donors[1], data.local[start + total]),
    )
    path_known = (uniform(count, 1) < rule.path).float()
    seen = uniform(count, 2) < rule.target_velocity
    before = torch.where(inside, seen[:, 0], ~lone) & (start > data.first[start]) & ~foreign
    beyond = seen[:, 1] & (start + total < data.last[start]) & ~foreign
    around = torch.stack([(gone - 1).clamp_min(0), gone], dim=1)
    turned, placed = poses(data, start, total, keys, around)

    def normal(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=generator, device=device) * noisy.view(-1, *[1] * (len(shape) - 1))

    hips = data.hips[now] + normal(count, 3) * rule.hips_noise
    matrices = to_matrix(turned[:, 1] + normal(count, 22, 6) * rule.rotation_noise)
    moved = (foreign & inside)[:, None, None]
    previous = torch.where(moved, placed[:, 0], data.positions[torch.maximum(now - 1, lowest)])
    state = fresh_state(data, now, lowest, hips, matrices, previous, known_phase)
    known = before.float()[:, None], beyond.float()[:, None]
    added = torch.zeros(count, ANCHORS, POSE, device=device)
    return Rows(start, gone, total, path_known, style, *known, added, keys, state)


def _donor(data: Frames, which: Float[Tensor, "row"], share: Float[Tensor, "row 1 1"]) -> Float[Tensor, "row 22 4"]:
    """Local rotations of random frames, drawn part of the way to a figure whose arms hang down."""
    frame = (which * len(data)).long()
    return nlerp(data.local[frame], AT_EASE.to(data.local).expand(len(frame), -1, -1), share)


def poses(
    data: Frames, start: Int[Tensor, "row"], total: Int[Tensor, "row"], keys: Keys, gone: Int[Tensor, "row time"]
) -> tuple[Float[Tensor, "row time 22 6"], Float[Tensor, "row time 22 3"]]:
    """The true rotations and joint positions of each row, ``gone`` frames after its start (clamped at its target).

    Where the keys are foreign, their upper bodies ease into the database's motion over half a second at most, and out
    of it again. So the style is made to matter (docs/method.md, D20): the keys no longer tell it, the label does.
    """
    gone = torch.minimum(gone, total[:, None])
    index = start[:, None] + gone
    rotations, positions = data.rotations[index], data.positions[index]
    row = torch.nonzero(keys.foreign)[:, 0]
    if len(row):
        since, whole = gone[row].float(), total[row, None].float()
        ramp = torch.clamp(whole / 2.0, max=EASE)
        into, out = _smooth(since / ramp), _smooth((whole - since) / ramp)
        local = data.local[index[row]]
        local = nlerp(keys.start_local[row, None], local, into[..., None, None])
        local = nlerp(keys.target_local[row, None], local, out[..., None, None])
        local[:, :, : UPPER.start] = data.local[index[row]][:, :, : UPPER.start]
        shape = local.shape[:2]
        matrices = world_matrices(local.flatten(0, 1))
        rotations[row] = to_six(matrices).unflatten(0, shape)
        positions[row] = joint_positions(data.hips[index[row]].flatten(0, 1), matrices).unflatten(0, shape)
    return rotations, positions


def _smooth(t: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    t = t.clamp(0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


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


def replace_rows(rows: Rows, fresh: Rows, where: Int[Tensor, "index"]) -> None:
    """Puts ``fresh`` into ``rows`` at the indices ``where``."""
    for field in PLAIN:
        getattr(rows, field)[where] = getattr(fresh, field)
    for field in (f.name for f in fields(Keys)):
        getattr(rows.keys, field)[where] = getattr(fresh.keys, field)
    rows.state = State(*(old.index_copy(0, where, new) for old, new in zip(rows.state, fresh.state, strict=True)))


def base_window(data: Frames, rows: Rows, length: int, planned: bool = False) -> Float[Tensor, "time row pose"]:
    """The base of each row at its present frame and the ``length`` next, clamped at the target: interpolation, or with
    ``planned`` what the row's plan makes of it, its root laid on the path where one is given."""
    steps = rows.gone[:, None] + torch.arange(length + 1, device=rows.gone.device)
    steps = torch.minimum(steps, rows.total[:, None])
    parts = steps / rows.total[:, None]
    start, target = rows.start, rows.start + rows.total
    keys = rows.keys
    base = interpolation(data.hips[start], keys.start_local, data.hips[target], keys.target_local, parts)
    if planned:
        base = base + spread_at(parts) @ rows.added
        way = data.hips[start[:, None] + steps]
        base[..., [0, 2]] += rows.path_known[..., None] * (way - base[..., :3])[..., [0, 2]]
    return base.transpose(0, 1).contiguous()


def spread_at(parts: Float[Tensor, "row time"]) -> Float[Tensor, "row time anchor"]:
    """`interpose.stitch_layout.spread` at any parts of a gap, 0 to 1."""
    pieces = torch.as_tensor(PIECES).to(parts)
    count = pieces.shape[1]
    at = (parts * count).floor().long().clamp(0, count - 1)
    here = (parts - at / count)[..., None]
    cubic, square, linear, constant = pieces[:, at]
    return ((cubic * here + square) * here + linear) * here + constant


def control(
    data: Frames,
    rows: Rows,
    base: Float[Tensor, "row pose"],
    base_next: Float[Tensor, "row pose"],
    target_rotations: Float[Tensor, "row 22 6"],
    target_positions: Float[Tensor, "row 22 3"],
) -> Control:
    """What steers the next step of each row; the path is the true root's (clamped at the target), with its flag."""
    target = rows.start + rows.total
    gone = torch.minimum(rows.gone, rows.total - 1)
    now = rows.start + gone
    ahead = now[:, None] + KEY_STEP * torch.arange(1, SIDE_KEYS + 1, device=now.device)
    return Control(
        target_hips=data.hips[target],
        target_rotations=target_rotations,
        target_positions=target_positions,
        base=base,
        base_next=base_next,
        frames_left=(rows.total - gone).float()[:, None],
        style=rows.style,
        path=root_keys(data, torch.minimum(ahead, target[:, None])),
        path_known=rows.path_known,
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

    ``rotations``, ``positions``: of that frame, as :func:`poses` gives them; ``before``: the positions one earlier.
    """
    target = rows.start + rows.total
    now = torch.minimum(rows.start + rows.gone + 1, target)
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
        alive=(rows.total - rows.gone > 1).float(),
        within=(keys <= target[:, None]).float(),
    )
