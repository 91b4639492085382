"""When a foot stands and when it swings: each foot's way through a gap, divided at the least cost.

A network that averages lets feet glide where they should stand and step, so a threshold on its contacts finds neither.
Here every division of the frames into stances and swings has a cost, and dynamic programming over the places where one
gives way to the other (a semi-Markov chain, as in speech) finds the cheapest for all feet at once. A stance costs by
how unlikely the contact is, how high the toe is, and how far it strays from one place: from the key's place where the
stance holds a key, else from its own mean. A swing costs by how far the toe has to be lifted to clear the floor, by how
little it moves, and once for being there, so that neither flickers. All costs are negative logarithms of likelihoods.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import binary_opening


@dataclass(frozen=True)
class FootSettings:
    """Frames are of 30 Hz, lengths metres, costs natural units.

    When a foot stands (`interpose.runtime.feet.stances`). trust: the weight of a contact's log odds. loose, loose_key:
    how far a toe may be from its place, or from a key's, for a cost of one. shortest, shortest_swing: frames of a
    stance and of a swing at least, between the keys. pace_swing: metres a frame that a swing may cover beyond those.
    step: how far apart both keys' places of one foot must be for it to have stepped between them. high, high_scale,
    high_most: the height from which a toe is unlikely to stand, the height above it that costs one (above the
    roll-out's own where it is a key's toe that is high), and the most that height costs. lift_scale: the lift of a
    swinging toe that costs one half. slow, slow_cost: metres a frame below which a low toe, one under ``high``, hardly
    swings, and what it costs if it does not move at all. change: what a swing costs. long, long_cost: frames that a toe
    may swing low, and the cost of each beyond. glide, glide_cost: frames from which on two feet that swing low at once
    are taken to glide, and the cost of each. key_cost: what it costs to swing at a key whose toe is lower than key_low.

    Where (`interpose.runtime.feet.footholds`). stretch: the longest correction; frames that need more are let go. pace:
    metres a frame by which a correction may change between two places; frames are let go to leave the time.
    heel_first: frames by which the heel leaves the ground before the toe. toe_heights, ankle_heights: from the lowest
    that a joint may be to the highest that one on the floor stands; a lower key lowers the floor around it. above:
    metres over those heights up to which a standing joint is brought to the floor; one higher stands on something.

    How between (`interpose.runtime.feet.swing`, `interpose.runtime.feet.lock`). decay: frames over which a correction
    fades. clear: the least height of a toe that swings. arch, arch_most: how much higher one goes that the roll-out
    drags, for each metre of its step and at most. folded: the longest correction as a share of the way from hip to
    ankle.
    """

    trust: float = 1.0
    loose: float = 0.06
    loose_key: float = 0.12
    shortest: int = 3
    shortest_swing: int = 4
    pace_swing: float = 0.15
    step: float = 0.03
    high: float = 0.05
    high_scale: float = 0.03
    high_most: float = 1.5
    lift_scale: float = 0.03
    slow: float = 0.005
    slow_cost: float = 3.3
    change: float = 2.0
    long: int = 20
    long_cost: float = 0.2
    glide: int = 6
    glide_cost: float = 1.0
    key_cost: float = 2.0
    key_low: float = 0.03
    stretch: float = 0.25
    pace: float = 0.03
    heel_first: int = 3
    toe_heights: tuple[float, float] = (0.0, 0.02)
    ankle_heights: tuple[float, float] = (0.06, 0.09)
    above: float = 0.1
    decay: float = 8.0
    clear: float = 0.03
    arch: float = 0.04
    arch_most: float = 0.03
    folded: float = 0.4


FOOT_DEFAULTS = FootSettings()

_SURE = 0.03
"""Contact probabilities are kept this far from 0 and 1; a key with less is known not to stand."""
_ROWS = 64
"""Ends of stances and swings whose costs are found at once; bounds the memory of long gaps."""


def divide(
    toes: Float[ndarray, "leg frame 3"],
    probability: Float[ndarray, "leg frame"],
    settings: FootSettings = FOOT_DEFAULTS,
    swing_cost: Float[ndarray, "leg frame"] | None = None,
) -> list[list[slice]]:
    """The frames in which each foot stands, in order; in all others it swings.

    ``toes``: global positions, the two keys included. ``probability``: of the toes' contact. ``swing_cost``: what it
    costs beside to swing in each frame.
    """
    legs, frames = probability.shape
    stand, high, swing = _evidence(toes, probability, settings)
    swing = swing if swing_cost is None else swing + swing_cost
    low_keys = _low_keys(toes, probability, settings)
    stood, swung = np.full((legs, frames + 1), np.inf), np.full((legs, frames + 1), np.inf)
    stood[:, 0] = swung[:, 0] = 0.0
    stood_from, swung_from = np.zeros((legs, frames + 1), dtype=int), np.zeros((legs, frames + 1), dtype=int)
    for first in range(1, frames + 1, _ROWS):
        ends = np.arange(first, min(first + _ROWS, frames + 1))
        stance_costs = _stance_costs(toes, stand, high, ends, settings)
        swing_costs = _swing_costs(toes, swing, low_keys, ends, settings)
        for row, end in enumerate(ends.tolist()):
            for best, came, before, cost in (
                (stood, stood_from, swung, stance_costs),
                (swung, swung_from, stood, swing_costs),
            ):
                total = before[:, :end] + cost[:, row, :end]
                came[:, end] = total.argmin(axis=1)
                best[:, end] = total.min(axis=1)
    found: list[list[slice]] = []
    for leg in range(legs):
        end, stands = frames, bool(stood[leg, -1] <= swung[leg, -1])
        spans: list[slice] = []
        while end > 0:
            begin = int((stood_from if stands else swung_from)[leg, end])
            if stands:
                spans.append(slice(begin, end))
            end, stands = begin, not stands
        found.append(spans[::-1])
    return found


def divide_pairs(
    toes: Float[ndarray, "leg frame 3"],
    probability: Float[ndarray, "leg frame"],
    settings: FootSettings = FOOT_DEFAULTS,
) -> list[list[slice]]:
    """:func:`divide` for feet that follow one another in pairs, left and right.

    Where both feet of a pair swing low at once for longer than in a leap, as if the figure glided, the second is
    divided once more, its swings there dearer, and then the first.
    """
    found = divide(toes, probability, settings)
    low = toes[..., 1] < settings.high
    for side in (1, 0):
        swings = low & ~_standing(found, low.shape[1])
        glides = binary_opening(swings[0::2] & swings[1::2], np.ones((1, settings.glide)))
        pairs = np.flatnonzero(glides.any(axis=1))
        if len(pairs) == 0:
            break
        legs = 2 * pairs + side
        again = divide(toes[legs], probability[legs], settings, settings.glide_cost * glides[pairs])
        for leg, spans in zip(legs.tolist(), again, strict=True):
            found[leg] = spans
    return found


def _standing(found: list[list[slice]], frames: int) -> Bool[ndarray, "leg {frames}"]:
    out = np.zeros((len(found), frames), dtype=bool)
    for leg, spans in enumerate(found):
        for span in spans:
            out[leg, span] = True
    return out


def _evidence(
    toes: Float[ndarray, "leg frame 3"], probability: Float[ndarray, "leg frame"], settings: FootSettings
) -> tuple[Float[ndarray, "leg frame"], Float[ndarray, "leg frame"], Float[ndarray, "leg frame"]]:
    """What each frame costs: standing by its contact, standing by its height, and swinging."""
    sure = np.clip(probability, _SURE, 1.0 - _SURE)
    height = toes[..., 1]
    speed = np.linalg.norm(np.gradient(toes, axis=1), axis=-1)
    stand = settings.trust * np.log((1.0 - sure) / sure)
    high = np.minimum((np.maximum(height - settings.high, 0.0) / settings.high_scale) ** 2, settings.high_most)
    swing = 0.5 * (np.clip(settings.clear - height, 0.0, settings.clear) / settings.lift_scale) ** 2
    swing += settings.slow_cost * np.clip(1.0 - speed / settings.slow, 0.0, 1.0) * (height < settings.high)
    swing[:, [0, -1]] += settings.key_cost * _low_keys(toes, probability, settings)
    return stand, high, swing


def _low_keys(
    toes: Float[ndarray, "leg frame 3"], probability: Float[ndarray, "leg frame"], settings: FootSettings
) -> Bool[ndarray, "leg 2"]:
    """Whether each foot is low at each key and not known to move there."""
    return (toes[:, [0, -1], 1] < settings.key_low) & (probability[:, [0, -1]] > _SURE)


def _stance_costs(
    toes: Float[ndarray, "leg frame 3"],
    stand: Float[ndarray, "leg frame"],
    high: Float[ndarray, "leg frame"],
    ends: Int[ndarray, "row"],
    settings: FootSettings,
) -> Float[ndarray, "leg row begin"]:
    """The cost of standing from each beginning to (not with) each of ``ends``."""
    frames, final = toes.shape[1], int(ends[-1])
    away = toes - toes[:, :1]
    way, square = _sums(away), _sums(np.sum(away**2, axis=-1))
    begins = np.arange(final)
    count = ends[:, None] - begins
    total = way[:, ends, None] - way[:, None, :final]
    squares = square[:, ends, None] - square[:, None, :final]
    stray = squares - np.sum(total**2, axis=-1) / np.maximum(count, 1)
    cost = stray / settings.loose**2 + _between(high, ends)
    cost[:, (begins > 0) & (count < settings.shortest)] = np.inf
    cost[:, :, 0] = squares[:, :, 0] / settings.loose_key**2 + _between(_hovering(toes, 0, settings), ends)[:, :, 0]
    if final == frames:  # stances that hold the target
        end = away[:, -1]
        from_start = _dot(end, end)
        stray = squares[:, -1] - 2.0 * np.einsum("lbc,lc->lb", total[:, -1], end) + count[-1] * from_start
        cost[:, -1] = stray / settings.loose_key**2 + _between(_hovering(toes, -1, settings), ends)[:, -1]
        cost[:, -1, 0] = np.where(from_start[:, 0] > settings.step**2, np.inf, cost[:, -1, 0])
    return cost + _between(stand, ends)


def _hovering(toes: Float[ndarray, "leg frame 3"], key: int, settings: FootSettings) -> Float[ndarray, "leg frame"]:
    """What it costs each frame to stand where a key's toe is, in the air and higher than the frame's own."""
    height = toes[:, key, 1, None]
    above = np.where(height > settings.high, np.maximum(height - toes[..., 1], 0.0), 0.0)
    return (above / settings.high_scale) ** 2


def _swing_costs(
    toes: Float[ndarray, "leg frame 3"],
    swing: Float[ndarray, "leg frame"],
    low_keys: Bool[ndarray, "leg 2"],
    ends: Int[ndarray, "row"],
    settings: FootSettings,
) -> Float[ndarray, "leg row begin"]:
    """The cost of swinging from each beginning to (not with) each of ``ends``."""
    frames, final = toes.shape[1], int(ends[-1])
    begins = np.arange(final)
    count = ends[:, None] - begins
    to = toes[:, np.minimum(ends, frames - 1)]
    since = toes[:, np.maximum(begins - 1, 0)]
    apart = np.linalg.norm(to[:, :, None] - since[:, None], axis=-1)
    late = np.maximum(settings.shortest_swing + apart / settings.pace_swing - count, 0.0)
    within = (begins > 0) & (ends[:, None] < frames)
    # From a key in which the foot stands, or to one, it takes as long as from stance to stance.
    left = (begins > 0) | low_keys[:, :1]
    reached = (ends < frames) | low_keys[:, 1:]
    dragged = _between((toes[..., 1] < settings.high).astype(float), ends)
    cost = _between(swing, ends) + settings.change * np.broadcast_to(left[:, None], apart.shape)
    cost += 2.0 * late * (left[:, None] & reached[:, :, None])
    cost += settings.long_cost * np.maximum(dragged - settings.long, 0.0)
    cost[:, within & (count < 2)] = np.inf
    return cost


def _sums(values: Float[ndarray, "leg frame *rest"]) -> Float[ndarray, "leg frame+1 *rest"]:
    return np.concatenate([np.zeros_like(values[:, :1]), np.cumsum(values, axis=1)], axis=1)


def _between(values: Float[ndarray, "leg frame"], ends: Int[ndarray, "row"]) -> Float[ndarray, "leg row begin"]:
    """The sum of the values from each beginning to each end."""
    sums = _sums(values)
    return sums[:, ends, None] - sums[:, None, : int(ends[-1])]


def _dot(a: Float[ndarray, "leg 3"], b: Float[ndarray, "leg 3"]) -> Float[ndarray, "leg 1"]:
    return np.sum(a * b, axis=-1, keepdims=True)
