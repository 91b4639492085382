"""Mirrored poses of any humanoid rig: left and right exchanged, the hips in place and facing as before."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.motion import Motion
from interpose.retarget.mapping import Mapping
from interpose.retarget.naming import split_side
from interpose.rotation import UP
from interpose.skeleton import MIRROR, Skeleton

_OTHER_SIDE = {"Left": "Right", "Right": "Left"}
_LONE_SIDE = re.compile(r"[^A-Za-z0-9]([lrLR])(?=[^A-Za-z0-9])")
_REFLECTION = np.array([-1.0, 1.0, 1.0])
"""The reflection at x = 0."""


def mirrored(motion: Motion, mapping: Mapping) -> Motion:
    """Every frame of ``motion`` mirrored at the upright plane through its hips, along their facing. Twice gives the
    motion back.

    Let S be that reflection and S0 the one at x = 0, which exchanges the sides of the T-pose. With R_j a joint's global
    rotation in the T-pose and T_j = G_j R_j^-1 what it has turned since, the joint b opposite to a gets T_b' = S T_a
    S0, so G_b' = S G_a R_a^-1 S0 R_b. Unmapped joints take R from the nearest mapped joint above them: the rest frames
    of a BVH are parallel, so a joint that keeps its rest rotation keeps it in the mirror.
    """
    skeleton, hips = mapping.skeleton, mapping.hips
    other, rest = counterparts(mapping), _rests(mapping)
    world = motion.global_rotations()
    place = motion.global_positions()[:, hips]
    # The rotation of the hips about the vertical since the T-pose.
    facing = rotation.twist(rotation.multiply(world[:, hips], rotation.inverse(rest[hips])), UP)

    def reflected(vectors: Float[ndarray, "frame *rest 3"]) -> Float[ndarray, "frame *rest 3"]:
        """Vectors in each frame's mirror."""
        back = facing.reshape(len(facing), *[1] * (vectors.ndim - 2), 4)
        return rotation.rotate(back, rotation.rotate(rotation.inverse(back), vectors) * _REFLECTION)

    turned = rotation.multiply(world, rotation.inverse(rest)[None])[:, other]
    # S = Y S0 Y^-1 with the facing Y; S0 Q S0 is the rotation about the mirrored axis in the opposite direction.
    inner = rotation.multiply(rotation.inverse(facing)[:, None], turned) * [1.0, -1.0, -1.0, 1.0]
    made = rotation.multiply(rotation.multiply(facing[:, None], inner), rest[None])
    moved = None if motion.translations is None else _moved(motion.translations, skeleton, other, rest)
    root = place + reflected(motion.root_positions - place)
    offsets = skeleton.offsets if moved is None else moved
    root = root + place - kinematics.global_positions(root, made, skeleton.parents, offsets)[:, hips]
    if moved is not None:
        moved[:, 0] = root
    local = rotation.continuous(kinematics.local_rotations(made, skeleton.parents))
    return replace(motion, root_positions=root, local_rotations=local, translations=moved)


def counterparts(mapping: Mapping) -> Int[ndarray, "joint"]:
    """For each joint of the rig its counterpart on the other side, by mapping or by name; itself where it has none."""
    skeleton = mapping.skeleton
    other = list(range(len(skeleton)))
    for ours, joint in enumerate(mapping.joints):
        across = mapping.joints[MIRROR[ours]]
        if joint is not None and across is not None:
            other[joint] = across
    used = set(mapping.joints)
    sides = _sides(skeleton.names)
    named: dict[tuple[str, str], list[int]] = {}
    for joint, one in enumerate(sides):
        if joint not in used:
            named.setdefault(one, []).append(joint)
    for joint, parent in enumerate(skeleton.parents):  # parents come first
        side, base = sides[joint]
        if joint in used or not side:
            continue
        found = [j for j in named.get((_OTHER_SIDE[side], base), []) if skeleton.parents[j] == other[parent]]
        own = [j for j in named[side, base] if skeleton.parents[j] == parent]
        if len(found) == len(own):
            other[joint] = found[own.index(joint)]
    return np.array(other)


def _sides(names: Sequence[str]) -> list[tuple[str, str]]:
    """For each joint its side, "" where it has none, and the rest of its name.

    Beyond `naming.split_side`, a side in the middle of a name counts ("thigh.L.001"), and an initial l or r where the
    same name exists with the other ("lhipjoint", "rhipjoint").
    """
    out = [_split(name) for name in names]
    bases = {base for side, base in out if not side}
    for i, (side, base) in enumerate(out):
        initial = base[:1]
        if not side and initial in ("l", "r") and ("r" if initial == "l" else "l") + base[1:] in bases:
            out[i] = ("Left" if initial == "l" else "Right"), base[1:]
    return out


def _split(name: str) -> tuple[str, str]:
    side, base = split_side(name)
    found = None if side else _LONE_SIDE.search(name)
    if found is None:
        return side, base
    return ("Left" if found[1].lower() == "l" else "Right"), name[: found.start()] + name[found.end() :]


def _rests(mapping: Mapping) -> Float[ndarray, "joint 4"]:
    """Each joint's global rotation in the T-pose."""
    known = {j: mapping.rest_global[ours] for ours, j in enumerate(mapping.joints) if j is not None}
    out: list[ndarray] = []
    for joint, parent in enumerate(mapping.skeleton.parents):
        above = known[mapping.hips] if parent < 0 else out[parent]
        out.append(known.get(joint, above))
    return np.array(out)


def _moved(
    translations: Float[ndarray, "frame joint 3"],
    skeleton: Skeleton,
    other: Int[ndarray, "joint"],
    rest: Float[ndarray, "joint 4"],
) -> Float[ndarray, "frame joint 3"]:
    """Joint positions in their parents' frames, their differences from the rest pose mirrored."""
    parents = np.maximum(np.array(skeleton.parents), 0)
    differs = (translations - skeleton.offsets)[:, other]
    above, across = rest[parents], rest[parents[other]]
    turned = rotation.rotate(across, differs) * _REFLECTION
    return skeleton.offsets + rotation.rotate(rotation.inverse(above), turned)
