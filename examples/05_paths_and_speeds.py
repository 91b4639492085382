"""The same two keys fast, medium and slow, then along three paths that are drawn: one picture of all.

    python examples/05_paths_and_speeds.py
    python examples/05_paths_and_speeds.py --style Chicken --gallery my-gallery -o sheet.png

Without a number of frames the gallery of trajectories suggests a duration, and the speed along a drawn path. A gallery
of your own data: `interpose gallery build DB -o my-gallery`.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import interpose as ip
from interpose.demo import poses
from interpose.gallery import store
from interpose.motion import concatenate
from interpose.render import SheetRow, contact_sheet

PATHS = {"straight on": [(0.0, 1.25)], "a bend to the left": [(1.2, 1.0)], "an S": [(0.6, 0.6), (-0.6, 1.9)]}
"""Points between the keys, x and z in metres; the keys themselves are added."""

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--style", help="one of the model's styles; free where left out")
parser.add_argument(
    "--gallery", type=Path, help="a folder of `interpose gallery build`; the model's own where left out"
)
parser.add_argument("--model", help="an installed model's name or a folder")
parser.add_argument("-o", "--out", default="paths.png")
given = parser.parse_args()

model = ip.load_model(given.model)
gallery = None if given.gallery is None else store.load(given.gallery)
start, target = poses.pose(poses.STAND), poses.pose(poses.WALK_LEFT, (0.0, 2.5))

suggested = model.suggest(start, target, style=given.style, gallery=gallery)
print(f"{suggested.frames} frames suggested")
asked = {each.speed: {"speed": each.speed} for each in suggested.alternatives}
asked |= {name: {"path": points} for name, points in PATHS.items()}
rows = []
for name, options in asked.items():
    made = model.inbetween(start, target, style=given.style, gallery=gallery, **options)[0]
    off = made.info.path_deviation_m
    notes = (f"{made.info.frames} frames, {(made.info.frames + 1) / start.rate:.1f} s",)
    notes += () if off is None else (f"{100 * off:.1f} cm off its path",)
    print(f"{name}: {', '.join(notes)}")
    rows.append(SheetRow(concatenate(start, made.motion, target), name, notes))
contact_sheet(given.out, rows, "speeds and paths", "The start in blue, the target in orange, the rest generated.")
