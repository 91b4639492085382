"""The trajectories of a gallery that fit a gap, as paths that can be requested again."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery import proposals
from interpose.gallery.proposals import PathRequest, Unreachable
from interpose.motion import Motion
from interpose.runtime.inbetween import gap_of
from interpose.runtime.request import Request
from interpose.runtime.resampling import model_steps, user_frames
from interpose.studio.project_format import PointPath
from interpose.studio.protocol import GalleryPath
from interpose.studio.rigs import Clip

MOST_PATH_POINTS = 40
POINT_SPACING = 0.02
"""Least distance between two points in metres; a trajectory that stays in place has one point."""


def find_paths(request: Request, clip: Clip, start: Motion, goal: Motion, frames: int, count: int) -> list[GalleryPath]:
    """At most ``count`` paths for a gap of ``frames`` frames, the most likely first; of the request's style if the
    gallery has any.

    Raises InputError if the rig is not a humanoid, there is no gallery, or none of its trajectories fits.
    """
    mapping, gallery = clip.humanoid, request.trajectories
    if gallery is None:
        raise InputError("the model has no gallery; draw a path, or choose another model")
    gap, rate = gap_of(start, goal, mapping), clip.motion.rate
    steps = model_steps(frames, rate)
    query = PathRequest(steps, style=request.matched_style)
    try:
        found = proposals.propose(gallery, gap.query, query, gap.ends, count=count, seed=request.seed)
    except Unreachable:
        if query.style is None:
            raise
        found = proposals.propose(gallery, gap.query, PathRequest(steps), gap.ends, count=count, seed=request.seed)
    seconds = (frames + 1) / rate
    return [
        GalleryPath(
            path=point_path(one.path * [1.0 / mapping.scale, 1.0 / mapping.scale, 1.0], seconds),
            frames=user_frames(one.trace.steps, rate),
            style=one.style,
            fit=one.fit,
            composed=one.composed,
        )
        for one in found
    ]


def point_path(path: Float[ndarray, "time 3"], seconds: float) -> PointPath:
    """A path of x, z and yaw reduced to a few points.

    The points are spread evenly over the mean of covered distance and elapsed time, so that bends and halts both have
    some.
    """
    distance = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1))])
    share = np.linspace(0.0, 1.0, len(path))
    progress = share + (distance / distance[-1] if distance[-1] > 0.0 else share)
    targets = np.linspace(0.0, 2.0, min(MOST_PATH_POINTS, len(path))) - 1e-9
    rows = np.unique(np.searchsorted(progress, targets))
    kept = [0]
    for row in rows[1:-1].tolist():
        distances = [np.linalg.norm(path[row, :2] - path[other, :2]) for other in (kept[-1], len(path) - 1)]
        if min(distances) >= POINT_SPACING:
            kept.append(row)
    if np.linalg.norm(path[-1, :2] - path[0, :2]) >= POINT_SPACING or len(kept) > 1:
        kept.append(len(path) - 1)
    points = path[kept]
    return PointPath(
        kind="waypoints",
        points=[(round(x, 4), round(z, 4)) for x, z in points[:, :2].tolist()],
        times=np.round(share[kept] * seconds, 4).tolist(),
        facing=np.round(points[:, 2], 4).tolist(),
        drawn=False,
    )
