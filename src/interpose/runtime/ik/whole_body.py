"""Inverse kinematics of a whole pose on any skeleton: given joints reach their targets, the others move little.

Damped least squares over all joints at once (Wampler 1986; Buss 2004, `Introduction to Inverse Kinematics`).
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
"""Metres from its target within which a joint has arrived."""
MOST_ITERATIONS = 80
LARGEST_STEP = 0.25
"""Radians that a joint turns, and metres that the root moves, in one iteration at most."""
DAMPING = 1e-2


@dataclass(frozen=True, eq=False)
class JointTargets:
    """Targets by joint. positions: metres in the world, NaN along a free axis. rotations: ``q_world_joint``."""

    positions: dict[int, Float[ndarray, "3"]]
    rotations: dict[int, Float[ndarray, "4"]]


@dataclass(frozen=True, eq=False)
class Ease:
    """How freely a pose changes: a weight for the rotation of each joint, 0 where it is fixed, and one for the root's
    position."""

    joints: Float[ndarray, "joint"]
    root: float


def solve(pose: Motion, wanted: JointTargets, ease: Ease) -> tuple[Motion, float]:
    """The pose (one frame) nearest to ``pose`` that meets the targets, and its largest miss in metres.

    Unreachable targets are approached. A joint with a target rotation keeps it whatever turns above it, so that only
    positions are left to solve for.
    """
    parents = pose.skeleton.parents
    places = pose.skeleton.offsets if pose.translations is None else pose.translations[0]
    held = np.zeros(len(parents), dtype=bool)
    held[list(wanted.rotations)] = True
    levers = _levers(parents, tuple(wanted.positions), held, ease.joints > 0.0)
    goal = np.array([*wanted.positions.values()]).reshape(-1, 3)
    given = np.isfinite(goal)
    root, local = pose.root_positions[0].copy(), pose.local_rotations[0].copy()
    turns = np.zeros((len(parents), 3))
    best: tuple[float, ndarray, ndarray] | None = None
    for _ in range(MOST_ITERATIONS):
        world = _turned(local, parents, turns, wanted.rotations)
        local = kinematics.local_rotations(world, parents)
        at = kinematics.global_positions(root, world, parents, places)
        off = np.where(given, goal - at[list(wanted.positions)], 0.0)
        miss = float(np.linalg.norm(off, axis=-1).max(initial=0.0))
        if best is None or miss < best[0]:
            best = miss, root, local
        if miss < REACHED:
            break
        turns, moved = _step(at, off, given, levers, ease)
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
"""A target position, the joint whose turn moves it, and the joint that is turned about that one with it."""


def _levers(
    parents: tuple[int, ...], wanted: tuple[int, ...], held: Bool[ndarray, "joint"], free: Bool[ndarray, "joint"]
) -> list[Lever]:
    """Which joints move which targets. What lies below a joint that is held in the world does not turn."""
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
    """Global rotations after each joint has turned by a world rotation vector, with everything below it."""
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
    given: Bool[ndarray, "wanted 3"],
    levers: list[Lever],
    ease: Ease,
) -> tuple[Float[ndarray, "joint 3"], Float[ndarray, "3"]]:
    """World rotation vectors of the joints and a move of the root, metres, that lead nearer to the targets."""
    joints = len(at)
    jacobian = np.zeros((len(off), 3, joints + 1, 3))
    jacobian[:, :, joints] = np.eye(3)
    for row, joint, end in levers:
        x, y, z = at[end] - at[joint]
        # The cross product with the lever: how the target moves as the joint turns.
        jacobian[row, :, joint] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    flat = jacobian.reshape(off.size, -1)[given.ravel()]
    weight = np.repeat([*ease.joints, ease.root], 3)
    square = (flat * weight) @ flat.T
    # Damping vanishes near the solution, so that convergence stays quadratic there.
    damping = DAMPING * min(1.0, float(np.sum(off**2))) * np.trace(square) / len(square) + 1e-12
    solved = np.linalg.solve(square + damping * np.eye(len(square)), off[given])
    step = (weight * (flat.T @ solved)).reshape(-1, 3)
    longest = float(np.linalg.norm(step, axis=-1).max())
    step = step * min(1.0, LARGEST_STEP / max(longest, 1e-12))
    return step[:joints], step[joints]
