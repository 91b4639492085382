"""`interpose evaluate`: reads what is measured, runs a protocol and prints its tables."""

from __future__ import annotations

import sys
from pathlib import Path

from interpose.cli.inputs import gallery_of, of_extra
from interpose.cli.output import show_progress
from interpose.errors import InputError

DEFAULT_METHODS = {"lafan1": "interp,zero-velocity", "dcmoe": "interp,plan,dcmoe", "stitch": "interp,plan,stitch"}


def on_lafan1(
    protocol: str, data: str, methods: str | None, model: str | None, out: str, context: int, seed: int
) -> int:
    from interpose.evaluate.dcmoe import evaluate_dcmoe
    from interpose.evaluate.lafan1 import evaluate_lafan1
    from interpose.evaluate.stitch import evaluate_stitch

    folder, named = Path(out), (methods or DEFAULT_METHODS[protocol]).split(",")
    if protocol == "lafan1":
        evaluate_lafan1(
            Path(data), named, folder, context_frames=context, model=model, seed=seed, progress=show_progress
        )
    else:
        run = evaluate_dcmoe if protocol == "dcmoe" else evaluate_stitch
        run(Path(data), named, folder, model=model, seed=seed, progress=show_progress)
    return _print_tables(folder)


def gallery(data: str, name: str | None, model: str | None, out: str, part: str, seed: int) -> int:
    from interpose.data import database
    from interpose.evaluate.gallery import evaluate_gallery
    from interpose.runtime import model_folder

    chosen, folder = model_folder.load(model), Path(out)
    source = gallery_of(name or str(chosen.path))
    evaluate_gallery(database.load(data), source, chosen, folder, part=part, seed=seed, progress=show_progress)
    return _print_tables(folder)


def style(data: str, model: str | None, out: str, strengths: str, part: str, seed: int) -> int:
    from interpose.data import database
    from interpose.runtime import model_folder

    try:
        given = [float(text) for text in strengths.split(",")]
    except ValueError:
        raise InputError(f"--strength takes numbers separated by commas, got {strengths!r}") from None
    of_extra("torch")
    folder = Path(out)
    of_extra("interpose.evaluate.style").evaluate_style(
        database.load(data),
        model_folder.load(model),
        folder,
        strengths=given,
        part=part,
        seed=seed,
        progress=show_progress,
    )
    return _print_tables(folder)


def _print_tables(folder: Path) -> int:
    """On standard output; the exit status."""
    print((folder / "results.md").read_text(encoding="utf-8"), end="")
    print(f"wrote {folder}", file=sys.stderr)
    return 0
