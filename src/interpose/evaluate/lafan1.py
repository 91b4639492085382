"""The LaFAN1 protocol (Harvey et al. 2020, `Robust Motion In-betweening`; the evaluation code of the data set).

Test: every window of 65 frames of the files of subject 5, one each 40 frames. Ten past frames, then the transition of
5, 15, 30 or 45 frames, then the target, the first frame after it. Only the transition is scored.

Each window is moved so that its root's mean on the ground over all its frames is the origin, then turned about the
vertical so that the hips' local +Y axis, laid on the ground, points to +X in the last past frame.

L2P divides each coordinate by its standard deviation over the windows of 50 frames, one each 20, of subjects 1 to 4,
moved and turned in the same way.

Transitions longer than 45 frames do not fit the official window. For them a window is n + 20 frames long, as the
official one is for 45, and all else is the same; such results carry the protocol name ``lafan1-extended``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import io, rotation
from interpose import skeleton as kinematics
from interpose.errors import InputError
from interpose.features import JOINTS
from interpose.motion import Motion
from interpose.skeleton import Skeleton

TRAIN_SUBJECTS = ("subject1", "subject2", "subject3", "subject4")
TEST_SUBJECTS = ("subject5",)
PAST = 10
"""Known frames before the transition; the last of them is the start key."""
WINDOW, OFFSET = 65, 40
SCALE_WINDOW, SCALE_OFFSET = 50, 20
LENGTHS = (5, 15, 30, 45)
"""The official transition lengths."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Equally long pieces of motions of one skeleton, metres, centred and turned as the protocol asks.

    root, local: what a motion is made of. rotations, positions: the same, global.
    """

    skeleton: Skeleton
    rate: float
    root: Float[ndarray, "window frame 3"]
    local: Float[ndarray, "window frame joint 4"]
    rotations: Float[ndarray, "window frame joint 4"]
    positions: Float[ndarray, "window frame joint 3"]

    def __len__(self) -> int:
        return len(self.root)

    def one(self, at: int) -> Windows:
        """That window alone."""
        only = slice(at, at + 1)
        arrays = self.root, self.local, self.rotations, self.positions
        return Windows(self.skeleton, self.rate, *(array[only] for array in arrays))


@dataclass(frozen=True, eq=False)
class Data:
    """The clips that are tested on, and the standard deviation of each global coordinate over the training windows."""

    clips: tuple[Motion, ...]
    scale: Float[ndarray, "joint 3"]


def read(folder: Path) -> Data:
    """The data set in a folder of LaFAN1's BVH files (``NAME_subjectN.bvh``), which need not be complete.

    Raises InputError where the folder is missing, lacks the files of a side of the split, or holds other skeletons.
    """
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; give the folder that holds LaFAN1's BVH files")
    train, test = (_clips(folder, subjects) for subjects in (TRAIN_SUBJECTS, TEST_SUBJECTS))
    return Data(test, position_scale(train))


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


def cut(clips: tuple[Motion, ...], length: int = WINDOW, offset: int = OFFSET, past: int = PAST) -> Windows:
    """The windows of all clips, in order; turned by the last of their ``past`` frames.

    The clips' skeletons differ by less than a micrometre; the first one's serves for all.
    """
    root, local = [], []
    for clip in clips:
        frames = _window_frames(len(clip), length, offset)
        root.append(clip.root_positions[frames])
        local.append(rotation.continuous(clip.local_rotations)[frames])
    roots, locals_ = np.concatenate(root), np.concatenate(local)
    if len(roots) == 0:
        raise InputError(f"no clip is longer than a window of {length} frames; ask for a shorter transition")
    centre, turn = _placement(roots, locals_[:, :, 0], past)
    locals_[:, :, 0] = rotation.multiply(turn, locals_[:, :, 0])
    roots = rotation.rotate(turn, roots - centre)
    skeleton = clips[0].skeleton
    return Windows(skeleton, clips[0].rate, roots, locals_, *forward_kinematics(skeleton, roots, locals_))


def _placement(
    root: Float[ndarray, "window frame 3"], hips: Float[ndarray, "window frame 4"], past: int = PAST
) -> tuple[Float[ndarray, "window 1 3"], Float[ndarray, "window 1 4"]]:
    """The point that becomes each window's origin, and the rotation about it that follows."""
    ground = np.array([1.0, 0.0, 1.0])
    forward = rotation.rotate(hips[:, past - 1], np.array([0.0, 1.0, 0.0])) * ground
    turn = rotation.between(forward, np.array([1.0, 0.0, 0.0]))
    return root.mean(axis=1, keepdims=True) * ground, turn[:, None]


def position_scale(clips: tuple[Motion, ...]) -> Float[ndarray, "joint 3"]:
    """The standard deviation of each joint's global coordinates over the training windows, metres."""
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


def forward_kinematics(
    skeleton: Skeleton, root: Float[ndarray, "*batch 3"], local: Float[ndarray, "*batch joint 4"]
) -> tuple[Float[ndarray, "*batch joint 4"], Float[ndarray, "*batch joint 3"]]:
    """Global rotations and global positions."""
    world = kinematics.global_rotations(local, skeleton.parents)
    return world, kinematics.global_positions(root, world, skeleton.parents, skeleton.offsets)


def window_length(frames: int) -> int:
    """The window for a transition of that many frames: the official 65, or as much longer as it takes."""
    return max(WINDOW, frames + 2 * PAST)


def protocol(frames: int) -> str:
    """The protocol's name in tables."""
    return "lafan1" if window_length(frames) == WINDOW else "lafan1-extended"
