"""The frames that DC-MoE trains on, as tensors on one device, and how poses are interpolated there."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
import roma
import torch
from jaxtyping import Float, Int
from torch import Tensor

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.data import label_issues
from interpose.data.database import Database
from interpose.features import RATE
from interpose.models.geometry import to_six
from interpose.motion import mirror
from interpose.skeleton import HUMANOID


@dataclass(frozen=True)
class Frames:
    """Every frame of one or more databases, mirrored copies after the originals; all tensors on one device."""

    hips: Float[Tensor, "frame 3"]
    rotations: Float[Tensor, "frame 22 6"]
    positions: Float[Tensor, "frame 22 3"]
    facing: Float[Tensor, "frame 2"]
    local: Float[Tensor, "frame 22 4"]
    contacts: Float[Tensor, "frame 4"]
    phases: Float[Tensor, "frame 10 3"]
    style: Int[Tensor, "frame"]
    first: Int[Tensor, "frame"]
    last: Int[Tensor, "frame"]
    weight: Float[Tensor, "frame"]
    """how often balanced sampling starts here: see :func:`balance`"""

    def __len__(self) -> int:
        return len(self.hips)

    def to(self, device: str) -> Frames:
        """The same on another device."""
        return Frames(**{f.name: getattr(self, f.name).to(device) for f in fields(self)})


def backwards(data: Frames) -> Frames:
    """The same clips with time running backwards; phases turn backwards too."""
    order = data.first + data.last - torch.arange(len(data), device=data.hips.device)
    turned = {f.name: getattr(data, f.name)[order] for f in fields(data) if f.name not in ("first", "last")}
    turned["phases"] = turned["phases"] * turned["phases"].new_tensor([-1.0, 1.0, 1.0])
    return replace(data, **turned)


def load_frames(
    database: Database,
    phases: Float[np.ndarray, "2 frame 10 3"] | None,
    styles: list[str],
    ranges: list[tuple[int, int]],
) -> Frames:
    """Those ``ranges`` [start, stop) of frames, each inside a clip, and their mirror images.

    Without ``phases`` they are zero (unknown). styles: the model's labels; label i becomes i + 1, others 0 (free), and
    so does the label of a frame that `interpose labels` dropped.
    """
    labels, trusted = database.style_indices(), label_issues.kept(database)
    label_of = {style.casefold(): i for i, style in enumerate(styles, start=1)}
    known = np.array([*(label_of.get(style.casefold(), 0) for style in database.styles), 0])  # the last for -1
    starts = database.ranges[:, 0]
    parts: list[dict[str, np.ndarray]] = []
    at = 0
    for mirrored in (False, True):
        for start, stop in ranges:
            clip = database.motion(start, stop)
            contacts = np.asarray(database.contacts[start:stop])
            if mirrored:
                clip, contacts = mirror(clip), contacts[:, [2, 3, 0, 1]]
            count = stop - start
            label = labels[np.searchsorted(starts, start, side="right") - 1]
            world = clip.global_rotations()
            positions = kinematics.global_positions(clip.root_positions, world, HUMANOID.parents, HUMANOID.offsets)
            forward = rotation.rotate(rotation.twist(world[:, 0], np.array([0.0, 1.0, 0.0])), np.array([0.0, 0.0, 1.0]))
            parts.append(
                {
                    "hips": clip.root_positions,
                    "rotations": rotation.to_6d(world),
                    "positions": positions,
                    "facing": forward[:, ::2],
                    "local": clip.local_rotations,
                    "contacts": contacts,
                    "phases": np.zeros((count, 10, 3)) if phases is None else phases[int(mirrored), start:stop],
                    "style": known[label] * (np.ones(count, dtype=int) if trusted is None else trusted[start:stop]),
                    "first": np.full(count, at),
                    "last": np.full(count, at + count - 1),
                }
            )
            at += count
    joined = {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}
    joined["weight"] = balance(joined["hips"], joined["last"])
    whole = {"style", "first", "last"}
    return Frames(**{k: torch.tensor(v, dtype=torch.int64 if k in whole else torch.float32) for k, v in joined.items()})


def balance(hips: Float[np.ndarray, "frame 3"], last: Int[np.ndarray, "frame"]) -> Float[np.ndarray, "frame"]:
    """Weights of the frames of one database, by what happens there: hips that stay within 10 cm for a second, within
    half a metre, or travel. A kind's weights add up to the square root of its frames, so a rare kind and a small
    database are drawn more often than their share, but not as often as a large one."""
    ahead = hips[np.minimum(np.arange(len(hips)) + round(RATE), last)]
    kind = np.digitize(np.linalg.norm((ahead - hips)[:, ::2], axis=-1), (0.1, 0.5))
    return 1.0 / np.sqrt(np.bincount(kind, minlength=3))[kind]


def joined(parts: list[Frames]) -> Frames:
    """Several, one after the other."""
    at, out = 0, []
    for part in parts:
        out.append(replace(part, first=part.first + at, last=part.last + at))
        at += len(part)
    return Frames(**{f.name: torch.cat([getattr(p, f.name) for p in out]) for f in fields(Frames)})


def interpolation(
    start_hips: Float[Tensor, "batch 3"],
    start_local: Float[Tensor, "batch 22 4"],
    target_hips: Float[Tensor, "batch 3"],
    target_local: Float[Tensor, "batch 22 4"],
    parts: Float[Tensor, "batch time"],
) -> Float[Tensor, "batch time pose"]:
    """The interpolation base A: hips linear, rotations SLERPed, as (hips, global 6-D); ``parts`` runs from 0 to 1."""
    weight = parts[:, :, None]
    hips = start_hips[:, None] * (1.0 - weight) + target_hips[:, None] * weight
    turn = roma.unitquat_to_rotvec(roma.quat_product(roma.quat_inverse(start_local), target_local), shortest_arc=True)
    step = roma.rotvec_to_unitquat(turn[:, None] * weight[..., None])
    local = roma.quat_product(start_local[:, None].expand_as(step), step)
    return torch.cat([hips, to_six(world_matrices(local)).flatten(2)], dim=-1)


def world_matrices(local: Float[Tensor, "*batch 22 4"]) -> Float[Tensor, "*batch 22 3 3"]:
    """``q_world_joint`` as matrices from ``q_parent_joint``."""
    turned = roma.unitquat_to_rotmat(local)
    world = [turned[..., 0, :, :]]
    for joint, parent in enumerate(HUMANOID.parents[1:], start=1):
        world.append(world[parent] @ turned[..., joint, :, :])
    return torch.stack(world, dim=-3)


def nlerp(
    a: Float[Tensor, "*#batch 4"], b: Float[Tensor, "*#batch 4"], t: Float[Tensor, "*#batch 1"]
) -> Float[Tensor, "*batch 4"]:
    """Linear interpolation of quaternions along the shorter arc, normalised."""
    near = torch.where((a * b).sum(dim=-1, keepdim=True) < 0.0, -b, b)
    mixed = a + (near - a) * t
    return mixed / mixed.norm(dim=-1, keepdim=True).clamp_min(1e-6)
