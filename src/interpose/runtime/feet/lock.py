"""Foot locking of a whole transition: feet that stand stay in place, feet that swing clear the floor.

Only the legs move, and nothing at either key. The floor is y = 0; a foot that stands elsewhere keeps its height.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.motion import Motion
from interpose.runtime.feet.footholds import eased, floor, footing
from interpose.runtime.feet.stances import FOOT_DEFAULTS, FootSettings, divide_pairs
from interpose.runtime.feet.swing import heel_lift, lifted, smooth_field
from interpose.runtime.ik.two_bone import soft_reach, two_bone_ik
from interpose.skeleton import HUMANOID, LEG_CHAINS, LEG_LENGTH

_ABOVE = np.array(HUMANOID.parents)[LEG_CHAINS[:, 0]]
_FOOT_LENGTH = float(np.linalg.norm(HUMANOID.offsets[LEG_CHAINS[0, 3]]))
_REACH_SLACK = 0.02
"""Metres by which leg and foot together stay short of full extension when they hold a place."""


def plant(motion: Motion, contacts: Float[ndarray, "frame 4"], settings: FootSettings = FOOT_DEFAULTS) -> Motion:
    """``motion`` with its feet locked to the ground while they are in contact; the first and last frame stay.

    ``motion``: of :data:`~interpose.skeleton.HUMANOID` at 30 Hz, both keys included. ``contacts``: probabilities for
    LeftFoot, LeftToe, RightFoot, RightToe; at the two keys those of the neighbouring frames, or 0 where a foot is known
    not to stand there. Raises ValueError for another skeleton.
    """
    if motion.skeleton != HUMANOID:
        raise ValueError("feet can only be locked on the 22-joint humanoid; retarget first")
    local = plant_batch(motion.root_positions[None], motion.local_rotations[None], contacts[None], settings)
    return replace(motion, local_rotations=local[0])


def plant_batch(
    root: Float[ndarray, "batch frame 3"],
    local: Float[ndarray, "batch frame 22 4"],
    contacts: Float[ndarray, "batch frame 4"],
    settings: FootSettings = FOOT_DEFAULTS,
) -> Float[ndarray, "batch frame 22 4"]:
    """The local rotations of :func:`plant` for several transitions of one length at once."""
    count, frames = root.shape[:2]
    if frames < 3:
        return local
    world = kinematics.global_rotations(local, HUMANOID.parents)
    positions = kinematics.global_positions(root, world, HUMANOID.parents, HUMANOID.offsets)
    # The leg axis is (batch, side) flattened, so that all legs are solved at once.
    legs = _by_leg(positions[:, :, LEG_CHAINS])
    down = _by_leg(contacts.reshape(count, frames, 2, 2))
    toes, ankles = _tracks(legs, down, settings)
    moved = np.any(np.abs(toes - legs[:, :, 3]) + np.abs(ankles - legs[:, :, 2]) > 1e-9, axis=-1)
    if not moved.any():
        return local
    turned = _turn_legs(
        legs[moved],
        _by_leg(world[:, :, LEG_CHAINS])[moved],
        _by_leg(world[:, :, _ABOVE])[moved],
        toes[moved],
        ankles[moved],
    )
    out = local.copy()
    leg, frame = np.nonzero(moved)
    out[leg[:, None] // 2, frame[:, None], LEG_CHAINS[leg % 2]] = turned
    return out


def _by_leg(values: Float[ndarray, "batch frame 2 *rest"]) -> Float[ndarray, "leg frame *rest"]:
    return np.moveaxis(values, 2, 1).reshape(-1, values.shape[1], *values.shape[3:])


def _turn_legs(
    leg: Float[ndarray, "frame 4 3"],
    world: Float[ndarray, "frame 4 4"],
    above: Float[ndarray, "frame 4"],
    toe: Float[ndarray, "frame 3"],
    ankle: Float[ndarray, "frame 3"],
) -> Float[ndarray, "frame 4 4"]:
    """Local rotations of thigh, shin, foot and toe that bring the toe to ``toe`` and the ankle near ``ankle``.

    ``leg``: their positions before, metres. ``world``: their global rotations before. ``above``: the global rotation of
    the joint above the thigh.
    """
    hip, knee, old_ankle, old_toe = (leg[:, i] for i in range(4))
    present = np.linalg.norm(old_ankle - hip, axis=-1)
    ankle = reachable_ankle(hip, toe, ankle, present)
    forward = rotation.rotate(world[:, 0], np.broadcast_to(rotation.FORWARD, hip.shape))
    thigh, shin = two_bone_ik(hip, knee, old_ankle, ankle, forward)
    foot = rotation.between(old_toe - old_ankle, toe - ankle)
    still = np.broadcast_to(rotation.IDENTITY, foot.shape)
    turned = rotation.multiply(np.stack([thigh, shin, foot, still], axis=1), world)
    parents = np.concatenate([above[:, None], turned[:, :3]], axis=1)
    return rotation.multiply(rotation.inverse(parents), turned)


def reachable_ankle(
    hip: Float[ndarray, "frame 3"],
    toe: Float[ndarray, "frame 3"],
    ankle: Float[ndarray, "frame 3"],
    present: Float[ndarray, "frame"],
) -> Float[ndarray, "frame 3"]:
    """The ankle nearest to ``ankle`` that is a foot's length from the toe and within reach of the hip.

    Where no ankle is both, the one between hip and toe, as far from the hip as the leg reaches.
    """
    ankle = toe + _unit(ankle - toe) * _FOOT_LENGTH
    wanted = np.linalg.norm(ankle - hip, axis=-1)
    reach = soft_reach(wanted, present, LEG_LENGTH)
    # The circle in which the sphere of the leg's reach about the hip meets that of the foot about the toe.
    apart = np.maximum(np.linalg.norm(toe - hip, axis=-1), 1e-9)
    axis = (hip - toe) / apart[:, None]
    along = (apart**2 + _FOOT_LENGTH**2 - reach**2) / (2.0 * apart)
    radius = np.sqrt(np.maximum(_FOOT_LENGTH**2 - along**2, 0.0))
    off = (ankle - toe) - np.sum((ankle - toe) * axis, axis=-1, keepdims=True) * axis
    raised = toe + along[:, None] * axis + radius[:, None] * _unit(off)
    raised = np.where((along < _FOOT_LENGTH)[:, None], raised, hip - reach[:, None] * axis)
    return np.where((reach < wanted - 1e-12)[:, None], raised, ankle)


def _tracks(
    legs: Float[ndarray, "leg frame 4 3"], down: Float[ndarray, "leg frame 2"], settings: FootSettings
) -> tuple[Float[ndarray, "leg frame 3"], Float[ndarray, "leg frame 3"]]:
    """The new positions of toes and ankles: in place while they stand, above the floor, and smooth in between.

    A foot is led by its toe. While the toe stands, the ankle turns about it, and where the leg is too short the heel
    rises.
    """
    ankles, toes = legs[:, :, 2], legs[:, :, 3]
    spans = divide_pairs(toes, down[:, :, 1], settings)
    reach = LEG_LENGTH + _FOOT_LENGTH - _REACH_SLACK
    stands = [footing(leg, d[:, 0], s, reach, settings) for leg, d, s in zip(legs, down, spans, strict=True)]
    wanted = np.stack([f.toe for f in stands]) - toes
    held = np.stack([eased(c, f.held, settings) for c, f in zip(wanted, stands, strict=True)])
    # The toe first: onto its places, then clear of the floor; the ankle takes part in both, ahead of a lifted toe.
    new_toes = toes + smooth_field(wanted, held, settings.decay)
    move = new_toes - toes
    new_toes[..., 1] = lifted(new_toes, held, settings)
    lift = new_toes[..., 1] - toes[..., 1] - move[..., 1]
    move[..., 1] += heel_lift(lift)
    # What then still separates the heel from its place, where the whole foot stands.
    rest = np.stack([f.heel for f in stands]) - ankles - move
    flat = held & np.stack([f.flat for f in stands]) & (np.linalg.norm(rest, axis=-1) <= settings.stretch)
    flat = np.stack([eased(c, f, settings) for c, f in zip(rest, flat, strict=True)])
    turn = smooth_field(rest, flat, settings.decay)
    # A folded leg, as in kneeling or rolling, would turn too far for a small correction of its ankle.
    limit = settings.folded * np.linalg.norm(ankles - legs[:, :, 0], axis=-1, keepdims=True)
    share = limit / np.maximum(np.linalg.norm(move + turn, axis=-1, keepdims=True), limit + 1e-9)
    new_toes, new_ankles = toes + share * (new_toes - toes), ankles + share * (move + turn)
    for new, old, (level, _) in (
        (new_toes, toes, settings.toe_heights),
        (new_ankles, ankles, settings.ankle_heights),
    ):
        new[:, 1:-1, 1] = np.maximum(new[..., 1], floor(old[..., 1], level))[:, 1:-1]
    return new_toes, new_ankles


def _unit(v: Float[ndarray, "*batch 3"]) -> Float[ndarray, "*batch 3"]:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12)
