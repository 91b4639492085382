"""What `--style-strength` does: `python benchmarks/style_strength.py [MODEL ...]`.

The demo's plain walk of 59 frames in every style of the model at several strengths: the mean
distance of a joint between two styles and from the free motion, centimetres; the jerk beside that of the free motion;
foot slide; how far any joint is from where it was a frame before at most, centimetres.
"""

from __future__ import annotations

import sys
from itertools import combinations

import numpy as np

from interpose import Motion, load_model
from interpose.demo import poses
from interpose.motion import concatenate

STRENGTHS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)


def main(models: list[str | None]) -> None:
    """Prints a row for each model, kind of path and strength."""
    keys = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 2.3))
    print("| model | path | strength | between styles, cm | from free, cm | jerk / free | foot slide | step, cm |")
    print("|---|---|---|---|---|---|---|---|")
    for name in models:
        model = load_model(name)
        for path in ("auto", "none"):
            (free,) = model.inbetween(*keys, 59, path=path)
            for strength in STRENGTHS:
                made = [
                    model.inbetween(*keys, 59, path=path, style=style, style_strength=strength)[0]
                    for style in model.styles
                ]
                apart = [distance(a.motion, b.motion) for a, b in combinations(made, 2)]
                gone = [distance(free.motion, each.motion) for each in made]
                jerk = np.mean([rough(each.motion) for each in made]) / rough(free.motion)
                slide = np.mean([each.info.foot_slide_cm_per_frame or 0.0 for each in made])
                step = max(farthest(concatenate(keys[0], each.motion, keys[1])) for each in made)
                print(
                    f"| {name or 'default'} | {path} | {strength:g} | {np.mean(apart):.1f} | {np.mean(gone):.1f} | "
                    f"{jerk:.2f} | {slide:.2f} | {step:.1f} |",
                    flush=True,
                )


def distance(one: Motion, other: Motion) -> float:
    """The mean distance of a joint, centimetres."""
    return 100.0 * float(np.linalg.norm(one.global_positions() - other.global_positions(), axis=-1).mean())


def rough(motion: Motion) -> float:
    """The mean third difference of the joints' places."""
    return float(np.linalg.norm(np.diff(motion.global_positions(), n=3, axis=0), axis=-1).mean())


def farthest(motion: Motion) -> float:
    """The longest way of a joint in one frame, centimetres."""
    return 100.0 * float(np.linalg.norm(np.diff(motion.global_positions(), axis=0), axis=-1).max())


if __name__ == "__main__":
    main(list(sys.argv[1:]) or [None])
