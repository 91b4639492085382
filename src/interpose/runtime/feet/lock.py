"""Feet that stand where they stand and step over the floor: the clean-up of a transition on the 22-joint humanoid.

The course is that of Kovar et al. 2002 (`Footskate Cleanup for Motion Capture Editing`): decide when each foot is
planted (`interpose.runtime.feet.stances`), choose where (`footholds`), spread the corrections smoothly over the frames
between (`swings`), and let analytic inverse kinematics (`limb`) move the legs. Nothing but the legs moves, and nothing
at both keys.

A foot is led by its toe; while the toe stands, the ankle turns about it, and where the leg is too short the heel comes
up. A toe that swings clears the floor; its heel leaves the ground before it and comes down before it. The floor is
y = 0; a foot that stands elsewhere keeps its height.
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
from interpose.runtime.feet.swing import led, lifted, smooth_field
from interpose.runtime.ik.two_bone import soft_reach, two_bone_ik
from interpose.skeleton import HUMANOID

_CHAINS = np.array([[HUMANOID.index(s + n) for n in ("UpLeg", "Leg", "Foot", "Toe")] for s in ("Left", "Right")])
_ABOVE = np.array(HUMANOID.parents)[_CHAINS[:, 0]]
_FORWARD = np.array([0.0, 0.0, 1.0])
_LEG_LENGTH = float(np.linalg.norm(HUMANOID.offsets[_CHAINS[0, 1:3]], axis=1).sum())
_FOOT_LENGTH = float(np.linalg.norm(HUMANOID.offsets[_CHAINS[0, 3]]))
_SLACK = 0.02
"""Metres that leg and foot together keep in hand when they hold a place."""


def plant(motion: Motion, contacts: Float[ndarray, "frame 4"], settings: FootSettings = FOOT_DEFAULTS) -> Motion:
    """``motion`` with its feet kept on the ground while they are in contact; the first and the last frame are kept.

    ``motion``: of :data:`~interpose.skeleton.HUMANOID` at 30 Hz, the two keys included. ``contacts``: probabilities for
    LeftFoot, LeftToe, RightFoot, RightToe, for the two keys those of their neighbours, or 0 where it is known that a
    foot does not stand there.
    """
    if motion.skeleton != HUMANOID:
        raise ValueError("feet are planted on the 22-joint humanoid; retarget first")
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
    # Legs are (batch, side) in one axis, then frames.
    legs = _by_leg(positions[:, :, _CHAINS])
    down = _by_leg(contacts.reshape(count, frames, 2, 2))
    toes, ankles = _tracks(legs, down, settings)
    moved = np.any(np.abs(toes - legs[:, :, 3]) + np.abs(ankles - legs[:, :, 2]) > 1e-9, axis=-1)
    if not moved.any():
        return local
    turned = _turn_legs(
        legs[moved],
        _by_leg(world[:, :, _CHAINS])[moved],
        _by_leg(world[:, :, _ABOVE])[moved],
        toes[moved],
        ankles[moved],
    )
    out = local.copy()
    leg, frame = np.nonzero(moved)
    out[leg[:, None] // 2, frame[:, None], _CHAINS[leg % 2]] = turned
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

    ``world``: their global rotations before. ``above``: that of the joint above the thigh.
    """
    hip, knee, old_ankle, old_toe = (leg[:, i] for i in range(4))
    present = np.linalg.norm(old_ankle - hip, axis=-1)
    ankle = reachable_ankle(hip, toe, ankle, present)
    forward = rotation.rotate(world[:, 0], np.broadcast_to(_FORWARD, hip.shape))
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


def _tracks(
    legs: Float[ndarray, "leg frame 4 3"], down: Float[ndarray, "leg frame 2"], settings: FootSettings
) -> tuple[Float[ndarray, "leg frame 3"], Float[ndarray, "leg frame 3"]]:
    """Where the toes and ankles should go: planted, above the floor, and smoothly from place to place."""
    ankles, toes = legs[:, :, 2], legs[:, :, 3]
    spans = divide_pairs(toes, down[:, :, 1], settings)
    reach = _LEG_LENGTH + _FOOT_LENGTH - _SLACK
    stands = [footing(leg, d[:, 0], s, reach, settings) for leg, d, s in zip(legs, down, spans, strict=True)]
    wanted = np.stack([f.toe for f in stands]) - toes
    held = np.stack([eased(way, f.held, settings) for way, f in zip(wanted, stands, strict=True)])
    new_toes = toes + smooth_field(wanted, held, settings.decay)
    move = new_toes - toes
    new_toes[..., 1] = lifted(new_toes, held, settings)
    lift = new_toes[..., 1] - toes[..., 1] - move[..., 1]
    move[..., 1] += led(lift)
    rest = np.stack([f.heel for f in stands]) - ankles - move
    flat = held & np.stack([f.flat for f in stands]) & (np.linalg.norm(rest, axis=-1) <= settings.stretch)
    flat = np.stack([eased(way, f, settings) for way, f in zip(rest, flat, strict=True)])
    turn = smooth_field(rest, flat, settings.decay)
    # A folded leg, as of one who sits on the heels or rolls, turns too far for a small way of its ankle.
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
