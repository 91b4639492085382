"""What the demo asks of the model: two keys, a time and a style for each scene."""

from __future__ import annotations

from dataclasses import dataclass

from interpose.demo import poses
from interpose.motion import Motion


@dataclass(frozen=True)
class Scene:
    """name: of its files. start, target: the keys, one frame each. frames: how many to make between them.

    asked: the request in a few words.
    """

    name: str
    style: str
    start: Motion
    target: Motion
    frames: int
    asked: str


def scenes() -> list[Scene]:
    """Three styles, each with two requests.

    The first is the same for all: two seconds between two frames of a plain walk. The second goes from standing into
    a pose of that style in four seconds, with a turn on the way.
    """
    walk = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 2.3))
    stand = poses.pose(poses.STAND)
    turns = {
        "Aeroplane": poses.pose(poses.AEROPLANE, (2.6, 2.6), 90.0),
        "Chicken": poses.pose(poses.CHICKEN, (-2.2, 2.4), -90.0),
        "KarateChop": poses.pose(poses.KARATE, (1.2, 2.4), 50.0),
    }
    made = []
    for style, target in turns.items():
        low = style.lower()
        made.append(Scene(f"{low}-walk", style, *walk, 59, "a plain walk"))
        made.append(Scene(f"{low}-turn", style, stand, target, 119, "from standing, with a turn"))
    return made
