"""The graphs that an engine needs beside the step, so that it hands over and gets plain world values (docs/engine.md).

`begin.onnx` makes the state of a pose, `aim.onnx` the target and the base along which the steps lead (docs/method.md,
D1), `pose.onnx` the pose to show: world quaternions, and what changes of course took from the velocity fades (`fading`
in `interpose.runtime`). They have no weights of their own, but for the planner's in `aim.onnx` where a model has one.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import torch
from torch import Tensor, nn

from interpose.export import onnx_file
from interpose.features import CHANNELS, HISTORY, JOINTS, RATE, SIDE_KEYS, state_shapes
from interpose.models.geometry import PARENTS, facing, joint_positions, to_matrix, to_six
from interpose.models.planner import Ends, GapPlan
from interpose.runtime.streaming.fading import FADE
from interpose.skeleton import HUMANOID, MIRROR
from interpose.stitch_layout import ANCHORS, LONGEST_PLAN, PIECES

TOLERANCE = 1e-3
POSE = 3 + JOINTS * 6
PARTS = 1 + JOINTS
FADING = {"offset": (PARTS, 3), "offset_speed": (PARTS, 3), "offset_left": (1,)}
PAST = {"past_hips": (2, 3), "past_rotations": (2, JOINTS, 6)}
"""What `pose.onnx` carries from frame to frame: the network's last two poses, and the offsets from them."""
QUATERNIONS = (JOINTS, 4)
ROTATIONS = (JOINTS, 6)
_FLIP = torch.tensor([-1.0, 1.0, 1.0])


def _levels() -> list[list[int]]:
    depth = [0] * len(HUMANOID)
    for joint, parent in enumerate(HUMANOID.parents[1:], start=1):
        depth[joint] = depth[parent] + 1
    return [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]


_LEVELS = _levels()
_ORDER = [joint for level in _LEVELS for joint in level]


class Begin(nn.Module):
    """A pose, and where it is known that of the frame before it, to the tensors that the other graphs carry."""

    inputs: ClassVar[dict[str, tuple[int, ...]]] = {
        "start_hips": (3,),
        "start_quaternions": QUATERNIONS,
        "before_hips": (3,),
        "before_quaternions": QUATERNIONS,
        "before_known": (1,),
    }
    outputs = (*state_shapes(), "path", *PAST, *FADING)

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        hips, quaternions, before_hips, before_quaternions, known = tensors
        batch = hips.shape[0]
        here = _matrix(quaternions)
        there = torch.where(known[..., None, None] > 0.5, _matrix(before_quaternions), here)
        before = torch.where(known > 0.5, before_hips, hips)
        positions = joint_positions(hips, here)
        roots = [torch.cat([p[:, ::2], facing(m[:, 0])], dim=-1)[:, None] for p, m in ((before, there), (hips, here))]
        still = roots[1][:, :, :2] * 0.0
        state = (
            hips * 1.0,
            to_six(here),
            positions,
            (positions - joint_positions(before, there)) * RATE,
            known * 1.0,
            torch.cat([roots[0].expand(-1, HISTORY, -1), roots[1]], dim=1),
            hips.new_zeros(batch, HISTORY, CHANNELS, 2),
            hips.new_zeros(batch, SIDE_KEYS, CHANNELS, 2),
        )
        path = torch.cat([roots[1], still], dim=-1).expand(-1, SIDE_KEYS, -1)
        past = torch.stack([before, hips], dim=1), torch.stack([to_six(there), to_six(here)], dim=1)
        fading = (hips.new_zeros(batch, *shape) for shape in FADING.values())
        return (*state, path, *past, *fading)


class Aim(nn.Module):
    """The present state, a target and the frames to it, to the target as the step takes it and the base at the frames
    ``at`` that are gone. With a planner its anchors are added, carried onto the frames by their spline."""

    outputs = ("target_hips", "target_rotations", "target_positions", "bases")

    def __init__(self, planner: GapPlan | None = None) -> None:
        super().__init__()
        self.planner = planner
        self.inputs: dict[str, tuple[int, ...]] = {"hips": (3,), "rotations": ROTATIONS}
        if planner is not None:
            start = {"positions": (JOINTS, 3), "velocities": (JOINTS, 3), "velocity_known": (1,)}
            self.inputs |= start | {"style": (planner.size.styles + 1,)}
        self.inputs |= {"goal_hips": (3,), "goal_quaternions": QUATERNIONS, "frames": (1,), "at": (5,)}
        pieces = torch.tensor(PIECES, dtype=torch.float32)
        self.register_buffer("pieces", pieces.permute(1, 0, 2).contiguous(), persistent=False)

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        given = dict(zip(self.inputs, tensors, strict=True))
        part = (given["at"] / given["frames"]).clamp(0.0, 1.0)
        here, there = to_matrix(given["rotations"]), _matrix(given["goal_quaternions"])
        start, goal = _local(here), _local(there)
        turn = _log(_quaternion(start.transpose(-1, -2) @ goal))
        local = start[:, None] @ _exp(part[:, :, None, None] * turn[:, None])
        hips = given["hips"][:, None] + part[..., None] * (given["goal_hips"] - given["hips"])[:, None]
        bases = torch.cat([hips, to_six(_world(local)).flatten(2)], dim=-1)
        target = given["goal_hips"] * 1.0, to_six(there), joint_positions(given["goal_hips"], there)
        if self.planner is not None:
            bases = bases + self._spread(part) @ self._added(self.planner, given, target)
        return (*target, bases)

    def _spread(self, part: Tensor) -> Tensor:
        """The anchors' weights at those parts of the way, (batch, time, anchor): `interpose.stitch_layout.spread`."""
        pieces: Tensor = self.get_buffer("pieces")
        count = ANCHORS + 1
        index = (part * count).floor().clamp(max=count - 1.0)
        since = part - index / count
        powers = torch.stack([since**3, since**2, since, since**0], dim=-1)
        weights = (powers[..., None] * pieces[index.long()]).sum(dim=-2)
        return weights * ((part > 0.0) & (part < 1.0))[..., None]

    @staticmethod
    def _added(planner: GapPlan, given: dict[str, Tensor], target: Sequence[Tensor]) -> Tensor:
        """The likeliest plan, the mean of it and of its mirror image's: `interpose.runtime.planner.plan`."""
        hips, rotations, positions = target
        steps = given["frames"]
        nil = torch.zeros_like
        ends = Ends(
            given["hips"],
            given["rotations"],
            given["positions"],
            given["velocities"] * given["velocity_known"][..., None],
            given["velocity_known"],
            hips,
            rotations,
            positions,
            nil(positions),
            nil(steps),
            steps,
            given["style"],
            steps.new_zeros(steps.shape[0], ANCHORS, 4),
            nil(steps),
        )
        added = [planner_says(planner, ends)]
        mirrored = planner_says(planner, Ends(*(_mirror(n, x) for n, x in zip(Ends._fields, ends, strict=True))))
        turned = _mirror("rotations", mirrored[..., 3:].unflatten(-1, (JOINTS, 6))).flatten(2)
        added.append(torch.cat([_mirror("hips", mirrored[..., :3]), turned], dim=-1))
        return 0.5 * (added[0] + added[1]) * (steps <= LONGEST_PLAN)[..., None]


def planner_says(planner: GapPlan, ends: Ends) -> Tensor:
    """What the likeliest plan adds at the anchors."""
    x, frame = planner(ends)
    return planner.decode(x, frame, planner.expect(x).mean)


class Pose(nn.Module):
    """The step's pose to the pose to show, in world quaternions and joint positions.

    change: 0 where the course is as it was; 1 where it has changed, and ``former`` is the pose that a step of the same
    state on the former course gives; 2 where a target was reached in the frame before, or begins a start whose
    frame before is known: then the last velocity goes on. frames_left: as the step was given it.
    """

    inputs = (
        {
            "hips": (3,),
            "rotations": ROTATIONS,
            "former_hips": (3,),
            "former_rotations": ROTATIONS,
            "change": (1,),
            "frames_left": (1,),
        }
        | PAST
        | FADING
    )
    outputs = ("shown_hips", "shown_quaternions", "shown_positions", *(f"next_{n}" for n in (*PAST, *FADING)))

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        given = dict(zip(self.inputs, tensors, strict=True))
        local = _local(to_matrix(given["rotations"]))
        former = _local(to_matrix(given["former_rotations"]))
        before, now = (_local(to_matrix(given["past_rotations"][:, i])) for i in (0, 1))
        past = given["past_hips"]
        changed = _velocity((given["hips"], local), (given["former_hips"], former))
        went_on = _velocity((past[:, 0], before), (past[:, 1], now)) - _velocity(
            (past[:, 1], now), (given["hips"], local)
        )
        change = given["change"][..., None]
        kick = torch.where(change > 1.5, went_on, changed) * (change > 0.5)
        speed = given["offset_speed"] + kick
        left = torch.where(given["change"] > 0.5, torch.full_like(given["change"], FADE), given["offset_left"])
        left = torch.minimum(left, given["frames_left"])
        time, value = left.clamp(min=1.0)[..., None], given["offset"]
        bend = -(3.0 * value + 2.0 * speed * time) / time**2
        turn = (2.0 * value + speed * time) / time**3
        going = (left > 1.0).to(value.dtype)
        offset = (value + speed + bend + turn) * going[..., None]
        speed = (speed + 2.0 * bend + 3.0 * turn) * going[..., None]
        left = (left - 1.0) * going
        hips = given["hips"] + offset[:, 0]
        world = _world(local @ _exp(offset[:, 1:]))
        kept = (
            torch.stack([past[:, 1], given["hips"]], dim=1),
            torch.stack([given["past_rotations"][:, 1], given["rotations"]], dim=1),
        )
        return (hips, _quaternion(world), joint_positions(hips, world), *kept, offset, speed, left)


def write_engine(folder: Path, planner: GapPlan | None = None) -> dict[str, float]:
    """Writes `begin.onnx`, `aim.onnx` and `pose.onnx` into a model folder; the largest difference of each from torch.

    ``planner``: the model's, where it has one. Raises InputError where a difference is too large.
    """
    graphs: dict[str, Begin | Aim | Pose] = {"begin": Begin(), "aim": Aim(planner), "pose": Pose()}
    differences = {}
    for name, graph in graphs.items():

        def inputs(batch: int, seed: int, shapes: dict[str, tuple[int, ...]] = graph.inputs) -> dict[str, Tensor]:
            return example(shapes, batch, seed)

        stored = 1.0 if planner is not None and name == "aim" else TOLERANCE
        written = onnx_file.write(
            graph, folder / f"{name}.onnx", inputs, graph.outputs, TOLERANCE, stored, frames=("at",)
        )
        differences[name] = written["as_stored"]
    return differences


def example(shapes: dict[str, tuple[int, ...]], batch: int, seed: int) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    generator = torch.Generator().manual_seed(seed)
    out = {name: 0.3 * torch.randn(batch, *shape, generator=generator) for name, shape in shapes.items()}
    for name, value in out.items():
        if name.endswith("quaternions"):
            value[..., 3] += 1.0
        elif name.endswith("rotations"):
            value += torch.tensor([1.0, 0, 0, 0, 1.0, 0])
    rows = torch.arange(batch)[:, None]
    flags = {"before_known": rows % 2, "velocity_known": rows % 2, "change": rows % 3, "frames_left": 1 + 5 * rows}
    flags |= {"frames": 8 + rows, "at": torch.arange(5 + seed % 3) + rows, "offset_left": rows}
    out |= {name: value.float() for name, value in flags.items() if name in out}
    if "style" in out:
        count = out["style"].shape[1]
        out["style"] = nn.functional.one_hot(rows[:, 0] % count, count).float()
    return out


def _matrix(q: Tensor) -> Tensor:
    """Rotation matrices of quaternions (x, y, z, w) of any length but nil."""
    x, y, z, w = (q / q.norm(dim=-1, keepdim=True)).unbind(-1)
    rows = [
        torch.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)], dim=-1),
        torch.stack([2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)], dim=-1),
        torch.stack([2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)], dim=-1),
    ]
    return torch.stack(rows, dim=-2)


def _quaternion(m: Tensor) -> Tensor:
    """Unit quaternions (x, y, z, w) of rotation matrices, w not negative: of four ways the one that divides by most."""
    a, b, c = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = torch.stack([1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c, 1.0 + a + b + c], dim=-1)
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    xw, yw, zw = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    x, y, z, w = squares.unbind(-1)
    ways = [
        torch.stack([x, xy, xz, xw], dim=-1),
        torch.stack([xy, y, yz, yw], dim=-1),
        torch.stack([xz, yz, z, zw], dim=-1),
        torch.stack([xw, yw, zw, w], dim=-1),
    ]
    out = ways[0]
    most = x
    for square, way in ((y, ways[1]), (z, ways[2]), (w, ways[3])):
        out = torch.where((square > most)[..., None], way, out)
        most = torch.maximum(most, square)
    out = out / out.norm(dim=-1, keepdim=True)
    return torch.where(out[..., 3:] < 0.0, -out, out)


def _log(q: Tensor) -> Tensor:
    """Rotation vectors of quaternions with w >= 0."""
    size = q[..., :3].norm(dim=-1, keepdim=True)
    angle = 2.0 * torch.atan(size / q[..., 3:].clamp(min=1e-12))
    return q[..., :3] * torch.where(size > 1e-6, angle / size.clamp(min=1e-6), torch.full_like(size, 2.0))


def _exp(v: Tensor) -> Tensor:
    """Rotation matrices of rotation vectors."""
    angle = v.norm(dim=-1, keepdim=True)
    share = torch.where(angle > 1e-6, (0.5 * angle).sin() / angle.clamp(min=1e-6), torch.full_like(angle, 0.5))
    return _matrix(torch.cat([v * share, (0.5 * angle).cos()], dim=-1))


def _local(world: Tensor) -> Tensor:
    """Each joint's rotation in its parent's frame, (batch, joint, 3, 3)."""
    below = world[:, PARENTS[1:]].transpose(-1, -2) @ world[:, 1:]
    return torch.cat([world[:, :1], below], dim=1)


def _world(local: Tensor) -> Tensor:
    """Global rotations from local ones, (..., joint, 3, 3), a product a level of the tree."""
    levels = [local[..., :1, :, :]]
    for above, joints in pairwise(_LEVELS):
        parents = [above.index(HUMANOID.parents[joint]) for joint in joints]
        levels.append(levels[-1][..., parents, :, :] @ local[..., joints, :, :])
    return torch.cat(levels, dim=-3)[..., [_ORDER.index(joint) for joint in range(JOINTS)], :, :]


def _velocity(before: tuple[Tensor, Tensor], after: tuple[Tensor, Tensor]) -> Tensor:
    """From each pose to the next, (batch, part, 3): `interpose.runtime.streaming.fading.velocity`."""
    turn = _log(_quaternion(before[1].transpose(-1, -2) @ after[1]))
    return torch.cat([(after[0] - before[0])[:, None], turn], dim=1)


def _mirror(name: str, value: Tensor) -> Tensor:
    """An input of the plan in a mirror at x = 0: `interpose.runtime.planner.mirrored`."""
    kind = name.rpartition("_")[2]
    if kind == "hips":
        return value * _FLIP
    if kind in ("positions", "velocities"):
        return value[..., MIRROR, :] * _FLIP
    if kind == "rotations":
        return value[..., MIRROR, :] * torch.cat([-_FLIP, _FLIP])
    return value * torch.tensor([-1.0, 1.0, -1.0, 1.0]) if name == "path" else value
