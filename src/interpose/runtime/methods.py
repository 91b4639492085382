"""Methods and models brought together: which model serves which method, and what the two can do."""

from __future__ import annotations

import os
from functools import cache
from importlib import import_module

from interpose.errors import InputError
from interpose.runtime import model_folder
from interpose.runtime.backends.backend import Abilities, Backend
from interpose.runtime.backends.registry import BACKENDS, DEFAULT_METHOD
from interpose.runtime.model_folder import Session


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
