"""Writes route.json: the targets of the example's character in world values, from poses that are posed by hand.

    python examples/engine/route.py

A route is a start pose and legs. A leg holds from its frame on: reach the pose at frame `arrive`, in the style. The
target moves by `drift` metres (x, z) a frame.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from interpose.demo import poses
from interpose.motion import Motion


def plain(pose: Motion) -> dict[str, Any]:
    """The hips' place and every joint's rotation since the T-pose, both in the world."""
    return {
        "hips": pose.root_positions[0].round(6).tolist(),
        "quaternions": pose.global_rotations()[0].round(6).tolist(),
    }


def leg(frame: int, pose: Motion, arrive: int, style: str = "", drift: tuple[float, float] = (0.0, 0.0)) -> Any:
    return plain(pose) | {"frame": frame, "arrive": arrive, "style": style, "drift": drift}


first = poses.pose(poses.WALK_LEFT, (0.0, 2.6))
clicked = poses.pose(poses.WALK_RIGHT, (2.2, 2.4), heading=70.0)
away = poses.pose(poses.WALK_LEFT, (3.6, 0.4), heading=160.0)
last = poses.pose(poses.STAND, (3.2, -1.4), heading=200.0)
route = {
    "frames": 210,
    "start": plain(poses.pose(poses.STAND)),
    "legs": [
        leg(0, first, 62),
        leg(30, clicked, 100),  # another target, in mid-stride
        leg(50, clicked, 100, "Angry"),  # another style
        leg(65, clicked, 90, "Angry"),  # less time
        leg(90, away, 150, drift=(-0.01, -0.004)),  # on from the target without a stop; this one moves in every frame
        leg(150, last, 210),
    ],
}
out = Path(__file__).with_name("route.json")
out.write_text(json.dumps(route) + "\n", encoding="utf-8")
