"""Inverse kinematics of a whole figure: some joints come to where they are wanted, the others move as little as it
takes.

Steps of Gauss and Newton over all joints at once, of least weighted norm, damped as they are far from the solution
(Wampler 1986; Buss 2004, `Introduction to Inverse Kinematics`). A joint whose turn is wanted keeps it in the world
whatever turns above it, so that only positions are left to solve for. Any skeleton will do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.motion import Motion

REACHED = 1e-7
"""Metres: nearer is there."""
ROUNDS = 80
STEP = 0.25
"""Radians that a joint turns in a round at most, and metres that the root moves."""
DAMPING = 1e-2


@dataclass(frozen=True, eq=False)
class JointTargets:
    """Where joints are to be, by joint: metres in the world, NaN along an axis that does not matter; and how they are
    to be turned, ``q_world_joint``."""

    positions: dict[int, Float[ndarray, "3"]]
    rotations: dict[int, Float[ndarray, "4"]]


@dataclass(frozen=True, eq=False)
class Ease:
    """How easily a figure moves: a share for each joint's turn, 0 where it is fixed, and one for the root's place."""

    joints: Float[ndarray, "joint"]
    root: float


def solve(pose: Motion, wanted: JointTargets, ease: Ease) -> tuple[Motion, float]:
    """The pose (one frame) that meets what is wanted and is near to ``pose``, and by how many metres it misses at most.

    What cannot be reached is come near to.
    """
    parents = pose.skeleton.parents
    places = pose.skeleton.offsets if pose.translations is None else pose.translations[0]
    held = np.zeros(len(parents), dtype=bool)
    held[list(wanted.rotations)] = True
    levers = _levers(parents, tuple(wanted.positions), held, ease.joints > 0.0)
    goal = np.array([*wanted.positions.values()]).reshape(-1, 3)
    asked = np.isfinite(goal)
    root, local = pose.root_positions[0].copy(), pose.local_rotations[0].copy()
    turns = np.zeros((len(parents), 3))
    best: tuple[float, ndarray, ndarray] | None = None
    for _ in range(ROUNDS):
        world = _turned(local, parents, turns, wanted.rotations)
        local = kinematics.local_rotations(world, parents)
        at = kinematics.global_positions(root, world, parents, places)
        off = np.where(asked, goal - at[list(wanted.positions)], 0.0)
        miss = float(np.linalg.norm(off, axis=-1).max(initial=0.0))
        if best is None or miss < best[0]:
            best = miss, root, local
        if miss < REACHED:
            break
        turns, moved = _step(at, off, asked, levers, ease)
        root = root + moved
    assert best is not None
    miss, root, local = best
    moved_places = None
    if pose.translations is not None:
        moved_places = pose.translations.copy()
        moved_places[0, 0] = root
    local = rotation.continuous(np.stack([pose.local_rotations[0], local]))[1:]
    return replace(pose, root_positions=root[None], local_rotations=local, translations=moved_places), miss


Lever = tuple[int, int, int]
"""Which wanted position, by which joint's turn, and the joint whose way from that one turns with it."""


def _levers(
    parents: tuple[int, ...], wanted: tuple[int, ...], held: Bool[ndarray, "joint"], free: Bool[ndarray, "joint"]
) -> list[Lever]:
    """What moves what: below a joint that is held in the world, nothing turns."""
    out = []
    for row, joint in enumerate(wanted):
        end, above = joint, parents[joint]
        while above >= 0:
            if held[above]:
                end = above
            elif free[above]:
                out.append((row, above, end))
            above = parents[above]
    return out


def _turned(
    local: Float[ndarray, "joint 4"],
    parents: tuple[int, ...],
    turns: Float[ndarray, "joint 3"],
    held: dict[int, Float[ndarray, "4"]],
) -> Float[ndarray, "joint 4"]:
    """Global rotations after each joint has turned by so much in the world, and all below it with it."""
    added = rotation.from_rotation_vector(turns)
    world = local.copy()
    for joint, parent in enumerate(parents):
        if joint in held:
            world[joint] = held[joint]
            continue
        if parent >= 0:
            world[joint] = rotation.multiply(world[parent], local[joint])
        if turns[joint].any():
            world[joint] = rotation.multiply(added[joint], world[joint])
    return world


def _step(
    at: Float[ndarray, "joint 3"],
    off: Float[ndarray, "wanted 3"],
    asked: Bool[ndarray, "wanted 3"],
    levers: list[Lever],
    ease: Ease,
) -> tuple[Float[ndarray, "joint 3"], Float[ndarray, "3"]]:
    """Turns of the joints and the root's move that lead nearer."""
    joints = len(at)
    jacobian = np.zeros((len(off), 3, joints + 1, 3))
    jacobian[:, :, joints] = np.eye(3)
    for row, joint, end in levers:
        x, y, z = at[end] - at[joint]
        jacobian[row, :, joint] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    flat = jacobian.reshape(off.size, -1)[asked.ravel()]
    weight = np.repeat([*ease.joints, ease.root], 3)
    square = (flat * weight) @ flat.T
    damping = DAMPING * min(1.0, float(np.sum(off**2))) * np.trace(square) / len(square) + 1e-12
    solved = np.linalg.solve(square + damping * np.eye(len(square)), off[asked])
    step = (weight * (flat.T @ solved)).reshape(-1, 3)
    longest = float(np.linalg.norm(step, axis=-1).max())
    step = step * min(1.0, STEP / max(longest, 1e-12))
    return step[:joints], step[joints]
