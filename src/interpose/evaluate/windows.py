"""The windows of LaFAN1's benchmark (Harvey et al. 2020, `Robust Motion In-betweening`, and its evaluation code).

Test: every window of 65 frames of the files of subject 5, one each 40 frames. Ten known frames, then the gap of 5, 15,
30 or 45 frames, then the target. Each window is moved so that the mean of its root on the ground is the origin, and
turned about the vertical so that the hips' local +Y axis, laid on the ground, points to +X in the start key.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import io, rotation
from interpose.errors import InputError
from interpose.evaluate.case import Case, Windows
from interpose.features import JOINTS
from interpose.motion import Motion
from interpose.retarget import Mapping, map_skeleton

TRAIN_SUBJECTS = ("subject1", "subject2", "subject3", "subject4")
TEST_SUBJECTS = ("subject5",)
KNOWN_FRAMES = 10
"""Known frames before the gap; the last of them is the start key."""
TEST_WINDOW, TEST_OFFSET = 65, 40
SCALE_WINDOW, SCALE_OFFSET = 50, 20
OFFICIAL_LENGTHS = (5, 15, 30, 45)


@dataclass(frozen=True, eq=False)
class LaFAN1:
    """The test clips, the mapping of their skeleton to the 22 joints, and the standard deviation of each global
    coordinate over the training windows, metres."""

    clips: tuple[Motion, ...]
    mapping: Mapping
    scale: Float[ndarray, "joint 3"]


def read(folder: Path) -> LaFAN1:
    """The data set in a folder of LaFAN1's BVH files (``NAME_subjectN.bvh``), which need not be complete.

    Raises InputError where the folder is missing, lacks the files of a side of the split, or holds other skeletons.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the folder that holds LaFAN1's BVH files")
    train, test = (_clips(folder, subjects) for subjects in (TRAIN_SUBJECTS, TEST_SUBJECTS))
    return LaFAN1(test, map_skeleton(test[0].skeleton), position_scale(train))


def _clips(folder: Path, subjects: tuple[str, ...]) -> tuple[Motion, ...]:
    paths = sorted(path for path in folder.glob("*.bvh") if path.stem.split("_")[-1] in subjects)
    if not paths:
        wanted = f"*_{subjects[0]}.bvh" + ("" if len(subjects) == 1 else f" to *_{subjects[-1]}.bvh")
        raise InputError(f"{folder} holds no {wanted}; give the folder of LaFAN1's own BVH files")
    clips = []
    for path in paths:
        clip = io.read(path)
        if len(clip.skeleton) != JOINTS or clip.skeleton.names[0] != "Hips":
            joints = len(clip.skeleton)
            raise InputError(f"{path} has {joints} joints and is not on LaFAN1's skeleton; remove it from the folder")
        clips.append(clip)
    return tuple(clips)


def cut(
    clips: tuple[Motion, ...], length: int = TEST_WINDOW, offset: int = TEST_OFFSET, known: int = KNOWN_FRAMES
) -> Windows:
    """The windows of all clips, in order, turned by the last of their ``known`` frames.

    The clips' skeletons differ by less than a micrometre; the first one's serves for all. Raises InputError where no
    clip is longer than a window.
    """
    frames = [_window_frames(len(clip), length, offset) for clip in clips]
    root = np.concatenate([clip.root_positions[chosen] for clip, chosen in zip(clips, frames, strict=True)])
    if len(root) == 0:
        raise InputError(f"no clip is longer than a window of {length} frames; choose a shorter gap")
    local = np.concatenate(
        [rotation.continuous(clip.local_rotations)[chosen] for clip, chosen in zip(clips, frames, strict=True)]
    )
    centre, turn = _placement(root, local[:, :, 0], known)
    local[:, :, 0] = rotation.multiply(turn, local[:, :, 0])
    return Windows(clips[0].skeleton, clips[0].rate, rotation.rotate(turn, root - centre), local)


def _placement(
    root: Float[ndarray, "window frame 3"], hips: Float[ndarray, "window frame 4"], known: int = KNOWN_FRAMES
) -> tuple[Float[ndarray, "window 1 3"], Float[ndarray, "window 1 4"]]:
    """The point that becomes each window's origin, and the rotation about it that follows."""
    ground = np.array([1.0, 0.0, 1.0])
    forward = rotation.rotate(hips[:, known - 1], np.array([0.0, 1.0, 0.0])) * ground
    turn = rotation.between(forward, np.array([1.0, 0.0, 0.0]))
    return root.mean(axis=1, keepdims=True) * ground, turn[:, None]


def position_scale(clips: tuple[Motion, ...]) -> Float[ndarray, "joint 3"]:
    """The standard deviation of each joint's global coordinates over the training windows, metres.

    These have 50 frames, one each 20, moved and turned like the test's. L2P divides by it.
    """
    count, total, squares = 0, np.zeros((JOINTS, 3)), np.zeros((JOINTS, 3))
    for clip in clips:
        frames = _window_frames(len(clip), SCALE_WINDOW, SCALE_OFFSET)
        if len(frames) == 0:
            continue
        centre, turn = _placement(clip.root_positions[frames], clip.local_rotations[frames, 0])
        positions = clip.global_positions()[frames] - centre[:, :, None]
        positions = positions.reshape(len(frames), -1, 3) @ rotation.to_matrix(turn[:, 0]).swapaxes(-1, -2)
        positions = positions.reshape(-1, JOINTS, 3)
        count += len(positions)
        total += positions.sum(axis=0)
        squares += np.square(positions).sum(axis=0)
    if count == 0:
        raise InputError(f"no training clip is longer than {SCALE_WINDOW} frames; give LaFAN1's own files")
    return np.sqrt(squares / count - np.square(total / count))


def _window_frames(frames: int, length: int, offset: int) -> Int[ndarray, "window length"]:
    """The frame numbers of each window; like the official code it leaves out a window that ends with its clip."""
    return np.arange(0, frames - length, offset)[:, None] + np.arange(length)


def window_length(frames: int) -> int:
    """The window for a gap of so many frames: the official 65, or as much longer as it takes."""
    return max(TEST_WINDOW, frames + 2 * KNOWN_FRAMES)


def cases(
    data: LaFAN1, lengths: Sequence[int], known: int = KNOWN_FRAMES, protocol: str | None = None
) -> Iterator[Case]:
    """The case of each length, the shortest first. known: up to the start. protocol: LaFAN1's own where left out."""
    for length, same in groupby(sorted(set(lengths)), window_length):
        windows = cut(data.clips, length)
        for frames in same:
            name = protocol or ("lafan1" if length == TEST_WINDOW else "lafan1-extended")
            target = KNOWN_FRAMES + frames
            yield Case(name, frames, windows, KNOWN_FRAMES - 1, target, known, data.mapping, data.scale)
