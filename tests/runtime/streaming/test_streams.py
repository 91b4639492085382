"""Many characters by one run of the network a frame: each as if it were alone."""

from dataclasses import replace

import learning
import numpy as np
import pytest
from retarget.characters import RIGS, build, random_motion

from interpose.errors import InputError
from interpose.runtime.model import Model
from interpose.runtime.model_folder import Session

CLIP = learning.march(90, 1.0, 0.5)
STARTS = [CLIP[20], CLIP[5:31], CLIP[40]]
TARGETS = [CLIP[60], CLIP[70], CLIP[20]]


def course(frame: int) -> tuple[list, list[float], list[str | None]]:
    """Targets, seconds left and styles of three characters, disturbed each in another frame and way."""
    targets = list(TARGETS)
    if frame >= 6:
        targets[0] = replace(CLIP[75], root_positions=CLIP[75].root_positions + np.array([0.4, 0.0, 0.2]))
    left = [20 - frame, (8 if frame < 8 else 24) - frame, 30 - frame - (10 if frame > 4 else 0)]
    return targets, [max(1, n) / 30.0 for n in left], ["Old", None, "Young" if frame > 9 else "Old"]


def test_rows_are_what_single_streams_are(session, monkeypatch):
    model = Model(session)
    many = model.streams(STARTS, styles=["Old", None, "Old"], seed=4)
    alone = [
        model.stream(start, style=style, seed=4 + i)
        for i, (start, style) in enumerate(zip(STARTS, ["Old", None, "Old"], strict=True))
    ]
    assert len(many) == 3
    runs: list[int] = []
    step = Session.step
    for frame in range(24):
        targets, left, styles = course(frame)
        with monkeypatch.context() as patch:
            patch.setattr(Session, "step", lambda self, feed: (runs.append(len(feed["hips"])), step(self, feed))[1])
            many.styles = styles
            made = many.step(targets, left)
        for row, stream in enumerate(alone):
            stream.style = styles[row]
            pose = stream.step(targets[row], left[row])
            np.testing.assert_allclose(pose.global_positions()[0], made.global_positions()[row], atol=3e-4)
            np.testing.assert_array_equal(many.contacts.shape, (3, 4))
    assert len(runs) == 24
    assert max(runs) <= 6
    assert runs.count(3) > 12


def test_each_arrives_at_its_own_target_exactly(session):
    many = Model(session).streams(STARTS)
    for frame in range(10):
        made = many.step(TARGETS, [(left - frame) / 30.0 if left > frame else 1.0 for left in (4, 10, 7)])
        for row, left in enumerate((4, 10, 7)):
            if frame + 1 == left:
                np.testing.assert_array_equal(made.local_rotations[row], TARGETS[row].local_rotations[0])
                np.testing.assert_array_equal(made.root_positions[row], TARGETS[row].root_positions[0])
    np.testing.assert_array_equal(many.poses.root_positions, made.root_positions)


def test_one_target_and_one_time_for_all(session):
    model = Model(session)
    a, b = model.streams(STARTS, styles="Old"), model.streams(STARTS, styles=["Old"] * 3)
    one, each = a.step(CLIP[60], 1.0), b.step([CLIP[60]] * 3, [1.0] * 3)
    np.testing.assert_array_equal(one.root_positions, each.root_positions)


def test_a_rig_with_joints_of_its_own(session):
    skeleton = build(RIGS[1])
    clip = random_motion(skeleton, 3, frames=4, spread=0.2)
    starts, targets = [clip[0], clip[1]], [clip[2], clip[3]]
    model = Model(session)
    many, alone = model.streams(starts), [model.stream(start, seed=i) for i, start in enumerate(starts)]
    for frame in range(6):
        made = many.step(targets, (6 - frame) / 30.0)
        for row, stream in enumerate(alone):
            pose = stream.step(targets[row], (6 - frame) / 30.0)
            np.testing.assert_allclose(pose.local_rotations[0], made.local_rotations[row], atol=2e-3)


def test_what_cannot_be_served(session):
    model = Model(session)
    with pytest.raises(InputError, match="at least one start"):
        model.streams([])
    with pytest.raises(InputError, match="must share one skeleton"):
        model.streams([CLIP[0], random_motion(build(RIGS[1]), 0, 1)])
    with pytest.raises(InputError, match="there are 3 characters, and 2 styles"):
        model.streams(STARTS, styles=["Old", None])
    many = model.streams(STARTS)
    with pytest.raises(InputError, match="there are 3 characters, and 2 targets"):
        many.step(TARGETS[:2], 1.0)
    with pytest.raises(InputError, match="there are 3 characters, and 2 times"):
        many.step(TARGETS, [1.0, 1.0])
    with pytest.raises(InputError, match=r"seconds_left must be 0 or more, got -1\.0"):
        many.step(TARGETS, [1.0, -1.0, 1.0])
