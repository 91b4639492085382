"""Known frames beside a key that are no motion: a T-pose in the first row, a cut, a jump of metres.

They must not be taken for the speed at the key. What a person can do bounds what counts as motion: over the 440,000
frames of LaFAN1, 100STYLE, Bandai-Namco, O3DE and CMU that we hold, hips move by 5.8 m/s at most, joints by 2.8 m/s
about the hips on average, and hips change their velocity by less than 4 m/s from frame to frame.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool
from numpy import ndarray

from interpose import retarget
from interpose.motion import Motion
from interpose.retarget import Mapping
from interpose.runtime.resampling import CONTEXT, MODEL_RATE

FASTEST_HIPS = 12.5
"""m/s; a sprinter's record."""
FASTEST_JOINTS = 4.5
"""m/s about the hips, on average over the joints."""
HARDEST_HIPS = 120.0
"""m/s^2, 12 g: beyond what a hard landing does to the hips."""
LEAST_JUMP = 4.0
"""m/s by which the hips' velocity changes at a cut at least; smaller changes at a high rate are noise."""
T_POSE = 0.06
"""Radians from the T-pose, on average over the joints below the hips."""


def motion_before(known: Motion, mapping: Mapping) -> Motion:
    """The end of ``known``, whose last frame is the start key, that is motion up to it: the key alone at least."""
    near = known[-_reach(known.rate) :]
    bad = np.flatnonzero(_jumps(retarget.to_humanoid(near, mapping)))
    return near[bad[-1] + 1 :] if len(bad) else known


def motion_after(known: Motion, mapping: Mapping) -> Motion:
    """The beginning of ``known``, whose first frame is the target key, that is motion from it on: the key alone at
    least."""
    return motion_before(known[::-1], mapping)[::-1]


def warning(dropped: int, before: bool) -> str:
    """What is said of known frames that were not used."""
    where = "before the start key" if before else "after the target key"
    frames, verb = ("the frame", "is") if dropped == 1 else (f"the {dropped} frames", "are")
    return (
        f"{frames} {where} {verb} not used: between there and the key the body jumps as no person moves "
        "(a T-pose in the first row, or a cut)"
    )


def _reach(rate: float) -> int:
    """Frames at that rate of which a model sees something."""
    return int(np.ceil((CONTEXT - 1) * rate / MODEL_RATE)) + 1


def _jumps(motion: Motion) -> Bool[ndarray, "step"]:
    """Which steps from frame to frame are no motion; the key is the last frame."""
    if len(motion) < 2:
        return np.zeros(0, dtype=bool)
    places = motion.global_positions()
    hips = np.diff(places[:, 0], axis=0) * motion.rate
    about = np.linalg.norm(np.diff(places - places[:, :1], axis=0), axis=-1).mean(axis=-1) * motion.rate
    turned = 2.0 * np.arccos(np.clip(np.abs(motion.local_rotations[:-1, 1:, 3]), 0.0, 1.0))
    left_t_pose = (turned.mean(axis=-1) < T_POSE) & (about > 1.0)
    jump = (np.linalg.norm(hips, axis=-1) > FASTEST_HIPS) | (about > FASTEST_JOINTS) | left_t_pose
    # A cut: a step that is faster than its neighbours, by a velocity that no person can gain from frame to frame.
    if len(hips) > 1:
        speed = np.linalg.norm(hips, axis=-1)
        change = np.linalg.norm(np.diff(hips, axis=0), axis=-1) > max(LEAST_JUMP, HARDEST_HIPS / motion.rate)
        slower = np.diff(speed) < 0.0
        jump |= np.append(change & slower, True) & np.insert(change & ~slower, 0, True)
    return jump
