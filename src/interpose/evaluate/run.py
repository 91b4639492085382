"""`interpose evaluate lafan1`: methods against the truth, as tables and a figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.evaluate import lafan1, metrics, tables
from interpose.evaluate.fill import INTERP, Carrier, Contender, fill, parse
from interpose.evaluate.metrics import Scores
from interpose.evaluate.tables import Row

LENGTHS = (*lafan1.LENGTHS, 60, 90)
TRUTH = "truth"
"""The name under which the tables show the metrics that need no comparison for the true motion."""
TOES = ("LeftToe", "RightToe")
HEADING = """# LaFAN1

Test windows of subject 5: the official protocol (`lafan1`) up to 45 frames, longer windows (`lafan1-extended`) beyond.
*Context* is the number of known frames before the transition. In brackets: the ratio to `interp` on the same windows.
With part of the data set's files only these ratios compare with other tables, not the values. Intervals (95 %,
bootstrap over windows) are in `results.json` and `results.csv`; what each metric is, in `interpose.evaluate.metrics`.
"""


def evaluate_lafan1(
    data: Path,
    methods: Sequence[str],
    out: Path,
    *,
    lengths: Sequence[int] = LENGTHS,
    context_frames: int = 1,
    seed: int = 0,
    model: str | None = None,
    progress: Callable[[str], None] = lambda message: None,
) -> list[Row]:
    """Run methods on LaFAN1's test windows and write ``results.json``, ``.csv``, ``.md`` and ``l2p.png`` to ``out``.

    data: the folder of LaFAN1's BVH files. methods: as `interpose.evaluate.fill.parse` takes them. lengths: of the
    transitions, in frames. context_frames: 1 to 10, how many frames the models know before the transition, the start
    key included (the baselines know the protocol's ten and use the last). Where matplotlib is not installed there is no
    figure. Raises InputError for a method, a length, a context or a folder that cannot be served, before anything is
    written.
    """
    if not 1 <= context_frames <= lafan1.PAST:
        raise InputError(f"the context has 1 to {lafan1.PAST} frames, not {context_frames}")
    if not lengths or min(lengths) < 2:
        raise InputError(f"transition lengths must be 2 frames or more, got {', '.join(map(str, lengths)) or 'none'}")
    chosen = parse(methods, model=model, context_frames=context_frames, reserved=(TRUTH,))
    progress(f"reading {data}")
    source = lafan1.read(data)
    carrier = Carrier.of(source.clips[0].skeleton, source.clips[0].rate)
    rows: list[Row] = []
    for window, group in groupby(sorted(set(lengths)), lafan1.window_length):
        windows = lafan1.cut(source.clips, window)
        for frames in group:
            rows += case_rows(Case(windows, frames, source.scale), chosen, carrier, seed, progress)
    tables.write(rows, out, HEADING)
    return rows


@dataclass(frozen=True, eq=False)
class Case:
    """One transition length: the windows, the frames to generate after the past ones, and the scale of L2P."""

    windows: lafan1.Windows
    frames: int
    scale: Float[ndarray, "joint 3"]

    @property
    def start(self) -> int:
        return lafan1.PAST - 1

    @property
    def target(self) -> int:
        return lafan1.PAST + self.frames


def case_rows(
    case: Case,
    methods: Sequence[Contender],
    carrier: Carrier,
    seed: int = 0,
    progress: Callable[[str], None] = lambda message: None,
) -> list[Row]:
    """All metrics of all methods on one transition length, each with its ratio to interp, and the truth's beside."""
    base = scores(case, INTERP, carrier)
    rows = list(
        tables.scored(truth_scores(case), {}, TRUTH, lafan1.protocol(case.frames), case.frames, lafan1.PAST, seed)
    )
    for method in methods:
        progress(f"{method.name}: {len(case.windows)} transitions of {case.frames} frames")
        found = base if method is INTERP else scores(case, method, carrier)
        rows += tables.scored(
            found, base, method.name, lafan1.protocol(case.frames), case.frames, method.context_frames, seed
        )
    return rows


def scores(case: Case, method: Contender, carrier: Carrier) -> dict[str, Scores]:
    """All metrics of one method, by name."""
    w, past = case.windows, slice(0, lafan1.PAST)
    target = slice(case.target, case.target + 1)
    keys = (w.root[:, past], w.local[:, past]), (w.root[:, target], w.local[:, target])
    return judged(case, *fill(method, *keys, case.frames, carrier=carrier).motion)


def judged(
    case: Case, made_root: Float[ndarray, "window frame 3"], made_local: Float[ndarray, "window frame joint 4"]
) -> dict[str, Scores]:
    """All metrics of the frames between the keys of each window, by name."""
    windows, start, target = case.windows, case.start, case.target
    made_rotations, made_positions = lafan1.forward_kinematics(windows.skeleton, made_root, made_local)
    inner = slice(start + 1, target)
    true_rotations, true_positions = windows.rotations[:, inner], windows.positions[:, inner]
    whole = windows.positions.copy()
    whole[:, inner] = made_positions
    with_keys = slice(start, target + 1)
    return {
        "L2P": metrics.l2p(made_positions, true_positions, case.scale),
        "L2Q": metrics.l2q(made_rotations, true_rotations),
        "L2Q_aligned": metrics.l2q_aligned(made_rotations, true_rotations),
        "NPSS": metrics.npss(made_rotations, true_rotations),
        "ADE": metrics.ade(made_positions, true_positions),
        "SLDE": metrics.slde(made_positions, true_positions),
        "jerk_ratio": metrics.jerk_ratio(whole[:, with_keys], windows.positions[:, with_keys]),
    } | _alone(case, whole)


def truth_scores(case: Case) -> dict[str, Scores]:
    """The metrics that compare with no truth, of the truth itself."""
    return _alone(case, case.windows.positions)


def _alone(case: Case, positions: Float[ndarray, "window frame joint 3"]) -> dict[str, Scores]:
    start, target, rate = case.start, case.target, case.windows.rate
    with_keys = positions[:, start : target + 1]
    toes = with_keys[:, :, [case.windows.skeleton.index(name) for name in TOES]]
    return {
        "foot_slide": metrics.foot_slide(toes),
        "foot_slide_speed": metrics.foot_slide_speed(toes, rate),
        "foot_slide_share": metrics.foot_slide_share(toes, rate),
        "arrival_position": metrics.arrival_position(with_keys[:, :-1], with_keys[:, -1]),
        "key_acceleration": metrics.key_acceleration(positions, rate, start, target),
    }
