"""What is asked of a gap, and what is told of a transition."""

from __future__ import annotations

from dataclasses import dataclass

from interpose.drawn_path.path_file import PathFile
from interpose.errors import InputError
from interpose.gallery.speeds import SPEEDS
from interpose.gallery.store import Gallery
from interpose.parts import Parts
from interpose.runtime import style_blend
from interpose.runtime.model_folder import Session

METHODS = ("dcmoe", "stitch", "stitch+detail", "interp")
PATHS = ("auto", "straight", "none")
"""What a path may be beside one that is drawn."""
STRONGEST = 3.0
"""The most that a style can be exaggerated."""


@dataclass(frozen=True, eq=False)
class Request:
    """What is asked of every gap. Raises InputError where it cannot be had.

    session: the model; needed by every method but interp. style: one of the model's, or a blend of them (`blends`), or
    None to leave it free. path: auto (matched from the gallery), straight, none (the network's own), or a name for
    ``lines``. lines: what was drawn.
    speed: fast, medium or slow, where no number of frames is given. gallery: in place of the model's own.
    control: how much a path counts beside the root that the network foresees, 0 to 1. strength: of the style, from 0,
    as good as free, over 1, as trained, to 3, exaggerated. parts: of the target that are given; None for all of it.
    """

    method: str = "dcmoe"
    session: Session | None = None
    style: str | None = None
    path: str = "auto"
    seed: int = 0
    speed: str | None = None
    lines: PathFile | None = None
    gallery: Gallery | None = None
    control: float = 1.0
    strength: float = 1.0
    parts: Parts | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"unknown method '{self.method}'; there are {', '.join(METHODS)}")
        if self.lines is None and self.path not in PATHS:
            raise InputError(f"unknown path '{self.path}'; use {', '.join(PATHS)}, or a file that ends in .json")
        if self.speed is not None and self.speed not in SPEEDS:
            raise InputError(f"unknown speed '{self.speed}'; there are {', '.join(SPEEDS)}")
        if not 0.0 <= self.control <= 1.0:
            raise InputError(f"the path's control must be 0 to 1, got {self.control}")
        if self.seed < 0:
            raise InputError(f"the seed must be 0 or more, got {self.seed}")
        if not 0.0 <= self.strength <= STRONGEST:
            raise InputError(f"the style's strength must be 0 to {STRONGEST:g}, got {self.strength}")
        if self.method == "interp":
            if self.style is not None:
                raise InputError(
                    f"interpolation has no styles; leave out style '{self.style}', or choose dcmoe or stitch"
                )
            if self.path != "auto":
                raise InputError(
                    f"interpolation follows no path; leave out path '{self.path}', or choose dcmoe or stitch"
                )
        elif self.session is None:
            raise InputError(f"method '{self.method}' needs a model")
        if self.strength != 1.0 and (self.method == "interp" or self.session is None or not self.session.styles):
            raise InputError(
                f"a style's strength of {self.strength:g} needs a model with styles; choose dcmoe or stitch"
            )
        if self.style is not None and self.session is not None:
            style_blend.check(self.style, self.session.styles, self.session.name)

    @property
    def trajectories(self) -> Gallery | None:
        """The gallery to match from: the one given, the model's own, or None."""
        return self.gallery if self.gallery is not None or self.session is None else self.session.gallery


@dataclass(frozen=True)
class Alternative:
    """A duration that the gallery knows for a gap. fit: the share of all candidates, by weight, of that speed."""

    speed: str
    frames: int
    fit: float


@dataclass(frozen=True)
class Suggested:
    """How many frames a gap should take, and what fast, medium and slow would be."""

    frames: int
    alternatives: tuple[Alternative, ...]


@dataclass(frozen=True)
class Info:
    """What is told of one transition; the fields are those of `--json`.

    start, target: the keys, as frames of the clip or as they were named. foot_slide_cm_per_frame: of the delivered
    motion with its keys, by :func:`foot_slide`; None where the rig's feet are not known. seconds: wall time of the gap,
    all variants together. fallback: None, or what could not be served as asked, why, and what served instead.
    speed: as asked for. trajectory: where the root's path is from: matched, composed, drawn, straight, model, or None
    where it is interpolated. path_deviation_m: the root's mean distance from that path on the ground, None without
    one. fit: of a matched path, 0 to 1. suggested: where no number of frames was given. style_strength, target_joints:
    as asked for; where only some joints of the target were given the arrival errors are theirs.
    """

    start: int | str
    target: int | str
    frames: int
    method: str
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
    suggested: Suggested | None = None
    style_strength: float = 1.0
    target_joints: str | None = None
