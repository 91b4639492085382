from __future__ import annotations

from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from interpose import InputError, Motion, io, rotation
from interpose.demo import poses, run
from interpose.mannequin import mannequin
from interpose.runtime import inbetween
from interpose.runtime.inbetween import Candidate
from interpose.runtime.model import Model
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID, MIRROR, MODEL_RATE

NAMES = [name for name, value in vars(poses).items() if isinstance(value, poses.DemoPose)]


class Interpolation(Model):
    """Stands in for a trained model, so that these tests need no weights."""

    def __init__(self) -> None:
        super().__init__(Session(Path("none"), {"name": "none", "method": "interp", "styles": []}))

    def inbetween(self, start: Motion, target: Motion, frames: int, **_: object) -> list[Candidate]:
        return inbetween.inbetween(start, target, frames, Request("interp"))


def test_there_are_as_many_poses_as_promised() -> None:
    assert len(NAMES) >= 8


@pytest.mark.parametrize("name", NAMES)
def test_a_pose_stands_on_the_floor(name: str) -> None:
    source = getattr(poses, name)
    made = poses.pose(source, (0.4, -0.2), 35.0)
    at, turned = made.global_positions()[0], made.global_rotations()[0]
    np.testing.assert_allclose(made.root_positions[0, [0, 2]], [0.4, -0.2])
    vertices, _ = mannequin(HUMANOID).posed(at, turned)
    assert abs(vertices[:, 1].min()) < 0.01
    for side in source.flat:
        assert at[HUMANOID.index(side + "Foot"), 1] == pytest.approx(poses.ANKLE, abs=2e-3)
        assert at[HUMANOID.index(side + "Toe"), 1] == pytest.approx(poses.BALL, abs=2e-3)
    for side in source.ball:
        assert at[HUMANOID.index(side + "Toe"), 1] == pytest.approx(poses.BALL, abs=2e-3)
        assert at[HUMANOID.index(side + "Foot"), 1] > poses.ANKLE


@pytest.mark.parametrize("name", NAMES)
def test_knees_and_elbows_bend_the_way_they_can(name: str) -> None:
    local = poses.pose(getattr(poses, name)).local_rotations[0]
    for side, sign in (("Left", -1.0), ("Right", 1.0)):
        knee = rotation.to_rotation_vector(local[HUMANOID.index(side + "Leg")])
        assert 0.0 <= knee[0] < np.deg2rad(150)
        np.testing.assert_allclose(knee[1:], 0.0, atol=1e-9)
        forward = rotation.rotate(local[HUMANOID.index(side + "ForeArm")], np.array([-sign, 0.0, 0.0]))
        swung = rotation.twist(local[HUMANOID.index(side + "ForeArm")], np.array([1.0, 0.0, 0.0]))
        assert rotation.rotate(rotation.inverse(swung), forward)[2] >= -1e-9


def test_a_standing_figure_lets_its_arms_hang() -> None:
    at = poses.pose(poses.STAND).global_positions()[0]
    hips, hand = at[0], at[HUMANOID.index("LeftHand")]
    assert hand[1] < hips[1] + 0.05
    assert 0.15 < hand[0] - hips[0] < 0.40


def test_a_mirrored_pose_is_the_mirror_image() -> None:
    made = poses.pose(poses.KARATE).global_positions()[0]
    other = poses.pose(poses.mirrored(poses.KARATE)).global_positions()[0]
    np.testing.assert_allclose(other[list(MIRROR)], made * [-1.0, 1.0, 1.0], atol=1e-9)


def test_heading_turns_from_forward_to_the_left() -> None:
    made = poses.pose(poses.STAND, heading=90.0)
    nose = rotation.rotate(made.global_rotations()[0, 0], np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(nose, [1.0, 0.0, 0.0], atol=1e-6)


def test_the_scenes_ask_for_three_styles_with_two_durations_each() -> None:
    found = run.scenes()
    assert len({s.name for s in found}) == len(found)
    durations: dict[str, set[int]] = {}
    for s in found:
        durations.setdefault(s.style, set()).add(s.frames)
        assert len(s.start) == len(s.target) == 1
        travelled = np.linalg.norm((s.target.root_positions - s.start.root_positions)[0, [0, 2]])
        assert 0.2 < travelled / ((s.frames + 1) / MODEL_RATE) < 3.0
    assert len(durations) >= 3
    assert all(len(frames) >= 2 for frames in durations.values())


def test_the_demo_writes_what_its_table_tells(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    two = run.scenes()[:2]
    monkeypatch.setattr(run, "scenes", lambda: two)
    made = run.demo(tmp_path / "new" / "folder", Interpolation())
    assert [m.scene for m in made] == two
    for each in made:
        assert all(file.stat().st_size > 0 for file in each.files)
        clip = io.read(each.files[0])
        assert len(clip) == each.scene.frames + 2
        for frame, key in ((0, each.scene.start), (-1, each.scene.target)):
            np.testing.assert_allclose(clip[frame].global_positions(), key.global_positions(), atol=1e-5)
    assert (tmp_path / "new" / "folder" / run.OVERVIEW).stat().st_size > 0
    console = Console(width=80, record=True, file=StringIO())
    console.print(run.table(made))
    told = console.export_text()
    assert "…" not in told
    for each in made:
        assert each.scene.name in told
        assert f"{each.info.foot_slide_cm_per_frame:.2f} cm/frame" in told


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="no folder can be made there"):
        run.demo(tmp_path / "file" / "out", Interpolation())
