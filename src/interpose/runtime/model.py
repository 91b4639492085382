"""The library's model: a loaded model folder with the methods that a program calls."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from interpose import retarget
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.runtime import inbetween
from interpose.runtime.inbetween import Candidate, Request
from interpose.runtime.session import Session, load
from interpose.runtime.stream import Stream


@dataclass(frozen=True, eq=False)
class Model:
    """A trained model, ready to run on the CPU."""

    session: Session

    @property
    def styles(self) -> tuple[str, ...]:
        """The style labels that it was trained with."""
        return self.session.styles

    @property
    def info(self) -> dict[str, Any]:
        """What its `model.json` says."""
        return self.session.info

    def inbetween(
        self,
        start: Motion,
        target: Motion,
        frames: int,
        *,
        style: str | None = None,
        speed: str | None = None,
        path: str | None = None,
        variants: int = 1,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
    ) -> list[Candidate]:
        """``variants`` candidates for the ``frames`` frames between ``start`` and ``target``, best first.

        Any rig and rate; both poses share the rig. The last frame of ``start`` is the key, those before it are context.
        ``mapping``, of :func:`interpose.retarget.plan`, saves the time to find it again for every gap of a clip.
        Raises InputError for what cannot be served: an unknown style, two rigs, fewer than one frame.
        """
        if speed is not None:
            raise InputError(f"speed '{speed}' cannot be asked for yet; it needs the gallery of trajectories")
        if variants < 1:
            raise InputError(f"variants must be 1 or more, got {variants}")
        request = Request(self.session.method, self.session, style, path or "auto", seed)
        return inbetween.inbetween(start, target, frames, request, variants=variants, mapping=mapping)

    def stream(
        self,
        start: Motion,
        *,
        style: str | None = None,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
    ) -> Stream:
        """Motion one pose at a time from the last frame of ``start``; its target may change: see :class:`Stream`.

        Raises InputError for a rig that is no humanoid, and for an unknown style.
        """
        return Stream(self.session, start, style, seed, mapping)


def load_model(name: str | os.PathLike[str] | None = None) -> Model:
    """The default model, an installed one by its name, or one from a folder; InputError where there is none."""
    return Model(load(name))
