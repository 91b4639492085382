"""`interpose evaluate gallery`: what a gallery's paths and durations are worth on gaps that it has not seen.

Windows of a prepared database, one start frame known. The model fills each gap along several paths of the true
duration: its own (`none`), a straight line (`straight`), the proposal that is the default in use (`gallery`), a direct
candidate drawn at random as the paper's Algorithm 1 draws it (`random`), and the true root's (`true`). Feet are
planted, as in use. Beside that: how near the suggested duration is to the true one, and how far apart the roots of
seven variants are, as the gallery makes them and as the model's start phases alone do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.data.database import Database
from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.evaluate import metrics, tables
from interpose.evaluate.fill import Contender, fill
from interpose.evaluate.lafan1 import forward_kinematics
from interpose.evaluate.metrics import Scores
from interpose.evaluate.tables import Row
from interpose.features import RATE
from interpose.gallery import matching, paths, proposals
from interpose.gallery.paths import query_of
from interpose.gallery.proposals import PathRequest, Unreachable
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import posture_of, track_of
from interpose.gallery.weighing import NOTHING_KNOWN, EndStates, gather
from interpose.gallery.windows import select
from interpose.motion import Motion
from interpose.runtime import guidance, poses
from interpose.runtime.gap_batch import Draw
from interpose.runtime.guidance import Gap
from interpose.runtime.methods import backend_of
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path as RootPath
from interpose.runtime.ranking import TOES
from interpose.runtime.request import Request
from interpose.runtime.transition import path_deviation
from interpose.skeleton import HUMANOID

LENGTHS = (30, 45, 60, 90)
OFFSET, HELD_OUT_OFFSET = 40, 12
"""Frames from one window to the next; fewer where only the ends of clips are used."""
MOST = 400
"""Windows of one length at most, evenly spaced."""
VARIANTS, VARIED = 7, 40
"""Variants of a gap, and gaps of a length, for the diversity."""
HEADING = """# Paths and durations

One start frame, paths of the true duration, feet planted. In brackets: the ratio to `interp` on the same windows. L2P
is scaled by the deviation of each coordinate over these windows, so only its ratios compare with other tables. *random*
is a direct candidate as Algorithm 1 of the paper draws it, *gallery* the proposal that is the default in use, *none*
the model's own way, *phases* variants that differ by their start phases alone. Intervals (95 %, bootstrap over windows)
are in `results.json` and `results.csv`.
"""


@dataclass(frozen=True, eq=False)
class Gaps:
    """Gaps of one length: frames from the start key to the target, both included, and what belongs to them."""

    root: Float[ndarray, "gap frame 3"]
    local: Float[ndarray, "gap frame 22 4"]
    positions: Float[ndarray, "gap frame 22 3"]
    paths: list[Float[ndarray, "frame 3"]]
    ends: list[EndStates]

    def __len__(self) -> int:
        return len(self.root)

    @property
    def frames(self) -> int:
        """Frames between the keys."""
        return self.root.shape[1] - 2

    def gap(self, row: int) -> Gap:
        """One of them as a plan sees it."""
        keys = Motion(HUMANOID, self.root[row][[0, -1]], self.local[row][[0, -1]], RATE)
        return Gap(keys[0], keys[1])


def evaluate_gallery(
    database: Database,
    gallery: Gallery,
    session: Session,
    out: Path,
    *,
    part: str = "all",
    lengths: Sequence[int] = LENGTHS,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[Row]:
    """Run the comparison of the module's text and write ``results.json``, ``.csv``, ``.md`` and ``l2p.png`` to ``out``.

    part: 'all' of the database, or 'held-out', the ends of the clips that trainings hold out. Raises InputError for
    another part and where no clip is long enough.
    """
    if part not in ("all", "held-out"):
        raise InputError(f"unknown part '{part}' of a database; use all or held-out")
    ranges = [(int(a), int(b)) for a, b in database.ranges] if part == "all" else training_ranges(database)[1]
    rows: list[Row] = []
    errors = []
    for frames in sorted(set(lengths)):
        gaps = cut(database, ranges, frames, OFFSET if part == "all" else HELD_OUT_OFFSET)
        progress(f"{len(gaps)} gaps of {frames} frames")
        rows += case_rows(gaps, gallery, session, seed)
        errors.append(duration_errors(gaps, gallery, seed))
        rows += _duration_rows(errors[-1], frames, seed)
    rows += _duration_rows(np.concatenate(errors), 0, seed)
    tables.write(rows, out, HEADING)
    return rows


def cut(database: Database, ranges: list[tuple[int, int]], frames: int, offset: int) -> Gaps:
    """The gaps of ``frames`` frames in those ranges, one each ``offset`` frames, at most :data:`MOST` of them.

    Each is moved so that the mean of its root is the origin of the ground, and turned to begin facing +Z. Raises
    InputError where there is none.
    """
    starts = np.array([s for a, b in ranges for s in range(a, b - frames - 1, offset)], dtype=np.int64)
    if not len(starts):
        raise InputError(f"{database.path}: no range of it holds a gap of {frames} frames; use shorter gaps")
    starts = starts[np.unique(np.linspace(0, len(starts) - 1, MOST).astype(int))]
    recorded = [database.motion(start, start + frames + 2) for start in starts.tolist()]
    root = np.stack([motion.root_positions for motion in recorded])
    local = np.stack([motion.local_rotations for motion in recorded])
    up = np.array([0.0, 1.0, 0.0])
    turn = rotation.inverse(rotation.twist(local[:, 0, 0], up))[:, None]
    root = rotation.rotate(turn, root - root.mean(axis=1, keepdims=True) * [1.0, 0.0, 1.0])
    local[:, :, 0] = rotation.multiply(turn, local[:, :, 0])
    motions = [Motion(HUMANOID, r, q, RATE) for r, q in zip(root, local, strict=True)]
    ends = [EndStates((posture_of(motion[0])[0], posture_of(motion[-1])[0])) for motion in motions]
    return Gaps(
        root, local, forward_kinematics(HUMANOID, root, local)[1], [track_of(motion) for motion in motions], ends
    )


def case_rows(gaps: Gaps, gallery: Gallery, session: Session, seed: int = 0) -> Iterator[Row]:
    """All rows of one length."""
    scale = gaps.positions.std(axis=(0, 1)) + 1e-6
    steps = gaps.frames + 1
    base = poses.interpolation((gaps.root[:, 0], gaps.local[:, 0]), (gaps.root[:, -1], gaps.local[:, -1]), gaps.frames)
    six = base[:, 1:-1, 3:].reshape(len(gaps), gaps.frames, len(HUMANOID), 6)
    straight = kinematics.global_positions(base[:, 1:-1, :3], rotation.from_6d(six), HUMANOID.parents, HUMANOID.offsets)
    reference = _scores(gaps, straight, scale)
    yield from tables.scored(reference, reference, "interp", "gallery", gaps.frames, 1, seed)
    yield from tables.scored(
        {"foot_slide": _slide(gaps, gaps.positions[:, 1:-1])}, {}, "truth", "gallery", gaps.frames, 1, seed
    )
    kinds: dict[str, list[RootPath | None]] = {
        "none": [None] * len(gaps),
        "straight": [paths.straight(query_of(way), steps) for way in gaps.paths],
        "random": [_random(gallery, way, seed + row) for row, way in enumerate(gaps.paths)],
        "gallery": [_planned(session, gallery, gaps.gap(row), steps, seed) for row in range(len(gaps))],
        "true": [*gaps.paths],
    }
    for name, chosen in kinds.items():
        root, local = _filled(session, gaps, chosen)
        found = _scores(gaps, forward_kinematics(HUMANOID, root, local)[1], scale)
        away = [path_deviation(made, path) for made, path in zip(root, chosen, strict=True) if path is not None]
        if away:
            found["path_deviation"] = metrics.mean(np.array(away)[:, None])
        yield from tables.scored(found, reference, name, "gallery", gaps.frames, 1, seed)
    for name, found in _diversity(gaps, gallery, session, seed).items():
        yield from tables.scored({"diversity": found}, {}, name, "gallery", gaps.frames, 1, seed)


def _planned(session: Session, gallery: Gallery, gap: Gap, steps: int, seed: int) -> RootPath | None:
    """The path that `interpose between` takes by default."""
    request = Request(session.method, session, gallery=gallery, path="gallery", seed=seed)
    return guidance.guide(request, gap, steps, 1)[0].path


def _random(gallery: Gallery, way: RootPath, seed: int) -> RootPath | None:
    """A direct candidate of about the true duration, drawn at random (Algorithm 1, line 25)."""
    draw, steps = np.random.default_rng(seed), len(way) - 1
    query, lengths = query_of(way), (int(steps / 1.1), int(np.ceil(steps * 1.1)))
    pool = gather(gallery, query, NOTHING_KNOWN, lengths, None, draw)
    if not len(pool):
        return None
    (trace,) = matching.traces(select(pool.found, draw.integers(len(pool), size=1)))
    return paths.retime(paths.place(gallery.tracks, trace, query), steps)


def _filled(
    session: Session, gaps: Gaps, chosen: Sequence[RootPath | None], vary: int | None = None
) -> tuple[Float[ndarray, "gap frame 3"], Float[ndarray, "gap frame 22 4"]]:
    """The gaps' inner frames along those paths, feet planted; ``vary`` is a seed of start phases."""
    contender = Contender(session.name, backend_of(session.method), session)
    drawn: list[Draw] = [None if vary is None else (vary, row) for row in range(len(gaps))]
    keys = (gaps.root[:, :1], gaps.local[:, :1]), (gaps.root[:, -1:], gaps.local[:, -1:])
    return fill(contender, *keys, gaps.frames, paths=chosen, draws=drawn).motion


def _scores(gaps: Gaps, made: Float[ndarray, "gap frame 22 3"], scale: Float[ndarray, "22 3"]) -> dict[str, Scores]:
    true = gaps.positions[:, 1:-1]
    whole = np.concatenate([gaps.positions[:, :1], made, gaps.positions[:, -1:]], axis=1)
    return {
        "L2P": metrics.l2p(made, true, scale),
        "ADE": metrics.ade(made, true),
        "foot_slide": _slide(gaps, made),
        "jerk_ratio": metrics.jerk_ratio(whole, gaps.positions),
    }


def _slide(gaps: Gaps, made: Float[ndarray, "gap frame 22 3"]) -> Scores:
    whole = np.concatenate([gaps.positions[:, :1], made, gaps.positions[:, -1:]], axis=1)
    return metrics.foot_slide(whole[:, :, TOES])


def duration_errors(gaps: Gaps, gallery: Gallery, seed: int = 0) -> Float[ndarray, "gap"]:
    """How far the suggested duration is from the true one, as a share of it; infinite where none can be suggested."""
    steps, away = gaps.frames + 1, []
    for way, ends in zip(gaps.paths, gaps.ends, strict=True):
        try:
            away.append(abs(proposals.suggestion(gallery, query_of(way), ends, None, seed).steps - steps) / steps)
        except Unreachable:
            away.append(np.inf)
    return np.array(away)


def _duration_rows(away: Float[ndarray, "gap"], frames: int, seed: int) -> Iterator[Row]:
    """Median error and share within 20 %; ``frames`` 0 stands for all lengths together."""
    chosen = np.random.default_rng(seed).integers(0, len(away), size=(1000, len(away)))
    for name, values in (
        ("duration_error_median", np.median(away[chosen], axis=1)),
        ("duration_within_20", np.mean(away[chosen] <= 0.2, axis=1)),
    ):
        value = float(np.median(away)) if name == "duration_error_median" else float(np.mean(away <= 0.2))
        low, high = metrics.interval(values)
        none = float("nan")
        yield Row("gallery", "gallery", frames, name, value, none, low, high, 1, none, none)


def _diversity(gaps: Gaps, gallery: Gallery, session: Session, seed: int) -> dict[str, Scores]:
    """Mean distance between the generated roots of seven variants, metres: along proposals, and from start phases."""
    chosen: Int[ndarray, "gap"] = np.unique(np.linspace(0, len(gaps) - 1, VARIED).astype(int))
    apart: dict[str, list[float]] = {"gallery": [], "phases": []}
    for row in chosen.tolist():
        found: list[RootPath] = []
        try:
            asked = PathRequest(gaps.frames + 1)
            made = proposals.propose(
                gallery, query_of(gaps.paths[row]), asked, gaps.ends[row], count=VARIANTS, seed=seed
            )
            found = [one.path for one in made]
        except Unreachable:
            pass
        for name, ways in (("gallery", found), ("phases", [None] * VARIANTS)):
            if len(ways) < 2:
                apart[name].append(0.0)
                continue
            index = [row] * len(ways)
            same = Gaps(gaps.root[index], gaps.local[index], gaps.positions[index], [], [])
            root = _filled(session, same, ways, seed + 1)[0][:, :, [0, 2]]
            pairs = combinations(range(len(ways)), 2)
            apart[name].append(float(np.mean([np.linalg.norm(root[a] - root[b], axis=-1).mean() for a, b in pairs])))
    return {name: metrics.mean(np.array(values)[:, None]) for name, values in apart.items()}
