"""The graphs that an engine needs beside the step, so that it hands over and gets plain world values (docs/engine.md).

`begin.onnx` makes the state of a pose, `aim.onnx` the target and the interpolation base, to which `plan.onnx` adds the
plan, `pose.onnx` the pose to show: world quaternions, in which a change of target fades in. They have no weights.
"""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import torch
from torch import Tensor, nn

from interpose.export import onnx_file
from interpose.features import CHANNELS, HISTORY, JOINTS, RATE, SIDE_KEYS, state_shapes
from interpose.models.geometry import PARENT_INDICES, facing, joint_positions, to_matrix, to_six
from interpose.runtime.streaming.fading import FADE_FRAMES
from interpose.skeleton import HUMANOID

BODY_PARTS = 1 + JOINTS
FADING_SHAPES = {"offset": (BODY_PARTS, 3), "offset_speed": (BODY_PARTS, 3), "offset_left": (1,)}
PAST_SHAPES = {"past_hips": (2, 3), "past_rotations": (2, JOINTS, 6)}
"""What `pose.onnx` carries from frame to frame: the network's last two poses, and the offsets from them."""
QUATERNIONS_SHAPE = (JOINTS, 4)
ROTATIONS_SHAPE = (JOINTS, 6)


def _levels() -> list[list[int]]:
    depth = [0] * len(HUMANOID)
    for joint, parent in enumerate(HUMANOID.parents[1:], start=1):
        depth[joint] = depth[parent] + 1
    return [[j for j, d in enumerate(depth) if d == level] for level in range(max(depth) + 1)]


_LEVELS = _levels()
_ORDER = [joint for level in _LEVELS for joint in level]


class BeginGraph(nn.Module):
    """A pose, and where it is known that of the frame before it, to the tensors that the other graphs carry."""

    inputs: ClassVar[dict[str, tuple[int, ...]]] = {
        "start_hips": (3,),
        "start_quaternions": QUATERNIONS_SHAPE,
        "before_hips": (3,),
        "before_quaternions": QUATERNIONS_SHAPE,
        "before_known": (1,),
    }
    outputs = (*state_shapes(), "path", *PAST_SHAPES, *FADING_SHAPES)

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
        fading = (hips.new_zeros(batch, *shape) for shape in FADING_SHAPES.values())
        return (*state, path, *past, *fading)


class AimGraph(nn.Module):
    """The present pose, a goal and the frames to it, to the target as step and plan take it and the interpolation base
    at the frames ``at``, counted from the present one."""

    inputs: ClassVar[dict[str, tuple[int, ...]]] = {
        "hips": (3,),
        "rotations": ROTATIONS_SHAPE,
        "goal_hips": (3,),
        "goal_quaternions": QUATERNIONS_SHAPE,
        "frames": (1,),
        "at": (5,),
    }
    outputs = ("target_hips", "target_rotations", "target_positions", "bases")

    def forward(self, *tensors: Tensor) -> tuple[Tensor, ...]:
        given = dict(zip(self.inputs, tensors, strict=True))
        part = (given["at"] / given["frames"]).clamp(0.0, 1.0)
        here, there = to_matrix(given["rotations"]), _matrix(given["goal_quaternions"])
        start, goal = _local(here), _local(there)
        turn = _log(_quaternion(start.transpose(-1, -2) @ goal))
        local = start[:, None] @ _exp(part[:, :, None, None] * turn[:, None])
        hips = given["hips"][:, None] + part[..., None] * (given["goal_hips"] - given["hips"])[:, None]
        bases = torch.cat([hips, to_six(_world(local)).flatten(2)], dim=-1)
        return given["goal_hips"] * 1.0, to_six(there), joint_positions(given["goal_hips"], there), bases


class PoseGraph(nn.Module):
    """The step's pose to the pose to show, in world quaternions and joint positions.

    change: 0 where the target is as it was; 1 where it has changed, and ``former`` is the pose that a step of the same
    state towards the former target gives; 2 where a target was reached in the frame before, or begins a start whose
    frame before is known: then the last velocity goes on. frames_left: as the step was given it.
    """

    inputs = (
        {
            "hips": (3,),
            "rotations": ROTATIONS_SHAPE,
            "former_hips": (3,),
            "former_rotations": ROTATIONS_SHAPE,
            "change": (1,),
            "frames_left": (1,),
        }
        | PAST_SHAPES
        | FADING_SHAPES
    )
    outputs = (
        "shown_hips",
        "shown_quaternions",
        "shown_positions",
        *(f"next_{n}" for n in (*PAST_SHAPES, *FADING_SHAPES)),
    )

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
        left = torch.where(given["change"] > 0.5, torch.full_like(given["change"], FADE_FRAMES), given["offset_left"])
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


GRAPHS = {"begin": BeginGraph, "aim": AimGraph, "pose": PoseGraph}


def write_engine(folder: Path) -> dict[str, float]:
    """Writes `begin.onnx`, `aim.onnx` and `pose.onnx` into a model folder; the largest difference of each from torch.

    Raises InputError where a difference is too large.
    """
    differences = {}
    for name, kind in GRAPHS.items():
        inputs = partial(example, kind.inputs)
        written = onnx_file.write(kind(), folder / f"{name}.onnx", inputs, kind.outputs, frames=("at",))
        differences[name] = written["as_stored"]
    return differences


def example(shapes: dict[str, tuple[int, ...]], batch: int, seed: int) -> dict[str, Tensor]:
    """Inputs of plausible size, for tracing and for the check."""
    rows = torch.arange(batch)[:, None]
    more = {"change": rows % 3, "at": torch.arange(5 + seed % 3) + rows, "offset_left": rows}
    return onnx_file.example(shapes, batch, seed) | {name: more[name].float() for name in more if name in shapes}


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
    """Unit quaternions (x, y, z, w) of rotation matrices, w not negative: of four forms the one that divides by
    most."""
    a, b, c = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = torch.stack([1.0 + a - b - c, 1.0 - a + b - c, 1.0 - a - b + c, 1.0 + a + b + c], dim=-1)
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    xw, yw, zw = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    x, y, z, w = squares.unbind(-1)
    forms = [
        torch.stack([x, xy, xz, xw], dim=-1),
        torch.stack([xy, y, yz, yw], dim=-1),
        torch.stack([xz, yz, z, zw], dim=-1),
        torch.stack([xw, yw, zw, w], dim=-1),
    ]
    out = forms[0]
    most = x
    for square, form in ((y, forms[1]), (z, forms[2]), (w, forms[3])):
        out = torch.where((square > most)[..., None], form, out)
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
    below = world[:, PARENT_INDICES[1:]].transpose(-1, -2) @ world[:, 1:]
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
