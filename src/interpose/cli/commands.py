"""Every command's options and help. The work is done in the other modules of this package, imported when it runs."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg

_SAID = ""
"""In place of tyro's "(default: None)", where the help text itself says what happens when the option is left out."""

OutFile = Annotated[str, arg(aliases=["-o"], metavar="OUT.bvh")]
OutFolder = Annotated[str, arg(aliases=["-o"], metavar="DIR")]


@dataclass(frozen=True)
class Options:
    """How the gaps are filled, and where to."""

    out: OutFile
    """The file to write, .bvh or .glb. With several variants: OUT-1, OUT-2, …, best first."""
    method: Annotated[str, arg(metavar="dcmoe|interp")] = "dcmoe"
    """dcmoe (a trained model) or interp (straight line and SLERP)."""
    model: Annotated[str | None, arg(metavar="NAME|DIR", help_behavior_hint=_SAID)] = None
    """An installed model (see `interpose models`) or a model's folder; the default model where left out."""
    style: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_SAID)] = None
    """One of the model's styles; free where left out, and then each further variant takes another one."""
    path: Annotated[str, arg(metavar="auto")] = "auto"
    """The root's track on the ground: auto leaves it to the model."""
    variants: Annotated[int, arg(metavar="N")] = 1
    """How many different answers to write."""
    seed: Annotated[int, arg(metavar="S")] = 0
    """The same seed gives the same motion."""
    json: bool = False
    """Print one JSON object for each gap of each variant on standard output."""


def fill(
    clip: Annotated[Positional[str], arg(metavar="CLIP")],
    /,
    keys: Annotated[str, arg(metavar="0,45,90-99")],
    generation: OmitArgPrefixes[Options],
) -> int:
    """Keep the key frames of a clip and make all others between the first and the last key anew.

    The frames before the first key and after the last stay as they are.

    Args:
        clip: The BVH file.
        keys: Frames to keep, from 0 on, negative ones from the end; they come out digit for digit as they went in.
    """
    from interpose.cli import generate

    return generate.fill(clip, keys, generation)


def between(
    start: Annotated[Positional[str], arg(metavar="START")],
    target: Annotated[Positional[str], arg(metavar="TARGET")],
    /,
    frames: Annotated[int, arg(metavar="N")],
    generation: OmitArgPrefixes[Options],
) -> int:
    """Make the motion from one pose to another on one skeleton.

    Args:
        start: FILE or FILE:FRAME, counted from 0, negative from the end; without FRAME, the file's last frame.
        target: FILE or FILE:FRAME likewise; without FRAME, the file's first frame.
        frames: Frames between the two. OUT has N + 2 frames: its first is the start, its last the target.
    """
    from interpose.cli import generate

    return generate.between(start, target, frames, generation)


def info(
    files: Annotated[Positional[tuple[str, ...]], arg(metavar="FILE", help_behavior_hint="(required)")],
    /,
    json: bool = False,
) -> int:
    """Tell what BVH files hold and how their joints map to the 22 joints of the models.

    Args:
        files: BVH files. One that cannot be read is reported, the others are still shown.
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
    dataset: Annotated[Positional[Literal["lafan1", "100style", "bandai", "bvh"]], arg(metavar="DATASET")],
    source: Annotated[Positional[tuple[str, ...]], arg(metavar="SOURCE", help_behavior_hint="(required)")],
    /,
    out: OutFolder,
    split: Literal["all", "train", "test"] = "all",
    workers: Annotated[int | None, arg(metavar="N", help_behavior_hint=_SAID)] = None,
) -> int:
    """Prepare a folder of motion capture for training: a database of the 22 joints at 30 Hz. Resumes where it stopped.

    Args:
        dataset: lafan1, 100style, bandai, or bvh for any folder of BVH files.
        source: Folders or files.
        out: The database's folder.
        split: For lafan1: train leaves out subject 5, on which the benchmark tests; test takes only it.
        workers: Processes at once; one a core where left out.
    """
    from interpose.cli import develop

    return develop.prepare(dataset, source, out, split, workers) if source else _nothing("prepare", "SOURCE")


def train(
    network: Annotated[Positional[Literal["pae", "dcmoe"]], arg(metavar="pae|dcmoe")],
    /,
    data: Annotated[tuple[str, ...], arg(metavar="DB")],
    out: OutFolder,
    preset: Annotated[str, arg(metavar="NAME")] = "small",
    phases: Annotated[tuple[str, ...], arg(metavar="FILE", help_behavior_hint=_SAID)] = (),
    foreign_keys: Annotated[float | None, arg(metavar="SHARE", help_behavior_hint=_SAID)] = None,
    minutes: Annotated[float | None, arg(metavar="M", help_behavior_hint=_SAID)] = None,
    device: Annotated[str | None, arg(metavar="cpu|cuda", help_behavior_hint=_SAID)] = None,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Train a network on a prepared database. Resumes where the run stopped.

    Args:
        network: pae (the periodic autoencoder) or dcmoe.
        data: Databases from `interpose prepare`.
        out: The run's folder.
        preset: full, small or tiny; dcmoe also has paper, the paper's recipe unchanged.
        phases: For dcmoe: the phases.npy that the autoencoder's run wrote, one a database; unknown where left out.
        foreign_keys: For dcmoe: share of rows, 0 to 1, with another's upper body at the keys, to make the style matter.
            The default model was trained with 0.4; none where left out.
        minutes: Stop after so many minutes; the same command goes on from there.
        device: Where to compute; a GPU where there is one.
        seed: Of weights and draws.
    """
    from interpose.cli import develop

    if not data:
        return _nothing("train", "DB after --data")
    return develop.train(network, data, phases, foreign_keys, out, preset, minutes, device, seed)


def export(
    run: Annotated[Positional[str], arg(metavar="RUN")],
    /,
    out: OutFolder,
    name: Annotated[str | None, arg(metavar="NAME", help_behavior_hint=_SAID)] = None,
) -> int:
    """Turn a training run into a model's folder: ONNX networks, checked against torch, and model.json.

    Args:
        run: The run's folder.
        out: The model's folder.
        name: The model's name; that of the folder where left out.
    """
    from interpose.cli import develop

    return develop.export(run, out, name)


def evaluate(
    protocol: Annotated[Positional[Literal["lafan1"]], arg(metavar="lafan1")],
    /,
    data: Annotated[str, arg(metavar="DIR")],
    out: OutFolder,
    methods: Annotated[str, arg(metavar="A,B,…")] = "interp,zero-velocity",
    model: Annotated[str | None, arg(metavar="NAME|DIR", help_behavior_hint=_SAID)] = None,
    context: Annotated[int, arg(metavar="N")] = 1,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Measure methods by a benchmark's protocol: tables (.md, .csv, .json) and a figure (.png, with matplotlib).

    Args:
        protocol: lafan1: the official protocol of LaFAN1.
        data: The benchmark's folder of BVH files.
        out: The folder for tables and figures.
        methods: interp, zero-velocity, dcmoe (with --model) and LABEL=MODEL, separated by commas.
        model: For dcmoe: an installed model or a folder; the installed model lafan1 where left out.
        context: Frames known to a model before the gap, 1 to 10; the baselines know the protocol's 10.
        seed: Of the bootstrap and of what the model draws.
    """
    from interpose.cli import develop

    del protocol
    return develop.evaluate(data, methods, model, out, context, seed)


def demo(out: OutFolder = "interpose-demo") -> int:
    """Fill sample key poses with the default model: BVH, GLB and a contact sheet each, and a table.

    Args:
        out: The folder to write to.
    """
    from interpose.demo.run import show

    return show(out)


def _nothing(command: str, wanted: str) -> int:
    print(f"interpose {command}: name at least one {wanted}", file=sys.stderr)
    return 2
