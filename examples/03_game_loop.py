"""A game's loop: one pose a call, thirty a second, while the target changes under way.

    python examples/03_game_loop.py -o loop.bvh

The character walks towards a first place; after a second the player clicks on another one. Nothing is planned ahead:
each call takes the present target and the seconds that are left, and gives the next pose.
"""

from __future__ import annotations

import argparse
import time

import interpose as ip
from interpose.demo import poses
from interpose.motion import concatenate

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--style", help="one of the model's styles; left free where left out")
parser.add_argument("--model", help="an installed model's name or a folder")
parser.add_argument("-o", "--out", default="loop.bvh", help=".bvh or .glb")
given = parser.parse_args()

start = poses.pose(poses.STAND)
first = poses.pose(poses.WALK_LEFT, (0.0, 2.6))
clicked = poses.pose(poses.WALK_RIGHT, (2.2, 2.0), heading=70.0)

stream = ip.load_model(given.model).stream(start, style=given.style)
walked, longest = [start], 0.0
arrival, target = 2.0, first
for frame in range(120):
    now = frame / 30.0
    if frame == 30:
        arrival, target = 4.0, clicked
    began = time.perf_counter()
    walked.append(stream.step(target=target, seconds_left=arrival - now))
    longest = max(longest, time.perf_counter() - began)

ip.write(given.out, concatenate(*walked))
print(f"{given.out}: {len(walked)} poses; the slowest took {1000.0 * longest:.1f} ms of the 33 ms that a frame has")
