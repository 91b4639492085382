"""How well partial targets are completed: `python benchmarks/target_parts.py DB MODEL [PAIRS] [OUT]`.

Pairs of held-out frames half a second to three seconds apart. For each group that may be given: how far the joints left
free are from the truth, centimetres, of the start pose carried along, of the likeliest completion and of the best of
eight; what the given part misses at most; how far the lowest joint is under the floor at most, where the truth's is
not; the median time of one completion. OUT gets a contact sheet of a few.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from interpose import load_model, parts, retarget
from interpose.data import database
from interpose.data.split import training_ranges
from interpose.motion import concatenate
from interpose.render import SheetRow, contact_sheet
from interpose.runtime import target_parts
from interpose.runtime.request import Request

VARIANTS = 8
SHOWN = 5


def main(db: Path, name: str, pairs: int = 40, out: Path | None = None) -> None:
    """Prints a row for each group."""
    model, data = load_model(name).session, database.load(db)
    request = Request(model.method, model)
    ranges = data.ranges.tolist() if "test" in db.name else training_ranges(data)[1]
    random = np.random.default_rng(0)
    drawn = []
    while len(drawn) < pairs:
        a, b = ranges[random.integers(len(ranges))]
        steps = int(random.integers(15, 91))
        if b - a > steps + 4:
            at = int(random.integers(a + 2, b - steps))
            drawn.append((data.motion(at - 1, at + 1), data.motion(at + steps, at + steps + 1), steps))
    mapping = retarget.map_skeleton(drawn[0][0])
    print("| given | carried cm | likeliest cm | best of 8 cm | misses m | deg | unreached | under floor cm | ms |")
    print("|---|---|---|---|---|---|---|---|---|")
    for group in [*parts.GROUPS, parts.GROUND, "hips,hands", "left-hand,right-foot"]:
        given, figures, rows = parts.parse(group), [], []
        unreached = 0
        for start, target, steps in drawn:
            began = time.perf_counter()
            (likeliest,) = target_parts.complete(start, target, given, request, mapping, steps)
            took = time.perf_counter() - began
            (carried,) = target_parts.complete(start, target, given, Request("interp"), mapping, steps)
            varied = replace(request, seed=1)
            others = target_parts.complete(start, target, given, varied, mapping, steps, VARIANTS - 1)
            true, free = target.global_positions()[0], ~given.known
            wrong = [
                100.0 * np.linalg.norm(e.pose.global_positions()[0] - true, axis=-1)[free].mean()
                for e in (carried, likeliest, *others)
            ]
            miss = target_parts.missed(likeliest.pose, target, given, mapping)
            unreached += likeliest.note is not None
            low = min(0.0, float(true[:, 1].min())) - likeliest.pose.global_positions()[0, :, 1].min()
            if likeliest.note is not None:
                miss = (0.0, 0.0)
            figures.append([wrong[0], wrong[1], min(wrong[1:]), *miss, max(100.0 * low, 0.0), 1000.0 * took])
            if len(rows) < 2 * SHOWN:
                shown = concatenate(start[-1], carried.pose, likeliest.pose, *(o.pose for o in others[:4]), target)
                rows.append(SheetRow(shown, f"{group}: start, carried, likeliest, four more, truth"))
        f = np.array(figures)
        mean, most = f.mean(axis=0), f.max(axis=0)
        print(
            f"| {group} | {mean[0]:.1f} | {mean[1]:.1f} | {mean[2]:.1f} | {most[3]:.0e} | {most[4]:.0e} | "
            f"{unreached}/{pairs} | {most[5]:.1f} | {np.median(f[:, 6]):.0f} |",
            flush=True,
        )
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            contact_sheet(out / f"{group}.png", rows[:SHOWN], name, group, poses=8)


if __name__ == "__main__":
    args = sys.argv[1:]
    main(Path(args[0]), args[1], int(args[2]) if len(args) > 2 else 40, Path(args[3]) if len(args) > 3 else None)
