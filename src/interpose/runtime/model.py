"""The library's model: a loaded model folder with the methods that a program calls."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy import ndarray

from interpose import parts, retarget
from interpose.drawn_path import path_file
from interpose.drawn_path.path_file import PathFile
from interpose.errors import InputError
from interpose.gallery.store import Gallery
from interpose.motion import Motion
from interpose.runtime import inbetween
from interpose.runtime.inbetween import Candidate
from interpose.runtime.model_folder import Session, load
from interpose.runtime.request import PATHS, Request, SuggestedDuration
from interpose.runtime.streaming.streams import Stream, Streams


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
        """Its `model.json`."""
        return self.session.info

    def inbetween(
        self,
        start: Motion,
        target: Motion,
        frames: int | None = None,
        *,
        method: str | None = None,
        style: str | None = None,
        speed: str | None = None,
        path: str | os.PathLike[str] | Sequence[Sequence[float]] | ndarray | None = None,
        variants: int = 1,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
        gallery: Gallery | None = None,
        control: float = 1.0,
        style_strength: float = 1.0,
        target_joints: str | None = None,
    ) -> list[Candidate]:
        """``variants`` candidates for the ``frames`` frames between ``start`` and ``target``, best first.

        Without ``frames`` the gallery suggests a duration, at ``speed`` (fast, medium or slow) where given. method: one
        that the model serves; its own where left out. path: None or "auto", "gallery", "straight", "none", a file that
        ends in .json (docs/paths.md), or points (x, z) on the ground in metres. style, style_strength, gallery,
        control: as in `interpose.runtime.request.Request`. target_joints: the parts of ``target`` that are given, such
        as "hips" or "left-hand,feet" (`interpose.parts.GROUPS`, joints of the 22, "ground"); the rest of it is free,
        and the whole pose that a candidate leads to is its ``target``.

        Any rig and rate; both poses share the rig. The last frame of ``start`` is the key, those before it are context.
        ``mapping``, of :func:`interpose.retarget.map_skeleton`, saves finding it again for every gap of a clip.
        Raises InputError for what cannot be served: an unknown style or joint, two rigs, fewer than one frame, frames
        and a speed together.
        """
        if variants < 1:
            raise InputError(f"variants must be 1 or more, got {variants}")
        named, drawn = _path(path)
        request = Request(
            method or self.session.method,
            self.session,
            style,
            style_strength,
            named,
            control,
            drawn,
            gallery,
            speed,
            seed,
            None if target_joints is None else parts.parse(target_joints),
        )
        return inbetween.inbetween(start, target, frames, request, variants=variants, mapping=mapping)

    def suggest(
        self, start: Motion, target: Motion, *, style: str | None = None, gallery: Gallery | None = None
    ) -> SuggestedDuration:
        """How many frames the gap between ``start`` and ``target`` should take, and the alternatives.

        Raises InputError where it is not known: no humanoid, no gallery, or too far apart for it.
        """
        request = Request(self.session.method, self.session, style, gallery=gallery)
        return inbetween.suggest(start, target, request)

    def stream(
        self,
        start: Motion,
        *,
        style: str | None = None,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
        plant: bool = False,
    ) -> Stream:
        """Motion one pose at a time from the last frame of ``start``; its target may change: see :class:`Stream`.

        ``plant``: hold feet where they stand. Raises InputError for a rig that is no humanoid, and an unknown style.
        """
        return Stream(self.session, start, style, seed, mapping, plant)

    def streams(
        self,
        starts: Sequence[Motion],
        *,
        styles: str | Sequence[str | None] | None = None,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
        plant: bool = False,
    ) -> Streams:
        """Characters of one rig, each as by :meth:`stream`, by one run of the network a frame: see :class:`Streams`.

        Their seeds are ``seed`` and those that follow. Raises InputError for no start, several rigs, a rig that is no
        humanoid, and an unknown style.
        """
        seeds = range(seed, seed + len(starts))
        return Streams(self.session, starts, styles, seeds, mapping, plant)


def _path(path: str | os.PathLike[str] | Sequence[Sequence[float]] | ndarray | None) -> tuple[str, PathFile | None]:
    """The path's name, and what was drawn."""
    if path is None or (isinstance(path, str) and path in PATHS):
        return path or "auto", None
    if isinstance(path, str | os.PathLike):
        name = os.fspath(path)
        return name, path_file.read(Path(name)) if name.lower().endswith(".json") else None
    return "drawn", path_file.of_points(path)


def load_model(name: str | os.PathLike[str] | None = None) -> Model:
    """The default model, an installed one by its name, or one from a folder; InputError where there is none."""
    return Model(load(name))
