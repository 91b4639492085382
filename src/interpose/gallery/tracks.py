"""What a gallery searches: the root's track of every frame of its clips, and the posture at each frame.

Nothing mirrored is stored: in a mirror, x and yaw of a track change their signs and a posture swaps its sides.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Float16, Float32, Int
from numpy import ndarray

from interpose.data.database import Database
from interpose.data.root import pose_yaw, turned
from interpose.errors import InputError
from interpose.features import RATE
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

POSTURE_POINTS = ("Head", "LeftHand", "RightHand", "LeftToe", "RightToe")
POSTURE_SIZE = 1 + 3 * len(POSTURE_POINTS)
"""Length of a posture: the hips' height, then x, y, z of each point."""
MOST_ACCELERATION = 60.0
"""m/s^2: a root that accelerates more has jumped, which happens in captures; no path should follow it."""
MOST_TURN_RATE = 20.0
"""rad/s: a facing that turns faster has lost its direction, as when a body rolls over."""
_POINT_JOINTS = [HUMANOID.index(name) for name in POSTURE_POINTS]
_MIRROR_ORDER = np.array([0, *(1 + 3 * p + c for p in (0, 2, 1, 4, 3) for c in range(3))])
_MIRROR_SIGNS = np.array([1.0, *([-1.0, 1.0, 1.0] * len(POSTURE_POINTS))])


@dataclass(frozen=True, eq=False)
class Tracks:
    """Root tracks of clips, one after another.

    root: x, z of the hips on the ground, metres, and the twist of the hips about the vertical, radians, unwrapped
    within a clip. It is not smoothed, so that a single key pose has one too. posture: the hips' height, and head, hands
    and feet in the root's own frame, metres. ranges: frames [start, stop) of each clip. clip_styles: index into
    ``styles``.
    """

    root: Float32[ndarray, "frame 3"]
    posture: Float16[ndarray, "frame 16"]
    ranges: Int[ndarray, "clip 2"]
    clip_styles: Int[ndarray, "clip"]
    styles: tuple[str, ...]

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.root)

    def style_of(self, frame: int) -> str:
        """The style of the clip that holds a frame."""
        return self.styles[int(self.clip_styles[np.searchsorted(self.ranges[:, 0], frame, side="right") - 1])]

    def cut(self, start: int, steps: int, mirrored: bool) -> Float[ndarray, "time 3"]:
        """The track of a window, both ends included, mirrored if so."""
        track = self.root[start : start + steps + 1].astype(float)
        return track * [-1.0, 1.0, -1.0] if mirrored else track


def track_of(motion: Motion) -> Float[ndarray, "frame 3"]:
    """x, z (metres) and unwrapped yaw (radians) of every frame of a motion of the 22 joints."""
    hips = motion.root_positions
    yaw = np.unwrap(pose_yaw(motion.local_rotations[:, 0]))
    return np.stack([hips[:, 0], hips[:, 2], yaw], axis=-1)


def posture_of(motion: Motion) -> Float[ndarray, "frame 16"]:
    """The posture (see :class:`Tracks`) of every frame of a motion of the 22 joints."""
    positions = motion.global_positions()
    yaw = pose_yaw(motion.local_rotations[:, 0])[:, None]
    away = positions[:, _POINT_JOINTS] - positions[:, :1] * [1.0, 0.0, 1.0]
    local = away.copy()
    local[..., ::2] = turned(away[..., ::2], -yaw)
    return np.concatenate([positions[:, :1, 1], local.reshape(len(local), -1)], axis=-1)


def mirror_posture(posture: Float[ndarray, "*batch 16"]) -> Float[ndarray, "*batch 16"]:
    """The posture of the mirrored pose."""
    return posture[..., _MIRROR_ORDER] * _MIRROR_SIGNS


def posture_distance(a: Float[ndarray, "*#batch 16"], b: Float[ndarray, "*#batch 16"]) -> Float[ndarray, "*batch"]:
    """The distance of two postures: root mean square over the hips' height and the five points, metres."""
    return np.asarray(np.sqrt(np.sum(np.square(a - b), axis=-1) / (1 + len(POSTURE_POINTS))))


def without_jumps(track: Float[ndarray, "frame 3"]) -> list[tuple[int, int]]:
    """The ranges [start, stop) of a track at 30 Hz that are free of jumps."""
    jumps = np.zeros(len(track) + 1, dtype=bool)  # between a frame and the one before it
    jumps[1:-1][np.abs(np.diff(track[:, 2])) * RATE > MOST_TURN_RATE] = True
    bend = np.linalg.norm(np.diff(track[:, :2], n=2, axis=0), axis=-1) * RATE**2 > MOST_ACCELERATION
    jumps[1:-2][bend] = True
    jumps[2:-1][bend] = True
    cuts = [0, *np.nonzero(jumps)[0].tolist(), len(track)]
    return [(a, b) for a, b in pairwise(cuts) if b - a > 1]


def from_database(database: Database, ranges: list[tuple[int, int]] | None = None) -> Tracks:
    """The tracks of a prepared database, or of some frame ranges of it (each inside a clip)."""
    chosen = [(int(a), int(b)) for a, b in database.ranges] if ranges is None else ranges
    starts = database.ranges[:, 0]
    motions = [database.motion(start, stop) for start, stop in chosen]
    clips = [int(np.searchsorted(starts, start, side="right")) - 1 for start, _ in chosen]
    return from_motions(motions, [database.clips[clip].style for clip in clips])


def from_motions(motions: list[Motion], styles: list[str]) -> Tracks:
    """The tracks of motions of the 22 joints at 30 Hz, each with its style and each starting at the origin.

    A motion is cut where its root jumps (:func:`without_jumps`). Raises InputError where no clip of two frames is left.
    """
    whole = [(motion, style, without_jumps(track_of(motion))) for motion, style in zip(motions, styles, strict=True)]
    motions = [motion[a:b] for motion, _, ranges in whole for a, b in ranges]
    styles = [style for _, style, ranges in whole for _ in ranges]
    if not motions:
        raise InputError("no clip has two frames without a jump between them; a gallery needs longer clips")
    names = tuple(sorted(set(styles)))
    tracks = [track_of(motion) for motion in motions]
    lengths = np.array([len(track) for track in tracks], dtype=np.int64)
    stops = np.cumsum(lengths)
    return Tracks(
        np.concatenate([track - [*track[0, :2], 0.0] for track in tracks]).astype(np.float32),
        np.concatenate([posture_of(motion) for motion in motions]).astype(np.float16),
        np.stack([stops - lengths, stops], axis=-1),
        np.array([names.index(style) for style in styles], dtype=np.int64),
        names,
    )
