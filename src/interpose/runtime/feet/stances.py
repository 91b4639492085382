"""When each foot stands and when it swings: the cheapest segmentation of a gap into stances and swings.

A network that averages lets feet glide, so a threshold on its predicted contacts finds neither stances nor swings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray
from scipy.ndimage import binary_opening


@dataclass(frozen=True)
class FootSettings:
    """Thresholds and costs of foot locking: frames at 30 Hz, metres, costs as negative log likelihoods."""

    # When a foot stands (`stances`).
    trust: float = 1.0  # weight of a predicted contact's log odds
    loose: float = 0.06  # distance of a standing toe from its place that costs one
    loose_key: float = 0.12  # the same where a key fixes the place
    shortest: int = 3  # fewest frames of a stance between the keys
    shortest_swing: int = 4  # fewest frames of a swing
    pace_swing: float = 0.15  # metres a frame that a swing may cover beyond those frames
    step: float = 0.03  # distance between a foot's places at the two keys from which it must have stepped
    high: float = 0.05  # height from which a toe is unlikely to stand
    high_scale: float = 0.03  # metres above that height, or above a key's raised toe, that cost one
    high_most: float = 1.5  # most that height costs
    lift_scale: float = 0.03  # lift of a swinging toe that costs one half
    slow: float = 0.005  # metres a frame below which a low toe hardly swings
    slow_cost: float = 3.3  # for a low toe that swings without moving
    change: float = 2.0  # for each swing
    long: int = 20  # frames that a toe may swing low at no cost
    long_cost: float = 0.2  # for each frame beyond
    glide: int = 6  # frames that both feet must swing low together to count as gliding
    glide_cost: float = 1.0  # for each gliding frame
    key_cost: float = 2.0  # for swinging at a key whose toe is lower than key_low
    key_low: float = 0.03
    # Where it stands (`footholds`).
    stretch: float = 0.25  # longest correction; frames that need more are released
    pace: float = 0.03  # metres a frame by which a correction may change from one place to the next
    heel_first: int = 3  # frames by which the heel leaves the ground before the toe
    toe_heights: tuple[float, float] = (0.0, 0.02)  # lowest allowed, and highest of a toe on the floor
    ankle_heights: tuple[float, float] = (0.06, 0.09)  # the same for the ankle
    above: float = 0.1  # metres over those heights below which a standing joint is put on the floor
    # How it moves in between (`lock`).
    decay: float = 8.0  # frames over which a correction fades
    clear: float = 0.03  # least height of a swinging toe
    arch: float = 0.04  # additional height of a dragged toe for each metre of its step
    arch_most: float = 0.03  # and the most of it
    folded: float = 0.4  # longest correction, as a share of the distance from hip to ankle


FOOT_DEFAULTS = FootSettings()

_CONTACT_MARGIN = 0.03
"""Contact probabilities are clipped this far from 0 and 1; a foot with less at a key is known not to stand there."""
_ENDS_AT_ONCE = 64
"""Segment ends whose costs are computed together; limits the memory for long gaps."""


def divide(
    toes: Float[ndarray, "leg frame 3"],
    probability: Float[ndarray, "leg frame"],
    settings: FootSettings = FOOT_DEFAULTS,
    swing_cost: Float[ndarray, "leg frame"] | None = None,
) -> list[list[slice]]:
    """The ranges of frames in which each foot stands, in order; in all others it swings.

    A semi-Markov chain solved by dynamic programming (as in speech segmentation), for all legs at once. A stance costs
    by how unlikely the contact is, how high the toe is, and how far it strays from one place: the key's where the
    stance holds a key, else its own mean. A swing costs by how far the toe must be lifted, by how little it moves, and
    once for being there, so that neither flickers.

    ``toes``: global positions, metres, both keys included. ``probability``: of the toes' contact, 0 to 1.
    ``swing_cost``: an additional cost of swinging in each frame.
    """
    legs, frames = probability.shape
    stand, high, swing = _evidence(toes, probability, settings)
    swing = swing if swing_cost is None else swing + swing_cost
    low_keys = _low_keys(toes, probability, settings)
    # stood[leg, end]: the least cost of the frames before `end` where the segment that ends there is a stance; swung
    # likewise for a swing. stood_from, swung_from: where that segment begins.
    stood, swung = np.full((legs, frames + 1), np.inf), np.full((legs, frames + 1), np.inf)
    stood[:, 0] = swung[:, 0] = 0.0
    stood_from, swung_from = np.zeros((legs, frames + 1), dtype=int), np.zeros((legs, frames + 1), dtype=int)
    for first in range(1, frames + 1, _ENDS_AT_ONCE):
        ends = np.arange(first, min(first + _ENDS_AT_ONCE, frames + 1))
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
    """:func:`divide` for pairs of feet, left and right in turn.

    Where both feet of a pair swing low together for longer than a leap, the character seems to glide: the right foot is
    divided again with a higher cost for swinging there, then the left.
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
    """Costs of each frame: of standing by its contact, of standing by its height, and of swinging."""
    sure = np.clip(probability, _CONTACT_MARGIN, 1.0 - _CONTACT_MARGIN)
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
    """Whether each foot is low at each of the two keys and may stand there."""
    return (toes[:, [0, -1], 1] < settings.key_low) & (probability[:, [0, -1]] > _CONTACT_MARGIN)


def _stance_costs(
    toes: Float[ndarray, "leg frame 3"],
    stand: Float[ndarray, "leg frame"],
    high: Float[ndarray, "leg frame"],
    ends: Int[ndarray, "row"],
    settings: FootSettings,
) -> Float[ndarray, "leg row begin"]:
    """The cost of standing from each beginning up to, not including, each of ``ends``."""
    frames, final = toes.shape[1], int(ends[-1])
    away = toes - toes[:, :1]
    sums, square_sums = _sums(away), _sums(np.sum(away**2, axis=-1))
    begins = np.arange(final)
    count = ends[:, None] - begins
    total = sums[:, ends, None] - sums[:, None, :final]
    squares = square_sums[:, ends, None] - square_sums[:, None, :final]
    # The squared distances from the mean, from running sums: sum |x - mean|^2 = sum |x|^2 - |sum x|^2 / count.
    stray = squares - np.sum(total**2, axis=-1) / np.maximum(count, 1)
    cost = stray / settings.loose**2 + _between(high, ends)
    cost[:, (begins > 0) & (count < settings.shortest)] = np.inf
    # Stances that begin with the start key keep to its place, which is the origin of `away`.
    cost[:, :, 0] = squares[:, :, 0] / settings.loose_key**2 + _between(_hovering(toes, 0, settings), ends)[:, :, 0]
    if final == frames:  # stances that end with the target keep to its place: sum |x - end|^2, expanded
        end = away[:, -1]
        from_start = _dot(end, end)
        stray = squares[:, -1] - 2.0 * np.einsum("lbc,lc->lb", total[:, -1], end) + count[-1] * from_start
        cost[:, -1] = stray / settings.loose_key**2 + _between(_hovering(toes, -1, settings), ends)[:, -1]
        cost[:, -1, 0] = np.where(from_start[:, 0] > settings.step**2, np.inf, cost[:, -1, 0])
    return cost + _between(stand, ends)


def _hovering(toes: Float[ndarray, "leg frame 3"], key: int, settings: FootSettings) -> Float[ndarray, "leg frame"]:
    """The cost of standing in each frame where the key's toe is in the air and higher than the frame's own."""
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
    """The cost of swinging from each beginning up to, not including, each of ``ends``."""
    frames, final = toes.shape[1], int(ends[-1])
    begins = np.arange(final)
    count = ends[:, None] - begins
    to = toes[:, np.minimum(ends, frames - 1)]
    since = toes[:, np.maximum(begins - 1, 0)]
    apart = np.linalg.norm(to[:, :, None] - since[:, None], axis=-1)
    # Frames that a swing lacks to cover its distance at a plausible speed.
    late = np.maximum(settings.shortest_swing + apart / settings.pace_swing - count, 0.0)
    within = (begins > 0) & (ends[:, None] < frames)
    # A swing from or to a key in which the foot stands needs as long as one between two stances.
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
    """The sum of the values from each beginning up to each end."""
    sums = _sums(values)
    return sums[:, ends, None] - sums[:, None, : int(ends[-1])]


def _dot(a: Float[ndarray, "leg 3"], b: Float[ndarray, "leg 3"]) -> Float[ndarray, "leg 1"]:
    return np.sum(a * b, axis=-1, keepdims=True)
