"""Options that several commands share, and how their help is written."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

from tyro.conf import arg

from interpose.io.registry import WRITERS, listed
from interpose.runtime.backends.registry import BACKENDS


def unset(metavar: str, **more: Any) -> Any:
    """An option whose help text itself says what happens when it is left out, in place of "(default: None)"."""
    return arg(metavar=metavar, help_behavior_hint="", **more)


OutFile = Annotated[
    str,
    arg(
        aliases=["-o"],
        metavar="OUT.bvh",
        help=f"The file to write, {listed(WRITERS)}. With several variants: OUT-1, OUT-2, …, best first.",
    ),
]
OutFolder = Annotated[str, arg(aliases=["-o"], metavar="DIR")]


@dataclass(frozen=True)
class Options:
    """How the gaps are filled, and where to."""

    out: OutFile
    method: Annotated[str | None, unset("|".join(BACKENDS))] = None
    """How gaps are filled; the method of --model where left out, dcmoe where no model is named either."""
    model: Annotated[str | None, unset("NAME|DIR")] = None
    """An installed model (see `interpose models`) or a model's folder; the method's default model where left out."""
    style: Annotated[str | None, unset("NAME")] = None
    """One of the model's styles, in any case, or a blend, as Angry+Drunk or Angry:0.7+Drunk:0.3; free where left out,
    and then further variants of dcmoe and plan take styles in turn."""
    style_strength: Annotated[float, arg(metavar="S")] = 1.0
    """Strength of the style: 0 is as good as free, 1 as trained, up to 3 exaggerated."""
    path: Annotated[str, arg(metavar="auto|gallery|straight|none|FILE.json")] = "auto"
    """The root path. auto: no path constraint for the likeliest variant; with dcmoe and plan every second further
    variant, and any gap over 3 s, follows a trajectory of the gallery. gallery: every variant follows one. straight: a
    straight line. none: no path constraint. FILE.json: a path that you drew."""
    path_control: Annotated[float, arg(metavar="W")] = 1.0
    """Weight of the path against the predicted root, 0 to 1."""
    gallery: Annotated[str | None, unset("DIR")] = None
    """A gallery from `interpose gallery build`, in place of the model's own; --path auto then means gallery."""
    speed: Annotated[str | None, unset("fast|medium|slow")] = None
    """How long a gap takes, in place of a number of frames; `fill` needs --retime for it."""
    variants: Annotated[int, arg(metavar="N")] = 1
    """Number of variants."""
    seed: Annotated[int, arg(metavar="S")] = 0
    """Random seed; the same seed gives the same motion."""
    force: bool = False
    """Overwrite OUT even where it is one of the inputs."""
    json: bool = False
    """Print one JSON object for each gap of each variant on standard output."""
