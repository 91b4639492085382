"""One gap, or all gaps of a clip, on the user's own rig: candidates, the best first, and what is told of each.

How a model's transition is made is in `transition`. The roll-out arrives at the target by construction (docs/method.md,
D1), and all that follows leaves both ends alone. The arrival errors of :class:`Info` measure what is left in the end:
the transition is made with its two ends, which take the same way as the frames between them, and its last frame is
held against the target key: the largest distance of a joint, and the largest angle between global rotations of a joint.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import retarget, rotation
from interpose.data import contacts
from interpose.errors import InputError
from interpose.keys import gaps
from interpose.motion import Motion, concatenate
from interpose.runtime.interpolate import aligned, check_gap, interpolate
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, model_steps
from interpose.runtime.session import Session
from interpose.runtime.transition import generate
from interpose.skeleton import HUMANOID

METHODS = ("dcmoe", "interp")
LONGEST_MODEL_GAP = 600

TOES = [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")]


@dataclass(frozen=True)
class Request:
    """What is asked of every gap. Raises InputError where it cannot be had.

    session: the model; needed by every method but interp. style: one of the model's, or None to leave it free.
    """

    method: str = "dcmoe"
    session: Session | None = None
    style: str | None = None
    path: str = "auto"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"unknown method '{self.method}'; there are {', '.join(METHODS)}")
        if self.path != "auto":
            raise InputError(f"path '{self.path}' cannot be followed; only 'auto' can, which leaves it to the model")
        if self.seed < 0:
            raise InputError(f"the seed must be 0 or more, got {self.seed}")
        if self.method == "interp":
            if self.style is not None:
                raise InputError(f"interpolation has no styles; leave out style '{self.style}', or choose dcmoe")
        elif self.session is None:
            raise InputError(f"method '{self.method}' needs a model")
        elif self.style is not None and self.style not in self.session.styles:
            known = ", ".join(self.session.styles) or "none"
            raise InputError(f"the model '{self.session.name}' has no style '{self.style}'; it has {known}")


@dataclass(frozen=True)
class Info:
    """What is told of one transition; the fields are those of `--json`.

    start, target: the keys, as frames of the clip or as they were named. foot_slide_cm_per_frame: of the delivered
    motion with its keys, by :func:`foot_slide`; None where the rig's feet are not known. seconds: wall time of the gap,
    all variants together. fallback: None, or why interpolation served in place of the method asked for.
    """

    start: int | str
    target: int | str
    frames: int
    method: str
    style: str | None
    path: str
    seed: int
    arrival_position_error_m: float
    arrival_rotation_error_deg: float
    foot_slide_cm_per_frame: float | None
    seconds: float
    fallback: str | None


@dataclass(frozen=True, eq=False)
class Candidate:
    """One generated transition: ``motion`` has the user's skeleton and rate and the gap's frames, without the keys."""

    motion: Motion
    info: Info


@dataclass(frozen=True, eq=False)
class Filled:
    """A clip with all its gaps filled, and what is told of each gap."""

    motion: Motion
    gaps: tuple[Info, ...]


def inbetween(
    start: Motion,
    target: Motion,
    frames: int,
    request: Request,
    *,
    variants: int = 1,
    mapping: retarget.Mapping | str | None = None,
    names: tuple[int | str, int | str] | None = None,
) -> list[Candidate]:
    """``variants`` candidates for the ``frames`` frames from ``start``'s last to ``target``'s first frame, best first.

    The frames of ``start`` before its last are context: the model sees where the motion comes from. Those of ``target``
    after its first say with what velocity to arrive. ``mapping`` is what :func:`mapping_of` gave for the clip, where it
    is known. ``names`` go to the info, by default 0 and frames + 1.
    The best slides least on its feet and leaves and meets the keys with the least jerk.
    Raises InputError where the skeletons differ or the gap is too short or too long.
    """
    check_gap(start, target, frames)
    mapping = mapping_of(start) if mapping is None else mapping
    found = _transitions([start] * variants, target, frames, request, mapping, names or (0, frames + 1))
    order = np.argsort([cost for _, cost in found], kind="stable")
    return [found[i][0] for i in order]


def fill(clip: Motion, keys: Sequence[int], request: Request, *, variants: int = 1) -> list[Filled]:
    """``clip`` with all frames between its first and last key made anew, but for the keys; best first.

    ``keys``: ascending frame numbers. What lies before a gap, known or just made, is its context, and known frames
    after it are arrived at with their velocity, so that the motion runs through a key without a stop. Raises InputError
    where no two neighbouring keys have a frame between them.
    """
    pairs = gaps(tuple(keys))
    if not pairs:
        raise InputError("the keys leave no frame to fill: there must be frames between two of them")
    mapping = mapping_of(clip)
    rows = [_copy(clip) for _ in range(variants)]
    infos: list[tuple[Info, ...]] = [()] * variants
    costs = np.zeros(variants)
    reach = int(np.ceil((CONTEXT - 1) * clip.rate / MODEL_RATE)) + 1
    for first, last in pairs:
        starts = [row[max(0, first + 1 - reach) : first + 1] for row in rows]
        target = clip[last : min(_known_until(last, keys, len(clip)), last + reach)]
        made = _transitions(starts, target, last - first - 1, request, mapping, (first, last))
        for i, (candidate, cost) in enumerate(made):
            rows[i].root_positions[first + 1 : last] = candidate.motion.root_positions
            rows[i].local_rotations[first + 1 : last] = candidate.motion.local_rotations
            moved, made_moved = rows[i].translations, candidate.motion.translations
            if moved is not None and made_moved is not None:
                moved[first + 1 : last] = made_moved
            infos[i] = (*infos[i], candidate.info)
            costs[i] += cost
    return [Filled(rows[i], infos[i]) for i in np.argsort(costs, kind="stable")]


def mapping_of(motion: Motion) -> retarget.Mapping | str:
    """How the rig maps to the 22 joints, or in a phrase why it does not."""
    try:
        return retarget.plan(motion)
    except InputError as error:
        return str(error)


def foot_slide(toes: Float[ndarray, "frame toe 3"], rate: float) -> float:
    """Centimetres a 30 Hz frame that the toes travel while they are low; zero where no toe is ever low.

    ``toes``: as `interpose.data.contacts.foot_slide` takes them.
    """
    travel, samples = contacts.foot_slide(toes)
    return float(travel / max(1, samples)) * rate / MODEL_RATE


def _transitions(
    starts: list[Motion],
    target: Motion,
    frames: int,
    request: Request,
    mapping: retarget.Mapping | str,
    names: tuple[int | str, int | str],
) -> list[tuple[Candidate, float]]:
    """A candidate and its cost for each of ``starts``, which end in the same key."""
    began = time.perf_counter()
    fallback = None if request.method == "interp" else _why_not(starts[0], frames, request, mapping)
    first, last = aligned(starts[0][-1], target[0])
    styles: list[str | None] = [None] * len(starts)
    if request.method == "interp" or request.session is None or isinstance(mapping, str) or fallback is not None:
        made = [concatenate(first, interpolate(first, last, frames), last)] * len(starts)
    else:
        goal = aligned(starts[0], target)[1]
        styles = _styles(request, len(starts))
        made = generate(starts, goal, frames, request.session, mapping, styles, request.seed)
    seconds = time.perf_counter() - began
    position, angle = _apart(made[0][-1], last)
    inner = [motion[1:-1] for motion in made]
    slides, costs = _judge(starts, inner, target, mapping)
    shared = Info(
        start=names[0],
        target=names[1],
        frames=frames,
        method="interp" if fallback is not None else request.method,
        style=None,
        path=request.path,
        seed=request.seed,
        arrival_position_error_m=round(position, 9),
        arrival_rotation_error_deg=round(angle, 6),
        foot_slide_cm_per_frame=None,
        seconds=round(seconds, 6),
        fallback=fallback,
    )
    found = []
    for motion, style, slide, cost in zip(inner, styles, slides, costs, strict=True):
        info = replace(shared, style=style, foot_slide_cm_per_frame=None if slide is None else round(slide, 4))
        found.append((Candidate(motion, info), cost))
    return found


def _styles(request: Request, count: int) -> list[str | None]:
    """The style of each variant: what was asked for; where it was left free, free first and then each style in turn,
    in an order that the seed decides."""
    assert request.session is not None
    known = request.session.styles
    if request.style is not None or not known:
        return [request.style] * count
    order = np.random.default_rng(request.seed).permutation(len(known))
    return [None, *(known[order[i % len(known)]] for i in range(count - 1))][:count]


def _why_not(start: Motion, frames: int, request: Request, mapping: retarget.Mapping | str) -> str | None:
    """Why the model cannot serve this gap, in one phrase, or None where it can."""
    assert request.session is not None
    if isinstance(mapping, str):
        return mapping
    if request.session.method != request.method:
        return f"the model '{request.session.name}' is for method {request.session.method}"
    if frames > LONGEST_MODEL_GAP:
        return f"the gap is longer than {LONGEST_MODEL_GAP} frames"
    if model_steps(frames, start.rate) == 1:
        return "the gap is shorter than two of the model's frames (1/15 s)"
    return None


def _known_until(key: int, keys: Sequence[int], frames: int) -> int:
    """The first frame after ``key`` that is not known; after the last key all frames are."""
    kept = set(keys)
    while key in kept:
        key += 1
    return frames if key > keys[-1] else key


def _copy(clip: Motion) -> Motion:
    moved = None if clip.translations is None else clip.translations.copy()
    return replace(
        clip,
        root_positions=clip.root_positions.copy(),
        local_rotations=clip.local_rotations.copy(),
        translations=moved,
    )


def _apart(one: Motion, other: Motion) -> tuple[float, float]:
    """The largest distance of a joint between two poses, metres, and the largest angle between rotations, degrees."""
    distance = np.linalg.norm(one.global_positions() - other.global_positions(), axis=-1)
    turn = rotation.multiply(rotation.inverse(one.global_rotations()), other.global_rotations())
    return float(distance.max()), float(np.degrees(rotation.angle(turn).max()))


def _judge(
    starts: list[Motion], inner: list[Motion], target: Motion, mapping: retarget.Mapping | str
) -> tuple[list[float | None], list[float]]:
    """Foot slide and cost of each transition; without a mapping nothing is known of either.

    The cost is the foot slide and how much the joints' mean step changes at the two ends, in centimetres a 30 Hz frame.
    """
    if isinstance(mapping, str):
        return [None] * len(inner), [0.0] * len(inner)
    rate = starts[0].rate
    parts = []
    for start, made in zip(starts, inner, strict=True):
        keys = aligned(start[-2:], target[0])
        parts += [keys[0], aligned(keys[0], made)[1], keys[1]]
    positions = retarget.to_humanoid(concatenate(*parts), mapping).global_positions()
    positions = positions.reshape(len(inner), -1, len(HUMANOID), 3)
    key = min(len(starts[0]), 2) - 1
    slides = [foot_slide(p[key:, TOES], rate) for p in positions]
    bends = np.linalg.norm(np.diff(positions, n=2, axis=1), axis=-1).mean(axis=-1) * 100.0 * rate / MODEL_RATE
    return list(slides), [slide + float(bend[0] + bend[-1]) / 2.0 for slide, bend in zip(slides, bends, strict=True)]
