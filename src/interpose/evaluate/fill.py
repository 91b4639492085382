"""How every evaluation fills the gaps of a case: methods with models, LaFAN1's baselines, feet locked as in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.evaluate.case import Case, Windows, joined
from interpose.retarget import from_humanoid, to_humanoid
from interpose.runtime import guidance, model_folder
from interpose.runtime.backends.backend import Abilities, Backend, abilities_of, backend_of
from interpose.runtime.backends.interp import InterpBackend
from interpose.runtime.backends.registry import BACKENDS
from interpose.runtime.feet import lock
from interpose.runtime.gap_batch import GapBatch, Generated, batch_of
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, continued
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID


@dataclass(frozen=True, eq=False)
class Contender:
    """What fills the gaps of a row of a table. context_frames: that it takes, the start key included."""

    name: str
    backend: Backend
    model: Session | None = None
    context_frames: int = 1

    @property
    def abilities(self) -> Abilities:
        found = self.backend.abilities(self.model)
        assert found is not None
        return found


class BenchmarkInterp(InterpBackend):
    """Interpolation in the exact form of LaFAN1's evaluation code: SLERP that keeps the start's sign and is linear,
    then normalised, where the cosine is above 0.99 (Harvey et al. 2020, section 5.3)."""

    summary = "interpolation, as LaFAN1's evaluation code has it"

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


class ZeroVelocity(InterpBackend):
    """The start pose, held (Harvey et al. 2020, section 5.3)."""

    name = "zero-velocity"
    summary = "the start pose, held"

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        root, local = (np.repeat(x[:, None], batch.longest, axis=1) for x in batch.keys[0])
        return Generated(root, local, np.zeros((*root.shape[:2], 4)))


INTERP, ZERO_VELOCITY = (Contender(one.name, one, context_frames=10) for one in (BenchmarkInterp(), ZeroVelocity()))
BASELINES = {one.name: one for one in (INTERP, ZERO_VELOCITY)}


@dataclass(frozen=True, eq=False)
class FilledGaps:
    """The frames between the keys on the data's skeleton: with locked feet, and ``raw``, before that.

    chain_distance: as in `interpose.runtime.gap_batch.Generated`.
    """

    motion: Windows
    raw: Windows
    chain_distance: Float[ndarray, "window"] | None = None


def fill(
    case: Case,
    contender: Contender,
    *,
    seed: int | None = None,
    paths: Sequence[Path | None] | None = None,
    styles: Sequence[str | None] | None = None,
    style_strength: float = 1.0,
) -> FilledGaps:
    """Fills every gap of a case from the contender's own number of known frames.

    seed: of a sample of each gap; the likeliest motion where left out. paths, styles: of each gap, None for no
    constraint. The signs of the quaternions continue from the start key, as they do in the data, since L2Q counts on
    it.
    """
    windows, frames = case.windows, case.frames
    known = windows.frames(slice(case.start + 1 - min(contender.context_frames, case.known), case.start + 1))
    target = windows.frame(case.target)
    if contender.abilities.any_rig:
        made = contender.backend.generate(contender.model, batch_of(known.batch, target.batch, frames))
        motion = Windows(windows.skeleton, windows.rate, made.root, made.local)
        return FilledGaps(motion, motion)
    keys = [known.retargeted(to_humanoid, case.mapping), target.retargeted(to_humanoid, case.mapping)]
    draws = None if seed is None else [(seed, row) for row in range(len(case))]
    batch = batch_of(
        keys[0].batch, keys[1].batch, frames, styles=styles, paths=paths, draws=draws, style_strength=style_strength
    )
    made = contender.backend.generate(contender.model, batch)
    raw = Windows(HUMANOID, windows.rate, made.root, made.local)

    def on_data(motion: Windows) -> Windows:
        motion = motion.retargeted(from_humanoid, case.mapping)
        return replace(motion, local=continued(known.local[:, -1], motion.local))

    locked = with_locked_feet(keys[0], raw, keys[1], made)
    return FilledGaps(on_data(locked), on_data(raw), made.chain_distance)


def with_locked_feet(known: Windows, raw: Windows, target: Windows, made: Generated) -> Windows:
    """Generated frames with locked feet, all on the 22 joints."""
    whole = joined(known.frame(-1), raw, target)
    contacts = np.pad(made.contacts, ((0, 0), (1, 1), (0, 0)), mode="edge")
    return replace(raw, local=lock.plant_batch(whole.root, whole.local, contacts)[:, 1:-1])


def guided_paths(case: Case, request: Request) -> list[Path | None]:
    """The path that a request takes in each gap, for the true duration."""
    return [guidance.guide(request, gap, case.frames + 1, 1)[0].path for gap in case.gaps]


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
        alone = data and all(name.startswith("lafan1") for name in data)
        if alone and backend_of(method).abilities(loaded) is not None:
            return loaded
    raise InputError(f"no installed model that was trained on LaFAN1 serves '{method}'; name one as {method}=MODEL")
