"""The same two keys in several styles and variants: numbers to compare them by, and one picture of all.

    python examples/02_styles_and_variants.py                                 the first three styles, two variants each
    python examples/02_styles_and_variants.py --styles Angry Drunk --variants 4 -o sheet.png

Candidates come best first: least foot slide and least jolt at the keys. The same seed gives the same candidates.
"""

from __future__ import annotations

import argparse

import interpose as ip
from interpose import retarget
from interpose.demo import poses
from interpose.motion import concatenate
from interpose.render import SheetRow, contact_sheet

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--styles", nargs="*", help="the first three of the model where left out")
parser.add_argument("--variants", type=int, default=2)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--model", help="an installed model's name or a folder")
parser.add_argument("-o", "--out", default="styles.png")
given = parser.parse_args()

model = ip.load_model(given.model)
start, target = poses.pose(poses.STAND), poses.pose(poses.WALK_LEFT, (0.8, 2.6), heading=30.0)
mapping = retarget.map_skeleton(start)  # found once, used for every call: the rig is the same

rows = []
for style in given.styles or [*model.styles[:3], None]:
    found = model.inbetween(start, target, 89, style=style, variants=given.variants, seed=given.seed, mapping=mapping)
    for number, candidate in enumerate(found, start=1):
        slide = candidate.info.foot_slide_cm_per_frame
        said = "no foot slide known" if slide is None else f"foot slide {slide:.2f} cm/frame"
        print(f"{style or 'free':12} variant {number}: {said}")
        whole = concatenate(start, candidate.motion, target)
        rows.append(SheetRow(whole, f"{style or 'free'} {number}", ("89 frames, 3 s", said)))
contact_sheet(given.out, rows, "styles and variants", "the start in blue, the target in orange, the rest generated")
print(f"wrote {given.out}")
