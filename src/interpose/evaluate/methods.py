"""In-betweening methods as functions of batched windows, on the data set's own skeleton, in metres.

``interp`` and ``zero-velocity`` are the two baselines of Harvey et al. 2020, section 5.3, in the exact form of
LaFAN1's evaluation code. :func:`from_model` makes a method of a model folder.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.evaluate.lafan1 import PAST
from interpose.motion import Motion
from interpose.retarget import Mapping, from_humanoid, map_skeleton, to_humanoid
from interpose.skeleton import HUMANOID, Skeleton

Generate = Callable[[ndarray, ndarray, ndarray, ndarray, int], tuple[ndarray, ndarray]]
"""``(context_root (window, context, 3), context_local (window, context, joint, 4), target_root (window, 3),
target_local (window, joint, 4), frames) -> (root (window, frames, 3), local (window, frames, joint, 4))``.

The last context frame is the start key. The signs of the quaternions that come back go on from it, as they do in the
clips; L2Q counts on it.
"""


Batch = tuple[ndarray, ndarray]
"""Roots (window, frame, 3) and local rotations (window, frame, joint, 4)."""


@dataclass(frozen=True)
class Method:
    """A name for the tables, what generates the frames between, and how many frames it knows before them."""

    name: str
    generate: Generate
    context_frames: int = PAST


def _interp(
    context_root: Float[ndarray, "window context 3"],
    context_local: Float[ndarray, "window context joint 4"],
    target_root: Float[ndarray, "window 3"],
    target_local: Float[ndarray, "window joint 4"],
    frames: int,
) -> tuple[Float[ndarray, "window frame 3"], Float[ndarray, "window frame joint 4"]]:
    t = np.arange(1, frames + 1) / (frames + 1)
    start = context_root[:, -1:]
    root = start + t[:, None] * (target_root[:, None] - start)
    return root, _slerp(context_local[:, -1][:, None], target_local[:, None], t[:, None])


def _slerp(
    a: Float[ndarray, "*#batch 4"], b: Float[ndarray, "*#batch 4"], t: Float[ndarray, "*#batch"]
) -> Float[ndarray, "*batch 4"]:
    """SLERP that keeps the sign of ``a`` and is linear, then normalised, where the cosine is above 0.99."""
    cosine = np.sum(a * b, axis=-1)
    b = np.where(cosine[..., None] < 0.0, -b, b)
    cosine = np.minimum(np.abs(cosine), 1.0)
    linear = 1.0 - cosine < 0.01
    angle = np.arccos(np.where(linear, 0.0, cosine))
    of_a = np.where(linear, 1.0 - t, np.sin((1.0 - t) * angle) / np.sin(angle))
    of_b = np.where(linear, t, np.sin(t * angle) / np.sin(angle))
    q = of_a[..., None] * a + of_b[..., None] * b
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def _zero_velocity(
    context_root: Float[ndarray, "window context 3"],
    context_local: Float[ndarray, "window context joint 4"],
    target_root: Float[ndarray, "window 3"],
    target_local: Float[ndarray, "window joint 4"],
    frames: int,
) -> tuple[Float[ndarray, "window frame 3"], Float[ndarray, "window frame joint 4"]]:
    return np.repeat(context_root[:, -1:], frames, axis=1), np.repeat(context_local[:, -1:], frames, axis=1)


INTERP = Method("interp", _interp)
"""The root on a straight line, the local rotations by SLERP, frame k of n at k / (n + 1)."""
ZERO_VELOCITY = Method("zero-velocity", _zero_velocity)
"""The start pose, held."""


@dataclass(frozen=True)
class Carrier:
    """Windows carried between a data set's skeleton and the humanoid, all frames in one call."""

    skeleton: Skeleton
    rate: float
    mapping: Mapping

    def onto(self, root: Float[ndarray, "window frame 3"], local: Float[ndarray, "window frame joint 4"]) -> Batch:
        """On the humanoid."""
        return self._carried(to_humanoid, self.skeleton, root, local)

    def back(self, root: Float[ndarray, "window frame 3"], local: Float[ndarray, "window frame 22 4"]) -> Batch:
        """On the data set's skeleton."""
        return self._carried(from_humanoid, HUMANOID, root, local)

    def _carried(
        self, across: Callable[[Motion, Mapping], Motion], source: Skeleton, root: ndarray, local: ndarray
    ) -> Batch:
        made = across(Motion(source, root.reshape(-1, 3), local.reshape(-1, len(source), 4), self.rate), self.mapping)
        return made.root_positions.reshape(root.shape), made.local_rotations.reshape(*root.shape[:2], -1, 4)


def from_model(
    name: str,
    model: str | None,
    skeleton: Skeleton,
    rate: float,
    *,
    context_frames: int = 1,
    style: str | None = None,
    seed: int = 0,
) -> Method:
    """The method of a model on another skeleton: retargeted to the humanoid on the way in and back on the way out.

    model: an installed model's name, its folder, or None for the default one. Raises InputError where it cannot be
    loaded, or where the skeleton is no humanoid.
    """
    from interpose.runtime import methods, model_folder, poses

    loaded = model_folder.load(model)
    carrier = Carrier(skeleton, rate, map_skeleton(skeleton))

    def generate(
        context_root: Float[ndarray, "window context 3"],
        context_local: Float[ndarray, "window context joint 4"],
        target_root: Float[ndarray, "window 3"],
        target_local: Float[ndarray, "window joint 4"],
        frames: int,
    ) -> Batch:
        start = carrier.onto(context_root, context_local)
        end = carrier.onto(target_root[:, None], target_local[:, None])
        made_root, made_local, contacts = methods.generate_batch(
            loaded, *start, end[0][:, 0], end[1][:, 0], frames, style=[style] * len(context_root), seed=seed
        )
        root, local = carrier.back(made_root, planted(start, end, made_root, made_local, contacts))
        return root, poses.continued(context_local[:, -1], local)

    return Method(name, generate, context_frames)


@dataclass(frozen=True, eq=False)
class Samples:
    """What a method drew for each window. motions: the likeliest first, then the samples, feet locked. raw: the
    likeliest before that. apart: how far its chains' joints are apart in the middle, metres."""

    motions: list[Batch]
    raw: Batch
    apart: Float[ndarray, "window"]


@dataclass(frozen=True)
class Drawn:
    """A method that draws: a name for the tables, and what gives so many samples of each window."""

    name: str
    draw: Callable[[ndarray, ndarray, ndarray, ndarray, int, int], Samples]


def drawing(name: str, model: str, skeleton: Skeleton, rate: float, *, seed: int = 0) -> Drawn:
    """The method of a stitching model on another skeleton, as :func:`from_model`, with samples.

    A ``name`` that ends in ``+detail`` refines what it makes. Raises InputError where the model cannot.
    """
    from interpose.runtime import model_folder, poses
    from interpose.runtime.backends import stitch

    loaded = model_folder.load(model)
    if name.endswith("+detail") and "stitch+detail" not in loaded.methods:
        raise InputError(f"the model '{loaded.name}' has no detail transformer; leave out +detail")
    loaded = loaded.serving(name)
    carrier = Carrier(skeleton, rate, map_skeleton(skeleton))

    def draw(
        context_root: ndarray,
        context_local: ndarray,
        target_root: ndarray,
        target_local: ndarray,
        frames: int,
        count: int,
    ) -> Samples:
        start = carrier.onto(context_root, context_local)
        end = carrier.onto(target_root[:, None], target_local[:, None])
        keys = *start, end[0][:, 0], end[1][:, 0]
        (root, local, contacts), apart = stitch.stitch(loaded, *keys, frames)

        def finished(root: ndarray, local: ndarray) -> Batch:
            root, local = carrier.back(root, local)
            return root, poses.continued(context_local[:, -1], local)

        motions = [finished(root, planted(start, end, root, local, contacts))]
        for number in range(count):
            made, _ = stitch.stitch(loaded, *keys, frames, seed=1 + seed * count + number, vary=True)
            motions.append(finished(made[0], planted(start, end, *made)))
        return Samples(motions, finished(root, local), apart)

    return Drawn(name, draw)


def planted(
    start: tuple[ndarray, ndarray],
    end: tuple[ndarray, ndarray],
    root: Float[ndarray, "window frame 3"],
    local: Float[ndarray, "window frame 22 4"],
    contacts: Float[ndarray, "window frame 4"],
) -> Float[ndarray, "window frame 22 4"]:
    """The local rotations of a roll-out with its feet planted, as in use. ``start``, ``end``: root positions and local
    rotations (window, frame, ...) of the known frames, whose last and whose first are the keys."""
    from interpose.runtime.feet import lock

    whole_root = np.concatenate([start[0][:, -1:], root, end[0][:, :1]], axis=1)
    whole_local = np.concatenate([start[1][:, -1:], local, end[1][:, :1]], axis=1)
    return lock.plant_batch(whole_root, whole_local, np.pad(contacts, ((0, 0), (1, 1), (0, 0)), mode="edge"))[:, 1:-1]
