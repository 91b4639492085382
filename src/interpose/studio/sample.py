"""The sample scene of a first visit: key poses made by hand, and the settings of the gaps between them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from interpose import io
from interpose.demo import poses
from interpose.demo.poses import DemoPose
from interpose.motion import concatenate
from interpose.studio.project_format import GapSettings, Project, ProjectKey, SourceFile


@dataclass(frozen=True)
class _Key:
    """A pose at a frame and a place on the ground. heading: degrees from +Z towards +X. after: the next gap."""

    pose: DemoPose
    frame: int
    ground: tuple[float, float]
    heading: float
    after: GapSettings


_KEYS = (
    _Key(poses.STAND, 0, (0.0, 0.0), 0.0, GapSettings(method="dcmoe", seed=1)),
    _Key(poses.WALK_LEFT, 39, (0.7, 1.2), 50.0, GapSettings(method="dcmoe", style="Chicken", seed=1)),
    _Key(poses.CHICKEN, 103, (2.2, 1.2), 120.0, GapSettings(method="dcmoe", style="Aeroplane", seed=1)),
    _Key(poses.AEROPLANE, 157, (3.1, -0.3), 170.0, GapSettings(method="stitch", style="KarateChop", seed=1)),
    _Key(poses.KARATE, 203, (2.3, -2.2), 220.0, GapSettings(method="dcmoe")),
)


@cache
def sample() -> Project:
    """The scene as a project whose source has one frame per key."""
    clip = concatenate(*(poses.pose(key.pose, key.ground, key.heading) for key in _KEYS))
    text = io.serialize(clip, "sample.bvh").decode()
    keys = [
        ProjectKey(id=f"sample-{i}", frame=key.frame, pose=None, source=i, after=key.after)
        for i, key in enumerate(_KEYS)
    ]
    return Project(format=1, name="Sample scene", source=SourceFile(name="sample.bvh", text=text), keys=keys)
