"""How much a style and a variant change a transition: `python benchmarks/style_effect.py [MODEL ...]`.

The demo's plain walk of 59 frames in every style of the model, and in one style in six variants: the mean distance of a
joint between two of them, over all pairs, in centimetres. Once with paths as by default, once without.
"""

from __future__ import annotations

import sys
from itertools import combinations

import numpy as np

from interpose import Motion, load_model
from interpose.demo import poses

VARIANTS = 6


def main(models: list[str | None]) -> None:
    """Prints a row for each model."""
    keys = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 2.3))
    print("| model | path | between styles, cm | between variants of one style, cm |\n|---|---|---|---|")
    for name in models:
        model = load_model(name)
        for path in ("auto", "none"):
            asked = {"frames": 59, "path": path}
            styles = [model.inbetween(*keys, style=style, **asked)[0].motion for style in model.styles]
            variants = model.inbetween(*keys, style=model.styles[0], variants=VARIANTS, seed=1, **asked)
            found = apart(styles), apart([v.motion for v in variants])
            print(f"| {name or 'default'} | {path} | {found[0]:.1f} | {found[1]:.1f} |")


def apart(motions: list[Motion]) -> float:
    """The mean distance of a joint between two of the motions, over all pairs, in centimetres."""
    positions = [motion.global_positions() for motion in motions]
    return 100.0 * float(np.mean([np.linalg.norm(a - b, axis=-1).mean() for a, b in combinations(positions, 2)]))


if __name__ == "__main__":
    main(list(sys.argv[1:]) or [None])
