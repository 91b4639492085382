"""Synthetic tracks: figures that walk, turn, stand, sidestep and back away; galleries and motions of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.gallery.matching import Query
from interpose.gallery.paths import turn
from interpose.gallery.tracks import POSTURE_SIZE, Tracks
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

RATE = 30.0
Track = Float[ndarray, "time 3"]


def even(frames: int, pace: float = 1.2, heading: float = 0.0, facing: float = 0.0) -> Track:
    """A straight walk at ``pace`` m/s, looking ``facing`` away from where it goes."""
    way = pace / RATE * np.arange(frames)
    return np.stack([way * np.sin(heading), way * np.cos(heading), np.full(frames, heading + facing)], axis=-1)


def arc(frames: int, pace: float = 1.2, turning: float = 0.5, heading: float = 0.0) -> Track:
    """A walk on a circle, turning by ``turning`` rad/s, looking ahead."""
    return _along(np.full(frames, pace), heading + turning / RATE * np.arange(frames), np.zeros(frames))


def wander(frames: int, seed: int) -> Track:
    """A walk that changes its pace, bends, stops, sidesteps and backs away, about once a second."""
    rng = np.random.default_rng(seed)
    seconds = np.arange(frames) / RATE
    legs = np.arange(frames // int(RATE) + 2)

    def changing(values: Sequence[float]) -> ndarray:
        return np.interp(seconds, legs, rng.choice(values, len(legs)))

    heading = rng.uniform(-np.pi, np.pi) + np.cumsum(changing([0.0, 0.0, 0.6, -0.6, 1.8, -1.8])) / RATE
    pace = changing([0.0, 0.7, 1.3, 1.3, 2.6, -0.9])
    return _along(pace + 0.05 * np.sin(11.0 * seconds), heading, changing([0.0, 0.0, 0.0, 0.9, -0.9, 1.6]))


def _along(pace: ndarray, heading: ndarray, facing: ndarray) -> Track:
    step = pace[:, None] / RATE * np.stack([np.sin(heading), np.cos(heading)], axis=-1)
    return np.concatenate([np.cumsum(step, axis=0) - step[0], (heading + facing)[:, None]], axis=-1)


def moved(track: Track, angle: float, x: float = 0.0, z: float = 0.0) -> Track:
    """The same walk elsewhere, turned."""
    return turn(track, angle, 1.0, track[0, :2] + [x, z])


def ends_of(track: Track) -> Query:
    """The query that a track answers."""
    first, last = track[[0, -1]].tolist()
    return Query(tuple(first), tuple(last))


def ahead(metres: float, facing: tuple[float, float] = (0.0, 0.0)) -> Query:
    """A query straight along +Z, with its facings relative to the way."""
    return Query((0.0, 0.0, facing[0]), (0.0, metres, facing[1]))


def tracks_of(
    tracks: Sequence[Track], styles: Sequence[str] | None = None, postures: Sequence[ndarray] | None = None
) -> Tracks:
    """The clips of those tracks; without ``postures`` all different, swinging."""
    labels = ["walk"] * len(tracks) if styles is None else list(styles)
    names = tuple(sorted(set(labels)))
    stops = np.cumsum([len(track) for track in tracks])
    if postures is None:
        mean, phase = np.random.default_rng(5).uniform([[0.2], [0.0]], [[0.9], [6.0]], size=(2, POSTURE_SIZE))
        postures = [mean + 0.1 * np.sin(0.2 * np.arange(len(track))[:, None] + phase) for track in tracks]
    spread = [
        np.broadcast_to(posture, (len(track), POSTURE_SIZE)) for posture, track in zip(postures, tracks, strict=True)
    ]
    return Tracks(
        np.concatenate(tracks).astype(np.float32),
        np.concatenate(spread).astype(np.float16),
        np.stack([np.concatenate([[0], stops[:-1]]), stops], axis=-1),
        np.array([names.index(label) for label in labels], dtype=np.int64),
        names,
    )


def motion_along(track: Track, seed: int = 0) -> Motion:
    """The 22 joints on a track: hips that lean but do not twist, limbs that swing, each side its own way."""
    rng = np.random.default_rng(seed)
    seconds = np.arange(len(track)) / RATE
    swing = np.sin(4.0 * seconds[:, None] + rng.uniform(0.0, 6.0, len(HUMANOID)))
    turned = rotation.from_rotation_vector(swing[..., None] * rng.uniform(-0.5, 0.5, (len(HUMANOID), 3)))
    upright = rotation.from_rotation_vector(track[:, 2:] * np.array([0.0, 1.0, 0.0]))
    lean = rotation.from_rotation_vector(swing[:, :1] * np.array([0.2, 0.0, 0.1]))
    turned[:, 0] = rotation.multiply(upright, lean)
    height = 0.9 + 0.05 * swing[:, 0]
    return Motion(HUMANOID, np.stack([track[:, 0], height, track[:, 1]], axis=-1), turned, RATE)


angles = st.one_of(
    st.sampled_from([0.0, np.pi, -np.pi, np.pi / 2.0, np.pi - 1e-7, 1e-7 - np.pi, 1e-9, 3.0 * np.pi, -7.0]),
    st.floats(-7.0, 7.0),
)
"""Radians, often at half a turn, and beyond."""


kinds = st.sampled_from(["wander", "even", "still", "spin", "noise"])
clips = st.tuples(kinds, st.integers(1, 70), st.integers(0, 99), angles, st.sampled_from(["Old", "Proud", "Young"]))
several_clips = st.lists(clips, min_size=1, max_size=4)
"""What :func:`drawn` makes clips of: kind, frames, seed, angle and style of each."""


def drawn(chosen: list[tuple[str, int, int, float, str]]) -> Tracks:
    """Clips of up to 70 frames: wandering, even, standing, spinning, without sense; and one of 40 frames of even."""
    made = []
    for kind, frames, seed, angle, _ in chosen:
        if kind == "wander":
            clip = wander(frames, seed)
        elif kind == "noise":
            clip = np.random.default_rng(seed).normal(size=(frames, 3))
        else:
            clip = even(frames, 1.2 if kind == "even" else 0.0, angle, angle + seed)
            clip[:, 2] += 0.2 * np.arange(frames) if kind == "spin" else 0.0
        made.append(clip)
    return tracks_of([*made, even(40)], [*(style for *_, style in chosen), "Old"])
