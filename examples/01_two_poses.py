"""Two poses in, the motion between them out.

    python examples/01_two_poses.py                                     the demo's two hand-made poses
    python examples/01_two_poses.py walk.bvh 0 60 --frames 59           frames 0 and 60 of your own clip
    python examples/01_two_poses.py walk.bvh 0 60 --frames 59 --style Angry -o angry.glb

The rig, its rate and its unit are the clip's own. What comes out is one whole motion with the keys at its two ends.
"""

from __future__ import annotations

import argparse

import interpose as ip
from interpose.demo import poses
from interpose.motion import concatenate

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("clip", nargs="?", help="a motion file")
parser.add_argument("start", nargs="?", type=int, default=0, help="frame of the start key")
parser.add_argument("target", nargs="?", type=int, default=-1, help="frame of the target key")
parser.add_argument("--frames", type=int, default=59, help="frames to make between them")
parser.add_argument("--style", help="one of the model's styles; free where left out")
parser.add_argument("--model", help="an installed model's name or a folder")
parser.add_argument("-o", "--out", default="two_poses.bvh", help=".bvh or .glb")
given = parser.parse_args()

if given.clip is None:
    start, target = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 2.3))
else:
    clip = ip.read(given.clip)
    start, target = clip[given.start], clip[given.target]

model = ip.load_model(given.model)
best = model.inbetween(start, target, given.frames, style=given.style)[0]
ip.write(given.out, concatenate(start, best.motion, target))
print(f"{given.out}: {best.info.frames} frames by {best.info.method} in {best.info.seconds:.2f} s")
if best.info.fallback is not None:
    print(f"note: {best.info.fallback}")
