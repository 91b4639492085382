"""`interpose fill` and `interpose between`: keys in, the motion between them out."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from interpose import keys as key_text
from interpose.cli.commands import Options
from interpose.cli.output import output_paths, write_all
from interpose.errors import InputError
from interpose.io import bvh
from interpose.motion import Motion, concatenate
from interpose.runtime import inbetween
from interpose.runtime.inbetween import Info, Request
from interpose.runtime.interpolate import aligned
from interpose.runtime.session import load


def fill(clip: str, keys: str, options: Options) -> int:
    paths = _outputs(options)
    source = bvh.read(clip)
    chosen = key_text.parse_keys(keys, len(source))
    filled = inbetween.fill(source, chosen, _request(options), variants=options.variants)
    kept = [*range(chosen[0]), *chosen, *range(chosen[-1] + 1, len(source))]
    _write(paths, [f.motion for f in filled], {frame: frame for frame in kept})
    _report(paths, [f.gaps for f in filled], options.json)
    return 0


def between(start: str, target: str, frames: int, options: Options) -> int:
    paths = _outputs(options)
    first, last = _pose(start, -1), _pose(target, 0)
    made = inbetween.inbetween(
        first.pose,
        last.pose,
        frames,
        _request(options),
        variants=options.variants,
        names=(f"{first.file}:{first.frame}", f"{last.file}:{last.frame}"),
    )
    layout, verbatim = _two_rows(first, last, frames)
    keys = aligned(replace(first.pose, layout=layout), last.pose)
    whole = [concatenate(keys[0], aligned(keys[0], c.motion)[1], keys[1]) for c in made]
    _write(paths, whole, verbatim)
    _report(paths, [(c.info,) for c in made], options.json)
    return 0


def _outputs(options: Options) -> list[Path]:
    if not 1 <= options.variants <= 100:
        raise InputError(f"--variants must be 1 to 100, got {options.variants}")
    return output_paths(options.out, options.variants)


def _request(options: Options) -> Request:
    needed = options.method in inbetween.METHODS and options.method != "interp"
    session = load(options.model) if needed or options.model is not None else None
    return Request(options.method, session, options.style, options.path, options.seed)


@dataclass(frozen=True, eq=False)
class _Pose:
    """A frame of a file."""

    pose: Motion
    file: str
    frame: int


def _pose(text: str, default: int) -> _Pose:
    name, frame = (text, None) if Path(text).is_file() else key_text.parse_pose(text)
    clip = bvh.read(name)
    number = key_text.frame_in_clip(default if frame is None else frame, len(clip), name)
    return _Pose(clip[number], name, number)


def _two_rows(first: _Pose, last: _Pose, frames: int) -> tuple[bvh.BvhLayout, dict[int, int]]:
    """The start's layout with the text of both poses' rows, and which output frames take them digit for digit.

    The target's text fits where its file has the same channels and unit; otherwise its numbers are written anew.
    """
    a, b = first.pose.layout, last.pose.layout
    assert isinstance(a, bvh.BvhLayout)
    assert isinstance(b, bvh.BvhLayout)
    rows, verbatim = [a.row(first.frame)], {0: 0}
    if a.channels == b.channels and a.metres_per_unit == b.metres_per_unit and np.array_equal(a.offsets, b.offsets):
        rows.append(b.row(last.frame))
        verbatim[frames + 1] = 1
    return replace(a, rows="\n".join(rows).encode()), verbatim


def _write(paths: Sequence[Path], motions: Sequence[Motion], verbatim: dict[int, int]) -> None:
    def write(i: int, path: Path) -> None:
        if path.suffix.lower() == ".glb":
            from interpose.io import gltf

            gltf.write(path, [motions[i]])
        else:
            bvh.write(path, motions[i], verbatim=verbatim)

    write_all(paths, write)


def _report(paths: Sequence[Path], told: Sequence[Sequence[Info]], as_json: bool) -> None:
    for variant, (path, infos) in enumerate(zip(paths, told, strict=True), start=1):
        for info in infos:
            if as_json:
                print(json.dumps({**asdict(info), "variant": variant, "output": str(path)}, ensure_ascii=False))
            else:
                print(_line(info), file=sys.stderr)
        print(f"wrote {path}", file=sys.stderr)


def _line(info: Info) -> str:
    slide = "" if info.foot_slide_cm_per_frame is None else f", foot slide {info.foot_slide_cm_per_frame:.2f} cm/frame"
    why = "" if info.fallback is None else f" (interpolated: {info.fallback})"
    arrival = f"{info.arrival_position_error_m * 100:.3f} cm, {info.arrival_rotation_error_deg:.3f} deg"
    return (
        f"{info.start} -> {info.target}: {info.frames} frames by {info.method}, arrival error {arrival}{slide}, "
        f"{info.seconds:.2f} s{why}"
    )
