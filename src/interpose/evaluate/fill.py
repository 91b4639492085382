"""How every evaluation fills gaps: batches on any humanoid skeleton, by a method and a model, feet locked as in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget import Mapping, from_humanoid, map_skeleton, to_humanoid
from interpose.runtime import model_folder
from interpose.runtime.backends.backend import Abilities, Backend
from interpose.runtime.backends.registry import BACKENDS
from interpose.runtime.feet import lock
from interpose.runtime.gap_batch import Batch, Draw, GapBatch, Generated, batch_of
from interpose.runtime.methods import abilities_of, backend_of
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, continued
from interpose.skeleton import HUMANOID, Skeleton


@dataclass(frozen=True, eq=False)
class Contender:
    """What fills the gaps of a row of a table. context_frames: that it knows before a gap."""

    name: str
    backend: Backend
    model: Session | None = None
    context_frames: int = 1

    @property
    def abilities(self) -> Abilities:
        found = self.backend.abilities(self.model)
        assert found is not None
        return found


class BenchmarkInterp:
    """Interpolation in the exact form of LaFAN1's evaluation code: SLERP that keeps the start's sign and is linear,
    then normalised, where the cosine is above 0.99 (Harvey et al. 2020, section 5.3)."""

    name = "interp"
    summary = "interpolation, as LaFAN1's evaluation code has it"

    def abilities(self, model: Session | None) -> Abilities:
        return Abilities(longest_steps=None, any_rig=True)

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        t = np.arange(1, batch.longest + 1) / (batch.longest + 1)
        (root, local), (goal_root, goal_local) = batch.keys
        hips = root[:, None] + t[:, None] * (goal_root - root)[:, None]
        a, b = local[:, None], goal_local[:, None]
        cosine = np.sum(a * b, axis=-1)
        b = np.where(cosine[..., None] < 0.0, -b, b)
        cosine = np.minimum(np.abs(cosine), 1.0)
        linear = 1.0 - cosine < 0.01
        angle = np.arccos(np.where(linear, 0.0, cosine))
        t = t[:, None]
        of_a = np.where(linear, 1.0 - t, np.sin((1.0 - t) * angle) / np.sin(angle))
        of_b = np.where(linear, t, np.sin(t * angle) / np.sin(angle))
        q = of_a[..., None] * a + of_b[..., None] * b
        return Generated(hips, q / np.linalg.norm(q, axis=-1, keepdims=True), np.zeros((*hips.shape[:2], 4)))


class ZeroVelocity:
    """The start pose, held (Harvey et al. 2020, section 5.3)."""

    name = "zero-velocity"
    summary = "the start pose, held"

    def abilities(self, model: Session | None) -> Abilities:
        return Abilities(longest_steps=None, any_rig=True)

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        root, local = (np.repeat(x[:, None], batch.longest, axis=1) for x in batch.keys[0])
        return Generated(root, local, np.zeros((*root.shape[:2], 4)))


INTERP, ZERO_VELOCITY = (Contender(one.name, one, context_frames=10) for one in (BenchmarkInterp(), ZeroVelocity()))
BASELINES = {one.name: one for one in (INTERP, ZERO_VELOCITY)}


@dataclass(frozen=True)
class Carrier:
    """Windows carried between a data set's skeleton and the humanoid, all frames in one call."""

    skeleton: Skeleton
    rate: float
    mapping: Mapping

    @classmethod
    def of(cls, skeleton: Skeleton, rate: float) -> Carrier:
        """Of a data set. Raises InputError where its skeleton is no humanoid."""
        return cls(skeleton, rate, map_skeleton(skeleton))

    def onto(self, motion: Batch) -> Batch:
        """On the humanoid."""
        return self._carried(to_humanoid, self.skeleton, motion)

    def back(self, motion: Batch) -> Batch:
        """On the data set's skeleton."""
        return self._carried(from_humanoid, HUMANOID, motion)

    def _carried(self, across, source: Skeleton, motion: Batch) -> Batch:
        root, local = motion
        made = across(Motion(source, root.reshape(-1, 3), local.reshape(-1, len(source), 4), self.rate), self.mapping)
        return made.root_positions.reshape(root.shape), made.local_rotations.reshape(*root.shape[:2], -1, 4)


@dataclass(frozen=True, eq=False)
class FilledGaps:
    """The frames between the keys on the data's skeleton: with locked feet, and ``raw``, before that. chain_distance:
    as in `interpose.runtime.gap_batch.Generated`."""

    motion: Batch
    raw: Batch
    chain_distance: Float[ndarray, "window"] | None


def fill(
    contender: Contender,
    start: Batch,
    target: Batch,
    frames: int,
    *,
    carrier: Carrier | None = None,
    styles: Sequence[str | None] | str | None = None,
    paths: Sequence[Path | None] | None = None,
    draws: Sequence[Draw] | None = None,
    style_strength: float = 1.0,
) -> FilledGaps:
    """Fills gaps of ``frames`` frames from the last frames of ``start`` to the first ones of ``target``.

    carrier: to the humanoid and back, where the data is on another skeleton. Only the contender's own context frames of
    ``start`` are seen. The signs of the quaternions go on from the start key, as they do in the data; L2Q counts on it.
    """
    known = start[0][:, -contender.context_frames :], start[1][:, -contender.context_frames :]
    if contender.abilities.any_rig:
        made = contender.backend.generate(contender.model, batch_of(known, target, frames))
        motion = made.root, made.local
        return FilledGaps(motion, motion, None)
    keys = (known, target) if carrier is None else (carrier.onto(known), carrier.onto(target))
    batch = batch_of(*keys, frames, styles=styles, paths=paths, draws=draws, style_strength=style_strength)
    made = contender.backend.generate(contender.model, batch)

    def on_data(local: ndarray) -> Batch:
        root, local = (made.root, local) if carrier is None else carrier.back((made.root, local))
        return root, continued(start[1][:, -1], local)

    return FilledGaps(on_data(with_locked_feet(*keys, made)), on_data(made.local), made.chain_distance)


def with_locked_feet(start: Batch, target: Batch, made: Generated) -> Float[ndarray, "window frame 22 4"]:
    """The local rotations of generated frames with their feet locked, as in use; start and target on the humanoid."""
    root = np.concatenate([start[0][:, -1:], made.root, target[0][:, :1]], axis=1)
    local = np.concatenate([start[1][:, -1:], made.local, target[1][:, :1]], axis=1)
    return lock.plant_batch(root, local, np.pad(made.contacts, ((0, 0), (1, 1), (0, 0)), mode="edge"))[:, 1:-1]


def parse(
    texts: Sequence[str], *, model: str | None = None, context_frames: int = 1, reserved: Sequence[str] = ()
) -> list[Contender]:
    """Contenders as they are typed: a baseline, a METHOD, LABEL=MODEL by the model's own method, or METHOD=MODEL.

    model: serves a method that is named alone; where left out, the first installed model that was trained on LaFAN1's
    training subjects alone. reserved: labels that the tables use. Raises InputError for names that cannot be served,
    and for one that stands twice.
    """
    out = [_contender(text.strip(), model, context_frames, reserved) for text in texts]
    names = [one.name for one in out]
    if not names or len(set(names)) < len(names):
        raise InputError(f"--methods names each method once, got {', '.join(names) or 'none'}")
    return out


def _contender(text: str, model: str | None, context_frames: int, reserved: Sequence[str]) -> Contender:
    label, equals, name = text.partition("=")
    choices = f"{', '.join((*BASELINES, *(n for n in BACKENDS if n not in BASELINES)))}, or LABEL=MODEL"
    if not label or (equals and not name) or label in reserved or (equals and label in BASELINES):
        raise InputError(f"--methods {text}: choose {choices}")
    if label in BASELINES:
        return BASELINES[label]
    if not equals and label not in BACKENDS:
        raise InputError(f"--methods {text}: unknown method; choose {choices}")
    chosen = name if equals else model
    loaded = benchmark_model(label) if chosen is None else model_folder.load(chosen)
    method = label if label in BACKENDS else loaded.method
    abilities_of(method, loaded)
    return Contender(label, backend_of(method), loaded, context_frames)


def benchmark_model(method: str) -> Session:
    """The first installed model that serves a method and was trained on LaFAN1 alone, subjects 1 to 4.

    Raises InputError where there is none.
    """
    for folder in model_folder.installed():
        loaded = model_folder.load(folder)
        data = loaded.info.get("training_data", [])
        if (
            data
            and all(name.startswith("lafan1") for name in data)
            and backend_of(method).abilities(loaded) is not None
        ):
            return loaded
    raise InputError(f"no installed model that was trained on LaFAN1 serves '{method}'; name one as {method}=MODEL")
