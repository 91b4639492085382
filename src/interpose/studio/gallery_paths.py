"""The trajectories that the gallery knows for a gap, as lines that can be asked for again."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery import proposals
from interpose.gallery.proposals import PathRequest, Unreachable
from interpose.gallery.store import Gallery
from interpose.motion import Motion
from interpose.runtime.inbetween import gap_of
from interpose.runtime.resampling import model_steps, user_frames
from interpose.studio.protocol import Line, WayInfo
from interpose.studio.rigs import Clip

POINTS = 40
"""Points of a line at most."""
APART = 0.02
"""Metres between two points of a line at least: where somebody stands, one is enough."""


def ways(
    gallery: Gallery | None,
    clip: Clip,
    start: Motion,
    goal: Motion,
    frames: int,
    style: str | None,
    count: int,
    seed: int,
) -> list[WayInfo]:
    """At most ``count`` ways for a gap of ``frames`` frames, the likeliest first; those of a style where there are any.

    Raises InputError where the rig is no humanoid, there is no gallery, or none of its trajectories leads there.
    """
    mapping = clip.humanoid
    if gallery is None:
        raise InputError("the model has no gallery, so no ways are known; draw one, or choose another method")
    gap, rate = gap_of(start, goal, mapping), clip.motion.rate
    steps = model_steps(frames, rate)
    asked = PathRequest(steps, style=style if style in gallery.styles else None)
    try:
        found = proposals.propose(gallery, gap.query, asked, gap.ends, count=count, seed=seed)
    except Unreachable:
        if asked.style is None:
            raise
        found = proposals.propose(gallery, gap.query, PathRequest(steps), gap.ends, count=count, seed=seed)
    seconds = (frames + 1) / rate
    return [
        WayInfo(
            line=line_of(one.path * [1.0 / mapping.scale, 1.0 / mapping.scale, 1.0], seconds),
            frames=user_frames(one.trace.steps, rate),
            style=one.style,
            fit=one.fit,
            composed=one.composed,
        )
        for one in found
    ]


def line_of(path: Float[ndarray, "time 3"], seconds: float) -> Line:
    """A path of x, z and yaw as a line of few points that leads the same way when it is followed.

    The points lie where equal shares of the way and of the time are done, half each, so that bends and halts have some.
    """
    away = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=-1))])
    share = np.linspace(0.0, 1.0, len(path))
    done = share + (away / away[-1] if away[-1] > 0.0 else share)
    rows = np.unique(np.searchsorted(done, np.linspace(0.0, 2.0, min(POINTS, len(path))) - 1e-9))
    kept = [0]
    for row in rows[1:-1].tolist():
        far = [np.linalg.norm(path[row, :2] - path[other, :2]) for other in (kept[-1], len(path) - 1)]
        if min(far) >= APART:
            kept.append(row)
    if np.linalg.norm(path[-1, :2] - path[0, :2]) >= APART or len(kept) > 1:
        kept.append(len(path) - 1)
    some = path[kept]
    return Line(
        kind="line",
        points=[(round(x, 4), round(z, 4)) for x, z in some[:, :2].tolist()],
        times=np.round(share[kept] * seconds, 4).tolist(),
        facing=np.round(some[:, 2], 4).tolist(),
        drawn=False,
    )
