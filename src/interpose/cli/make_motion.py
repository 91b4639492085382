"""Options and help of the commands that make motion; the modules beside do the work, imported when a command runs."""

from __future__ import annotations

import sys
from typing import Annotated, Literal

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


def gallery_build(
    database: Annotated[Positional[str], arg(metavar="DB")],
    /,
    out: OutFolder,
    part: Literal["all", "train"] = "all",
) -> int:
    """Index every stretch of 15 to 150 frames of a prepared database, and its mirror image, as a trajectory to match.

    Args:
        database: From `interpose prepare`.
        out: The gallery's folder.
        part: train leaves out the ends of the clips that trainings hold out.
    """
    from interpose.cli import gallery as command

    return command.build(database, out, part)


def gallery_query(
    gallery: Annotated[Positional[str], arg(metavar="GALLERY")],
    start: Annotated[Positional[str], arg(metavar="START")],
    target: Annotated[Positional[str], arg(metavar="TARGET")],
    /,
    frames: Annotated[int | None, unset("N")] = None,
    speed: Annotated[str | None, unset("fast|medium|slow")] = None,
    style: Annotated[str | None, unset("NAME")] = None,
    count: Annotated[int, arg(metavar="K")] = 7,
    seed: Annotated[int, arg(metavar="S")] = 0,
    json: bool = False,
) -> int:
    """Suggest durations and matching trajectories between two poses.

    Args:
        gallery: A gallery's folder, a gallery.npz, or a model's name.
        start: FILE or FILE:FRAME as for `between`, or a place X,Z,DEG: metres on the ground, facing about +Y from +Z.
        target: Likewise.
        frames: Frames between the two at 30 Hz; as many as suggested where left out.
        speed: In place of frames.
        style: One of the gallery's; any where left out.
        count: Number of different trajectories.
        seed: Random seed; the same seed gives the same answer.
        json: Print one JSON object.
    """
    from interpose.cli import gallery as command

    return command.query(gallery, (start, target), (frames, speed, style), count, seed, json)


def gallery_generate(
    database: Annotated[Positional[str], arg(metavar="DB")],
    /,
    model: Annotated[str, arg(metavar="NAME|DIR")],
    frames: Annotated[int, arg(metavar="N")] = 18_000,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Give a model a gallery of its own motion, which can be bundled with it: no frame of the database is in it.

    Args:
        database: From `interpose prepare`; key poses are taken from it.
        model: An installed model or a model's folder; its gallery.npz is replaced.
        frames: Frames of motion to generate, over all styles of the database.
        seed: Random seed; the same seed gives the same gallery.
    """
    from interpose.cli import gallery as command

    return command.generate(database, model, frames, seed)


def gallery_plot(
    gallery: Annotated[Positional[str], arg(metavar="GALLERY")],
    /,
    out: OutFolder,
    style: Annotated[str | None, unset("NAME")] = None,
    distance: Annotated[float, arg(metavar="M")] = 2.0,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Draw the paper's figures 3, 4 and 6: paths for four turns, distances by style, a match step by step.

    Args:
        gallery: A gallery's folder, a gallery.npz, or a model's name.
        out: The folder for the figures.
        style: Of the paths and the match; any where left out.
        distance: Metres from start to target of the paths.
        seed: Random seed; the same seed gives the same figures.
    """
    from interpose.cli import gallery as command

    return command.plot(gallery, out, style, distance, seed)


def nothing(command: str, wanted: str) -> int:
    """The exit status where a list of arguments is empty, with a message."""
    print(f"interpose {command}: name at least one {wanted}", file=sys.stderr)
    return 2
