"""What a method is to the rest of the program: what it can do, alone or with a model, and how it fills gaps."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Protocol, runtime_checkable

from interpose.errors import InputError
from interpose.features import RATE
from interpose.runtime import model_folder
from interpose.runtime.backends.registry import BACKENDS, DEFAULT_METHOD
from interpose.runtime.gap_batch import GapBatch, Generated
from interpose.runtime.model_folder import Session

LONGEST_GAP_STEPS = 601
"""Steps from start to target at most, of any trained method: 600 frames at 30 Hz, 20 s."""


@dataclass(frozen=True)
class Abilities:
    """What a method can do with a model; what it cannot is refused, never ignored.

    styles: labels that can be requested, each at any strength. paths: the root can follow a path. partial_targets: a
    network completes a target of which only some joints are given; otherwise the start pose is carried along. variants:
    several candidates of one gap differ. latent_variants: they do so by their latents alone; otherwise further variants
    also take other styles and trajectories of the gallery, and long gaps are matched from it. longest_steps: from start
    to target, None for no limit. any_rig: :meth:`Backend.generate` takes poses of any skeleton.
    """

    styles: tuple[str, ...] = ()
    paths: bool = False
    partial_targets: bool = False
    variants: bool = False
    latent_variants: bool = False
    longest_steps: int | None = LONGEST_GAP_STEPS
    any_rig: bool = False

    @property
    def longest_seconds(self) -> float | None:
        """The longest gap in seconds."""
        return None if self.longest_steps is None else (self.longest_steps - 1) / RATE


@runtime_checkable
class Backend(Protocol):
    """A method. name: as commands and files have it. summary: one phrase for help texts."""

    @property
    def name(self) -> str: ...
    @property
    def summary(self) -> str: ...

    def abilities(self, model: Session | None) -> Abilities | None:
        """What it can do with a model, None for no model; None where that does not serve it."""
        ...

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        """The frames between the keys of each gap. Raises InputError for an unknown style."""
        ...


def trained(model: Session, *, latent_variants: bool = False, longest_steps: int = LONGEST_GAP_STEPS) -> Abilities:
    """What every trained method can do with a model of its own."""
    return Abilities(model.styles, True, model.completes, True, latent_variants, longest_steps)


def backend_of(method: str) -> Backend:
    """A method by its name. Raises InputError where there is none."""
    if method not in BACKENDS:
        raise InputError(f"unknown method '{method}'; choose one of {', '.join(BACKENDS)}")
    return _imported(BACKENDS[method])


@cache
def _imported(place: str) -> Backend:
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def needs_model(method: str) -> bool:
    """Whether a method works with a model only."""
    return backend_of(method).abilities(None) is None


def methods_of(model: Session) -> tuple[str, ...]:
    """The methods that need a model and that this one serves, its own first."""
    served = [name for name in BACKENDS if needs_model(name) and backend_of(name).abilities(model) is not None]
    return tuple(sorted(served, key=lambda name: name != model.method))


def abilities_of(method: str, model: Session | None) -> Abilities:
    """What a method can do with a model. Raises InputError where the model does not serve it."""
    found = backend_of(method).abilities(model)
    if found is None:
        if model is None:
            raise InputError(f"method '{method}' needs a model")
        served = " and ".join(methods_of(model)) or "no method of this version"
        raise InputError(
            f"the model '{model.name}' serves {served}, not '{method}'; leave out the method or choose another model"
        )
    return found


def choose(method: str | None, model: str | os.PathLike[str] | None) -> tuple[str, Session | None]:
    """The method and the model to use where one of them, or both, are left out: a model's own method, a method's first
    installed model. Raises InputError where they do not go together, and where no installed model serves a method."""
    if model is not None:
        loaded = model_folder.load(model)
        chosen = method or loaded.method
        abilities_of(chosen, loaded)
        return chosen, loaded
    chosen = method or DEFAULT_METHOD
    if not needs_model(chosen):
        return chosen, None
    for folder in model_folder.installed():
        loaded = model_folder.load(folder)
        if backend_of(chosen).abilities(loaded) is not None:
            return chosen, loaded
    raise InputError(f"no installed model serves method '{chosen}'; name a model that does")
