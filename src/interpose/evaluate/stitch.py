"""`interpose evaluate stitch`: table 1 of Ren et al. 2024, and the figures 6 and 8, from exactly two frames.

Windows of 50 frames of subject 5, one each 20, moved and turned by their first frame. A gap of n frames counts both its
keys, as in the paper (METHOD.md, B4): frame 0 is the start, frame n - 1 the target, and the n - 2 between are scored.
A model that draws is shown three times: the likeliest motion (the prior's mean), the mean of ten samples, and for each
window and metric the best of the ten.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.evaluate import lafan1, metrics, tables
from interpose.evaluate.methods import INTERP, ZERO_VELOCITY, Drawn, Method, drawing, from_model
from interpose.evaluate.metrics import Scores
from interpose.evaluate.stitch_figures import draw_errors, draw_samples
from interpose.evaluate.tables import Row
from interpose.runtime import model_folder

PROTOCOL = "stitch"
LENGTHS = (10, 30, 50)
"""Frames of a gap, both keys counted."""
OFFSET = 20
SAMPLES = 10
DEFAULTS = {"stitch": "stitch-lafan1", "dcmoe": "lafan1"}
"""The installed models that stand for a method where none is named: those trained on LaFAN1's subjects 1 to 4."""
BEST = ("L2P", "L2Q_aligned", "ADE", "SLDE", "NPSS")
"""Metrics of which the best of the samples says something."""
TOES = ("LeftToe", "RightToe")
HEADING = """# Stitching

From exactly two frames: windows of 50 frames of subject 5, one each 20; n frames count both keys (Ren et al. 2024,
table 1). In brackets: the ratio to `interp` on the same windows. *sample* is the mean of ten, *best* the best of the
ten in each window and metric, *worst* the one that slides most. Feet are locked as in use; `raw` is without. With part
of the data set's files only ratios compare with other tables. Intervals (95 %, bootstrap over windows) are in
`results.json`.
"""


@dataclass(frozen=True, eq=False)
class Case:
    """Gaps of one length. frames: of the gap, both keys counted. scale: of L2P."""

    windows: lafan1.Windows
    frames: int
    scale: Float[ndarray, "joint 3"]


def evaluate_stitch(
    data: Path,
    methods: Sequence[str],
    out: Path,
    *,
    model: str | None = None,
    lengths: Sequence[int] = LENGTHS,
    samples: int = SAMPLES,
    offset: int = OFFSET,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[Row]:
    """Runs methods on gaps of which two frames are known; writes ``results.json``, ``.csv``, ``.md`` and figures.

    data: the folder of LaFAN1's BVH files. methods: ``interp``, ``zero-velocity``, ``stitch`` or ``dcmoe`` for
    ``model`` or, without it, for the installed model that was trained on subjects 1 to 4, and ``LABEL=MODEL``; a label
    that ends in ``+detail`` refines. Figure 6 (``errors.png``) shows all methods, figure 8 (``samples.png``) the first
    that draws. Raises InputError for what cannot be served, before anything is written.
    """
    if not lengths or min(lengths) < 4 or max(lengths) > lafan1.SCALE_WINDOW:
        raise InputError(f"gaps have 4 to {lafan1.SCALE_WINDOW} frames here, both keys counted, got {list(lengths)}")
    source = lafan1.read(data)
    windows = lafan1.cut(source.clips, lafan1.SCALE_WINDOW, offset, 1)
    fixed, drawn = _chosen(methods, windows, model, seed)
    rows: list[Row] = []
    errors: dict[str, list[Float[ndarray, "sample frame"]]] = {}
    for frames in sorted(set(lengths)):
        case = Case(windows, frames, source.scale)
        base = scores(case, *_fixed(case, INTERP))
        rows += tables.scored(_alone(case, windows.positions[:, :frames]), {}, "truth", PROTOCOL, frames, 1, seed)
        for method in fixed:
            progress(f"{method.name}: {len(windows)} gaps of {frames} frames")
            made = _fixed(case, method)
            rows += tables.scored(scores(case, *made), base, method.name, PROTOCOL, frames, 1, seed)
            if frames == max(lengths):
                errors[method.name] = [_along(case, made[1])]
        for method in drawn:
            progress(f"{method.name}: {len(windows)} gaps of {frames} frames, {samples} samples each")
            mean, several = _several(case, method, samples)
            for name, found in several.items():
                rows += tables.scored(found, base, name, PROTOCOL, frames, 1, seed)
            if frames == max(lengths):
                errors[method.name] = mean
    tables.write(rows, out, HEADING)
    draw_errors(errors, out / "errors.png")
    if drawn:
        draw_samples(windows, drawn[0], max(lengths), out / "samples.png")
    return rows


def _chosen(
    methods: Sequence[str], windows: lafan1.Windows, model: str | None, seed: int
) -> tuple[list[Method], list[Drawn]]:
    """The methods that give one motion a gap, and those that draw."""
    fixed: list[Method] = []
    drawn: list[Drawn] = []
    baselines = {method.name: method for method in (INTERP, ZERO_VELOCITY)}
    for text in methods:
        label, equals, name = text.strip().partition("=")
        if not label or (equals and not name) or (equals and label in baselines):
            raise InputError(f"--methods {text}: give interp, zero-velocity, stitch, dcmoe or LABEL=MODEL")
        if label in baselines:
            fixed.append(baselines[label])
            continue
        if not equals and label not in DEFAULTS:
            raise InputError(f"--methods {text}: no such method; there are {', '.join((*baselines, *DEFAULTS))}")
        chosen = name if equals else model or DEFAULTS[label]
        skeleton, rate = windows.skeleton, windows.rate
        if model_folder.load(chosen).method == "stitch":
            drawn.append(drawing(label, chosen, skeleton, rate, seed=seed))
        else:
            fixed.append(from_model(label, chosen, skeleton, rate, seed=seed))
    names = [m.name for m in (*fixed, *drawn)]
    if not names or len(set(names)) < len(names):
        raise InputError(f"--methods names each method once, got {', '.join(names) or 'none'}")
    return fixed, drawn


def _keys(case: Case) -> tuple[ndarray, ndarray, ndarray, ndarray, int]:
    w, last = case.windows, case.frames - 1
    return w.root[:, :1], w.local[:, :1], w.root[:, last], w.local[:, last], case.frames - 2


def _fixed(case: Case, method: Method) -> tuple[Float[ndarray, "window frame joint 4"], ndarray]:
    return lafan1.forward_kinematics(case.windows.skeleton, *method.generate(*_keys(case)))


def scores(
    case: Case, rotations: Float[ndarray, "window frame joint 4"], positions: Float[ndarray, "window frame joint 3"]
) -> dict[str, Scores]:
    """All metrics of one motion a gap."""
    w, last = case.windows, case.frames - 1
    inner = slice(1, last)
    true_rotations, true_positions = w.rotations[:, inner], w.positions[:, inner]
    whole = np.concatenate([w.positions[:, :1], positions, w.positions[:, last : last + 1]], axis=1)
    return {
        "L2P": metrics.l2p(positions, true_positions, case.scale),
        "L2Q": metrics.l2q(rotations, true_rotations),
        "L2Q_aligned": metrics.l2q_aligned(rotations, true_rotations),
        "NPSS": metrics.npss(rotations, true_rotations),
        "ADE": metrics.ade(positions, true_positions),
        "SLDE": metrics.slde(positions, true_positions),
        "jerk_ratio": metrics.jerk_ratio(whole, w.positions[:, : case.frames]),
    } | _alone(case, whole)


def _alone(case: Case, whole: Float[ndarray, "window frame joint 3"]) -> dict[str, Scores]:
    """What needs no truth, of gaps with both keys."""
    toes = whole[:, :, [case.windows.skeleton.index(name) for name in TOES]]
    speed, acceleration = metrics.seam(whole)
    return {
        "foot_slide": metrics.foot_slide(toes),
        "arrival_position": metrics.arrival_position(whole[:, :-1], whole[:, -1]),
        "seam_speed": speed,
        "seam_acceleration": acceleration,
    }


def _several(
    case: Case, method: Drawn, samples: int
) -> tuple[list[Float[ndarray, "sample frame"]], dict[str, dict[str, Scores]]]:
    """Of a method that draws: its errors along time, and the metrics of the mean, of samples, and of the best."""
    made = method.draw(*_keys(case), samples)
    skeleton = case.windows.skeleton
    kinematics = [lafan1.forward_kinematics(skeleton, root, local) for root, local in made.motions]
    found = [scores(case, *each) for each in kinematics]
    mean, drawn = found[0], found[1:]
    raw = lafan1.forward_kinematics(skeleton, *made.raw)
    out = {method.name: mean | {"MMPE": metrics.mean(made.apart[:, None])}}
    out[f"{method.name} raw"] = {
        k: v for k, v in scores(case, *raw).items() if k in ("foot_slide", "jerk_ratio", "L2P")
    }
    sample = {name: metrics.pooled([each[name] for each in drawn]) for name in mean}
    positions = np.stack([p for _, p in kinematics[1:]])
    out[f"{method.name} sample"] = sample | {"APD": metrics.apd(positions)}
    out[f"{method.name} best of {samples}"] = {name: metrics.best([each[name] for each in drawn]) for name in BEST}
    slides = [each["foot_slide"] for each in drawn]
    worst = max(slides, key=lambda s: s.value)
    out[f"{method.name} worst of {samples}"] = {"foot_slide": worst}
    return [_along(case, p)[0][None] for _, p in kinematics[1:4]], out


def _along(case: Case, positions: Float[ndarray, "window frame joint 3"]) -> Float[ndarray, "1 frame"]:
    """The mean displacement of the joints in each frame, metres."""
    apart = np.linalg.norm(positions - case.windows.positions[:, 1 : case.frames - 1], axis=-1)
    return np.asarray(apart.mean(axis=(0, 2)))[None]
