"""Foot locking of a whole transition: feet that stand stay in place, feet that swing clear the floor.

Only the legs move, and nothing at either key. The floor is y = 0; a foot that stands elsewhere keeps its height.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray
from scipy.linalg import solveh_banded

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.rotation import unit
from interpose.runtime.feet.footholds import eased, floor, footing
from interpose.runtime.feet.stances import FOOT_DEFAULTS, FootSettings, divide_pairs
from interpose.runtime.ik.two_bone import soft_reach, two_bone_ik
from interpose.skeleton import HUMANOID, LEG_CHAINS, LEG_LENGTH

_ABOVE = np.array(HUMANOID.parents)[LEG_CHAINS[:, 0]]
_FOOT_LENGTH = float(np.linalg.norm(HUMANOID.offsets[LEG_CHAINS[0, 3]]))
_REACH_SLACK = 0.02
"""Metres by which leg and foot together stay short of full extension when they hold a place."""
_CLEARANCE = np.array([0.0, 0.6, 0.9, 1.0])
"""Share of the clearance that a toe has 0, 1, 2, ... frames after it leaves its place or before it reaches it."""
_KEY_CLEARANCE = np.array([0.0, 0.04, 0.15, 0.31, 0.5, 0.69, 0.85, 0.96, 1.0])
"""The same from or to a key in which the foot does not stand."""
_HEEL_LEAD = (0.1, 0.2, 0.4, 0.2, 0.1)
"""Weights of the toe's lift in this frame and the next four in the lift of the heel."""
_AFTER_KEY = np.array([0.0, 0.25, 0.75, 1.0])
_SOFT_FLOOR = 0.01
"""Metres over which the least height takes over from the toe's own."""


def plant_batch(
    root: Float[ndarray, "batch frame 3"],
    local: Float[ndarray, "batch frame 22 4"],
    contacts: Float[ndarray, "batch frame 4"],
    settings: FootSettings = FOOT_DEFAULTS,
) -> Float[ndarray, "batch frame 22 4"]:
    """Local rotations with feet locked to the ground while they are in contact; the first and last frame stay.

    Transitions of one length on :data:`~interpose.skeleton.HUMANOID` at 30 Hz, both keys included. ``contacts``:
    probabilities for LeftFoot, LeftToe, RightFoot, RightToe; at the two keys those of the neighbouring frames, or 0
    where a foot is known not to stand there.
    """
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
    ankle = toe + unit(ankle - toe) * _FOOT_LENGTH
    wanted = np.linalg.norm(ankle - hip, axis=-1)
    reach = soft_reach(wanted, present, LEG_LENGTH)
    # The circle in which the sphere of the leg's reach about the hip meets that of the foot about the toe.
    apart = np.maximum(np.linalg.norm(toe - hip, axis=-1), 1e-9)
    axis = (hip - toe) / apart[:, None]
    along = (apart**2 + _FOOT_LENGTH**2 - reach**2) / (2.0 * apart)
    radius = np.sqrt(np.maximum(_FOOT_LENGTH**2 - along**2, 0.0))
    off = (ankle - toe) - np.sum((ankle - toe) * axis, axis=-1, keepdims=True) * axis
    raised = toe + along[:, None] * axis + radius[:, None] * unit(off)
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


def smooth_field(
    values: Float[ndarray, "leg frame channel"], held: Bool[ndarray, "leg frame"], decay: float
) -> Float[ndarray, "leg frame channel"]:
    """For each leg, the correction c(frame) that is ``values`` where ``held`` and smooth and short-lived elsewhere.

    It minimises the sum of |second difference of c|^2 + 4 / decay^4 |c|^2: a beam on an elastic foundation, which
    forgets a place within some ``decay`` frames. It is zero at both keys and one frame beyond them, so that keys stay
    and nothing jumps there. One banded system solves all legs.
    """
    legs, frames, channels = values.shape
    fixed = np.ones((legs, frames + 2), dtype=bool)
    fixed[:, 2:-2] = held[:, 1:-1]
    known = np.zeros((legs, frames + 2, channels))
    known[:, 2:-2] = np.where(held[:, 1:-1, None], values[:, 1:-1], 0.0)
    moved = np.any(known, axis=(1, 2))
    if not moved.any():
        return known[:, 1:-1]
    curvature = np.diff(known[moved], n=2, axis=1)
    pull = np.zeros_like(known[moved])
    pull[:, :-2] += curvature
    pull[:, 1:-1] -= 2.0 * curvature
    pull[:, 2:] += curvature
    free = ~fixed[moved].reshape(-1)
    # The upper bands of D'D are 6, -4, 1. Each leg's first two and last two rows are fixed, so legs do not interact.
    bands = np.zeros((3, len(free)))
    bands[2] = np.where(free, 6.0 + 4.0 / decay**4, 1.0)
    bands[1, 1:] = np.where(free[1:] & free[:-1], -4.0, 0.0)
    bands[0, 2:] = np.where(free[2:] & free[:-2], 1.0, 0.0)
    right = np.where(free[:, None], -pull.reshape(-1, channels), known[moved].reshape(-1, channels))
    known[moved] = solveh_banded(bands, right).reshape(-1, frames + 2, channels)
    return known[:, 1:-1]


def lifted(
    toes: Float[ndarray, "leg frame 3"], held: Bool[ndarray, "leg frame"], settings: FootSettings
) -> Float[ndarray, "leg frame"]:
    """The toes' heights, metres, raised where they swing too low; unchanged where ``held`` and at the keys.

    A toe gains its clearance within three frames of leaving its place, and more slowly from a key in which it does not
    stand. A dragged toe rises in an arch above that, the higher the longer its step.
    """
    legs, frames = held.shape
    anchor = held.copy()
    anchor[:, [0, -1]] = True
    number = np.broadcast_to(np.arange(frames), (legs, frames))
    before = np.maximum.accumulate(np.where(anchor, number, 0), axis=1)
    after = np.minimum.accumulate(np.where(anchor, number, frames - 1)[:, ::-1], axis=1)[:, ::-1]
    row = np.arange(legs)[:, None]
    step = np.linalg.norm((toes[row, after] - toes[row, before])[..., ::2], axis=-1)
    share = (number - before) / np.maximum(after - before, 1)
    # The highest point of each swing says whether the network drags the toe (1) or lifts it by itself (0).
    highest = np.maximum.reduceat(toes[..., 1].reshape(-1), np.flatnonzero(anchor))[np.cumsum(anchor) - 1]
    drags = np.clip(2.0 - 2.0 * highest.reshape(legs, frames) / settings.clear, 0.0, 1.0)
    arch = drags * np.minimum(settings.arch * step, settings.arch_most) * np.sin(np.pi * share) ** 2
    clear = settings.clear + floor(toes[..., 1], 0.0)
    least = clear + arch
    rests = held.copy()
    rests[:, 0] &= held[:, 1]
    rests[:, -1] &= held[:, -2]
    for at, count in ((before, number - before), (after, after - number)):
        off = np.where(rests[row, at], _table(_CLEARANCE, count), _table(_KEY_CLEARANCE, count))
        least -= np.maximum(clear[row, at] - toes[row, at, 1], 0.0) * (1.0 - off)
    height = toes[..., 1]
    # A smooth maximum of the own and the least height.
    near = np.maximum(_SOFT_FLOOR - np.abs(height - least), 0.0)
    raised = np.maximum(height, least) + near**2 / (4.0 * _SOFT_FLOOR)
    return np.where(anchor, height, raised)


def heel_lift(lift: Float[ndarray, "leg frame"]) -> Float[ndarray, "leg frame"]:
    """The heel's lift for that of the toe, metres: earlier and smoother, as the heel leaves the ground and comes down
    first in a step. Zero at the keys."""
    frames = lift.shape[1]
    ahead = np.pad(lift, ((0, 0), (0, len(_HEEL_LEAD) - 1)))
    rise = np.sum([w * ahead[:, k : k + frames] for k, w in enumerate(_HEEL_LEAD)], axis=0)
    return rise * _table(_AFTER_KEY, np.arange(frames)) * (np.arange(frames) < frames - 1)


def _table(values: Float[ndarray, "step"], count: ndarray) -> ndarray:
    return values[np.minimum(count, len(values) - 1)]
