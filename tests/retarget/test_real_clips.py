"""Real motion capture to the 22 joints and back; needs INTERPOSE_DATA."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose import io, rotation
from interpose.motion import Motion
from interpose.retarget import Mapping, from_humanoid, map_skeleton, to_humanoid
from interpose.skeleton import HUMANOID

ENDS = ("LeftHand", "RightHand", "LeftFoot", "RightFoot", "LeftToe", "RightToe")


def clips(folder: Path, count: int, frames: int = 600) -> list[Motion]:
    """A few clips spread over the folder, thinned to about so many frames."""
    paths = sorted(folder.glob("*.bvh"))
    chosen = [io.read(paths[k]) for k in np.linspace(0, len(paths) - 1, count).astype(int)]
    return [clip[:: max(1, len(clip) // frames)] for clip in chosen]


def ends(motion: Motion, names: dict[str, str | None]) -> np.ndarray:
    return motion.global_positions()[:, [motion.skeleton.names.index(str(names[end])) for end in ENDS]]


def planted_heights(pose: Motion) -> tuple[float, float]:
    """Heights of ankles and toes in the 5 % of frames where each is lowest."""
    points = np.sort(pose.global_positions()[:, :, 1], axis=0)[: max(1, len(pose) // 20)]
    feet = [HUMANOID.index(name) for name in ("LeftFoot", "RightFoot")]
    toes = [HUMANOID.index(name) for name in ("LeftToe", "RightToe")]
    return float(np.median(points[:, feet])), float(np.median(points[:, toes]))


def check_hinges(pose: Motion) -> None:
    """In the parent bone's frame knees bend about the left axis and elbows about the upright one, within 45 degrees."""
    bent = {
        "LeftLeg": ([0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
        "RightLeg": ([0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
        "LeftForeArm": ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0]),
        "RightForeArm": ([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
    }
    for name, (bone, axis) in bent.items():
        lower = rotation.rotate(pose.local_rotations[:, HUMANOID.index(name)], np.array(bone))
        hinge = np.cross(bone, lower).mean(axis=0)
        if np.linalg.norm(hinge) > np.sin(np.radians(20.0)):
            assert hinge @ axis > 0.7 * np.linalg.norm(hinge), name


def test_lafan1_comes_back_the_same(lafan1_dir: Path) -> None:
    for clip in clips(lafan1_dir, 5):
        mapping = map_skeleton(clip)
        assert (mapping.profile, mapping.missing, mapping.unmapped) == ("LaFAN1", (), ())
        assert mapping.scale == pytest.approx(1.0, abs=1e-4)
        pose = to_humanoid(clip, mapping)
        order = [clip.skeleton.index(name) for name in HUMANOID.names]
        np.testing.assert_allclose(pose.global_positions(), clip.global_positions()[:, order], atol=1e-3)
        back = from_humanoid(pose, mapping)
        np.testing.assert_allclose(back.global_positions(), clip.global_positions(), atol=1e-9)
        check_hinges(pose)


def test_lafan1_starts_in_the_t_pose_of_the_humanoid(lafan1_dir: Path) -> None:
    clip = io.read(lafan1_dir / "dance1_subject1.bvh")[0]
    turns = rotation.angle(to_humanoid(clip, map_skeleton(clip)).global_rotations()[0])
    assert turns.max() < np.radians(30.0)


def check_there_and_back(clip: Motion, mapping: Mapping, lowest_toe: float) -> None:
    """Hands and feet come back; planted feet stand on the humanoid's floor."""
    pose = to_humanoid(clip, mapping)
    names = mapping.pairs()
    for like in (None, clip[0], clip):
        back = from_humanoid(pose, mapping, like)
        assert np.linalg.norm(ends(back, names) - ends(clip, names), axis=-1).max() < 0.005
    ankle, toe = planted_heights(pose)
    assert 0.06 < ankle < 0.085
    assert lowest_toe < toe < 0.015
    check_hinges(pose)


def test_100style_keeps_hands_feet_and_floor(style100_dir: Path) -> None:
    for clip in clips(style100_dir, 5):
        mapping = map_skeleton(clip)
        assert (mapping.profile, mapping.missing, mapping.unmapped) == ("100STYLE", (), ("Chest3",))
        check_there_and_back(clip, mapping, lowest_toe=-0.02)


def test_bandai_namco_keeps_hands_feet_and_floor(bandai_dir: Path) -> None:
    for clip in clips(bandai_dir, 8):
        mapping = map_skeleton(clip)
        assert (mapping.profile, mapping.missing, mapping.unmapped) == ("Bandai-Namco", ("Spine1",), ("joint_Root",))
        # At the push-off a longer foot than Bandai-Namco's reaches deeper.
        check_there_and_back(clip, mapping, lowest_toe=-0.04)


@pytest.mark.parametrize("name", ["dance1_subject1", "walk4_subject1"])
def test_lafan1_is_understood_without_its_names(lafan1_dir: Path, name: str) -> None:
    clip = io.read(lafan1_dir / f"{name}.bvh")[::10]
    nameless = replace(clip.skeleton, names=tuple(f"joint{j}" for j in range(len(clip.skeleton))))
    mapping, known = map_skeleton(replace(clip, skeleton=nameless)), map_skeleton(clip)
    assert mapping.profile == "hierarchy"
    assert mapping.joints == known.joints
    off = rotation.angle(rotation.multiply(mapping.rest_global, rotation.inverse(known.rest_global)))
    assert off.max() < np.radians(5.0)
    assert mapping.lift == pytest.approx(known.lift, abs=0.01)
