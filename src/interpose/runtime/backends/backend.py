"""What a method is to the rest of the program: what it can do with a model, and how it fills gaps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from interpose.features import RATE
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
