"""`interpose fill` and `interpose between`: keys in, the motion between them out."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

from interpose import io, parts
from interpose import keys as key_text
from interpose.cli.inputs import gallery_of, named_pose, pose
from interpose.cli.options import Options
from interpose.drawn_path import path_file
from interpose.errors import InputError
from interpose.io.registry import writer_of
from interpose.motion import Motion, concatenate
from interpose.runtime import inbetween
from interpose.runtime.backends.backend import choose
from interpose.runtime.interpolate import aligned
from interpose.runtime.model_folder import load
from interpose.runtime.request import Info, Request


def fill(clip: str, keys: str, options: Options, retime: bool = False) -> int:
    paths = _outputs(options, clip)
    source = io.read(clip)
    chosen = key_text.parse_keys(keys, len(source))
    filled = inbetween.fill(source, chosen, _request(options, retime), variants=options.variants, retime=retime)
    _write(paths, [f.motion for f in filled], [f.kept for f in filled])
    _report(paths, [f.gaps for f in filled], options.json)
    return 0


def between(start: str, target: str, frames: int | None, options: Options, target_joints: str | None = None) -> int:
    paths = _outputs(options, named_pose(start)[0], named_pose(target)[0])
    given = None if target_joints is None else parts.parse(target_joints)
    (first, file, frame), (last, target_file, target_frame) = pose(start, -1), pose(target, 0)
    made = inbetween.inbetween(
        first,
        last,
        frames,
        _request(options, frames is None, given),
        variants=options.variants,
        names=(f"{file}:{frame}", f"{target_file}:{target_frame}"),
    )
    layout, fits = first.layout, False
    if layout is not None:
        layout, fits = layout.joined(frame, last.layout, target_frame)
    fits &= all(c.target is None for c in made)
    keys = aligned(replace(first, layout=layout), last)
    ends = [keys[1] if c.target is None else aligned(keys[0], c.target)[1] for c in made]
    whole = [concatenate(keys[0], aligned(keys[0], c.motion)[1], end) for c, end in zip(made, ends, strict=True)]
    _write(paths, whole, [{0: 0, len(one) - 1: 1} if fits else {0: 0} for one in whole])
    _report(paths, [(c.info,) for c in made], options.json)
    return 0


def _outputs(options: Options, *inputs: str) -> list[Path]:
    if not 1 <= options.variants <= 100:
        raise InputError(f"--variants must be 1 to 100, got {options.variants}")
    return output_paths(options.out, options.variants, () if options.force else inputs)


def output_paths(out: str, variants: int, inputs: Sequence[str] = ()) -> list[Path]:
    """OUT.bvh for one variant, OUT-1.bvh, OUT-2.bvh, … for several.

    Raises InputError, before anything is generated, where the suffix is not known, the folder cannot be written to, or
    a file is one of the ``inputs``.
    """
    path = Path(out)
    writer_of(out)
    if not path.parent.is_dir():
        raise InputError(f"{out}: there is no folder {path.parent}; create it first")
    paths = [path] if variants == 1 else [path.with_stem(f"{path.stem}-{i}") for i in range(1, variants + 1)]
    for each in paths:
        if each.is_dir():
            raise InputError(f"{each} is a folder; name a file")
        if each.exists() and any(Path(name).exists() and each.samefile(name) for name in inputs):
            raise InputError(f"{each} is one of the inputs; name another file, or overwrite it with --force")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"{out}: the folder {path.parent} cannot be written to")
    return paths


def _request(options: Options, untimed: bool, given: parts.Parts | None = None) -> Request:
    """``untimed``: the gallery is to suggest how long a gap takes, for a method without a model, too."""
    method, model = choose(options.method, options.model)
    gallery = None if options.gallery is None else gallery_of(options.gallery)
    if model is None and gallery is None and untimed:
        gallery = load().gallery
    return Request(
        method=method,
        model=model,
        style=options.style,
        style_strength=options.style_strength,
        path=options.path,
        path_control=options.path_control,
        drawn=path_file.read(Path(options.path)) if options.path.lower().endswith(".json") else None,
        gallery=gallery,
        speed=options.speed,
        seed=options.seed,
        parts=given,
    )


def _write(paths: Sequence[Path], motions: Sequence[Motion], unchanged_rows: Sequence[dict[int, int]]) -> None:
    """All files or none: temporaries beside them are renamed at the end."""
    if len(paths) == 1:
        io.write(paths[0], motions[0], unchanged_rows[0])
        return
    temporaries = [p.with_name(f".{p.stem}.{os.getpid()}{p.suffix}") for p in paths]
    try:
        for temporary, path, motion, rows in zip(temporaries, paths, motions, unchanged_rows, strict=True):
            try:
                io.write(temporary, motion, rows)
            except InputError as error:
                raise InputError(str(error).replace(str(temporary), str(path))) from error
        for temporary, path in zip(temporaries, paths, strict=True):
            os.replace(temporary, path)
    finally:
        for temporary in temporaries:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def _report(paths: Sequence[Path], infos: Sequence[Sequence[Info]], as_json: bool) -> None:
    for variant, (path, gaps) in enumerate(zip(paths, infos, strict=True), start=1):
        for info in gaps:
            if as_json:
                print(json.dumps({**asdict(info), "variant": variant, "output": str(path)}, ensure_ascii=False))
            else:
                print(_summary(info), file=sys.stderr)
            for warning in info.warnings:
                print(f"warning: {info.start} -> {info.target}: {warning}", file=sys.stderr)
        print(f"wrote {path}", file=sys.stderr)


def _summary(info: Info) -> str:
    slide = "" if info.foot_slide_cm_per_frame is None else f", foot slide {info.foot_slide_cm_per_frame:.2f} cm/frame"
    served = "falls back to interpolation: " if info.trajectory is None else ""
    why = "" if info.fallback is None else f" ({served}{info.fallback})"
    arrival = f"{info.arrival_position_error_m * 100:.3f} cm, {info.arrival_rotation_error_deg:.3f} deg"
    return (
        f"{info.start} -> {info.target}: {info.frames} frames by {info.method}, arrival error {arrival}{slide}, "
        f"{info.seconds:.2f} s{_details(info)}{why}"
    )


def _details(info: Info) -> str:
    """Where the path is from and how closely it is kept, and other durations."""
    out = "" if info.trajectory in (None, "model") else f", {info.trajectory} path"
    if info.path_deviation_m is not None:
        out += f" kept within {info.path_deviation_m * 100:.1f} cm"
    if info.suggested is not None:
        others = ", ".join(f"{a.speed} {a.frames} ({a.fit:.0%})" for a in info.suggested.alternatives)
        out += f"; {info.suggested.frames} frames suggested: {others}"
    return out
