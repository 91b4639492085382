"""What the studio answers, as functions of what is asked, the rig and the models; nothing here waits or remembers."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy import ndarray

from interpose.drawn_path import path_file
from interpose.drawn_path.path_file import SAME_POINT, PathFile
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget.mirrored import mirrored
from interpose.runtime import inbetween
from interpose.runtime.interpolate import aligned
from interpose.runtime.request import Info, Request
from interpose.runtime.resampling import CONTEXT, MODEL_RATE
from interpose.runtime.style_blend import leading
from interpose.studio import gallery_paths, pose_library, pose_rows
from interpose.studio.messages import shapes
from interpose.studio.methods import Sessions, session_of
from interpose.studio.protocol import (
    Alternative,
    Asked,
    CandidateInfo,
    Candidates,
    Ends,
    Generate,
    Library,
    LibraryPoses,
    Line,
    Mirror,
    Paths,
    Posed,
    Suggest,
    Suggested,
    Told,
    WayInfo,
    Ways,
)
from interpose.studio.rigs import Clip, Shelf

Arrays = Mapping[str, ndarray]
Answer = tuple[Told, dict[str, ndarray]]


def answer(asked: Asked, arrays: Arrays, shelf: Shelf, sessions: Sessions) -> Answer:
    """The answer to anything but `cancel`. Raises InputError where it cannot be served, `rigs.Unknown` where the rig is
    not here."""
    match asked:
        case Generate():
            return generate(asked, arrays, shelf.get(asked.rig), sessions)
        case Suggest():
            return suggest(asked, arrays, shelf.get(asked.rig), sessions)
        case Paths():
            return paths(asked, arrays, shelf.get(asked.rig), sessions)
        case Mirror():
            return mirror(asked, arrays, shelf.get(asked.rig))
        case Library():
            return poses(asked, arrays, shelf.get(asked.rig))
        case _:
            raise InputError(f"'{asked.type}' has no answer")


def generate(asked: Generate, arrays: Arrays, clip: Clip, sessions: Sessions) -> Answer:
    """Candidates for a gap, the best first. What must be interpolated comes out once, for it has no variants."""
    began = time.perf_counter()
    start, target = _ends(arrays, clip)
    one = asked.live or asked.method == "interp"
    made = inbetween.inbetween(
        start, target, asked.frames, _request(asked, sessions), variants=1 if one else asked.variants,
        mapping=clip.mapping,
    )  # fmt: skip
    if all(candidate.info.trajectory is None for candidate in made):
        made = made[:1]
    frames = np.stack([pose_rows.of_motion(candidate.motion) for candidate in made])
    told = {"frames": frames}
    infos = [_told(candidate.info) for candidate in made]
    seconds = round(time.perf_counter() - began, 4)
    header = Candidates(
        type="candidates",
        id=asked.id,
        gap=asked.gap,
        live=asked.live,
        infos=infos,
        seconds=seconds,
        arrays=shapes(told),
    )
    return header, told


def suggest(asked: Suggest, arrays: Arrays, clip: Clip, sessions: Sessions) -> Answer:
    """How long a gap should take."""
    start, target = _ends(arrays, clip)
    request = Request("dcmoe", session_of(sessions, "dcmoe"), style_of(asked))
    made = inbetween.suggest(start, target, request, mapping=clip.mapping)
    others = [Alternative.model_validate(vars(each)) for each in made.alternatives]
    return Suggested(type="suggested", id=asked.id, frames=made.frames, alternatives=others), {}


def paths(asked: Paths, arrays: Arrays, clip: Clip, sessions: Sessions) -> Answer:
    """The ways that the gallery knows, or why it knows none."""
    start, target = _ends(arrays, clip)
    goal = aligned(start, target)[1]
    gallery = session_of(sessions, "dcmoe").gallery
    found: list[WayInfo] = []
    reason = None
    try:
        found = gallery_paths.ways(
            gallery, clip, start, goal, asked.frames, leading(style_of(asked)), asked.count, asked.seed
        )
    except InputError as error:
        reason = str(error)
    return Ways(type="ways", id=asked.id, ways=found, reason=reason), {}


def mirror(asked: Mirror, arrays: Arrays, clip: Clip) -> Answer:
    """A pose in its own mirror."""
    (pose,) = _taken(arrays, "pose")
    made = mirrored(pose_rows.to_motion(pose, clip.motion, "the pose")[0], clip.humanoid)
    told = {"pose": pose_rows.of_motion(made)}
    return Posed(type="posed", id=asked.id, arrays=shapes(told)), told


def poses(asked: Library, arrays: Arrays, clip: Clip) -> Answer:
    """The poses that ship."""
    _taken(arrays)
    told = {"poses": pose_rows.of_motion(pose_library.posed(clip))}
    return LibraryPoses(type="library", id=asked.id, names=list(pose_library.POSES), arrays=shapes(told)), told


def style_of(asked: Ends) -> str | None:
    """The style as a request has it: a name, or two with their shares, as in ``A:0.7+B:0.3``."""
    if asked.blend is None or asked.blend.share == 0.0:
        return asked.style
    if asked.style is None:
        raise InputError(f"a share of style '{asked.blend.style}' needs a style to be a share of; choose one")
    if asked.blend.share == 1.0 or asked.blend.style == asked.style:
        return asked.blend.style
    share = round(asked.blend.share, 4)
    return f"{asked.style}:{1.0 - share:.4g}+{asked.blend.style}:{share:.4g}"


def _request(asked: Generate, sessions: Sessions) -> Request:
    if asked.method == "interp":
        return Request("interp", seed=asked.seed)
    session, style = session_of(sessions, asked.method), style_of(asked)
    if isinstance(asked.path, Line):
        return Request(asked.method, session, style, "drawn", asked.seed, lines=_line(asked.path))
    return Request(asked.method, session, style, asked.path.kind, asked.seed)


def _line(line: Line) -> PathFile:
    """What was drawn, points that repeat the one before left out."""
    points = np.array(line.points)
    kept = [0]
    for row in range(1, len(points)):
        if np.linalg.norm(points[row] - points[kept[-1]]) >= 2.0 * SAME_POINT:
            kept.append(row)
    chosen = [None if each is None else [each[row] for row in kept] if len(each) == len(points) else each
              for each in (line.times, line.facing)]  # fmt: skip
    return path_file.of_points(points[kept].tolist(), *chosen)


def _ends(arrays: Arrays, clip: Clip) -> tuple[Motion, Motion]:
    """The known frames before and after a gap, no more of them than a model is shown."""
    start, target = _taken(arrays, "start", "target")
    reach = int(np.ceil((CONTEXT - 1) * clip.motion.rate / MODEL_RATE)) + 1
    return (
        pose_rows.to_motion(start, clip.motion, "start")[-reach:],
        pose_rows.to_motion(target, clip.motion, "target")[:reach],
    )


def _taken(arrays: Arrays, *names: str) -> list[ndarray]:
    """The arrays with these names. Raises InputError where there are others, or not these."""
    if set(arrays) != set(names):
        given = ", ".join(name[:40] for name in arrays) or "none"
        raise InputError(f"the arrays {', '.join(names) or 'none'} are needed here, but given are {given}")
    return [arrays[name] for name in names]


def _told(info: Info) -> CandidateInfo:
    return CandidateInfo(
        method="interp" if info.method == "interp" else "stitch" if info.method.startswith("stitch") else "dcmoe",
        style=info.style,
        trajectory=info.trajectory,
        foot_slide=info.foot_slide_cm_per_frame,
        fit=info.fit,
        path_deviation=info.path_deviation_m,
        fallback=info.fallback,
    )
