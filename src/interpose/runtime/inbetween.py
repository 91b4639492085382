"""One gap, or all gaps of a clip, on the user's own rig: candidates, the best first, and information on each.

Transitions arrive at the target by construction. The arrival errors of :class:`Info` measure what is left in the end:
the largest distance of a joint, and the largest angle between its global rotations, of the last frame from the target.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from interpose import retarget
from interpose.drawn_path.path_file import DrawnPath
from interpose.errors import InputError
from interpose.gallery.speeds import Suggestion
from interpose.keys import gaps
from interpose.motion import Motion, concatenate, sample
from interpose.parts import Parts
from interpose.runtime import guidance, known_frames, target_parts
from interpose.runtime.confidence import LOW, warning
from interpose.runtime.guidance import Gap, Guidance
from interpose.runtime.interpolate import aligned, check_gap, interpolate
from interpose.runtime.ranking import apart, judge
from interpose.runtime.request import Info, Request, SpeedOption, SuggestedDuration
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, model_steps, recent, user_frames
from interpose.runtime.transition import Transition, generate

STRAYED = 0.25
"""Metres of mean distance from the path; beyond them a warning is given."""
MISFIT = 0.25
"""What a path that fits badly costs: centimetres of foot slide for each factor e of its fit."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One generated transition: ``motion`` has the user's skeleton and rate and the gap's frames, without the keys.

    target: the whole pose that it leads to, where only a part of one was given; otherwise None.
    """

    motion: Motion
    info: Info
    target: Motion | None = None


@dataclass(frozen=True, eq=False)
class Filled:
    """A clip with all its gaps filled, and information on each gap.

    kept: for each frame of the clip that was kept, where it is now and where it was.
    """

    motion: Motion
    gaps: tuple[Info, ...]
    kept: dict[int, int]


def inbetween(
    start: Motion,
    target: Motion,
    frames: int | None,
    request: Request,
    *,
    variants: int = 1,
    mapping: retarget.Mapping | str | None = None,
    names: tuple[int | str, int | str] | None = None,
) -> list[Candidate]:
    """``variants`` candidates for the ``frames`` frames from ``start``'s last to ``target``'s first frame, best first.

    Without ``frames`` each takes the time that the gallery suggests, or that its own path took. The frames of ``start``
    before its last are context: the model sees the motion that leads to the key. Those of ``target`` after its first
    give the velocity of the arrival. ``mapping`` is what :func:`mapping_of` gave for the clip, where it is known.
    ``names`` go to the info, by default 0 and frames + 1. Where the request names parts of the target, each candidate
    leads to a whole pose of its own that has them. The best slides least on its feet, leaves and meets the keys with
    the least jerk, and has the path that fits best. Raises InputError where the skeletons differ, the gap is too short
    or too long, frames and a speed are both given, or no time is known.
    """
    check_gap(start, target, 1 if frames is None else frames)
    if frames is not None and request.speed is not None:
        raise InputError(f"speed '{request.speed}' and {frames} frames contradict each other; give one of them")
    _check_gallery(request, timed=frames is not None)
    mapping = mapping_of(start) if mapping is None else mapping
    if request.parts is None or request.parts.whole:
        found = _transitions([start] * variants, target, frames, request, mapping, names)
    else:
        found = _to_parts(start, target, frames, request, request.parts, mapping, names, variants)
    order = np.argsort([cost for _, cost in found], kind="stable")
    return [found[i][0] for i in order]


def suggest(
    start: Motion, target: Motion, request: Request, *, mapping: retarget.Mapping | str | None = None
) -> SuggestedDuration:
    """How many frames the gap from ``start``'s last to ``target``'s first frame should take, and the alternatives.

    Raises InputError where it is not known: the rig is no humanoid, there is no gallery, or it does not reach so far.
    """
    check_gap(start, target, 1)
    gap = gap_of(start, aligned(start, target)[1], mapping_of(start) if mapping is None else mapping)
    return _in_frames(guidance.suggest_duration(request, gap), start.rate)


def fill(
    clip: Motion, keys: Sequence[int], request: Request, *, variants: int = 1, retime: bool = False
) -> list[Filled]:
    """``clip`` with all frames between its first and last key regenerated, but for the keys; best first.

    ``keys``: ascending frame numbers. What lies before a gap, known or just made, is its context, and known frames
    after it are arrived at with their velocity, so that the motion runs through a key without a stop. With ``retime``
    each gap takes the time that is suggested for it, and the keys move apart or together. Raises InputError where no
    two neighbouring keys have a frame between them, and for a speed without ``retime``.
    """
    pairs = gaps(tuple(keys))
    if not pairs:
        raise InputError("the keys leave no frame to fill: there must be frames between two of them")
    if request.speed is not None and not retime:
        raise InputError(
            f"the keys say how long each gap takes; speed '{request.speed}' needs --retime, which moves them"
        )
    if request.parts is not None:
        raise InputError("the keys of a clip are kept whole; a target in part can be given between two poses only")
    _check_gallery(request, timed=not retime)
    if request.drawn is not None:
        request.drawn.check(pairs)
    mapping = mapping_of(clip)
    rows = [[clip[: pairs[0][0] + 1]] for _ in range(variants)]
    kept = [dict(zip(range(pairs[0][0] + 1), range(pairs[0][0] + 1), strict=True)) for _ in range(variants)]
    infos: list[tuple[Info, ...]] = [()] * variants
    costs = np.zeros(variants)
    reach = int(np.ceil((CONTEXT - 1) * clip.rate / MODEL_RATE)) + 1
    for (first, last), (following, _) in zip(pairs, [*pairs[1:], (len(clip) - 1, 0)], strict=True):
        starts = [_tail(row, reach) for row in rows]
        target = clip[last : min(_known_until(last, keys, len(clip)), last + reach)]
        frames = None if retime else last - first - 1
        made = _transitions(starts, target, frames, request, mapping, (first, last))
        for i, (candidate, cost) in enumerate(made):
            rows[i] += [candidate.motion, clip[last : following + 1]]
            at = sum(map(len, rows[i][:-1]))
            kept[i] |= {at + n: last + n for n in range(following + 1 - last)}
            infos[i] = (*infos[i], candidate.info)
            costs[i] += cost
    return [Filled(concatenate(*rows[i]), infos[i], kept[i]) for i in np.argsort(costs, kind="stable")]


def mapping_of(motion: Motion) -> retarget.Mapping | str:
    """How the rig maps to the 22 joints, or in a phrase why it does not."""
    try:
        return retarget.map_skeleton(motion)
    except InputError as error:
        return str(error)


def gap_of(start: Motion, goal: Motion, mapping: retarget.Mapping | str) -> Gap:
    """The gap from ``start``'s last to ``goal``'s first frame on the 22 joints at 30 Hz, with what is known around it.

    Raises InputError where the rig is no humanoid.
    """
    if isinstance(mapping, str):
        raise InputError(f"cannot suggest a duration: {mapping}; give a number of frames")
    ahead = np.minimum(np.arange(min(2, len(goal))) * goal.rate / MODEL_RATE, len(goal) - 1.0)
    known = retarget.to_humanoid(recent(start, CONTEXT), mapping), retarget.to_humanoid(sample(goal, ahead), mapping)
    return Gap(*(replace(motion, rate=MODEL_RATE) for motion in known))


def _to_parts(
    start: Motion,
    target: Motion,
    frames: int | None,
    request: Request,
    parts: Parts,
    mapping: retarget.Mapping | str,
    names: tuple[int | str, int | str] | None,
    variants: int,
) -> list[tuple[Candidate, float]]:
    """Candidates and their costs, each to an ending of its own that has the given ``parts`` of the target."""
    steps = None if frames is None else model_steps(frames, start.rate)
    begin, goal = aligned(start[-1], target[0])
    _check_finite(begin, goal)
    out = []
    for i, end in enumerate(target_parts.complete(start, target, parts, request, mapping, steps, variants)):
        assert isinstance(mapping, retarget.Mapping)
        each = replace(request, seed=request.seed + i)
        ((candidate, cost),) = _transitions(
            [start],
            end.pose,
            frames,
            each,
            mapping,
            names,
            lambda pose: target_parts.missed(pose, goal, parts, mapping),
        )
        notes = [note for note in (end.note, candidate.info.fallback) if note is not None]
        info = replace(candidate.info, seed=request.seed, fallback="; ".join(notes) or None, target_joints=str(parts))
        out.append((Candidate(candidate.motion, info, end.pose), cost))
    return out


def _transitions(
    starts: list[Motion],
    target: Motion,
    frames: int | None,
    request: Request,
    mapping: retarget.Mapping | str,
    names: tuple[int | str, int | str] | None,
    arrival: Callable[[Motion], tuple[float, float]] | None = None,
) -> list[tuple[Candidate, float]]:
    """A candidate and its cost for each of ``starts``, which end in the same key; ``arrival``: its errors in a last
    pose, by default those of all joints."""
    began = time.perf_counter()
    rate = starts[0].rate
    first, last = aligned(starts[0][-1], target[0])
    warnings: list[str] = []
    if not isinstance(mapping, str):
        starts, target, warnings = _moving(starts, target, mapping)
    goal = aligned(starts[0], target)[1]
    _check_finite(first, last)
    drawn = _drawn(request, names)
    gap = None if isinstance(mapping, str) else gap_of(starts[0], goal, mapping)
    suggestion = suggested = None
    if frames is None and drawn is None:
        suggestion = guidance.suggest_duration(request, gap or gap_of(starts[0], goal, mapping))
        suggested = _in_frames(suggestion, rate)
    interpolated = request.method == "interp"  # on the joints of the rig itself
    fallback = None if interpolated else _why_not(frames, rate, request, mapping)
    guided: list[Guidance | None] = [None] * len(starts)
    if gap is None or isinstance(mapping, str) or interpolated or fallback is not None:
        if frames is None and suggested is not None and fallback is None:
            by_speed = {each.speed: each.frames for each in suggested.alternatives}
            frames = by_speed.get(request.speed or "", suggested.frames)
        if frames is None:
            raise InputError(f"cannot suggest a duration: {fallback}; give a number of frames")
        sizes = [frames] * len(starts)
        made = [Transition(concatenate(first, interpolate(first, last, frames), last), None)] * len(starts)
    else:
        steps = None if frames is None else model_steps(frames, rate)
        scaled = None if drawn is None else drawn.scaled(mapping.scale)
        found = guidance.guide(request, gap, steps, len(starts), drawn=scaled, suggested=suggestion)
        sizes = [user_frames(one.steps, rate) if frames is None else frames for one in found]
        made = generate(starts, goal, sizes, found, request, mapping)
        guided = [*found]
    seconds = time.perf_counter() - began
    slides, costs = judge(starts, [one.motion[1:-1] for one in made], target, mapping)
    out = []
    for one, size, guide, slide, cost in zip(made, sizes, guided, slides, costs, strict=True):
        position, angle = apart(one.motion[-1], last) if arrival is None else arrival(one.motion[-1])
        info = Info(
            start=0 if names is None else names[0],
            target=size + 1 if names is None else names[1],
            frames=size,
            method="interp" if guide is None else request.method,
            model=None if guide is None or request.model is None else request.model.name,
            style=None if guide is None else guide.style,
            path=request.path,
            seed=request.seed,
            arrival_position_error_m=round(position, 9),
            arrival_rotation_error_deg=round(angle, 6),
            foot_slide_cm_per_frame=_rounded(slide, 4),
            seconds=round(seconds, 6),
            fallback=fallback if guide is None else guide.note,
            confidence=_rounded(one.confidence, 3),
            warnings=(*warnings, *_strayed(one.deviation), *_unsure(one.confidence)),
            speed=request.speed,
            trajectory=None if guide is None else guide.trajectory,
            path_deviation_m=_rounded(one.deviation, 5),
            fit=None if guide is None else _rounded(guide.fit, 3),
            suggested=suggested,
            style_strength=request.style_strength,
        )
        misfit = 0.0 if guide is None or guide.fit is None else -MISFIT * float(np.log(guide.fit))
        out.append((Candidate(one.motion[1:-1], info), cost + misfit))
    return out


def _check_gallery(request: Request, timed: bool) -> None:
    """Raise InputError where a gallery was given that nothing would use."""
    unused = request.drawn is None and (request.path in ("straight", "none") or not request.abilities.paths)
    if request.gallery is not None and timed and unused:
        how = f"path '{request.path}'" if request.abilities.paths else f"method '{request.method}'"
        raise InputError(
            f"{how} with a given duration uses no gallery; leave out the gallery, or choose path 'gallery'"
        )


def _check_finite(*poses: Motion) -> None:
    """Raise InputError where a key holds numbers that are none."""
    for pose in poses:
        if not (np.isfinite(pose.root_positions).all() and np.isfinite(pose.local_rotations).all()):
            raise InputError("a key pose holds numbers that are not finite (NaN or infinite); give poses without them")


def _moving(starts: list[Motion], target: Motion, mapping: retarget.Mapping) -> tuple[list[Motion], Motion, list[str]]:
    """Starts, which have one length, and the target without known frames that are no motion, and what is said of it."""
    before = min(len(known_frames.motion_before(start, mapping)) for start in starts)
    after = len(known_frames.motion_after(target, mapping))
    dropped = ((len(starts[0]) - before, True), (len(target) - after, False))
    warnings = [known_frames.warning(count, before_key) for count, before_key in dropped if count]
    return [start[-before:] for start in starts], target[:after], warnings


def _strayed(deviation: float | None) -> list[str]:
    """A warning where the root does not keep to its path."""
    if deviation is None or deviation <= STRAYED:
        return []
    return [f"the root strays {deviation:.2f} m from its path on average; give more time, or a path nearer to the keys"]


def _unsure(confidence: float | None) -> list[str]:
    return [] if confidence is None or confidence >= LOW else [warning(confidence)]


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def _drawn(request: Request, names: tuple[int | str, int | str] | None) -> DrawnPath | None:
    """The path that was drawn for this gap."""
    if request.drawn is None:
        return None
    if names is not None and isinstance(names[0], int) and isinstance(names[1], int):
        return request.drawn.of(names[0], names[1])
    return request.drawn.whole


def _in_frames(suggestion: Suggestion, rate: float) -> SuggestedDuration:
    """The suggestion in frames of the user's rate."""
    each = tuple(SpeedOption(g.speed, user_frames(g.steps, rate), round(g.fit, 3)) for g in suggestion.groups)
    return SuggestedDuration(user_frames(suggestion.steps, rate), each)


def _why_not(frames: int | None, rate: float, request: Request, mapping: retarget.Mapping | str) -> str | None:
    """Why the method cannot serve this gap, in one phrase, or None where it can."""
    if isinstance(mapping, str):
        return mapping
    if frames is None:
        return None
    steps, longest = model_steps(frames, rate), request.abilities.longest_steps
    if longest is not None and steps > longest:
        return f"the gap is longer than {(longest - 1) / MODEL_RATE:.3g} s, the most for method '{request.method}'"
    if steps == 1:
        return "the gap is shorter than two of the model's frames (1/15 s)"
    return None


def _known_until(key: int, keys: Sequence[int], frames: int) -> int:
    """The first frame after ``key`` that is not known; after the last key all frames are."""
    kept = set(keys)
    while key in kept:
        key += 1
    return frames if key > keys[-1] else key


def _tail(pieces: Sequence[Motion], reach: int) -> Motion:
    """The last ``reach`` frames of some motions, one after the other."""
    used, count = 0, 0
    while used < len(pieces) and count < reach:
        used += 1
        count += len(pieces[-used])
    return concatenate(*pieces[len(pieces) - used :])[-reach:]
