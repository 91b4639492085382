"""A motion: a skeleton with the root's position and the joints' rotations for each frame, and functions of motions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.skeleton import HUMANOID, MIRROR, Skeleton


@runtime_checkable
class SourceLayout(Protocol):
    """How the file that a motion was read from is laid out; `interpose.io` needs it to write frames back unchanged."""

    @property
    def metres_per_unit(self) -> float:
        """Length of the file's unit."""
        ...

    @property
    def nbytes(self) -> int:
        """Bytes of the file's text that are kept in memory."""
        ...

    def joined(self, frame: int, other: SourceLayout | None, other_frame: int) -> tuple[SourceLayout, bool]:
        """This layout with two rows, one of this file and one of another, and whether the other's row fits.

        It fits where both files have the same channels, offsets and unit; otherwise it is left out.
        """
        ...


@dataclass(frozen=True, eq=False)
class Motion:
    """A clip or a pose (a motion of one frame).

    root_positions: metres. local_rotations: ``q_parent_joint``, scalar last. rate: frames a second. translations: each
    joint's position in its parent's frame, for files that animate joints other than the root, else None (entry 0
    repeats the root's position). layout: of the file it was read from; kept when the motion is
    cut. Raises ValueError where the shapes do not fit.
    """

    skeleton: Skeleton
    root_positions: Float[ndarray, "frame 3"]
    local_rotations: Float[ndarray, "frame joint 4"]
    rate: float
    translations: Float[ndarray, "frame joint 3"] | None = None
    layout: SourceLayout | None = None

    def __post_init__(self) -> None:
        frames, joints = self.local_rotations.shape[:2]
        if joints != len(self.skeleton) or self.root_positions.shape != (frames, 3):
            raise ValueError(
                f"rotations {self.local_rotations.shape} and root {self.root_positions.shape} do not fit "
                f"{len(self.skeleton)} joints"
            )
        if self.translations is not None and self.translations.shape != (frames, joints, 3):
            raise ValueError(f"translations {self.translations.shape}, expected {(frames, joints, 3)}")
        if not self.rate > 0:
            raise ValueError(f"rate must be positive, got {self.rate}")

    def __len__(self) -> int:
        return len(self.root_positions)

    def __getitem__(self, frames: int | slice | Int[ndarray, "some"]) -> Motion:
        """One frame, a range or some of the frames, as a motion. Raises IndexError for a frame outside the motion."""
        if not isinstance(frames, slice | ndarray):
            count = len(self)
            if not -count <= frames < count:
                raise IndexError(f"frame {frames} of a motion of {count} frames")
            frames = slice(frames % count, frames % count + 1)
        moved = None if self.translations is None else self.translations[frames]
        return replace(
            self,
            root_positions=self.root_positions[frames],
            local_rotations=self.local_rotations[frames],
            translations=moved,
        )

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last."""
        return (len(self) - 1) / self.rate

    def global_rotations(self) -> Float[ndarray, "frame joint 4"]:
        """``q_world_joint`` of every joint."""
        return kinematics.global_rotations(self.local_rotations, self.skeleton.parents)

    def global_positions(self) -> Float[ndarray, "frame joint 3"]:
        """World positions of every joint, metres."""
        offsets = self.skeleton.offsets if self.translations is None else self.translations
        return kinematics.global_positions(self.root_positions, self.global_rotations(), self.skeleton.parents, offsets)


def from_global(
    skeleton: Skeleton, root: Float[ndarray, "frame 3"], world: Float[ndarray, "frame joint 4"], rate: float
) -> Motion:
    """A motion from root positions (metres) and global rotations, with continuous signs."""
    local = rotation.continuous(kinematics.local_rotations(world, skeleton.parents))
    return Motion(skeleton, root, local, rate)


def concatenate(*parts: Motion) -> Motion:
    """One motion after another. Raises ValueError where they differ in skeleton or rate."""
    first = parts[0]
    if any(p.skeleton != first.skeleton or p.rate != first.rate for p in parts):
        raise ValueError("motions can only be joined if they share their skeleton and rate")
    moved = [p.translations for p in parts if p.translations is not None]
    return replace(
        first,
        root_positions=np.concatenate([p.root_positions for p in parts]),
        local_rotations=np.concatenate([p.local_rotations for p in parts]),
        translations=np.concatenate(moved) if len(moved) == len(parts) else None,
    )


def sample(motion: Motion, times: Float[ndarray, "time"]) -> Motion:
    """The poses at ``times``, in frames of ``motion``: the root interpolated linearly, the rotations by SLERP.

    Times outside the clip are clamped to its ends. A whole number gives that frame unchanged.
    """
    times = np.clip(times, 0.0, len(motion) - 1.0)
    low = np.floor(times).astype(int)
    high = np.minimum(low + 1, len(motion) - 1)
    part = times - low

    def linear(x: Float[ndarray, "frame *rest"]) -> Float[ndarray, "time *rest"]:
        weight = part.reshape(-1, *[1] * (x.ndim - 1))
        return (1.0 - weight) * x[low] + weight * x[high]

    exact = part == 0.0
    turned = motion.local_rotations[low].copy()
    if not exact.all():
        between = ~exact
        turned[between] = rotation.slerp(turned[between], motion.local_rotations[high[between]], part[between][:, None])
    return replace(
        motion,
        root_positions=linear(motion.root_positions),
        local_rotations=turned,
        translations=None if motion.translations is None else linear(motion.translations),
    )


def resample(motion: Motion, rate: float) -> Motion:
    """The motion at another rate (Hz), its first frame kept. Its own rate gives the motion itself."""
    if rate == motion.rate:
        return motion
    count = int(np.floor(motion.duration * rate + 1e-6)) + 1
    return replace(sample(motion, np.arange(count) * (motion.rate / rate)), rate=float(rate))


def velocities(positions: Float[ndarray, "frame *rest"], rate: float) -> Float[ndarray, "frame *rest"]:
    """Backward differences per second; the first frame repeats the second's (zero for a single frame)."""
    if len(positions) == 1:
        return np.zeros_like(positions)
    step = np.diff(positions, axis=0) * rate
    return np.concatenate([step[:1], step])


def mirror(motion: Motion) -> Motion:
    """A motion of :data:`~interpose.skeleton.HUMANOID` mirrored at x = 0, left and right exchanged. Raises ValueError
    for another skeleton."""
    if motion.skeleton.names != HUMANOID.names:
        raise ValueError("only motions of the 22-joint humanoid can be mirrored; retarget first")
    flip = np.array([1.0, -1.0, -1.0, 1.0])
    return replace(
        motion,
        root_positions=motion.root_positions * np.array([-1.0, 1.0, 1.0]),
        local_rotations=motion.local_rotations[:, MIRROR] * flip,
        translations=None,
        layout=None,
    )
