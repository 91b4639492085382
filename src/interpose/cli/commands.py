"""Every command's options and help. The work is done in the other modules of this package, imported when it runs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg
from tyro.extras import literal_type_from_choices

from interpose.data.sources import DATASETS
from interpose.io.registry import WRITERS, listed, readable

_SAID = ""
"""In place of tyro's "(default: None)", where the help text itself says what happens when the option is left out."""

_DATASET_HELP = f"{', '.join(DATASETS)}; bvh is any folder of BVH files."
_TEST_SUBJECTS = [f"{', '.join(d.test_subjects)} of {name}" for name, d in DATASETS.items() if d.test_subjects]
_SPLIT_HELP = f"train leaves out the test subjects ({'; '.join(_TEST_SUBJECTS)}), test keeps only them."

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
    method: Annotated[str, arg(metavar="dcmoe|stitch|stitch+detail|interp")] = "dcmoe"
    """dcmoe, stitch or stitch+detail (trained models) or interp (straight line and SLERP)."""
    model: Annotated[str | None, arg(metavar="NAME|DIR", help_behavior_hint=_SAID)] = None
    """An installed model (see `interpose models`) or a model's folder; the default model where left out."""
    style: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_SAID)] = None
    """One of the model's styles, or a blend, as Angry+Drunk or Angry:0.7+Drunk:0.3; free where left out, and then each
    further variant takes another one."""
    style_strength: Annotated[float, arg(metavar="S")] = 1.0
    """How much of the style: 0 is as good as free, 1 as trained, up to 3 exaggerated."""
    path: Annotated[str, arg(metavar="auto|straight|none|FILE.json")] = "auto"
    """The root's way on the ground: auto matches a trajectory of the gallery, straight is a straight line, none leaves
    it to the model, and a file holds what you drew (docs/paths.md)."""
    speed: Annotated[str | None, arg(metavar="fast|medium|slow", help_behavior_hint=_SAID)] = None
    """How long a gap takes, in place of a number of frames; `fill` needs --retime for it."""
    gallery: Annotated[str | None, arg(metavar="DIR", help_behavior_hint=_SAID)] = None
    """A gallery from `interpose gallery build`; the model's own where left out."""
    path_control: Annotated[float, arg(metavar="W")] = 1.0
    """How much a path counts beside the way that the model foresees, 0 to 1."""
    variants: Annotated[int, arg(metavar="N")] = 1
    """How many different answers to write."""
    seed: Annotated[int, arg(metavar="S")] = 0
    """The same seed gives the same motion."""
    json: bool = False
    """Print one JSON object for each gap of each variant on standard output."""


def fill(
    clip: Annotated[Positional[str], arg(metavar="CLIP", help=f"The clip: {readable()}.")],
    /,
    keys: Annotated[str, arg(metavar="0,45,90-99")],
    generation: OmitArgPrefixes[Options],
    retime: bool = False,
) -> int:
    """Keep the key frames of a clip and make all others between the first and the last key anew.

    The frames before the first key and after the last stay as they are.

    Args:
        keys: Frames to keep, from 0 on, negative ones from the end; they come out digit for digit as they went in.
        retime: Let each gap take the time that the gallery suggests, or --speed, in place of the clip's own.
    """
    from interpose.cli import generate

    return generate.fill(clip, keys, generation, retime)


def between(
    start: Annotated[Positional[str], arg(metavar="START")],
    target: Annotated[Positional[str], arg(metavar="TARGET")],
    /,
    generation: OmitArgPrefixes[Options],
    frames: Annotated[int | None, arg(metavar="N", help_behavior_hint=_SAID)] = None,
    target_joints: Annotated[str | None, arg(metavar="hips|hands|...", help_behavior_hint=_SAID)] = None,
) -> int:
    """Make the motion from one pose to another on one skeleton.

    Args:
        start: FILE or FILE:FRAME, counted from 0, negative from the end; without FRAME, the file's last frame.
        target: FILE or FILE:FRAME likewise; without FRAME, the file's first frame.
        frames: Frames between the two; as many as the gallery suggests where left out. OUT has N + 2 frames: its first
            is the start, its last the target.
        target_joints: What is given of the target, separated by commas; the rest of it is free. hips, hands, left-hand,
            right-hand, feet, left-foot, right-foot, head, upper, lower, ground (place and facing), or joints of the 22.
    """
    from interpose.cli import generate

    return generate.between(start, target, frames, generation, target_joints)


def gallery(argument: Annotated[Positional[str], arg(metavar="build|query|plot|generate")], /) -> int:
    """Trajectories to match: build a gallery, ask it for the ways between two poses, draw its figures.

    Args:
        argument: build, query, plot or generate; `interpose gallery build --help` and so on say more.
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
    frames: Annotated[int | None, arg(metavar="N", help_behavior_hint=_SAID)] = None,
    speed: Annotated[str | None, arg(metavar="fast|medium|slow", help_behavior_hint=_SAID)] = None,
    style: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_SAID)] = None,
    count: Annotated[int, arg(metavar="K")] = 7,
    seed: Annotated[int, arg(metavar="S")] = 0,
    json: bool = False,
) -> int:
    """Tell how long the way from one pose to another takes, and the trajectories that lead there.

    Args:
        gallery: A gallery's folder, a gallery.npz, or a model's name.
        start: FILE or FILE:FRAME as for `between`, or a place X,Z,DEG: metres on the ground, facing about +Y from +Z.
        target: Likewise.
        frames: Frames between the two at 30 Hz; as many as suggested where left out.
        speed: In place of frames.
        style: One of the gallery's; any where left out.
        count: How many different trajectories.
        seed: The same seed gives the same answer.
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
    """Give a model a gallery of its own motion, which may travel with it: no frame of the database is in it.

    Args:
        database: From `interpose prepare`; key poses are taken from it.
        model: An installed model or a model's folder; its gallery.npz is written anew.
        frames: Of motion to generate, over all styles of the database.
        seed: The same seed gives the same gallery.
    """
    from interpose.cli import gallery as command

    return command.generate(database, model, frames, seed)


def gallery_plot(
    gallery: Annotated[Positional[str], arg(metavar="GALLERY")],
    /,
    out: OutFolder,
    style: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_SAID)] = None,
    distance: Annotated[float, arg(metavar="M")] = 2.0,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Draw the paper's figures 3, 4 and 6: ways for four turns, distances by style, a match step by step.

    Args:
        gallery: A gallery's folder, a gallery.npz, or a model's name.
        out: The folder for the figures.
        style: Of the ways and the match; any where left out.
        distance: Metres from start to target of the ways.
        seed: The same seed gives the same figures.
    """
    from interpose.cli import gallery as command

    return command.plot(gallery, out, style, distance, seed)


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

    return inspect.info(files, json) if files else _nothing("info", "FILE")


def models(json: bool = False) -> int:
    """List the installed models: methods, styles, rate, training data, licence of the weights.

    Args:
        json: Print one JSON object for each model on standard output.
    """
    from interpose.cli import inspect

    return inspect.models(json)


def prepare(
    dataset: Annotated[
        Positional[str], arg(metavar="DATASET", constructor=literal_type_from_choices(DATASETS), help=_DATASET_HELP)
    ],
    source: Annotated[Positional[tuple[str, ...]], arg(metavar="SOURCE", help_behavior_hint="(required)")],
    /,
    out: OutFolder,
    split: Annotated[Literal["all", "train", "test"], arg(help=_SPLIT_HELP)] = "all",
    workers: Annotated[int | None, arg(metavar="N", help_behavior_hint=_SAID)] = None,
) -> int:
    """Prepare motion capture for training: a database of the 22 joints at 30 Hz. Resumes where it stopped.

    Args:
        source: Folders, zip archives or files.
        out: Folder of the database.
        workers: Number of processes; one for each core by default.
    """
    from interpose.cli import training

    return training.prepare(dataset, source, out, split, workers) if source else _nothing("prepare", "SOURCE")


def labels(
    data: Annotated[Positional[str], arg(metavar="DB")],
    /,
    out: Annotated[str | None, arg(aliases=["-o"], metavar="DIR", help_behavior_hint=_SAID)] = None,
    noise: Annotated[float, arg(metavar="SHARE")] = 0.6,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Find the frames of a database that its style labels do not describe; trainings then leave these labels free.

    Writes labels-kept.npz into the database; delete it to have all labels back.

    Args:
        data: A database from `interpose prepare`.
        out: The folder for the report and pictures of what was dropped; DB/labels where left out.
        noise: The share of the estimated label errors to drop, most doubtful first; 1 is plain confident learning.
        seed: Of the judging networks.
    """
    from interpose.cli import training

    return training.labels(data, out, noise, seed)


def train(
    network: Annotated[
        Positional[Literal["pae", "dcmoe", "stitch", "detail", "target"]], arg(metavar="pae|dcmoe|stitch|detail|target")
    ],
    /,
    data: Annotated[tuple[str, ...], arg(metavar="DB")],
    out: OutFolder,
    preset: Annotated[str, arg(metavar="NAME")] = "small",
    phases: Annotated[tuple[str, ...], arg(metavar="FILE", help_behavior_hint=_SAID)] = (),
    foreign_keys: Annotated[float | None, arg(metavar="SHARE", help_behavior_hint=_SAID)] = None,
    without: Annotated[str | None, arg(metavar="PART", help_behavior_hint=_SAID)] = None,
    plan_from: Annotated[str | None, arg(metavar="RUN", help_behavior_hint=_SAID)] = None,
    plan_steps: Annotated[int | None, arg(metavar="N", help_behavior_hint=_SAID)] = None,
    refines: Annotated[str | None, arg(metavar="RUN", help_behavior_hint=_SAID)] = None,
    backward: Annotated[bool, arg(help_behavior_hint=_SAID)] = False,
    compiled: Annotated[bool, arg(name="compile", help_behavior_hint=_SAID)] = False,
    minutes: Annotated[float | None, arg(metavar="M", help_behavior_hint=_SAID)] = None,
    device: Annotated[str | None, arg(metavar="cpu|cuda", help_behavior_hint=_SAID)] = None,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Train a network on a prepared database. Resumes where the run stopped.

    Args:
        network: pae (the periodic autoencoder), dcmoe, stitch (S-CVAE), detail (refines what stitch makes) or
            target (completes targets that are given in part).
        data: Databases from `interpose prepare`.
        out: The run's folder.
        preset: full, small or tiny; dcmoe and stitch also have paper, their papers' recipes unchanged.
        phases: For dcmoe: the phases.npy that the autoencoder's run wrote, one a database; unknown where left out.
        foreign_keys: For dcmoe: share of rows, 0 to 1, with another's upper body at the keys, to make the style matter.
            The default model was trained with 0.4; none where left out.
        without: For stitch: what to leave out, as docs/stitch.md names the rows of table 6: "w/o BS", "w/o SL", ...
        plan_from: For dcmoe: another run, of dcmoe or stitch, whose planner is taken. For stitch: a finished run whose
            phases and plan are taken as they are.
        plan_steps: For dcmoe: updates of the planner; the preset's where left out, none where it is taken.
        refines: For detail: the run of stitch whose transitions it learns to refine.
        backward: For dcmoe: on motion that runs backwards, for stitching from both ends.
        compiled: For dcmoe: by torch.compile, which takes minutes to begin; slower on the CPU that it was tried on.
        minutes: Stop after so many minutes; the same command goes on from there.
        device: Where to compute; a GPU where there is one.
        seed: Of weights and draws.
    """
    from interpose.cli import training

    if not data:
        return _nothing("train", "DB after --data")
    extra = training.Extra(phases, foreign_keys, without, plan_from, refines, backward, plan_steps, compiled)
    return training.train(network, data, out, preset, minutes, device, seed, extra)


def export(
    run: Annotated[Positional[str], arg(metavar="RUN")],
    /,
    out: OutFolder,
    name: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_SAID)] = None,
    onto: Annotated[str | None, arg(metavar="MODEL", help_behavior_hint=_SAID)] = None,
) -> int:
    """Turn a training run into a model's folder: ONNX networks, checked against torch, and model.json.

    Args:
        run: The run's folder.
        out: The model's folder.
        name: The model's name; that of the folder where left out.
        onto: For a run of detail, of target or of dcmoe --backward: the model's folder that it completes; out is a
            copy of that.
    """
    from interpose.cli import training

    return training.export(run, out, name, onto)


def evaluate(
    protocol: Annotated[
        Positional[Literal["lafan1", "dcmoe", "stitch", "gallery", "style"]],
        arg(metavar="lafan1|dcmoe|stitch|gallery|style"),
    ],
    /,
    data: Annotated[str, arg(metavar="DIR")],
    out: OutFolder,
    methods: Annotated[str, arg(metavar="A,B,…")] = "interp,zero-velocity",
    model: Annotated[str | None, arg(metavar="NAME|DIR", help_behavior_hint=_SAID)] = None,
    context: Annotated[int, arg(metavar="N")] = 1,
    seed: Annotated[int, arg(metavar="S")] = 0,
    gallery: Annotated[str | None, arg(metavar="GALLERY", help_behavior_hint=_SAID)] = None,
    part: Annotated[Literal["all", "held-out"] | None, arg(help_behavior_hint=_SAID)] = None,
    strength: Annotated[str, arg(metavar="S,…")] = "1",
) -> int:
    """Measure methods by a benchmark's protocol: tables (.md, .csv, .json) and a figure (.png, with matplotlib).

    Args:
        protocol: lafan1: the official protocol of LaFAN1. dcmoe: its windows from one frame, along each kind of path,
            with pictures of gaps. stitch: from exactly two frames, with samples. gallery: what the paths and durations
            of a gallery are worth. style: whether a classifier sees the style asked for.
        data: lafan1, dcmoe, stitch: the folder of LaFAN1's BVH files; gallery: a database that the gallery has not
            seen; style: the database that the model was trained on, or another of the same styles.
        out: The folder for tables and figures.
        methods: interp, zero-velocity, dcmoe or stitch (with --model) and LABEL=MODEL, separated by commas.
        model: For dcmoe: an installed model or a folder; the installed model lafan1 where left out.
        context: Frames known to a model before the gap, 1 to 10; the baselines know the protocol's 10.
        seed: Of the bootstrap and of what the model draws.
        gallery: For gallery: a gallery's folder or a model's name; the model's own where left out.
        part: For gallery: held-out takes only the ends of the clips that trainings hold out; all where left out.
            For style: all judges by the halves of all clips, where the judge otherwise learns from those ends.
        strength: For style: the strengths to ask for it with, separated by commas.
    """
    from interpose.cli import training

    if protocol == "style":
        return training.evaluate_style(data, model, out, strength, part or "held-out", seed)
    if protocol == "dcmoe":
        return training.evaluate_dcmoe(data, methods, out, seed)
    if protocol == "stitch":
        return training.evaluate_stitch(data, methods, model, out, seed)
    if protocol == "gallery":
        return training.evaluate_gallery(data, gallery, model, out, part or "all", seed)
    return training.evaluate(data, methods, model, out, context, seed)


def demo(out: OutFolder = "interpose-demo") -> int:
    """Fill sample key poses with the default model: BVH, GLB and a contact sheet each, and a table.

    Args:
        out: The folder to write to.
    """
    from interpose.demo.run import show

    return show(out)


def studio(
    clip: Annotated[Positional[str | None], arg(metavar="[CLIP]", help_behavior_hint=_SAID)] = None,
    /,
    port: Annotated[int | None, arg(metavar="P", help_behavior_hint=_SAID)] = None,
    no_browser: bool = False,
) -> int:
    """Open the studio, the authoring tool, in the browser: keys, gaps, styles and paths. Ctrl+C stops it.

    It can be reached from this machine only.

    Args:
        clip: A BVH file or a project (.interpose) to open; where left out, what was open last, or a sample scene.
        port: Where it listens; 8360, or the next that is free, where left out.
        no_browser: Only print the address.
    """
    from interpose.cli import studio as opening

    return opening.studio(clip, port, no_browser)


def _nothing(command: str, wanted: str) -> int:
    print(f"interpose {command}: name at least one {wanted}", file=sys.stderr)
    return 2
