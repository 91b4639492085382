"""`interpose evaluate stitch`: table 1 of Ren et al. 2024, and the figures 6 and 8, from exactly two frames.

Windows of 50 frames of subject 5, one each 20, moved and turned by their first frame. A gap of n frames counts both its
keys, as in the paper: frame 0 is the start, frame n - 1 the target, and the n - 2 between are scored.
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
from interpose.evaluate.fill import INTERP, Carrier, Contender, FilledGaps, fill, parse
from interpose.evaluate.metrics import Scores
from interpose.evaluate.stitch_figures import draw_errors, draw_samples
from interpose.evaluate.tables import Row
from interpose.runtime.gap_batch import Batch, Draw

PROTOCOL = "stitch"
LENGTHS = (10, 30, 50)
"""Frames of a gap, both keys counted."""
OFFSET = 20
SAMPLES = 10
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

    data: the folder of LaFAN1's BVH files. methods: as `interpose.evaluate.fill.parse` takes them; those whose variants
    differ by their latents alone are shown with samples. Figure 6 (``errors.png``) shows all methods, figure 8
    (``samples.png``) the first that draws. Raises InputError for what cannot be served, before anything is written.
    """
    if not lengths or min(lengths) < 4 or max(lengths) > lafan1.SCALE_WINDOW:
        raise InputError(f"gaps have 4 to {lafan1.SCALE_WINDOW} frames here, both keys counted, got {list(lengths)}")
    source = lafan1.read(data)
    windows = lafan1.cut(source.clips, lafan1.SCALE_WINDOW, offset, 1)
    carrier = Carrier.of(windows.skeleton, windows.rate)
    chosen = parse(methods, model=model, reserved=("truth",))
    drawn = [one for one in chosen if one.abilities.latent_variants]
    rows: list[Row] = []
    errors: dict[str, list[Float[ndarray, "sample frame"]]] = {}
    for frames in sorted(set(lengths)):
        case = Case(windows, frames, source.scale)
        base = scores(case, *_kinematics(case, _fill(case, INTERP, carrier).motion))
        rows += tables.scored(_alone(case, windows.positions[:, :frames]), {}, "truth", PROTOCOL, frames, 1, seed)
        for method in chosen:
            count = samples if method in drawn else 0
            progress(f"{method.name}: {len(windows)} gaps of {frames} frames, {count} samples each")
            along, several = _several(case, method, carrier, count, seed)
            for name, found in several.items():
                rows += tables.scored(found, base, name, PROTOCOL, frames, 1, seed)
            if frames == max(lengths):
                errors[method.name] = along
    tables.write(rows, out, HEADING)
    draw_errors(errors, out / "errors.png")
    if drawn:
        draw_samples(windows, drawn[0], carrier, max(lengths), out / "samples.png")
    return rows


def keys(windows: lafan1.Windows, frames: int) -> tuple[Batch, Batch]:
    """The first and the last of so many frames."""
    at = slice(frames - 1, frames)
    return (windows.root[:, :1], windows.local[:, :1]), (windows.root[:, at], windows.local[:, at])


def _fill(case: Case, method: Contender, carrier: Carrier, draw: int | None = None) -> FilledGaps:
    """``draw``: the seed of a sample; None for the likeliest motion."""
    drawn: list[Draw] = [None if draw is None else (draw, row) for row in range(len(case.windows))]
    return fill(method, *keys(case.windows, case.frames), case.frames - 2, carrier=carrier, draws=drawn)


def _kinematics(case: Case, motion: Batch) -> tuple[ndarray, ndarray]:
    return lafan1.forward_kinematics(case.windows.skeleton, *motion)


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
    case: Case, method: Contender, carrier: Carrier, samples: int, seed: int
) -> tuple[list[Float[ndarray, "sample frame"]], dict[str, dict[str, Scores]]]:
    """A method's errors along time, and its metrics; where it draws, also those of the mean, of samples, of the
    best."""
    likeliest = _fill(case, method, carrier)
    mean = scores(case, *_kinematics(case, likeliest.motion))
    along = [_along(case, _kinematics(case, likeliest.motion)[1])]
    if not samples:
        return along, {method.name: mean}
    drawn = [_kinematics(case, _fill(case, method, carrier, 1 + seed * samples + i).motion) for i in range(samples)]
    found = [scores(case, *each) for each in drawn]
    distance = likeliest.chain_distance
    apart = {} if distance is None else {"MMPE": metrics.mean(distance[:, None])}
    raw = scores(case, *_kinematics(case, likeliest.raw))
    out = {method.name: mean | apart}
    out[f"{method.name} raw"] = {k: v for k, v in raw.items() if k in ("foot_slide", "jerk_ratio", "L2P")}
    pooled = {name: metrics.pooled([each[name] for each in found]) for name in mean}
    out[f"{method.name} sample"] = pooled | {"APD": metrics.apd(np.stack([p for _, p in drawn]))}
    out[f"{method.name} best of {samples}"] = {name: metrics.best([each[name] for each in found]) for name in BEST}
    worst = max((each["foot_slide"] for each in found), key=lambda s: s.value)
    out[f"{method.name} worst of {samples}"] = {"foot_slide": worst}
    return [_along(case, p) for _, p in drawn[:3]], out


def _along(case: Case, positions: Float[ndarray, "window frame joint 3"]) -> Float[ndarray, "1 frame"]:
    """The mean displacement of the joints in each frame, metres."""
    apart = np.linalg.norm(positions - case.windows.positions[:, 1 : case.frames - 1], axis=-1)
    return np.asarray(apart.mean(axis=(0, 2)))[None]
