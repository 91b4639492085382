"""Poses one a call: the same motion as in one piece, targets that change, rigs of other kinds; and many at once."""

from dataclasses import replace

import learning
import numpy as np
import pytest
from retarget.characters import RIGS, build, random_motion

from interpose import retarget, rotation
from interpose.errors import InputError
from interpose.motion import Motion, sample
from interpose.runtime import inertia
from interpose.runtime.backends import dcmoe
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.model import Model
from interpose.runtime.model_folder import Session
from interpose.runtime.streaming.streams import Stream, Streams
from interpose.skeleton import HUMANOID, Skeleton

CLIP = learning.march(90, 1.0, 0.5)
STARTS = [CLIP[20], CLIP[5:31], CLIP[40]]
TARGETS = [CLIP[60], CLIP[70], CLIP[20]]


def walked(stream: Stream, target: Motion, frames: int) -> list[Motion]:
    """The poses of so many calls, the last of which is the target."""
    return [stream.step(target, (frames - i) / 30.0) for i in range(frames)]


def placed(poses: list[Motion]):
    return np.concatenate([pose.global_positions() for pose in poses])


def steps(poses: list[Motion]):
    """The largest way of a joint from each pose to the next, metres."""
    return np.linalg.norm(np.diff(placed(poses), axis=0), axis=-1).max(axis=1)


def assert_same_pose(pose: Motion, other: Motion):
    np.testing.assert_array_equal(pose.root_positions, other.root_positions)
    np.testing.assert_array_equal(pose.local_rotations, other.local_rotations)


@pytest.mark.parametrize("context", [1, 10])
def test_undisturbed_it_is_the_whole_roll_out(session, context):
    """Left as the motion came to the start, where that is known."""
    start, target = CLIP[21 - context : 21], CLIP[60]
    poses = walked(Stream(session, start, "Old"), target, 40)
    keys = [(pose.root_positions[None], pose.local_rotations[None]) for pose in (start, target)]
    made = dcmoe.BACKEND.generate(session, batch_of(*keys, 39, styles="Old"))
    root, local = made.root, made.local
    if context > 1:
        root = np.concatenate([start.root_positions[None, -1:], root, target.root_positions[None]], axis=1)
        local = np.concatenate([start.local_rotations[None, -1:], local, target.local_rotations[None]], axis=1)
        before = inertia.NeighbourPose(start.root_positions[None, -2], start.local_rotations[None, -2], 1.0 / 30.0)
        root, local = (x[:, 1:-1] for x in inertia.leave(root, local, before, 1.0 / 30.0))
    wanted = Motion(HUMANOID, root[0], local[0], 30.0)
    np.testing.assert_allclose(placed(poses[:-1]), wanted.global_positions(), atol=2e-4)
    assert_same_pose(poses[-1], target)
    assert all(len(pose) == 1 and pose.rate == 30.0 for pose in poses)


def test_the_same_calls_give_the_same_poses_and_a_seed_others(session):
    def made(**options):
        return placed(walked(Stream(session, CLIP[20], **options), CLIP[40], 8))

    np.testing.assert_array_equal(made(), made())
    assert np.abs(made(seed=3) - made()).max() > 1e-4
    assert np.abs(made(style="Young") - made()).max() > 1e-3


def test_the_target_may_change_at_any_time(session):
    stream = Stream(session, CLIP[20])
    first, second = CLIP[60], CLIP[80]
    second = replace(second, root_positions=second.root_positions + np.array([0.5, 0.0, -0.3]))
    before = [stream.step(first, (40 - i) / 30.0) for i in range(15)]
    after = walked(stream, second, 30)
    assert_same_pose(after[-1], second)
    every = steps([CLIP[20], *before, *after])
    assert every[15] < 1.5 * np.delete(every, 15).max()
    assert every.max() < 0.3


def test_the_time_left_may_change_at_any_time(session):
    stream = Stream(session, CLIP[20])
    hurried = [stream.step(CLIP[60], 2.0 - i / 30.0) for i in range(10)]
    hurried += walked(stream, CLIP[60], 12)
    assert_same_pose(hurried[-1], CLIP[60])
    assert steps([CLIP[20], *hurried]).max() < 0.3
    for wait in (1.0, 1.0, 1.0):  # a target that stays a second ahead is never reached, and nothing breaks
        stream.step(CLIP[80], wait)
    assert np.abs(placed([stream.pose]) - CLIP[80].global_positions()).max() > 0.05


def test_one_gap_follows_another(session):
    stream = Stream(session, CLIP[0])
    for at in (20, 40, 41):
        poses = walked(stream, CLIP[at], 5)
        assert_same_pose(poses[-1], CLIP[at])
        assert_same_pose(stream.pose, CLIP[at])


def bends(poses: list[Motion]):
    """The largest change of a joint's step from each pose to the next but one, metres."""
    return np.linalg.norm(np.diff(placed(poses), n=2, axis=0), axis=-1).max(axis=1)


def jumped(poses: list[Motion], at: int):
    """The bend at a frame as a share of the largest in what comes after the first frames."""
    every = bends(poses)
    return every[at] / np.delete(every, at)[2:].max()


@pytest.mark.parametrize("change", ["target", "style", "time"])
def test_a_change_is_no_pop(session, change, monkeypatch):
    def made():
        stream = Stream(session, CLIP[20], "Old")
        poses = [stream.step(CLIP[60], (40 - i) / 30.0) for i in range(15)]
        if change == "style":
            stream.style = "Young"
        target = replace(CLIP[60], root_positions=CLIP[60].root_positions + np.array([1.5, 0.0, -1.0]))
        left = 12 if change == "time" else 25
        return [CLIP[20], *poses, *walked(stream, target if change == "target" else CLIP[60], left)]

    kept = jumped(made(), 14)
    assert kept < 1.0
    monkeypatch.setattr(Streams, "_keep_speed", lambda *_: None)
    assert jumped(made(), 14) > 1.5 * kept


def test_the_style_is_told_and_checked(session):
    stream = Stream(session, CLIP[20], "Old")
    assert stream.style == "Old"
    with pytest.raises(InputError, match="has no style 'Angry'"):
        stream.style = "Angry"
    assert stream.style == "Old"
    stream.style = None
    assert stream.style is None


def test_a_target_that_moves_in_every_frame_is_reached(session):
    stream, poses = Stream(session, CLIP[20]), [CLIP[20]]
    for frame in range(40):
        away = np.array([0.03 * frame, 0.0, 0.0])
        target = replace(CLIP[60], root_positions=CLIP[60].root_positions + away)
        poses.append(stream.step(target, (40 - frame) / 30.0))
    assert_same_pose(poses[-1], target)
    assert steps(poses).max() < 0.3


def test_speed_goes_through_a_target(session):
    stream = Stream(session, CLIP[20])
    poses = [CLIP[20], *walked(stream, CLIP[40], 20), *walked(stream, CLIP[70], 30)]
    assert bends(poses)[19] < bends(poses)[2:].max() * 0.9
    roots = np.concatenate([pose.root_positions for pose in poses])
    before, after = roots[20] - roots[19], roots[21] - roots[20]
    np.testing.assert_allclose(after, before, atol=0.35 * np.linalg.norm(before))


@pytest.mark.parametrize("seconds", [0.0, 0.01, 1.0 / 30.0])
def test_without_time_the_pose_is_the_target(session, seconds):
    stream = Stream(session, CLIP[20])
    assert_same_pose(stream.step(CLIP[40], seconds), CLIP[40])
    assert_same_pose(stream.step(CLIP[50:60], seconds), CLIP[50])


@pytest.mark.parametrize("rig", RIGS[1::4], ids=lambda rig: rig.profile)
def test_rigs_of_other_kinds(session, rig):
    skeleton = build(rig)
    clip = random_motion(skeleton, 3, frames=2, spread=0.2)
    start, target = clip[0], replace(clip[1], root_positions=clip[0].root_positions + np.array([[0.2, 0.0, 0.4]]))
    stream = Stream(session, start)
    poses = walked(stream, target, 12)
    assert all(pose.skeleton == skeleton for pose in poses)
    assert_same_pose(poses[-1], target)
    every = steps([start, *poses])
    assert every[0] < 0.25
    assert every[-1] < 0.25
    mapping = retarget.map_skeleton(start)
    on22 = [retarget.to_humanoid(pose, mapping) for pose in (start, target)]
    keys = [(pose.root_positions[None], pose.local_rotations[None]) for pose in on22]
    root = dcmoe.BACKEND.generate(session, batch_of(*keys, 11)).root
    hips = np.concatenate([retarget.to_humanoid(pose, mapping).root_positions for pose in poses[:-1]])
    np.testing.assert_allclose(hips, root[0], atol=1e-4)
    again = walked(Stream(session, start, mapping=mapping), target, 12)
    np.testing.assert_array_equal(placed(again), placed(poses))


def test_joints_that_no_model_knows_go_their_own_way(session):
    skeleton = Skeleton(
        (*HUMANOID.names, "LeftFinger"),
        (*HUMANOID.parents, HUMANOID.index("LeftHand")),
        np.concatenate([HUMANOID.offsets, [[0.1, 0.0, 0.0]]]),
    )
    bent = rotation.from_rotation_vector(np.linspace(0.0, 1.2, 90)[:, None, None] * np.array([0.0, 0.0, 1.0]))
    clip = Motion(skeleton, CLIP.root_positions, np.concatenate([CLIP.local_rotations, bent], axis=1), 30.0)
    poses = walked(Stream(session, clip[20]), clip[60], 8)
    angles = [float(rotation.angle(pose.local_rotations[0, -1])) for pose in poses]
    begin, end = (float(rotation.angle(bent[at, 0])) for at in (20, 60))
    np.testing.assert_allclose(angles, np.linspace(begin, end, 9)[1:], atol=1e-4)


def test_a_start_at_another_rate_and_a_target_of_another(session):
    fast = replace(sample(CLIP, np.arange(0.0, 41.0) / 2.0), rate=60.0)
    poses = walked(Stream(session, fast), replace(CLIP[60], rate=24.0), 8)
    wanted = walked(Stream(session, CLIP[11:21]), CLIP[60], 8)
    np.testing.assert_allclose(placed(poses), placed(wanted), atol=1e-4)


def test_what_cannot_be_served(session):
    stream = Stream(session, CLIP[20])
    for seconds in (-0.1, np.nan, np.inf):
        with pytest.raises(InputError, match="seconds_left must be 0 or more"):
            stream.step(CLIP[40], seconds)
    other = build(RIGS[1])
    with pytest.raises(InputError, match="must share one skeleton"):
        stream.step(random_motion(other, 0, 1), 1.0)
    with pytest.raises(InputError, match="has no style 'Angry'"):
        Stream(session, CLIP[20], "Angry")
    snake = Skeleton(("a", "b", "c"), (-1, 0, 1), np.ones((3, 3)))
    with pytest.raises(InputError):
        Stream(session, random_motion(snake, 0, 1))
    assert_same_pose(stream.step(CLIP[40], 0.0), CLIP[40])  # a refused call leaves the stream as it was


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


def test_many_that_cannot_be_served(session):
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
