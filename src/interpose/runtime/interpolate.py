"""Method `interp`: the root on a straight line, the rotations by SLERP, on the user's own skeleton.

The baseline of Harvey et al. 2020 (`Robust Motion In-betweening`, section 5) and what serves where a model cannot:
frame i of n lies at t = i / (n + 1) between the two keys. It works on any skeleton and keeps the rate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from interpose.errors import InputError
from interpose.motion import Motion, concatenate, sample

LONGEST = 100_000
"""Frames in a gap, at most, for any method: a guard against a slip of the keyboard, not a limit of the method."""


def interpolate(start: Motion, target: Motion, frames: int) -> Motion:
    """The ``frames`` frames between the last frame of ``start`` and the first of ``target``, at ``start``'s rate.

    Raises InputError where ``frames`` is not between 1 and :data:`LONGEST`, or where the two skeletons differ.
    """
    check_gap(start, target, frames)
    keys = concatenate(*aligned(start[-1], target[0]))
    return sample(keys, np.arange(1, frames + 1) / (frames + 1))


def check_gap(start: Motion, target: Motion, frames: int) -> None:
    """Raise InputError where no method could fill the gap."""
    if not 1 <= frames <= LONGEST:
        raise InputError(f"a gap holds 1 to {LONGEST} frames, got {frames}")
    a, b = start.skeleton, target.skeleton
    if a.names != b.names:
        raise InputError(
            f"start and target must share one skeleton: the start's joints are {_listed(a.names)}, the target's are "
            f"{_listed(b.names)}"
        )
    if a.parents != b.parents:
        raise InputError("start and target must share one skeleton: their joints have the same names, other parents")
    apart = np.abs(a.offsets[1:] - b.offsets[1:]).max(initial=0.0)
    if apart > 1e-3 and (start.translations is None or target.translations is None):
        joint = int(np.abs(a.offsets[1:] - b.offsets[1:]).max(axis=1).argmax()) + 1
        raise InputError(
            f"start and target must share one skeleton: the offset of {a.names[joint]} differs by {apart * 100:.2f} cm"
        )


def aligned(start: Motion, target: Motion) -> tuple[Motion, Motion]:
    """``target`` as a motion of ``start``'s skeleton, rate and layout, both with translations where one has them."""
    if start.translations is not None or target.translations is not None:
        start, target = _with_translations(start), _with_translations(target)
    return start, replace(target, skeleton=start.skeleton, rate=start.rate, layout=start.layout)


def _with_translations(motion: Motion) -> Motion:
    if motion.translations is not None:
        return motion
    moved = np.repeat(motion.skeleton.offsets[None], len(motion), axis=0)
    moved[:, 0] = motion.root_positions
    return replace(motion, translations=moved)


def _listed(names: tuple[str, ...]) -> str:
    shown = ", ".join(names[:3])
    return f"{shown} … ({len(names)} joints)" if len(names) > 3 else f"{shown} ({len(names)} joints)"
