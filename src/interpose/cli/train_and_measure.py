"""The commands that train and measure. Each imports what does its work when it runs."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg
from tyro.extras import literal_type_from_choices

from interpose.cli.make_motion import nothing
from interpose.cli.options import OutFolder, unset
from interpose.data.sources import DATASETS
from interpose.errors import InputError

RECIPES = Literal["pae", "plan", "dcmoe", "stitch", "detail", "target"]
PROTOCOLS = Literal["lafan1", "dcmoe", "stitch", "gallery", "style"]
DEFAULT_METHODS = {"lafan1": "interp,zero-velocity", "dcmoe": "interp,plan,dcmoe", "stitch": "interp,plan,stitch"}
_RECIPE_MODULES = {"pae": "phases.recipe", "plan": "planner.recipe", "detail": "stitch.detail"}
"""The modules of recipes that are not `NAME.recipe`."""
_OWNERS = {
    "plan": ("dcmoe", "stitch"),
    "phases": ("dcmoe",),
    "without": ("stitch",),
    "refines": ("detail",),
    "backward": ("dcmoe",),
    "compiled": ("dcmoe",),
}
"""Options that some recipes alone have, by the recipe's argument."""
_EXTRA = {"torch", "roma", "safetensors", "onnx", "onnxscript", "tensorboard", "cleanlab", "matplotlib"}
_DATASET_HELP = f"{', '.join(DATASETS)}; bvh is any folder of BVH files."
_TEST_SUBJECTS = [f"{', '.join(d.test_subjects)} of {name}" for name, d in DATASETS.items() if d.test_subjects]
_SPLIT_HELP = f"train leaves out the test subjects ({'; '.join(_TEST_SUBJECTS)}), test keeps only them."


def prepare(
    dataset: Annotated[
        Positional[str], arg(metavar="DATASET", constructor=literal_type_from_choices(DATASETS), help=_DATASET_HELP)
    ],
    source: Annotated[Positional[tuple[str, ...]], arg(metavar="SOURCE", help_behavior_hint="(required)")],
    /,
    out: OutFolder,
    split: Annotated[Literal["all", "train", "test"], arg(help=_SPLIT_HELP)] = "all",
    workers: Annotated[int | None, unset("N")] = None,
) -> int:
    """Prepare motion capture for training: a database of the 22 joints at 30 Hz. Resumes where it stopped.

    Args:
        source: Folders, zip archives or files.
        out: Folder of the database.
        workers: Number of processes; one for each core by default.
    """
    from interpose.data import ingest

    if not source:
        return nothing("prepare", "SOURCE")
    if workers is not None and workers < 1:
        raise InputError(f"--workers must be 1 or more, got {workers}")
    report = ingest.prepare(dataset, list(source), out, split=split, workers=workers)
    print(report.markdown(), end="")
    print(f"wrote {out}", file=sys.stderr)
    return 0


def labels(
    data: Annotated[Positional[str], arg(metavar="DB")],
    /,
    out: Annotated[str | None, unset("DIR", aliases=["-o"])] = None,
    noise: Annotated[float, arg(metavar="SHARE")] = 0.6,
    seed: Annotated[int, arg(metavar="S")] = 0,
) -> int:
    """Find mislabelled frames of a database by confident learning; trainings then leave these labels free.

    Writes labels-kept.npz into the database; delete it to have all labels back.

    Args:
        data: A database from `interpose prepare`.
        out: The folder for the report and pictures of what was dropped; DB/labels where left out.
        noise: The share of the estimated label errors to drop, most doubtful first; 1 is plain confident learning.
        seed: Random seed of the classifiers.
    """
    module = of_extra("interpose.train.style.labels")
    folder = None if out is None else Path(out)
    print(module.distil(Path(data), folder, noise=noise, seed=seed, progress=_show_progress), end="")
    kept = module.label_issues.KEPT_LABELS_FILE
    print(f"wrote {folder or Path(data) / 'labels'} and {kept} in {data}", file=sys.stderr)
    return 0


def train(
    network: Annotated[Positional[RECIPES], arg(metavar="pae|plan|dcmoe|stitch|detail|target")],
    /,
    data: Annotated[tuple[str, ...], arg(metavar="DB")],
    out: Annotated[str, arg(aliases=["-o"], metavar="RUN")],
    preset: Annotated[str, arg(metavar="full|small|tiny|paper")] = "small",
    config: Annotated[str | None, unset("FILE.json")] = None,
    plan: Annotated[str | None, unset("RUN")] = None,
    phases: Annotated[tuple[str, ...], unset("FILE.npy")] = (),
    without: Annotated[str | None, unset("ROW")] = None,
    refines: Annotated[str | None, unset("RUN")] = None,
    backward: bool = False,
    compiled: Annotated[bool, arg(name="compile")] = False,
    minutes: Annotated[float | None, unset("M")] = None,
    device: Annotated[str | None, unset("cpu|cuda")] = None,
    seed: Annotated[int | None, unset("S")] = None,
) -> int:
    """Train a network; run the same command again to resume. Needs the extra interpose[train].

    Args:
        network: pae: the periodic autoencoder, whose phases dcmoe takes. plan: the planner, along which dcmoe and
            stitch work. dcmoe: the mixture of experts. stitch: S-CVAE. detail: a transformer that refines those gaps.
            target: the completion of partial targets.
        data: Databases from `interpose prepare`.
        out: The run's folder.
        preset: full, small (for two CPU cores) or tiny; dcmoe and stitch also have paper, their papers' recipes.
        config: Settings in place of the preset's: some fields, a run's config.json, or a model's model.json, which
            trains that model again.
        plan: For dcmoe and stitch: the run of `interpose train plan` whose planner they work along. dcmoe works along
            interpolation where left out.
        phases: For dcmoe: the phases.npy that the autoencoder's run wrote, one a database; unknown where left out.
        without: For stitch: what to leave out, a row of table 6: "w/o BS", "w/o SL", ...
        refines: For detail: the run of stitch whose transitions it learns to refine.
        backward: For dcmoe: on motion that runs backwards, for stitching from both ends.
        compiled: For dcmoe: by torch.compile, which takes minutes to start; slower on the CPU that it was tried on.
        minutes: Stop after so many minutes; the same command resumes.
        device: Where to compute; a GPU where there is one.
        seed: Random seed of weights and sampling; that of --config, or 0, where left out.
    """
    if not data:
        return nothing("train", "DB after --data")
    recipe = of_extra(f"interpose.train.{_RECIPE_MODULES.get(network, f'{network}.recipe')}")
    configs = of_extra("interpose.train.common.config")
    if device is None:
        device = "cuda" if of_extra("torch").cuda.is_available() else "cpu"
    given = {
        "plan": None if plan is None else Path(plan),
        "phases": [Path(file) for file in phases] or None,
        "without": without,
        "refines": None if refines is None else Path(refines),
        "backward": backward,
        "compiled": compiled,
    }
    for option, value in given.items():
        if network not in _OWNERS[option] and value not in (None, False):
            flag, owners = "compile" if option == "compiled" else option, " and ".join(_OWNERS[option])
            raise InputError(f"--{flag} is for {owners}; it is not valid for {network}")
    settings = configs.preset_of(recipe.PRESETS, preset)
    if config is not None:
        part = network if network in ("plan", "detail", "target") else "backward" if backward else None
        settings = configs.read(Path(config), settings, part)
    if network not in ("plan", "dcmoe") and of_extra("interpose.train.common.parallel").started() > 1:
        raise InputError(f"{network} trains on one process; torchrun is for plan and dcmoe")
    outcome = recipe.train(
        [Path(folder) for folder in data],
        Path(out),
        config=settings,
        seed=settings.seed if seed is None else seed,
        max_minutes=minutes,
        device=device,
        **{option: value for option, value in given.items() if network in _OWNERS[option]},
    )
    if os.environ.get("RANK", "0") == "0":
        if config is not None:
            configs.check_data(Path(config), Path(out))
        print(f"{out}: {outcome}", file=sys.stderr)
    return 130 if outcome == "interrupted" else 0


def export(
    run: Annotated[Positional[str], arg(metavar="RUN")],
    /,
    out: OutFolder,
    name: Annotated[str | None, unset("NAME")] = None,
    onto: Annotated[str | None, unset("MODEL")] = None,
) -> int:
    """Turn a training run into a model's folder: ONNX networks, checked against torch, and model.json.

    Args:
        run: The run's folder.
        out: The model's folder.
        name: The model's name; that of the folder where left out.
        onto: For a run of detail, of target or of dcmoe --backward: the model's folder that it completes; out is a
            copy of that.
    """
    made = of_extra("interpose.export").export(Path(run), Path(out), name=name, onto=onto)
    print(f"wrote {made}", file=sys.stderr)
    return 0


def evaluate(
    protocol: Annotated[Positional[PROTOCOLS], arg(metavar="lafan1|dcmoe|stitch|gallery|style")],
    /,
    data: Annotated[str, arg(metavar="DIR")],
    out: OutFolder,
    methods: Annotated[str | None, unset("A,B,…")] = None,
    model: Annotated[str | None, unset("NAME|DIR")] = None,
    context: Annotated[int, arg(metavar="N")] = 1,
    seed: Annotated[int, arg(metavar="S")] = 0,
    gallery: Annotated[str | None, unset("GALLERY")] = None,
    part: Annotated[Literal["all", "held-out"] | None, arg(help_behavior_hint="")] = None,
    strength: Annotated[str, arg(metavar="S,…")] = "1",
) -> int:
    """Measure methods by a benchmark's protocol: tables (.md, .csv, .json) and a figure (.png, with matplotlib).

    Args:
        protocol: lafan1: the official protocol of LaFAN1. dcmoe: its windows from one frame, along each kind of path,
            with pictures of gaps. stitch: from exactly two frames, with samples. gallery: how well the paths and
            durations of a gallery perform. style: whether a classifier sees the requested style.
        data: lafan1, dcmoe, stitch: the folder of LaFAN1's BVH files; gallery: a database that the gallery has not
            seen; style: the database that the model was trained on, or another of the same styles.
        out: The folder for tables and figures.
        methods: For lafan1, dcmoe and stitch: interp, zero-velocity, a method such as plan, METHOD=MODEL, LABEL=MODEL,
            separated by commas. Where left out: interp and zero-velocity; for dcmoe and stitch interp, plan and the
            method.
        model: The model of methods that are named alone; the installed one trained on LaFAN1 where left out.
        context: Frames known to a model before the gap, 1 to 10; the baselines know the protocol's 10.
        seed: Random seed of the bootstrap and of the models' samples.
        gallery: For gallery: a gallery's folder or a model's name; the model's own where left out.
        part: For gallery: held-out takes only the ends of the clips that trainings hold out; all where left out.
            For style: all tests on the halves of all clips, where the classifier otherwise learns from those ends.
        strength: For style: the style strengths to measure, separated by commas.
    """
    from interpose.data import database
    from interpose.runtime import model_folder

    folder = Path(out)
    if protocol == "style":
        try:
            strengths = [float(text) for text in strength.split(",")]
        except ValueError:
            raise InputError(f"--strength takes numbers separated by commas, got {strength!r}") from None
        of_extra("torch")
        of_extra("interpose.evaluate.style").evaluate_style(
            database.load(data),
            model_folder.load(model),
            folder,
            strengths=strengths,
            part=part or "held-out",
            seed=seed,
            progress=_show_progress,
        )
    elif protocol == "gallery":
        from interpose.cli.inputs import gallery_of
        from interpose.evaluate.gallery import evaluate_gallery

        chosen, part = model_folder.load(model), part or "all"
        source = gallery_of(gallery or str(chosen.path))
        evaluate_gallery(database.load(data), source, chosen, folder, part=part, seed=seed, progress=_show_progress)
    else:
        module = import_module(f"interpose.evaluate.{protocol}")
        named = (methods or DEFAULT_METHODS[protocol]).split(",")
        more: dict[str, Any] = {"context_frames": context} if protocol == "lafan1" else {}
        run = getattr(module, f"evaluate_{protocol}")
        run(Path(data), named, folder, model=model, seed=seed, progress=_show_progress, **more)
    print((folder / "results.md").read_text(encoding="utf-8"), end="")
    print(f"wrote {folder}", file=sys.stderr)
    return 0


def of_extra(name: str) -> ModuleType:
    """A module that needs the extra `train`; InputError where the extra is not installed."""
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] in _EXTRA:
            raise InputError(f"{error.name} is not installed; install it with pip install 'interpose[train]'") from None
        raise


def _show_progress(message: str) -> None:
    print(message, file=sys.stderr, flush=True)
