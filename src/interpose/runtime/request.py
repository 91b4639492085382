"""A request for a gap, which travels whole from command, library and studio, and what is known of the result."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from interpose.drawn_path.path_file import PathFile
from interpose.errors import InputError
from interpose.gallery.speeds import SPEEDS
from interpose.gallery.store import Gallery
from interpose.parts import Parts
from interpose.runtime import style_blend
from interpose.runtime.backends.backend import Abilities, Backend, abilities_of, backend_of
from interpose.runtime.backends.registry import DEFAULT_METHOD
from interpose.runtime.model_folder import Session

PATHS = ("auto", "gallery", "straight", "none")
"""What a path may be beside one that is drawn."""
MAX_STYLE_STRENGTH = 3.0


@dataclass(frozen=True, eq=False)
class Request:
    """How every gap is to be filled. What the method and the model cannot do is refused with InputError, never ignored.

    method: a name of `interpose.runtime.backends.registry`. model: that serves it; None where it needs none. style: one
    of the model's in any case, or a blend (`style_blend`), or None to leave it free. style_strength: from 0, as good as
    free, over 1, as trained, to 3, exaggerated. path: of the root. auto leaves the likeliest candidate unconstrained
    (see `guidance`), gallery matches a trajectory, straight is a straight line, none leaves all candidates
    unconstrained; with ``drawn``, its name. path_control: weight of the path against the predicted root, 0 to 1.
    gallery: in place of the model's own; path auto then means gallery. speed: fast, medium or slow, where no number of
    frames is given. parts: of the target that are given; None for all.
    """

    method: str = DEFAULT_METHOD
    model: Session | None = None
    style: str | None = None
    style_strength: float = 1.0
    path: str = "auto"
    path_control: float = 1.0
    drawn: PathFile | None = None
    gallery: Gallery | None = None
    speed: str | None = None
    seed: int = 0
    parts: Parts | None = None

    def __post_init__(self) -> None:
        abilities = self.abilities
        if self.drawn is None and self.path not in PATHS:
            raise InputError(f"unknown path '{self.path}'; use {', '.join(PATHS)}, or a file that ends in .json")
        if self.speed is not None and self.speed not in SPEEDS:
            raise InputError(f"unknown speed '{self.speed}'; there are {', '.join(SPEEDS)}")
        if not 0.0 <= self.path_control <= 1.0:
            raise InputError(f"the path's control must be 0 to 1, got {self.path_control}")
        if self.seed < 0:
            raise InputError(f"the seed must be 0 or more, got {self.seed}")
        if not 0.0 <= self.style_strength <= MAX_STYLE_STRENGTH:
            raise InputError(f"the style's strength must be 0 to {MAX_STYLE_STRENGTH:g}, got {self.style_strength}")
        if not abilities.paths and (self.path != "auto" or self.path_control != 1.0):
            raise InputError(f"method '{self.method}' follows no path; leave it out, or choose another method")
        if self.gallery is not None and self.path == "auto" and abilities.paths:
            object.__setattr__(self, "path", "gallery")
        if self.path == "gallery" and self.trajectories is None:
            raise InputError("there is no gallery to match a path from; give one, or another path")
        if self.style is not None:
            if not abilities.styles:
                raise InputError(f"method '{self.method}' has no styles here; leave out style '{self.style}'")
            assert self.model is not None
            object.__setattr__(self, "style", style_blend.spelled(self.style, abilities.styles, self.model.name))
        if self.style_strength != 1.0 and not abilities.styles:
            raise InputError(f"a style strength of {self.style_strength:g} needs a method and a model with styles")

    @property
    def backend(self) -> Backend:
        return backend_of(self.method)

    @cached_property
    def abilities(self) -> Abilities:
        """What the method can do with the model. Raises InputError where they do not go together."""
        return abilities_of(self.method, self.model)

    @property
    def matched_style(self) -> str | None:
        """The style to match trajectories in: the one that the request has most of, None where the gallery lacks it."""
        leading, gallery = style_blend.leading(self.style), self.trajectories
        return leading if gallery is not None and leading in gallery.styles else None

    @property
    def trajectories(self) -> Gallery | None:
        """The gallery to match from: the one given, the model's own, or None."""
        return self.gallery if self.gallery is not None or self.model is None else self.model.gallery


@dataclass(frozen=True)
class SpeedOption:
    """A duration that the gallery suggests for a gap. fit: the share of all candidates, by weight, of that speed."""

    speed: str
    frames: int
    fit: float


@dataclass(frozen=True)
class SuggestedDuration:
    """How many frames a gap should take, and what fast, medium and slow would be."""

    frames: int
    alternatives: tuple[SpeedOption, ...]


@dataclass(frozen=True)
class Info:
    """Of one transition; the fields are those of `--json`.

    start, target: the keys, as frames of the clip or as they were named. method, model: that served. path: as
    requested. trajectory: where the root's path is from: matched, composed, drawn, straight, model where it is
    unconstrained, or None where it is interpolated. path_deviation_m: the root's mean distance from that path on the
    ground, None without one. fit: of a matched path, 0 to 1. foot_slide_cm_per_frame: of the delivered motion with its
    keys, per 30 Hz frame; None where the rig's feet are not known. seconds: wall time of the gap, all variants
    together. fallback: None, or what could not be served as requested, why, and what served instead. speed,
    style_strength, target_joints: as requested; where only some joints of the target were given the arrival errors are
    theirs. suggested: where no number of frames was given. confidence: 0 to 1, how far the model knows such a gap,
    None where that is not known. warnings: sentences on what is doubtful in the result.
    """

    start: int | str
    target: int | str
    frames: int
    method: str
    model: str | None
    style: str | None
    path: str
    seed: int
    arrival_position_error_m: float
    arrival_rotation_error_deg: float
    foot_slide_cm_per_frame: float | None
    seconds: float
    fallback: str | None
    speed: str | None = None
    trajectory: str | None = None
    path_deviation_m: float | None = None
    fit: float | None = None
    suggested: SuggestedDuration | None = None
    style_strength: float = 1.0
    target_joints: str | None = None
    confidence: float | None = None
    warnings: tuple[str, ...] = ()
