"""The methods, models and galleries that the studio offers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from interpose.demo import poses
from interpose.errors import InputError
from interpose.gallery.store import Gallery
from interpose.runtime import model_folder
from interpose.runtime.backends.backend import backend_of
from interpose.runtime.backends.registry import BACKENDS
from interpose.runtime.inbetween import inbetween, mapping_of, suggest
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.studio.protocol import MethodInfo


@dataclass(frozen=True, eq=False)
class Offer:
    """The installed models, the default one first, and the gallery that the studio was started with."""

    models: tuple[Session, ...] = field(default_factory=lambda: tuple(map(model_folder.load, model_folder.installed())))
    gallery: Gallery | None = None
    gallery_name: str | None = None

    @cached_property
    def methods(self) -> list[MethodInfo]:
        """Each method with each model that serves it."""
        return [info for method in BACKENDS for model in (None, *self.models) if (info := _info(method, model))]

    def model_of(self, method: str, name: str | None) -> Session | None:
        """The model of this name, or the first one that serves the method. Raises InputError if there is none."""
        served = [info.model for info in self.methods if info.method == method]
        if not served:
            known = ", ".join(dict.fromkeys(info.method for info in self.methods))
            raise InputError(f"no installed model serves method '{method}'; choose one of {known}")
        if name is not None and name not in served:
            known = ", ".join(filter(None, served)) or "none"
            raise InputError(f"the model '{name}' is not installed for method '{method}'; choose one of {known}")
        return next((model for model in self.models if model.name == (name or served[0])), None)


def _info(method: str, model: Session | None) -> MethodInfo | None:
    """A method with a model, or None if the model does not serve it, or if it needs none."""
    backend = backend_of(method)
    abilities = backend.abilities(model)
    if abilities is None or (model is not None and backend.abilities(None) is not None):
        return None
    return MethodInfo(
        method=method,
        summary=backend.summary,
        model=None if model is None else model.name,
        licence=None if model is None else str(model.info["licence"]),
        styles=list(abilities.styles),
        paths=abilities.paths,
        gallery=model is not None and (model.path / "gallery.npz").exists(),
        partial_targets=abilities.partial_targets,
        variants=abilities.variants,
        longest_seconds=abilities.longest_seconds,
        any_rig=abilities.any_rig,
    )


def warm(offer: Offer) -> None:
    """Generates a short gap with the first model of each kind, so that networks and galleries are loaded in advance."""
    start, target = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 1.5))
    mapping = mapping_of(start)
    for model in {model.method: model for model in reversed(offer.models)}.values():
        request = Request(model.method, model)
        inbetween(start, target, 30, request, mapping=mapping)
        if request.trajectories is not None:
            suggest(start, target, request, mapping=mapping)
