"""Metrics of in-betweening, for batches of windows.

Each is a function of arrays (window, frame, joint, channel) and gives :class:`Scores`: a total and a weight for each
window, so that the value is their ratio of sums and a bootstrap over windows needs nothing else.

L2P, L2Q and NPSS are those of Harvey et al. 2020 (`Robust Motion In-betweening`, section 5.3, and the evaluation code
of LaFAN1), NPSS after Gopalakrishnan et al. 2019 (`A Neural Temporal Model for Human Motion Prediction`). ADE and SLDE
are those of the S-CVAE paper: metres, mean over joints. APD is its sum over frames and joints divided by their number.
Foot slide is that of `interpose.data.contacts`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.data import contacts

Positions = Float[ndarray, "window frame joint 3"]
"""Global positions; of another unit than metres, results are in it, too."""
Rotations = Float[ndarray, "window frame joint 4"]
"""Global quaternions."""
Toes = Float[ndarray, "window frame toe 3"]
"""Global positions of the toes in metres, the keys included at both ends."""


@dataclass(frozen=True, eq=False)
class Scores:
    """One metric over windows; the value is ``sum(total) / sum(weight)``, NaN where nothing has weight."""

    total: Float[ndarray, "window"]
    weight: Float[ndarray, "window"]

    @property
    def value(self) -> float:
        weight = self.weight.sum()
        return float(self.total.sum() / weight) if weight > 0 else float("nan")

    def bootstrap(self, seed: int = 0, draws: int = 1000) -> Float[ndarray, "draw"]:
        """The value of each of many draws of the windows with replacement.

        The same seed draws the same windows for every method, so that differences and ratios are paired. Neighbouring
        windows overlap and come from few files: what the draws show is a lower bound of the true doubt.
        """
        chosen = _choices(len(self.total), seed, draws)
        weight = chosen @ self.weight
        return np.divide(chosen @ self.total, weight, out=np.full(draws, np.nan), where=weight > 0.0)


@lru_cache(maxsize=4)
def _choices(windows: int, seed: int, draws: int) -> Float[ndarray, "draw window"]:
    """How often each draw takes each window."""
    chosen = np.random.default_rng(seed).multinomial(windows, np.full(windows, 1.0 / windows), size=draws)
    return chosen.astype(float)


def interval(draws: Float[ndarray, "draw"], level: float = 0.95) -> tuple[float, float]:
    """The percentile interval of bootstrap draws, those that are not finite left out; NaN where none is."""
    finite = draws[np.isfinite(draws)]
    if len(finite) == 0:
        return float("nan"), float("nan")
    low, high = np.quantile(finite, [(1.0 - level) / 2.0, (1.0 + level) / 2.0])
    return float(low), float(high)


def mean(values: Float[ndarray, "window *rest"]) -> Scores:
    """The mean over everything, every window of weight one."""
    flat = values.reshape(len(values), -1)
    return Scores(flat.mean(axis=1), np.ones(len(values)))


def l2p(pred: Positions, true: Positions, scale: Float[ndarray, "joint 3"] | float) -> Scores:
    """Norm over all joints' global positions, each coordinate divided by its standard deviation; mean over frames.

    ``scale`` is in the unit of the positions; the result has none.
    """
    return mean(np.linalg.norm(((pred - true) / scale).reshape(*pred.shape[:2], -1), axis=-1))


def l2q(pred: Rotations, true: Rotations) -> Scores:
    """Norm over all joints' global quaternions as they stand, signs included (the official form); mean over frames."""
    return mean(np.linalg.norm((pred - true).reshape(*pred.shape[:2], -1), axis=-1))


def align_signs(pred: Rotations, true: Rotations) -> Rotations:
    """``pred`` with each quaternion's sign chosen nearest to ``true``'s."""
    return np.where(np.sum(pred * true, axis=-1, keepdims=True) < 0.0, -pred, pred)


def l2q_aligned(pred: Rotations, true: Rotations) -> Scores:
    """:func:`l2q` of rotations instead of signed quaternions: each joint's sign in each frame is fixed first."""
    return l2q(align_signs(pred, true), true)


def npss(pred: Float[ndarray, "window frame *channel"], true: Float[ndarray, "window frame *channel"]) -> Scores:
    """Distance of the power spectra over time, each channel weighted by the true power. Lower is better.

    As in LaFAN1's evaluation the power is the square of the real part of the Fourier transform, and the distance of
    two normalised spectra is the sum over frequencies of the difference of their cumulative sums.
    """

    def power(x: Float[ndarray, "window frame *channel"]) -> Float[ndarray, "window frequency flat"]:
        return np.square(np.fft.fft(x.reshape(*x.shape[:2], -1), axis=1).real)

    def cumulative(p: Float[ndarray, "window frequency flat"]) -> Float[ndarray, "window frequency flat"]:
        total = p.sum(axis=1, keepdims=True)
        return np.cumsum(np.divide(p, total, out=np.zeros_like(p), where=total > 0.0), axis=1)

    true_power = power(true)
    distance = np.abs(cumulative(power(pred)) - cumulative(true_power)).sum(axis=1)
    weight = true_power.sum(axis=1)
    return Scores(np.sum(distance * weight, axis=1), weight.sum(axis=1))


def ade(pred: Positions, true: Positions) -> Scores:
    """Average displacement error: mean distance over joints and frames, in the unit of the positions (metres)."""
    return mean(np.linalg.norm(pred - true, axis=-1))


def slde(pred: Positions, true: Positions) -> Scores:
    """:func:`ade` of the last generated frame only, the one before the target."""
    return ade(pred[:, -1:], true[:, -1:])


def apd(candidates: Float[ndarray, "candidate window frame joint 3"]) -> Scores:
    """Average pairwise distance of candidates: mean over pairs, frames and joints, in the unit of the positions.

    The S-CVAE paper prints the sum over frames and joints instead: multiply by ``frame * joint``.
    """
    first, second = np.triu_indices(len(candidates), k=1)
    if len(first) == 0:
        raise ValueError("a distance between candidates needs at least two of them")
    pairs = [np.linalg.norm(candidates[a] - candidates[b], axis=-1) for a, b in zip(first, second, strict=True)]
    return mean(np.mean(pairs, axis=0))


def foot_slide(toes: Toes) -> Scores:
    """Mean weighted displacement of the toes in centimetres a frame, over the samples in contact
    (`interpose.data.contacts.foot_slide`)."""
    travel, samples = contacts.foot_slide(toes)
    return Scores(travel, samples.astype(float))


def foot_slide_speed(toes: Toes, rate: float) -> Scores:
    """Mean weighted horizontal speed of the toes over all samples, in contact or not: metres a second."""
    speed = rate * np.linalg.norm(np.diff(toes[..., ::2], axis=1), axis=-1)
    return mean(speed * contacts.slide_weight(toes[:, 1:, :, 1]))


def foot_slide_share(toes: Toes, rate: float) -> Scores:
    """The share of samples in contact (toe below H) that move horizontally faster than LaFAN1's own labels allow."""
    contact = toes[:, 1:, :, 1] < contacts.SLIDE_HEIGHT
    fast = rate * np.linalg.norm(np.diff(toes[..., ::2], axis=1), axis=-1) > contacts.BENCHMARK_SPEED
    return Scores((fast & contact).sum(axis=(1, 2)).astype(float), contact.sum(axis=(1, 2)).astype(float))


def arrival_position(whole: Positions) -> Scores:
    """How far from the target the transition leads: mean distance over joints, in the unit of the positions.

    ``whole``: the transition with both its keys. Where it leads is its last frame carried on by one more step like the
    last. A true motion does not quite give zero, for it accelerates.
    """
    return mean(np.linalg.norm(2.0 * whole[:, -2] - whole[:, -3] - whole[:, -1], axis=-1))


def acceleration(
    positions: Float[ndarray, "*batch frame joint 3"], rate: float
) -> Float[ndarray, "*batch frame-2 joint"]:
    """Norm of the second difference, metres a second squared, of every frame but the first and the last."""
    return np.linalg.norm(np.diff(positions, n=2, axis=-3), axis=-1) * rate**2


def key_acceleration(positions: Positions, rate: float, start: int, target: int) -> Scores:
    """Mean acceleration over joints in the start key, the target key and their generated neighbours, m/s^2.

    A pop at a key shows here. ``positions`` hold the transition with true frames around it, at least one on each side.
    """
    frames = np.unique([start, start + 1, target - 1, target])
    return mean(acceleration(positions, rate)[:, frames - 1])


def jerk_ratio(pred: Positions, true: Positions) -> Scores:
    """Mean norm of the third difference over that of the truth: below one is smoother, above one shakier.

    Needs four frames; the transition is given with both its keys.
    """

    def jerk(x: Positions) -> Float[ndarray, "window"]:
        return np.linalg.norm(np.diff(x, n=3, axis=1), axis=-1).mean(axis=(1, 2))

    return Scores(jerk(pred), jerk(true))


def seam(whole: Positions) -> tuple[Scores, Scores]:
    """Speed and acceleration of the joints around the middle of the gap, over those of the whole gap.

    ``whole``: the gap with both its keys, T intervals. The middle is the frame T // 2 and the one after it, between
    which stitched chains meet. Near one where no seam shows; the truth says how near.
    """
    middle = (whole.shape[1] - 1) // 2
    speed = np.linalg.norm(np.diff(whole, axis=1), axis=-1).mean(axis=-1)
    bend = np.linalg.norm(np.diff(whole, n=2, axis=1), axis=-1).mean(axis=-1)
    return (
        Scores(speed[:, middle - 1 : middle + 2].mean(axis=1), speed.mean(axis=1)),
        Scores(bend[:, middle - 1 : middle + 1].mean(axis=1), bend.mean(axis=1)),
    )


def mean_of_samples(each: Sequence[Mapping[str, Scores]]) -> dict[str, Scores]:
    """The mean of every metric over several samples of the same windows, window by window."""
    return {
        name: Scores(np.mean([s[name].total for s in each], axis=0), np.mean([s[name].weight for s in each], axis=0))
        for name in each[0]
    }


def best_of_samples(each: Sequence[Mapping[str, Scores]], names: Sequence[str]) -> dict[str, Scores]:
    """The smallest value of every named metric among several samples, window by window."""
    out = {}
    for name in names:
        totals, weights = (np.stack([getattr(one[name], part) for one in each]) for part in ("total", "weight"))
        ratio = np.divide(totals, weights, out=np.full_like(totals, np.inf), where=weights > 0.0)
        best = np.argmin(ratio, axis=0)[None]
        out[name] = Scores(np.take_along_axis(totals, best, 0)[0], np.take_along_axis(weights, best, 0)[0])
    return out
