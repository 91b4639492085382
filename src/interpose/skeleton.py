"""Skeletons, forward kinematics and its inverse, as functions of arrays.

``q_parent_joint`` (local rotation) and ``q_world_joint`` (global rotation) are unit quaternions (x, y, z, w); positions
are metres, Y up, right-handed.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints, parents before children; joint 0 is the root.

    names: unique. parents: index of each joint's parent, -1 for the root. offsets: each joint's position in its
    parent's frame in the rest pose, metres. Raises ValueError where these do not fit together.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Float[ndarray, "joint 3"]

    def __post_init__(self) -> None:
        if not len(self.names) == len(self.parents) == len(self.offsets):
            raise ValueError(f"{len(self.names)} names, {len(self.parents)} parents, {len(self.offsets)} offsets")
        if len(set(self.names)) != len(self.names):
            raise ValueError(f"joint names are not unique: {self.names}")
        if self.parents[0] != -1 or any(not 0 <= p < j for j, p in enumerate(self.parents[1:], start=1)):
            raise ValueError(f"parents must come before their children and joint 0 be the only root: {self.parents}")

    def __len__(self) -> int:
        return len(self.names)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Skeleton)
            and self.names == other.names
            and self.parents == other.parents
            and np.array_equal(self.offsets, other.offsets)
        )

    def __hash__(self) -> int:
        return hash((self.names, self.parents))

    def index(self, name: str) -> int:
        """The index of the joint with that name. Raises ValueError where there is none."""
        if name not in self.names:
            raise ValueError(f"no joint is called {name!r}; the joints are {', '.join(self.names)}")
        return self.names.index(name)

    def rest_positions(self) -> Float[ndarray, "joint 3"]:
        """Joint positions in the rest pose with the root at the origin, metres."""
        out = np.concatenate([np.zeros((1, 3)), self.offsets[1:]])
        for joint, parent in enumerate(self.parents[1:], start=1):
            out[joint] += out[parent]
        return out


@lru_cache(maxsize=256)
def _levels(parents: tuple[int, ...]) -> tuple[tuple[list[int], list[int]], ...]:
    """The joints at each depth below the root, with their parents."""
    depth = [0] * len(parents)
    for joint, parent in enumerate(parents[1:], start=1):
        depth[joint] = depth[parent] + 1
    levels = [[j for j, d in enumerate(depth) if d == level] for level in range(1, max(depth) + 1)]
    return tuple((joints, [parents[j] for j in joints]) for joints in levels)


def global_rotations(
    local: Float[ndarray, "*batch joint 4"], parents: tuple[int, ...]
) -> Float[ndarray, "*batch joint 4"]:
    """``q_world_joint`` from ``q_parent_joint``."""
    world = np.array(local, dtype=float)
    for joints, above in _levels(parents):
        world[..., joints, :] = rotation.multiply(world[..., above, :], local[..., joints, :])
    return world


def local_rotations(
    world: Float[ndarray, "*batch joint 4"], parents: tuple[int, ...]
) -> Float[ndarray, "*batch joint 4"]:
    """``q_parent_joint`` from ``q_world_joint``: undoes :func:`global_rotations`."""
    index = np.array(parents[1:], dtype=int)
    rest = rotation.multiply(rotation.inverse(world[..., index, :]), world[..., 1:, :])
    return np.concatenate([world[..., :1, :], rest], axis=-2)


def global_positions(
    root: Float[ndarray, "*batch 3"],
    world: Float[ndarray, "*batch joint 4"],
    parents: tuple[int, ...],
    translations: Float[ndarray, "*#batch joint 3"],
) -> Float[ndarray, "*batch joint 3"]:
    """Joint positions, metres, from the root's position, the global rotations and the joints' ``translations``.

    ``translations``: positions in the parent's frame, which are the skeleton's offsets, or one set a frame where a file
    animates them. Entry 0 is not used.
    """
    index = np.array(parents[1:], dtype=int)
    bones = rotation.rotate(world[..., index, :], translations[..., 1:, :])
    out = np.concatenate([root[..., None, :], bones], axis=-2)
    for joints, above in _levels(parents):
        out[..., joints, :] += out[..., above, :]
    return out


def _humanoid() -> Skeleton:
    # LaFAN1's bone lengths, in a T-pose that faces +Z with its left hand at +X. Every joint's frame equals the
    # world's, so a joint's global rotation is what its bone has turned since the T-pose.
    leg = [
        ("UpLeg", "Hips", (0.1055, 0.0010, 0.0186)),
        ("Leg", "UpLeg", (0.0, -0.4350, 0.0)),
        ("Foot", "Leg", (0.0, -0.4237, 0.0)),
        ("Toe", "Foot", (0.0, -0.0745, 0.1561)),
    ]
    spine = [
        ("Spine", "Hips", (0.0, 0.0690, -0.0260)),
        ("Spine1", "Spine", (0.0, 0.1259, 0.0)),
        ("Spine2", "Spine1", (0.0, 0.1234, 0.0)),
        ("Neck", "Spine2", (0.0, 0.2583, 0.0)),
        ("Head", "Neck", (0.0, 0.1177, 0.0)),
    ]
    arm = [
        ("Shoulder", "Spine2", (0.0600, 0.1975, -0.0148)),
        ("Arm", "Shoulder", (0.1128, 0.0, 0.0)),
        ("ForeArm", "Arm", (0.3300, 0.0, 0.0)),
        ("Hand", "ForeArm", (0.2520, 0.0, 0.0)),
    ]
    both, middle = (("Left", 1.0), ("Right", -1.0)), (("", 1.0),)
    joints: dict[str, tuple[str, tuple[float, float, float]]] = {"Hips": ("", (0.0, 0.0, 0.0))}
    for limb, sides in ((leg, both), (spine, middle), (arm, both)):
        for prefix, sign in sides:
            for name, parent, (x, y, z) in limb:
                joints[prefix + name] = (parent if parent in joints else prefix + parent, (sign * x, y, z))
    names = tuple(joints)
    parents = tuple(-1 if parent == "" else names.index(parent) for parent, _ in joints.values())
    return Skeleton(names, parents, np.array([offset for _, offset in joints.values()]))


HUMANOID = _humanoid()
"""The 22 joints inside every model in LaFAN1's order: a T-pose facing +Z, left at +X, frames equal to the world's."""

MODEL_RATE = 30.0
"""Frames a second inside models and databases."""

MIRROR = tuple(
    HUMANOID.index(n.replace("Left", "#").replace("Right", "Left").replace("#", "Right")) for n in HUMANOID.names
)
"""For each joint of :data:`HUMANOID` its counterpart on the other side; itself where it lies in the middle."""

LEG_BONES = ("UpLeg", "Leg", "Foot", "Toe")
ARM_BONES = ("Shoulder", "Arm", "ForeArm", "Hand")

LEG_CHAINS = np.array([[HUMANOID.index(side + bone) for bone in LEG_BONES] for side in ("Left", "Right")])
"""Joints of the humanoid's left and right leg, in the order of :data:`LEG_BONES`."""

LEG_LENGTH = float(np.linalg.norm(HUMANOID.offsets[LEG_CHAINS[0, 1:3]], axis=1).sum())
"""Metres from the humanoid's hip to its ankle along the bones."""
