"""`interpose info` and `interpose models`: what files and models hold."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

from interpose import io, retarget
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.skeleton import MODEL_RATE


def info(files: Sequence[str], as_json: bool) -> int:
    """Print each file's report; 1 where one of them cannot be read."""
    status = 0
    for name in files:
        try:
            report = describe(name, io.read(name))
        except InputError as error:
            print(f"interpose: {error}", file=sys.stderr, flush=True)
            status = 1
            continue
        print(json.dumps(report, ensure_ascii=False) if as_json else _text(report), flush=True)
    return status


def describe(name: str, clip: Motion) -> dict[str, Any]:
    """What `interpose info` reports of a clip; `mapping` is None where no humanoid is found, with a `problem`."""
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


def _text(report: dict[str, Any]) -> str:
    units = {0.001: "mm", 0.01: "cm", 0.0254: "inches", 1.0: "m"}
    unit = units.get(report["unit_m"], f"{report['unit_m']:.4g} m")
    lines = [
        report["file"],
        f"  {report['joints']} joints, {report['frames']} frames at {report['rate']:g} Hz "
        f"({report['duration_s']:.2f} s), unit {unit}",
    ]
    if report["mapping"] is None:
        return "\n".join([*lines, f"  not a humanoid: {report['problem']}; its gaps can only be interpolated"])
    lines.append(f"  profile {report['profile']}, scaled by {report['scale']:.3f} to the model")
    width = max(map(len, report["mapping"]))
    lines += [f"    {ours:<{width}}  {theirs or '-'}" for ours, theirs in report["mapping"].items()]
    lines.append(f"  missing: {', '.join(report['missing']) or 'none'}")
    lines.append(f"  unmapped, interpolated: {', '.join(report['unmapped']) or 'none'}")
    return "\n".join(lines)


def models(as_json: bool) -> int:
    """Print the installed models: the methods that each serves, the data that it knows, its licence and its styles."""
    from interpose.runtime import model_folder
    from interpose.runtime.backends import backend

    sessions = [model_folder.load(folder) for folder in model_folder.installed()]
    if as_json:
        for one in sessions:
            served = {"folder": str(one.path), "methods": backend.methods_of(one)}
            print(json.dumps(served | one.info, ensure_ascii=False))
        return 0
    if not sessions:
        print(f"no model is installed in {model_folder.INSTALLED}", file=sys.stderr)
    for one in sessions:
        info = one.info
        print(f"{one.name}: {info.get('rate', MODEL_RATE):g} Hz, {info.get('parameters', 0):,} weights")
        for number, name in enumerate(backend.methods_of(one)):
            longest = backend.abilities_of(name, one).longest_seconds
            gaps = "gaps of any length" if longest is None else f"gaps up to {longest:.3g} s"
            heading = "" if number else "methods"
            print(f"  {heading:<11} {name}: {backend.backend_of(name).summary}; {gaps}")
        print(f"  trained on  {', '.join(info.get('training_data') or ['unknown data'])}")
        print(f"  licence     {info['licence']}")
        print(f"  styles      {', '.join(one.styles) or 'none'}")
        gallery = info.get("gallery")
        print(f"  gallery     {gallery['made_from'] if gallery else 'none'}")
    return 0
