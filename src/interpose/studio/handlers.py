"""Answers the browser's requests: functions of the request, the rig and the models, without state."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy import ndarray

from interpose import parts
from interpose.drawn_path import path_file
from interpose.drawn_path.path_file import SAME_POINT, PathFile
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget.mirrored import mirrored
from interpose.runtime import inbetween
from interpose.runtime.interpolate import aligned
from interpose.runtime.request import Info, Request
from interpose.runtime.resampling import CONTEXT, MODEL_RATE
from interpose.studio import gallery_paths, pose_library, pose_rows
from interpose.studio.messages import shapes
from interpose.studio.methods import Offer
from interpose.studio.project_format import GapSettings, PathChoice, PointPath
from interpose.studio.protocol import (
    CandidateInfo,
    Candidates,
    ClientMessage,
    DurationOption,
    FindPaths,
    GalleryPath,
    GalleryPaths,
    Generate,
    Library,
    LibraryPoses,
    Mirror,
    MirroredPose,
    ServerMessage,
    SuggestDuration,
    SuggestedDurations,
)
from interpose.studio.rigs import Clip, RigStore

Arrays = Mapping[str, ndarray]
Answer = tuple[ServerMessage, dict[str, ndarray]]


def answer(message: ClientMessage, arrays: Arrays, store: RigStore, offer: Offer) -> Answer:
    """The answer to any message but `cancel`.

    Raises InputError if the request cannot be served, and `rigs.UnknownRig` if the store does not have the rig.
    """
    match message:
        case Generate():
            return generate(message, arrays, store.get(message.rig), offer)
        case SuggestDuration():
            return suggest(message, arrays, store.get(message.rig), offer)
        case FindPaths():
            return find_paths(message, arrays, store.get(message.rig), offer)
        case Mirror():
            return mirror(message, arrays, store.get(message.rig))
        case Library():
            return library(message, arrays, store.get(message.rig))
        case _:
            raise InputError(f"'{message.type}' has no answer")


def generate(message: Generate, arrays: Arrays, clip: Clip, offer: Offer) -> Answer:
    """Candidates for a gap, best first. Methods without variants, such as interpolation, give one."""
    began = time.perf_counter()
    start, target = _ends(arrays, clip)
    request = _request(message.settings, offer)
    variants = 1 if message.live or not request.abilities.variants else message.settings.variants
    candidates = inbetween.inbetween(start, target, message.frames, request, variants=variants, mapping=clip.mapping)
    if all(candidate.info.trajectory is None for candidate in candidates):
        candidates = candidates[:1]
    out = {"frames": np.stack([pose_rows.of_motion(candidate.motion) for candidate in candidates])}
    targets = [candidate.target for candidate in candidates if candidate.target is not None]
    if targets:
        out["targets"] = np.concatenate([pose_rows.of_motion(pose) for pose in targets])
    header = Candidates(
        type="candidates",
        id=message.id,
        gap=message.gap,
        live=message.live,
        infos=[_candidate_info(candidate.info) for candidate in candidates],
        seconds=round(time.perf_counter() - began, 4),
        arrays=shapes(out),
    )
    return header, out


def suggest(message: SuggestDuration, arrays: Arrays, clip: Clip, offer: Offer) -> Answer:
    """The suggested duration of a gap, and alternatives."""
    start, target = _ends(arrays, clip)
    found = inbetween.suggest(start, target, _unconstrained(message.settings, offer), mapping=clip.mapping)
    options = [DurationOption.model_validate(vars(each)) for each in found.alternatives]
    return SuggestedDurations(type="suggested", id=message.id, frames=found.frames, alternatives=options), {}


def find_paths(message: FindPaths, arrays: Arrays, clip: Clip, offer: Offer) -> Answer:
    """The trajectories of the gallery that fit a gap, or why there are none."""
    start, target = _ends(arrays, clip)
    goal = aligned(start, target)[1]
    request = _unconstrained(message.settings, offer)
    found: list[GalleryPath] = []
    reason = None
    try:
        found = gallery_paths.find_paths(request, clip, start, goal, message.frames, message.count)
    except InputError as error:
        reason = str(error)
    return GalleryPaths(type="gallery-paths", id=message.id, paths=found, reason=reason), {}


def mirror(message: Mirror, arrays: Arrays, clip: Clip) -> Answer:
    """A pose with left and right swapped."""
    (pose,) = _named(arrays, "pose")
    out = mirrored(pose_rows.to_motion(pose, clip.motion, "the pose")[0], clip.humanoid)
    rows = {"pose": pose_rows.of_motion(out)}
    return MirroredPose(type="mirrored", id=message.id, arrays=shapes(rows)), rows


def library(message: Library, arrays: Arrays, clip: Clip) -> Answer:
    """The bundled poses."""
    _named(arrays)
    rows = {"poses": pose_rows.of_motion(pose_library.posed(clip))}
    return LibraryPoses(type="library", id=message.id, names=list(pose_library.POSES), arrays=shapes(rows)), rows


def style_of(settings: GapSettings) -> str | None:
    """The style as `Request` expects it: a name, or two with their shares, as in ``A:0.7+B:0.3``."""
    style, blend = settings.style, settings.blend
    if blend is None or blend.share == 0.0:
        return style
    if style is None:
        raise InputError(f"a blend with style '{blend.style}' needs a first style; choose one")
    if blend.share == 1.0 or blend.style == style:
        return blend.style
    share = round(blend.share, 4)
    return f"{style}:{1.0 - share:.4g}+{blend.style}:{share:.4g}"


def _request(settings: GapSettings, offer: Offer) -> Request:
    """The settings as a request of the runtime."""
    path = "drawn" if isinstance(settings.path, PointPath) else settings.path.kind
    model = offer.model_of(settings.method, settings.model)
    matched = path in ("auto", "gallery") and model is not None and not settings.own_gallery
    return Request(
        settings.method,
        model,
        style_of(settings),
        settings.style_strength,
        path,
        settings.path_control,
        drawn=_path_file(settings.path) if isinstance(settings.path, PointPath) else None,
        gallery=offer.gallery if matched else None,
        seed=settings.seed,
        parts=None if settings.target_joints is None else parts.parse(settings.target_joints),
    )


def _unconstrained(settings: GapSettings, offer: Offer) -> Request:
    """The same without a path of its own, to search the gallery for one."""
    return _request(settings.model_copy(update={"path": PathChoice(kind="auto")}), offer)


def _path_file(path: PointPath) -> PathFile:
    """The path as the runtime reads it, without points that repeat the previous one."""
    points = np.array(path.points)
    kept = [0]
    for row in range(1, len(points)):
        if np.linalg.norm(points[row] - points[kept[-1]]) >= 2.0 * SAME_POINT:
            kept.append(row)
    chosen = [None if each is None else [each[row] for row in kept] if len(each) == len(points) else each
              for each in (path.times, path.facing)]  # fmt: skip
    return path_file.of_points(points[kept].tolist(), *chosen)


def _ends(arrays: Arrays, clip: Clip) -> tuple[Motion, Motion]:
    """The known frames before and after a gap, as many as a model looks at."""
    start, target = _named(arrays, "start", "target")
    reach = int(np.ceil((CONTEXT - 1) * clip.motion.rate / MODEL_RATE)) + 1
    return (
        pose_rows.to_motion(start, clip.motion, "start")[-reach:],
        pose_rows.to_motion(target, clip.motion, "target")[:reach],
    )


def _named(arrays: Arrays, *names: str) -> list[ndarray]:
    """The arrays with these names. Raises InputError unless exactly these are given."""
    if set(arrays) != set(names):
        given = ", ".join(name[:40] for name in arrays) or "none"
        raise InputError(f"this request needs the arrays {', '.join(names) or 'none'}, got {given}")
    return [arrays[name] for name in names]


def _candidate_info(info: Info) -> CandidateInfo:
    return CandidateInfo(
        method=info.method,
        model=info.model,
        style=info.style,
        trajectory=info.trajectory,
        foot_slide=info.foot_slide_cm_per_frame,
        fit=info.fit,
        path_deviation=info.path_deviation_m,
        fallback="; ".join(note for note in (info.fallback, *info.warnings) if note) or None,
    )
