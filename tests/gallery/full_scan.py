"""The full scan: every window of every clip, as recorded and mirrored; what the index must find."""

from __future__ import annotations

import numpy as np

from interpose.gallery.tracks import Tracks
from interpose.gallery.windows import (
    LONGEST_WINDOW,
    SHORTEST_WINDOW,
    FoundWindows,
    WindowQuery,
    errors,
    features,
    first_of,
    merged,
)


def best(tracks: Tracks, wanted: WindowQuery, count: int) -> FoundWindows:
    """The ``count`` windows of the least error (equation 8), best first."""
    able = [c for c in range(len(tracks.ranges)) if wanted.styles is None or tracks.clip_styles[c] in wanted.styles]
    parts: list[FoundWindows] = []
    for steps in range(max(wanted.steps[0], SHORTEST_WINDOW), min(wanted.steps[1], LONGEST_WINDOW) + 1):
        ranges = tracks.ranges[able]
        starts = [np.arange(a, b - steps) for a, b in ranges if b - a > steps]
        if not starts:
            continue
        start = np.concatenate(starts)
        for mirrored in (0, 1):
            root = tracks.root * np.array([-1.0, 1.0, -1.0], dtype=np.float32) if mirrored else tracks.root
            distance, at_start, at_end = features(root, start, steps)
            error = errors(at_start, at_end, wanted.units(), wanted.criterion)
            rows = np.nonzero(
                (distance >= wanted.distance[0]) & (distance <= wanted.distance[1]) & (error <= wanted.limit)
            )[0]
            same = np.full(len(rows), 1, dtype=np.int64)
            found = start[rows].astype(np.int64), same * steps, same * mirrored, error[rows].astype(np.int64)
            parts.append(first_of(FoundWindows(*found), count))
    return first_of(merged(parts), count)
