"""Hips, limbs and head of a skeleton whose names say nothing, from its hierarchy, bone lengths and shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.motion import Motion
from interpose.rotation import FORWARD
from interpose.skeleton import ARM_BONES, LEG_BONES, Skeleton, global_positions, global_rotations

_TOLERANCE = 0.05  # relative difference below which bones have the same length
_SIDE_FRAMES = 64  # of a motion, used to tell left from right


@dataclass(frozen=True)
class _Limb:
    """stem: the joint before the first long bone, if any. joints: from there to the end of the limb."""

    stem: int | None
    joints: list[int]


def guess(skeleton: Skeleton, motion: Motion | None = None) -> dict[str, int] | None:
    """Joints for the humanoid's hips, limbs and head, or None where the skeleton is not a humanoid.

    The hips carry two like branches (the legs) and a third (the spine) on which another such pair (the arms) grows.
    Like branches have as many joints and bones of the same lengths. The two longest neighbouring bones of a limb are
    thigh and shin, or upper arm and forearm. The feet show which side is left, in the rest pose or else in the motion's
    frames.
    """
    tree = _Tree(skeleton)
    best: tuple[tuple[bool, float], int, tuple[int, int], int | None] | None = None
    for hips in range(len(skeleton)):
        legs = tree.pair(hips)
        if legs is None:
            continue
        others = [j for child in tree.children[hips] if child not in legs for j in tree.below(child)]
        chests = [j for j in others if tree.pair(j) is not None]
        chest = max(chests, key=tree.size, default=None)
        if chest is None and not tree.first(hips):
            continue  # a pair with none above it is a pair of arms, unless nothing branches before it
        rank = (chest is not None, tree.size(legs[0]))
        if best is None or rank > best[0]:
            best = (rank, hips, legs, chest)
    if best is None:
        return None
    _, hips, legs, chest = best
    found = {"Hips": hips}
    last = chest
    arms = None if chest is None else tree.pair(chest)
    used = set(legs) if chest is None else set(arms or ())
    rising = [child for child in tree.children[hips if chest is None else chest] if child not in used]
    if rising:
        chain = tree.chain(max(rising, key=tree.size))
        found["Head"] = last = chain[-1] if chest is None else chain[min(1, len(chain) - 1)]
    thighs = [tree.limb(leg) for leg in legs]
    left = _left(skeleton, motion, hips, last, thighs)
    for pair, names, stem in (
        (thighs, LEG_BONES, None),
        ([tree.limb(arm) for arm in arms or ()], ARM_BONES[1:], ARM_BONES[0]),
    ):
        if not pair:
            continue
        swapped = left(pair[1].joints[0]) > left(pair[0].joints[0])
        for side, limb in zip(("Left", "Right"), pair[::-1] if swapped else pair, strict=True):
            found.update({side + name: joint for name, joint in zip(names, limb.joints, strict=False)})
            if stem is not None and limb.stem is not None:
                found[side + stem] = limb.stem
    return found


class _Tree:
    """The skeleton as children and bone lengths."""

    def __init__(self, skeleton: Skeleton) -> None:
        self.children = [[c for c, p in enumerate(skeleton.parents) if p == j] for j in range(len(skeleton))]
        self.lengths = np.linalg.norm(skeleton.offsets, axis=1)

    def below(self, joint: int) -> list[int]:
        """The joint and all below it."""
        return [joint] + [j for child in self.children[joint] for j in self.below(child)]

    def size(self, joint: int) -> float:
        """The summed length of all bones below the joint, metres."""
        return float(sum(self.lengths[j] for j in self.below(joint)[1:]))

    def reach(self, joint: int) -> float:
        """The length of the longest chain below the joint, metres."""
        return max((float(self.lengths[c]) + self.reach(c) for c in self.children[joint]), default=0.0)

    def chain(self, joint: int) -> list[int]:
        """The joint and the longest chain below it."""
        out = [joint]
        while self.children[out[-1]]:
            out.append(max(self.children[out[-1]], key=lambda c: float(self.lengths[c]) + self.reach(c)))
        return out

    def first(self, joint: int) -> bool:
        """Whether the skeleton branches at this joint first."""
        return next((j for j, below in enumerate(self.children) if len(below) > 1), None) == joint

    def limb(self, joint: int) -> _Limb:
        """The longest chain, cut so that it begins with its two longest neighbouring bones."""
        chain = self.chain(joint)
        bones = self.lengths[chain[1:]]
        start = int(np.argmax(bones[:-1] + bones[1:]))
        return _Limb(chain[start - 1] if start > 0 else None, chain[start:])

    def pair(self, joint: int) -> tuple[int, int] | None:
        """The two longest branches below the joint that are like each other and long enough for a limb."""
        grown = [c for c in self.children[joint] if len(self.chain(c)) >= 3]
        like = [(a, b) for a, b in combinations(grown, 2) if self._like(a, b)]
        return max(like, key=lambda pair: self.size(pair[0]), default=None)

    def _like(self, a: int, b: int) -> bool:
        one, other = (np.sort(self.lengths[self.below(j)]) for j in (a, b))
        return len(one) == len(other) and np.allclose(one, other, rtol=_TOLERANCE, atol=_TOLERANCE * float(one.max()))


def _left(
    skeleton: Skeleton, motion: Motion | None, hips: int, top: int | None, legs: list[_Limb]
) -> Callable[[int], float]:
    """A function from a joint to its distance to the left of the hips, up to scale."""
    zero = np.tile(np.array([0.0, 0.0, 0.0, 1.0]), (1, len(skeleton), 1))
    poses = global_positions(
        np.zeros((1, 3)), global_rotations(zero, skeleton.parents), skeleton.parents, skeleton.offsets
    )

    def up(points: Float[ndarray, "frame joint 3"]) -> Float[ndarray, "frame 3"]:
        if top is not None:
            return points[:, top] - points[:, hips]
        return np.mean([points[:, leg.joints[0]] - points[:, leg.joints[2]] for leg in legs], axis=0)

    folded = any(float(np.sum(up(poses) * (poses[:, leg.joints[2]] - poses[:, leg.joints[0]]))) >= 0.0 for leg in legs)
    if folded and motion is not None:
        poses = motion[:: max(1, len(motion) // _SIDE_FRAMES)].global_positions()
    forward = sum(poses[:, leg.joints[3]] - poses[:, leg.joints[2]] for leg in legs if len(leg.joints) > 3)
    if not isinstance(forward, ndarray):
        forward = np.broadcast_to(FORWARD, poses[:, hips].shape)
    left = np.cross(up(poses), forward)
    return lambda joint: float(np.sum((poses[:, joint] - poses[:, hips]) * left))
