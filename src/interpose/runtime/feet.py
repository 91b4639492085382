"""Feet that stay where they stand: the clean-up of a generated transition on the 22-joint humanoid.

The course is that of Kovar et al. 2002 (`Footskate Cleanup for Motion Capture Editing`): decide when each foot joint is
planted, choose where, spread the corrections smoothly over the neighbouring frames, and let analytic inverse kinematics
move the legs. Here the corrections of a joint are the field c(frame) that moves it onto its places and is otherwise as
smooth and as short-lived as possible, the least sum of |second difference of c|^2 + (4 / decay^4) |c|^2: a beam on an
elastic foundation, which forgets a place within some `decay` frames. It is zero at both keys and one frame beyond them,
so that keys stay as they are and nothing jumps there.

A foot is led by its toe; while the toe stands, the ankle turns about it, and where the leg is too short the heel comes
up. Places that would need too long a way are let go. The floor is y = 0; a foot that stands elsewhere keeps its height.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.linalg import solveh_banded

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.motion import Motion
from interpose.runtime.footholds import DEFAULT, Settings, eased, overlap, places, runs
from interpose.runtime.limb import soft_reach, two_bone_ik
from interpose.skeleton import HUMANOID

_CHAINS = np.array([[HUMANOID.index(s + n) for n in ("UpLeg", "Leg", "Foot", "Toe")] for s in ("Left", "Right")])
_PARENTS = np.array(HUMANOID.parents)[_CHAINS]
_FORWARD = np.array([0.0, 0.0, 1.0])
_LEG_LENGTH = float(np.linalg.norm(HUMANOID.offsets[_CHAINS[0, 1:3]], axis=1).sum())
_FOOT_LENGTH = float(np.linalg.norm(HUMANOID.offsets[_CHAINS[0, 3]]))
_SLACK = 0.02
"""Metres that leg and foot together keep in hand when they hold a place."""
_RISE = 0.005
"""Metres a frame by which the floor may rise from a key that is below it."""


def plant(motion: Motion, contacts: Float[ndarray, "frame 4"], settings: Settings = DEFAULT) -> Motion:
    """``motion`` with its feet kept on the ground while they are in contact; the first and the last frame are kept.

    ``motion``: of :data:`~interpose.skeleton.HUMANOID` at 30 Hz, the two keys included. ``contacts``: probabilities for
    LeftFoot, LeftToe, RightFoot, RightToe; those of the two keys are taken from their neighbours.
    """
    if motion.skeleton != HUMANOID:
        raise ValueError("feet are planted on the 22-joint humanoid; retarget first")
    local = plant_batch(motion.root_positions[None], motion.local_rotations[None], contacts[None], settings)
    return replace(motion, local_rotations=local[0])


def plant_batch(
    root: Float[ndarray, "batch frame 3"],
    local: Float[ndarray, "batch frame 22 4"],
    contacts: Float[ndarray, "batch frame 4"],
    settings: Settings = DEFAULT,
) -> Float[ndarray, "batch frame 22 4"]:
    """The local rotations of :func:`plant` for several transitions of one length at once."""
    count, frames = root.shape[:2]
    if frames < 3:
        return local
    world = kinematics.global_rotations(local, HUMANOID.parents)
    positions = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)
    # Legs are (batch, side) in one axis, then frames.
    legs = np.moveaxis(positions[:, :, _CHAINS], 2, 1).reshape(2 * count, frames, 4, 3)
    down = np.moveaxis(contacts.reshape(count, frames, 2, 2), 2, 1).reshape(2 * count, frames, 2)
    tracks = [_foot_track(leg, planted, settings) for leg, planted in zip(legs, down, strict=True)]
    toes, ankles = np.stack([toe for toe, _ in tracks]), np.stack([ankle for _, ankle in tracks])
    moved = np.any(np.abs(toes - legs[:, :, 3]) + np.abs(ankles - legs[:, :, 2]) > 1e-9, axis=-1)
    if not moved.any():
        return local
    out = local.copy()
    for side in range(2):
        rows = np.argwhere(moved[side::2])
        at = (rows[:, 0], rows[:, 1])
        out[at[0][:, None], at[1][:, None], _CHAINS[side]] = _turn_leg(
            legs[side::2][at], world[at], toes[side::2][at], ankles[side::2][at], side
        )
    return out


def _turn_leg(
    leg: Float[ndarray, "frame 4 3"],
    world: Float[ndarray, "frame 22 4"],
    toe: Float[ndarray, "frame 3"],
    ankle: Float[ndarray, "frame 3"],
    side: int,
) -> Float[ndarray, "frame 4 4"]:
    """Local rotations of thigh, shin, foot and toe that bring the toe to ``toe`` and the ankle near ``ankle``."""
    hip, knee, old_ankle, old_toe = (leg[:, i] for i in range(4))
    present = np.linalg.norm(old_ankle - hip, axis=-1)
    ankle = reachable_ankle(hip, toe, ankle, present)
    turned = world[:, _CHAINS[side]]
    forward = rotation.rotate(turned[:, 0], np.broadcast_to(_FORWARD, hip.shape))
    thigh, shin = two_bone_ik(hip, knee, old_ankle, ankle, forward)
    foot = rotation.between(old_toe - old_ankle, toe - ankle)
    still = np.broadcast_to(rotation.IDENTITY, foot.shape)
    turned = rotation.multiply(np.stack([thigh, shin, foot, still], axis=1), turned)
    above = np.concatenate([world[:, _PARENTS[side, :1]], turned[:, :3]], axis=1)
    return rotation.multiply(rotation.inverse(above), turned)


def reachable_ankle(
    hip: Float[ndarray, "frame 3"],
    toe: Float[ndarray, "frame 3"],
    ankle: Float[ndarray, "frame 3"],
    present: Float[ndarray, "frame"],
) -> Float[ndarray, "frame 3"]:
    """The ankle nearest to ``ankle`` that is a foot's length from the toe and within reach of the hip.

    Where no ankle is both, the one on the line from hip to toe, as far out as the leg reaches.
    """
    ankle = toe + _unit(ankle - toe) * _FOOT_LENGTH
    wanted = np.linalg.norm(ankle - hip, axis=-1)
    reach = soft_reach(wanted, present, _LEG_LENGTH)
    # The circle in which the sphere of the leg's reach about the hip meets that of the foot about the toe.
    apart = np.maximum(np.linalg.norm(toe - hip, axis=-1), 1e-9)
    axis = (hip - toe) / apart[:, None]
    along = (apart**2 + _FOOT_LENGTH**2 - reach**2) / (2.0 * apart)
    radius = np.sqrt(np.maximum(_FOOT_LENGTH**2 - along**2, 0.0))
    off = (ankle - toe) - np.sum((ankle - toe) * axis, axis=-1, keepdims=True) * axis
    raised = toe + along[:, None] * axis + radius[:, None] * _unit(off)
    raised = np.where((along < _FOOT_LENGTH)[:, None], raised, hip - reach[:, None] * axis)
    return np.where((reach < wanted - 1e-12)[:, None], raised, ankle)


def _foot_track(
    leg: Float[ndarray, "frame 4 3"], down: Float[ndarray, "frame 2"], settings: Settings
) -> tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 3"]]:
    """Where toe and ankle of one foot should go: planted, above the floor, and smoothly from place to place."""
    hip, ankle, toe = leg[:, 0], leg[:, 2], leg[:, 3]
    held, wanted = np.zeros(len(toe), dtype=bool), np.zeros_like(toe)
    flat, heel = held.copy(), np.zeros_like(ankle)
    toe_places = places(toe, runs(down[:, 1], toe, settings.toe_heights, settings), settings.toe_heights, settings)
    for run, where in toe_places:
        held[run], wanted[run] = True, where - toe[run]
    for run in runs(down[:, 0], ankle, settings.ankle_heights, settings):
        shared = [(both, where) for toes, where in toe_places if (both := overlap(run, toes))]
        if shared:  # heel and toe belong to one place: the foot's own direction while both are down
            both, where = shared[0]
            direction = _mean_or_key(ankle - toe, both)
            stands = [(run, where + direction / np.linalg.norm(direction) * _FOOT_LENGTH)]
        else:
            stands = places(ankle, [run], settings.ankle_heights, settings)
        for span, where in stands:
            flat[span], heel[span] = True, where
            alone = np.arange(len(toe))[span]
            alone = alone[~held[span]]  # where the heel stands alone the whole foot moves with it
            held[alone], wanted[alone] = True, where - ankle[alone]
    held &= np.linalg.norm(wanted, axis=-1) <= settings.stretch
    held &= np.linalg.norm(toe + wanted - hip, axis=-1) <= _LEG_LENGTH + _FOOT_LENGTH - _SLACK
    held = eased(wanted, held, settings)
    move = _above_floor(toe, _smooth_field(wanted, held, settings.decay), held, settings)
    rest = heel - ankle - move
    flat &= held & (np.linalg.norm(rest, axis=-1) <= settings.stretch)
    new_ankle = ankle + move + _smooth_field(rest, eased(rest, flat, settings), settings.decay)
    new_ankle[1:-1, 1] = np.maximum(new_ankle[:, 1], _floor(ankle[:, 1], settings.ankle_heights[0]))[1:-1]
    return toe + move, new_ankle


def _mean_or_key(vectors: Float[ndarray, "frame 3"], run: slice) -> Float[ndarray, "3"]:
    if run.start == 0:
        return vectors[0]
    return vectors[-1] if run.stop == len(vectors) else vectors[run].mean(axis=0)


def _floor(heights: Float[ndarray, "frame"], level: float) -> Float[ndarray, "frame"]:
    """The lowest allowed height in each frame: ``level``, or what a lower key comes from or goes to."""
    away = np.arange(len(heights)) * _RISE
    return np.minimum(level, np.minimum(heights[0] + away, heights[-1] + away[::-1]))


def _above_floor(
    toe: Float[ndarray, "frame 3"], move: Float[ndarray, "frame 3"], locked: Bool[ndarray, "frame"], settings: Settings
) -> Float[ndarray, "frame 3"]:
    """The corrections with those frames raised that would sink under the floor, their neighbours smoothly with them."""
    lowest = _floor(toe[:, 1], settings.toe_heights[0]) - toe[:, 1]
    held, raised = locked.copy(), move.copy()
    for _ in range(3):
        below = raised[:, 1] < lowest - 1e-6
        below[[0, -1]] = False
        if not below.any():
            return raised
        held |= below
        level = np.where(locked, move[:, 1], lowest)
        raised[:, 1:2] = _smooth_field(np.maximum(level, lowest)[:, None], held, settings.decay)
    raised[1:-1, 1] = np.maximum(raised[1:-1, 1], lowest[1:-1])
    return raised


def _smooth_field(
    values: Float[ndarray, "frame channel"], held: Bool[ndarray, "frame"], decay: float
) -> Float[ndarray, "frame channel"]:
    """The field that is ``values`` where ``held``, zero at the keys and beyond, and else the smoothest that fades.

    The least sum of |second difference|^2 + 4 / decay^4 |field|^2, by a banded system.
    """
    frames, channels = values.shape
    fixed = np.concatenate([[True, True], held[1:-1], [True, True]])
    known = np.zeros((frames + 2, channels))
    known[2:-2][held[1:-1]] = values[1:-1][held[1:-1]]
    if fixed.all() or not held[1:-1].any():
        return known[1:-1]
    stiffness = 4.0 / decay**4
    curvature = np.diff(known, n=2, axis=0)
    pull = np.zeros_like(known)
    pull[:-2] += curvature
    pull[1:-1] -= 2.0 * curvature
    pull[2:] += curvature
    free = ~fixed
    # Rows of the upper bands of D'D: 6, -4, 1 (fewer at the ends, which are fixed anyway).
    bands = np.zeros((3, frames + 2))
    bands[2] = np.where(free, 6.0 + stiffness, 1.0)
    bands[1, 1:] = np.where(free[1:] & free[:-1], -4.0, 0.0)
    bands[0, 2:] = np.where(free[2:] & free[:-2], 1.0, 0.0)
    right = np.where(free[:, None], -pull, known)
    return solveh_banded(bands, right)[1:-1]


def _unit(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3"]:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
