"""`interpose info` and `interpose models`: what files and models hold."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

from interpose import io, retarget
from interpose.errors import InputError
from interpose.motion import Motion


def info(files: Sequence[str], as_json: bool) -> int:
    """Print each file's report; 1 where one of them cannot be read."""
    status = 0
    for name in files:
        try:
            told = describe(name, io.read(name))
        except InputError as error:
            print(f"interpose: {error}", file=sys.stderr, flush=True)
            status = 1
            continue
        print(json.dumps(told, ensure_ascii=False) if as_json else _text(told), flush=True)
    return status


def describe(name: str, clip: Motion) -> dict[str, Any]:
    """What `interpose info` tells of a clip; `mapping` is None where no humanoid is found, `problem` then says why."""
    try:
        mapping, problem = retarget.map_skeleton(clip), None
    except InputError as error:
        mapping, problem = None, str(error)
    return {
        "file": name,
        "joints": len(clip.skeleton),
        "frames": len(clip),
        "rate": clip.rate,
        "unit_m": 1.0 if clip.layout is None else clip.layout.metres_per_unit,
        "duration_s": clip.duration,
        "profile": None if mapping is None else mapping.profile,
        "mapping": None if mapping is None else mapping.pairs(),
        "missing": None if mapping is None else list(mapping.missing),
        "unmapped": list(clip.skeleton.names) if mapping is None else list(mapping.unmapped),
        "scale": None if mapping is None else mapping.scale,
        "problem": problem,
    }


def _text(told: dict[str, Any]) -> str:
    units = {0.001: "mm", 0.01: "cm", 0.0254: "inches", 1.0: "m"}
    unit = units.get(told["unit_m"], f"{told['unit_m']:.4g} m")
    lines = [
        told["file"],
        f"  {told['joints']} joints, {told['frames']} frames at {told['rate']:g} Hz "
        f"({told['duration_s']:.2f} s), unit {unit}",
    ]
    if told["mapping"] is None:
        return "\n".join([*lines, f"  not a humanoid: {told['problem']}; its gaps can only be interpolated"])
    lines.append(f"  profile {told['profile']}, {told['scale']:.3f} times its size is the model's")
    width = max(map(len, told["mapping"]))
    lines += [f"    {ours:<{width}}  {theirs or '-'}" for ours, theirs in told["mapping"].items()]
    lines.append(f"  missing: {', '.join(told['missing']) or 'none'}")
    lines.append(f"  interpolated, for want of a counterpart: {', '.join(told['unmapped']) or 'none'}")
    return "\n".join(lines)


def models(as_json: bool) -> int:
    """Print the installed models."""
    from interpose.runtime import model_folder

    sessions = [model_folder.load(folder) for folder in model_folder.installed()]
    if as_json:
        for one in sessions:
            print(json.dumps({"folder": str(one.path), **one.info}, ensure_ascii=False))
        return 0
    if not sessions:
        print(f"no model is installed in {model_folder.INSTALLED}", file=sys.stderr)
    for one in sessions:
        told = one.info
        print(f"{one.name}: method {one.method}, {told.get('rate', 30.0):g} Hz, {told.get('parameters', 0):,} weights")
        print(f"  trained on  {', '.join(told.get('training_data') or ['unknown data'])}")
        print(f"  licence     {told['licence']}")
        print(f"  styles      {', '.join(one.styles) or 'none'}")
        gallery = told.get("gallery")
        print(f"  gallery     {gallery['made_from'] if gallery else 'none'}")
    return 0
