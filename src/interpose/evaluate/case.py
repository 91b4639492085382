"""A case of an evaluation: gaps of one length, one in each window of a data set, and the scores of what fills them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import skeleton as kinematics
from interpose.data.database import Database
from interpose.errors import InputError
from interpose.evaluate import metrics
from interpose.evaluate.metrics import Scores
from interpose.gallery.tracks import track_of
from interpose.motion import Motion
from interpose.retarget import Mapping, to_humanoid
from interpose.runtime.gap_batch import Batch
from interpose.runtime.guidance import Gap
from interpose.runtime.poses import Path
from interpose.skeleton import HUMANOID, MODEL_RATE, Skeleton

TOE_NAMES = ("LeftToe", "RightToe")


@dataclass(frozen=True, eq=False)
class Windows:
    """Motions of one skeleton and one length: hips positions in metres and local rotations."""

    skeleton: Skeleton
    rate: float
    root: Float[ndarray, "window frame 3"]
    local: Float[ndarray, "window frame joint 4"]

    def __len__(self) -> int:
        return len(self.root)

    @cached_property
    def rotations(self) -> Float[ndarray, "window frame joint 4"]:
        """Global rotations."""
        return kinematics.global_rotations(self.local, self.skeleton.parents)

    @cached_property
    def positions(self) -> Float[ndarray, "window frame joint 3"]:
        """Global positions, metres."""
        return kinematics.global_positions(self.root, self.rotations, self.skeleton.parents, self.skeleton.offsets)

    @property
    def batch(self) -> Batch:
        return self.root, self.local

    def take(self, rows: Sequence[int]) -> Windows:
        """Some of the windows."""
        return replace(self, root=self.root[list(rows)], local=self.local[list(rows)])

    def frames(self, chosen: slice) -> Windows:
        """Some frames of each window."""
        return replace(self, root=self.root[:, chosen], local=self.local[:, chosen])

    def frame(self, at: int) -> Windows:
        """One frame of each window; negative from the end."""
        return self.frames(slice(at, at + 1 or None))

    @property
    def motions(self) -> list[Motion]:
        return [Motion(self.skeleton, *arrays, self.rate) for arrays in zip(self.root, self.local, strict=True)]

    def retargeted(self, transfer: Callable[[Motion, Mapping], Motion], mapping: Mapping | None) -> Windows:
        """To or from the 22 joints, as `interpose.retarget` transfers a motion; as they are without a mapping."""
        if mapping is None:
            return self
        # All frames of all windows as one motion, which is many times faster than one by one.
        flat = Motion(self.skeleton, self.root.reshape(-1, 3), self.local.reshape(-1, len(self.skeleton), 4), self.rate)
        made = transfer(flat, mapping)
        local = made.local_rotations.reshape(*self.root.shape[:2], -1, 4)
        return Windows(made.skeleton, self.rate, made.root_positions.reshape(self.root.shape), local)


def joined(*parts: Windows) -> Windows:
    """Windows of one skeleton, one after the other in time."""
    root, local = (np.concatenate(arrays, axis=1) for arrays in zip(*(part.batch for part in parts), strict=True))
    return Windows(parts[0].skeleton, parts[0].rate, root, local)


def database_windows(database: Database, starts: Sequence[int], frames: int) -> Windows:
    """The windows of a prepared database that begin at those frames."""
    motions = [database.motion(start, start + frames) for start in starts]
    root = np.array([motion.root_positions for motion in motions]).reshape(-1, frames, 3)
    local = np.array([motion.local_rotations for motion in motions]).reshape(-1, frames, len(HUMANOID), 4)
    return Windows(HUMANOID, MODEL_RATE, root, local)


@dataclass(frozen=True, eq=False)
class Case:
    """Gaps of one length, one in each window.

    protocol, length: as tables name them. start, target: the frames of the keys. known: frames that may be used up to
    the start, which is the last of them. mapping: to the 22 joints, None where the windows are of these. scale: of L2P,
    the standard deviation of each global coordinate in metres.
    """

    protocol: str
    length: int
    windows: Windows
    start: int
    target: int
    known: int = 1
    mapping: Mapping | None = None
    scale: Float[ndarray, "joint 3"] | float = 1.0

    def __len__(self) -> int:
        return len(self.windows)

    @property
    def frames(self) -> int:
        """Frames to generate, between the keys."""
        return self.target - self.start - 1

    @cached_property
    def truth(self) -> Windows:
        """The recorded frames between the keys."""
        return self.windows.frames(slice(self.start + 1, self.target))

    @cached_property
    def humanoid(self) -> Windows:
        """The recorded motion from key to key on the 22 joints."""
        return self.windows.frames(slice(self.start, self.target + 1)).retargeted(to_humanoid, self.mapping)

    @cached_property
    def true_paths(self) -> list[Path]:
        """The path of the recorded root in each gap."""
        return [track_of(motion) for motion in self.humanoid.motions]

    @cached_property
    def gaps(self) -> list[Gap]:
        """The keys of each gap, from which paths and durations are predicted."""
        return [Gap(motion[0], motion[-1]) for motion in self.humanoid.motions]

    def take(self, rows: Sequence[int]) -> Case:
        """Some of the gaps, of which one may stand several times."""
        return replace(self, windows=self.windows.take(rows))

    def with_keys(self, made: Windows) -> Windows:
        """The frames between the keys, and the keys around them."""
        return joined(self.windows.frame(self.start), made, self.windows.frame(self.target))

    def positions(self, made: Windows, around: int = 0) -> Float[ndarray, "window frame joint 3"]:
        """Global positions from key to key, and of so many recorded frames before and after."""
        whole = self.windows.positions[:, self.start - around : self.target + 1 + around].copy()
        whole[:, around + 1 : around + 1 + self.frames] = made.positions
        return whole

    def toes(self, made: Windows) -> Float[ndarray, "window frame 2 3"]:
        """Global positions of the toes from key to key."""
        return self.positions(made)[:, :, [self.windows.skeleton.index(name) for name in TOE_NAMES]]


COMPARED: dict[str, Callable[[Case, Windows], Scores]] = {
    "L2P": lambda case, made: metrics.l2p(made.positions, case.truth.positions, case.scale),
    "L2Q": lambda case, made: metrics.l2q(made.rotations, case.truth.rotations),
    "L2Q_aligned": lambda case, made: metrics.l2q_aligned(made.rotations, case.truth.rotations),
    "NPSS": lambda case, made: metrics.npss(made.rotations, case.truth.rotations),
    "ADE": lambda case, made: metrics.ade(made.positions, case.truth.positions),
    "SLDE": lambda case, made: metrics.slde(made.positions, case.truth.positions),
    "jerk_ratio": lambda case, made: metrics.jerk_ratio(case.positions(made), case.positions(case.truth)),
}
"""Metrics that compare with the recorded motion."""
UNPAIRED: dict[str, Callable[[Case, Windows], Scores]] = {
    "foot_slide": lambda case, made: metrics.foot_slide(case.toes(made)),
    "foot_slide_speed": lambda case, made: metrics.foot_slide_speed(case.toes(made), case.windows.rate),
    "foot_slide_share": lambda case, made: metrics.foot_slide_share(case.toes(made), case.windows.rate),
    "arrival_position": lambda case, made: metrics.arrival_position(case.positions(made)),
    "key_acceleration": lambda case, made: metrics.key_acceleration(
        case.positions(made, 1), case.windows.rate, 1, case.frames + 2
    ),
    "seam_speed": lambda case, made: metrics.seam(case.positions(made))[0],
    "seam_acceleration": lambda case, made: metrics.seam(case.positions(made))[1],
}
"""Metrics of a motion by itself, so of the recorded one, too."""


def scores(case: Case, made: Windows, names: Sequence[str]) -> dict[str, Scores]:
    """The named metrics of the frames between the keys, on the data's skeleton."""
    return {name: (COMPARED | UNPAIRED)[name](case, made) for name in names}


def truth_scores(case: Case, names: Sequence[str]) -> dict[str, Scores]:
    """Those of the named metrics that the recorded motion has by itself."""
    return scores(case, case.truth, [name for name in names if name in UNPAIRED])


def check_lengths(lengths: Sequence[int], shortest: int, longest: int | None = None) -> None:
    """Raises InputError for lengths that a protocol does not have, and for none."""
    if not lengths or min(lengths) < shortest or (longest is not None and max(lengths) > longest):
        limits = f"{shortest} frames or more" if longest is None else f"{shortest} to {longest} frames"
        raise InputError(f"gaps have {limits}, got {', '.join(map(str, lengths)) or 'none'}")
