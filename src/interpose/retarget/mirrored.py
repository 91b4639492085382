"""A pose of any humanoid rig in its own mirror: left and right exchanged, the hips where they are and as they face.

Let S be the reflection at the upright plane through the hips that they face along, and S0 the one at x = 0, which
exchanges the sides of the T-pose. With R_j a joint's global rotation in the T-pose and T_j = G_j R_j^-1 what it has
turned since, the joint b on the other side from a gets T_b' = S T_a S0, so G_b' = S G_a R_a^-1 S0 R_b. `rest_global`
has R of the 22 joints. Every other joint takes that of the nearest of the 22 above it: in the rest pose of a BVH all
frames are parallel, so that a joint which keeps its rest rotation keeps it in the mirror. Their counterparts are found
by their names; a joint without one is its own.
"""

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

_SWAP = {"Left": "Right", "Right": "Left"}
_ALONE = re.compile(r"[^A-Za-z0-9]([lrLR])(?=[^A-Za-z0-9])")
_SIDES = np.array([-1.0, 1.0, 1.0])
"""The reflection at x = 0."""


def mirrored(motion: Motion, mapping: Mapping) -> Motion:
    """Every frame of ``motion`` in its own mirror. Twice gives the motion back."""
    skeleton, hips = mapping.skeleton, mapping.hips
    other, rest = counterparts(mapping), _rests(mapping)
    world = motion.global_rotations()
    place = motion.global_positions()[:, hips]
    facing = _facing(rotation.multiply(world[:, hips], rotation.inverse(rest[hips])))

    def reflected(vectors: Float[ndarray, "frame *rest 3"]) -> Float[ndarray, "frame *rest 3"]:
        """Seen in each frame's mirror."""
        back = facing.reshape(len(facing), *[1] * (vectors.ndim - 2), 4)
        return rotation.rotate(back, rotation.rotate(rotation.inverse(back), vectors) * _SIDES)

    turned = rotation.multiply(world, rotation.inverse(rest)[None])[:, other]
    # S T S0 is a rotation: S = Y S0 Y^-1 with the facing Y, and S0 Q S0 turns about the mirrored axis the other way.
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
    """For each joint of the rig the one on its other side; itself where it lies in the middle or has none."""
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
        side, word = sides[joint]
        if joint in used or not side:
            continue
        found = [j for j in named.get((_SWAP[side], word), []) if skeleton.parents[j] == other[parent]]
        own = [j for j in named[side, word] if skeleton.parents[j] == parent]
        if len(found) == len(own):
            other[joint] = found[own.index(joint)]
    return np.array(other)


def _sides(names: Sequence[str]) -> list[tuple[str, str]]:
    """For each joint its side, "" where it has none, and the rest of its name.

    Beyond `naming.split_side`, a side in the middle of a name counts ("thigh.L.001"), and one that is only a letter
    before a word, where the other side has that word, too ("lhipjoint", "rhipjoint").
    """
    out = [_split(name) for name in names]
    words = {word for side, word in out if not side}
    for i, (side, word) in enumerate(out):
        letter = word[:1]
        if not side and letter in ("l", "r") and ("r" if letter == "l" else "l") + word[1:] in words:
            out[i] = ("Left" if letter == "l" else "Right"), word[1:]
    return out


def _split(name: str) -> tuple[str, str]:
    side, word = split_side(name)
    found = None if side else _ALONE.search(name)
    if found is None:
        return side, word
    return ("Left" if found[1].lower() == "l" else "Right"), name[: found.start()] + name[found.end() :]


def _facing(turned: Float[ndarray, "frame 4"]) -> Float[ndarray, "frame 4"]:
    """The turn about the vertical that hips have made since the T-pose."""
    return rotation.twist(turned, UP)


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
    """Places of joints in their parents' frames: what each differs from the rest pose is seen in the mirror."""
    parents = np.maximum(np.array(skeleton.parents), 0)
    differs = (translations - skeleton.offsets)[:, other]
    above, across = rest[parents], rest[parents[other]]
    turned = rotation.rotate(across, differs) * _SIDES
    return skeleton.offsets + rotation.rotate(rotation.inverse(above), turned)
