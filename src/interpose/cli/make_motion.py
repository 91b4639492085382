"""The commands that make motion; the modules beside do the work, imported when a command runs."""

from __future__ import annotations

import sys
from typing import Annotated

from tyro.conf import OmitArgPrefixes, Positional, arg

from interpose.cli.options import Options, OutFolder, unset
from interpose.io.registry import readable


def demo(out: OutFolder = "interpose-demo") -> int:
    """Fill sample key poses with the default model: BVH, GLB and a contact sheet each, and a table.

    Args:
        out: The folder to write to.
    """
    from interpose.demo.run import show

    return show(out)


def info(
    files: Annotated[
        Positional[tuple[str, ...]],
        arg(
            metavar="FILE",
            help=f"The files: {readable()}. One that cannot be read is reported, the others are still shown.",
            help_behavior_hint="(required)",
        ),
    ],
    /,
    json: bool = False,
) -> int:
    """Describe motion files and how their joints map to the 22 joints of the models.

    Args:
        json: Print one JSON object for each file on standard output.
    """
    from interpose.cli import inspect

    return inspect.info(files, json) if files else nothing("info", "FILE")


def fill(
    clip: Annotated[Positional[str], arg(metavar="CLIP", help=f"The clip: {readable()}.")],
    /,
    keys: Annotated[str, arg(metavar="0,45,90-99")],
    generation: OmitArgPrefixes[Options],
    retime: bool = False,
) -> int:
    """Keep the key frames of a clip and regenerate the rest between the first and the last key.

    The frames before the first key and after the last stay as they are.

    Args:
        keys: Frames to keep, from 0 on, negative ones from the end; they come out digit for digit as they went in.
        retime: Give each gap the duration that the gallery suggests, or --speed, in place of the clip's own.
    """
    from interpose.cli import generate

    return generate.fill(clip, keys, generation, retime)


def between(
    start: Annotated[Positional[str], arg(metavar="START")],
    target: Annotated[Positional[str], arg(metavar="TARGET")],
    /,
    generation: OmitArgPrefixes[Options],
    frames: Annotated[int | None, unset("N")] = None,
    target_joints: Annotated[str | None, unset("hips|hands|...")] = None,
) -> int:
    """Generate the motion from one pose to another on one skeleton.

    Args:
        start: FILE or FILE:FRAME, counted from 0, negative from the end; without FRAME, the file's last frame.
        target: FILE or FILE:FRAME likewise; without FRAME, the file's first frame.
        frames: Frames between the two; as many as the gallery suggests where left out. OUT has N + 2 frames: its first
            is the start, its last the target.
        target_joints: The constrained parts of the target, separated by commas; the rest is free. hips, hands,
            left-hand, right-hand, feet, left-foot, right-foot, head, upper, lower, ground (position and facing), or
            joints of the 22.
    """
    from interpose.cli import generate

    return generate.between(start, target, frames, generation, target_joints)


def models(json: bool = False) -> int:
    """List the installed models: methods, styles, rate, training data, licence of the weights.

    Args:
        json: Print one JSON object for each model on standard output.
    """
    from interpose.cli import inspect

    return inspect.models(json)


def studio(
    clip: Annotated[Positional[str | None], unset("[CLIP]")] = None,
    /,
    port: Annotated[int | None, unset("P")] = None,
    gallery: Annotated[str | None, unset("DIR")] = None,
    no_browser: bool = False,
) -> int:
    """Open the studio, the authoring tool, in the browser: keys, gaps, styles and paths. Ctrl+C stops it.

    It can be reached from this machine only.

    Args:
        clip: A motion file or a project (.interpose) to open; where left out, what was open last, or a sample scene.
        port: The port to listen on; 8360, or the next that is free, where left out.
        gallery: A gallery from `interpose gallery build` to match paths from; the models' own where left out.
        no_browser: Only print the address.
    """
    from interpose.cli import studio as opening

    return opening.studio(clip, port, no_browser, gallery)


def gallery(argument: Annotated[Positional[str], arg(metavar="build|query|plot|generate")], /) -> int:
    """Build a gallery of trajectories, query it for durations and paths between two poses, draw its figures.

    Args:
        argument: build, query, plot or generate; `interpose gallery build --help` and so on show more.
    """
    print(f"interpose gallery: there is no '{argument}'; use build, query, plot or generate", file=sys.stderr)
    return 2


def nothing(command: str, wanted: str) -> int:
    """The exit status where a list of arguments is empty, with a message."""
    print(f"interpose {command}: name at least one {wanted}", file=sys.stderr)
    return 2
