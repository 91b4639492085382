"""Plans of where the root shall go, and that the network is shown them as it was in training."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose.drawn_path.path_file import DrawnPath
from interpose.errors import InputError
from interpose.gallery import paths, proposals, store
from interpose.gallery.proposals import PathRequest
from interpose.gallery.tracks import from_database, track_of
from interpose.motion import Motion
from interpose.runtime import guidance
from interpose.runtime.backends import dcmoe
from interpose.runtime.guidance import Gap, Wish, plans
from interpose.skeleton import HUMANOID
from interpose.train.dcmoe.sequences import Sampling, draw


@pytest.fixture(scope="module")
def gallery(database):
    return store.of_tracks(from_database(database))


def gap_of(frames=45, begin=20, context=1):
    walk = learning.march(200, 0.9, 0.4)
    return Gap(walk[begin - context + 1 : begin + 1], walk[begin + frames + 1 :])


def test_the_path_is_shown_as_in_training(frames):
    rows = draw(frames, 12, len(learning.STYLES), Sampling(lone_start=0.5, path=1.0), torch.Generator().manual_seed(1))
    wanted = learning.steering(frames, rows).path.numpy()
    for i in range(12):
        begin, gone, total = int(rows.start[i]), int(rows.gone[i]), int(rows.total[i])
        span = slice(begin, begin + total + 1)
        facing = frames.facing[span].numpy()
        yaw = np.unwrap(np.arctan2(facing[:, 0], facing[:, 1]))
        path = np.concatenate([frames.hips[span, ::2].numpy(), yaw[:, None]], axis=-1).astype(float)
        shown = dcmoe.guidance([path], max(total, 1))[0, min(gone, total - 1)]
        np.testing.assert_allclose(shown, wanted[i], atol=2e-4)


def test_rows_without_a_path_are_shown_none():
    path = np.zeros((4, 3))
    shown = dcmoe.guidance([None, path], 3)
    assert not shown[0].any()
    assert np.all(shown[1, ..., 3] == 1.0)


def test_rows_of_different_lengths_are_those_of_separate_calls(session):
    walk = learning.march(120, 1.0, 0.0)
    lengths, target = [20, 33, 7], [60, 80, 100]
    start = walk.root_positions[:1], walk.local_rotations[:1]
    goals = walk.root_positions[target], walk.local_rotations[target]
    repeat = np.zeros(3, dtype=int)[:, None]
    ways = [None, paths.straight(paths.query_of(track_of(walk)[[0, 80]]), 34), None]
    together = dcmoe.generate_batch(
        session, walk.root_positions[repeat], walk.local_rotations[repeat], *goals, lengths, paths=ways
    )
    assert together[0].shape == (3, 33, 3)
    for row, frames in enumerate(lengths):
        alone = dcmoe.generate_batch(
            session,
            start[0][None],
            start[1][None],
            goals[0][row : row + 1],
            goals[1][row : row + 1],
            frames,
            paths=[ways[row]],
        )
        for a, b in zip(together, alone, strict=True):
            np.testing.assert_allclose(a[row, :frames], b[0], atol=2e-4)
    np.testing.assert_allclose(together[0][2, 7:], np.repeat(goals[0][2:], 26, axis=0), atol=1e-5)


def test_a_path_changes_what_the_network_does_and_its_control_is_gradual(session):
    gap = gap_of()
    keys = [gap.context.root_positions[None], gap.context.local_rotations[None]]
    keys += [gap.target.root_positions[:1], gap.target.local_rotations[:1]]
    line = paths.straight(gap.query, 46)
    made = [dcmoe.generate_batch(session, *keys, 45, paths=[line], control=w)[0] for w in (1.0, 0.999, 0.5)]
    free = dcmoe.generate_batch(session, *keys, 45)[0]
    assert np.abs(made[0] - free).max() > 1e-3
    assert np.abs(made[0] - made[1]).max() < 0.1 * np.abs(made[0] - made[2]).max()


def test_a_matched_plan_ends_exactly_at_the_keys(session, gallery):
    gap = gap_of()
    made = plans(session, gallery, gap, Wish(46), 3)
    assert [plan.steps for plan in made] == [46] * 3
    assert made[0].trajectory == "matched"
    assert made[0].style is None
    for plan in made:
        if plan.path is not None:
            assert len(plan.path) == 47
            np.testing.assert_allclose(plan.path[0], gap.query.start, atol=1e-9)
            np.testing.assert_allclose(plan.path[-1, :2], gap.query.target[:2], atol=1e-9)
            assert 0.0 < plan.fit <= 1.0


def test_the_first_is_the_trajectory_nearest_to_the_networks_own_way(session, gallery):
    gap = gap_of()
    own = guidance._own_way(session, gap, 46, guidance.Wish(46))
    np.testing.assert_allclose(own[[0, -1]], [gap.query.start, gap.query.target], atol=1e-9)
    near = plans(session, gallery, gap, Wish(46), 1)[0].path
    others = [plan.path for plan in plans(session, gallery, gap, Wish(46), 6)[1:] if plan.path is not None]
    assert others
    assert all(paths.apart(near, own) <= paths.apart(other, own) + 0.02 for other in others)


def test_without_a_time_the_gallery_suggests_one(session, gallery):
    gap = gap_of()
    told = guidance.suggestion(gallery, gap, Wish(None))
    assert plans(session, gallery, gap, Wish(None), 1)[0].steps == told.steps
    for path in ("straight", "none"):
        assert plans(session, gallery, gap, Wish(None, path), 1)[0].steps == told.steps
    fast = plans(session, gallery, gap, Wish(None, speed="fast"), 1)[0].steps
    slow = plans(session, gallery, gap, Wish(None, speed="slow"), 1)[0].steps
    assert fast <= told.steps <= slow
    with pytest.raises(InputError, match="give a number of frames"):
        plans(session, None, gap, Wish(None), 1)


def test_straight_and_none_are_what_they_say(session, gallery):
    gap = gap_of()
    line = plans(session, gallery, gap, Wish(30, "straight"), 2)
    assert [plan.trajectory for plan in line] == ["straight"] * 2
    np.testing.assert_allclose(np.diff(line[0].path, n=2, axis=0), 0.0, atol=1e-12)
    none = plans(session, gallery, gap, Wish(30, "none"), 2)
    assert [(plan.path, plan.trajectory) for plan in none] == [(None, "model")] * 2


def test_variants_of_a_free_style_take_styles_and_one_of_a_given_style_keeps_it(session, gallery):
    free = plans(session, gallery, gap_of(), Wish(46, "none"), 3)
    assert free[0].style is None
    assert {free[1].style, free[2].style} == set(learning.STYLES)
    asked = plans(session, gallery, gap_of(), Wish(46, style="Old"), 3)
    assert [plan.style for plan in asked] == ["Old"] * 3


def test_a_style_that_the_gallery_lacks_is_matched_from_all_and_told(session, database):
    tracks = from_database(database)
    renamed = store.of_tracks(type(tracks)(tracks.root, tracks.posture, tracks.ranges, tracks.clip_styles, ("a", "b")))
    plan = plans(session, renamed, gap_of(), Wish(46, style="Old"), 1)[0]
    assert plan.trajectory == "matched"
    assert "no trajectory in style 'Old'" in plan.note


@pytest.mark.parametrize("steps", [6, 20])
def test_what_cannot_be_is_left_to_the_model_with_the_nearest_that_can(session, gallery, steps):
    gap = gap_of()
    far = gap.target[:1]
    far = Motion(HUMANOID, far.root_positions + np.array([40.0, 0.0, 0.0]), far.local_rotations, 30.0)
    plan = plans(session, gallery, Gap(gap.context, far), Wish(steps), 1)[0]
    assert (plan.steps, plan.path, plan.trajectory) == (steps, None, "model")
    assert "the path is the model's own" in plan.note
    assert any(word in plan.note for word in ("frames would do", "set a key in between", "nearest takes"))
    with pytest.raises(InputError, match="set a key in between"):
        plans(session, gallery, Gap(gap.context, far), Wish(None), 1)


def test_a_short_gap_at_a_plausible_pace_is_the_models_own_without_a_word(session, gallery):
    plan = plans(session, gallery, gap_of(frames=6), Wish(7), 1)[0]
    assert (plan.steps, plan.path, plan.trajectory, plan.note) == (7, None, "model", None)


def test_a_drawn_line_is_followed(session, gallery):
    gap = gap_of()
    middle = (np.array(gap.query.start[:2]) + np.array(gap.query.target[:2])) / 2.0 + [0.5, 0.0]
    plan = plans(session, gallery, gap, Wish(46, "drawn", DrawnPath(middle[None])), 2)
    assert [p.trajectory for p in plan] == ["drawn"] * 2
    assert np.linalg.norm(plan[0].path[:, :2] - middle, axis=-1).min() < 0.1
    assert plan[0].steps == 46


def test_known_motion_around_the_gap_gives_velocities():
    gap = gap_of(context=5)
    before, after = gap.ends.velocities
    np.testing.assert_allclose(before, np.diff(gap.context.root_positions[-2:, ::2], axis=0)[0] * 30.0)
    assert after is not None
    lone = Gap(gap.context[-1], gap.target[0])
    assert lone.ends.velocities == (None, None)


def test_a_way_of_another_style_is_taken_where_it_is_clearly_nearer_to_the_networks_own(gallery):
    gap = gap_of()
    (near,) = proposals.propose(gallery, gap.query, PathRequest(46), gap.ends)
    aside = 0.5 * np.sin(np.linspace(0.0, np.pi, 47))[:, None] * np.array([1.0, 1.0, 0.0])
    far = replace(near, path=near.path + aside)
    taken = guidance._of_any_style(gallery, gap.query, gap.ends, far, near.path, 0)
    assert paths.apart(taken.path, near.path) < 0.1
    assert guidance._of_any_style(gallery, gap.query, gap.ends, near, near.path, 0) is near


def test_a_model_that_foresees_gaps_goes_its_own_way_first_and_by_turns(planned_session, gallery):
    gap = gap_of()
    made = plans(planned_session, gallery, gap, Wish(46), 4)
    assert [plan.trajectory for plan in made] == ["model", made[1].trajectory, "model", made[3].trajectory]
    assert {made[1].trajectory, made[3].trajectory} <= {"matched", "composed"}
    assert not np.array_equal(made[1].path, made[3].path)
    (alone,) = plans(planned_session, gallery, gap, Wish(46), 1)
    assert (alone.path, alone.note) == (None, None)


def test_beyond_what_a_planner_knows_the_gallery_leads(planned_session, gallery):
    gap = gap_of(frames=100)
    assert plans(planned_session, gallery, gap, Wish(92), 1)[0].trajectory == "model"
    assert plans(planned_session, gallery, gap, Wish(93), 1)[0].trajectory != "model"


def test_a_time_too_short_is_told_by_a_model_that_foresees_gaps_too(planned_session, gallery):
    (made,) = plans(planned_session, gallery, gap_of(frames=100), Wish(3), 1)
    assert made.trajectory == "model"
    assert "m/s, and the fastest trajectory" in made.note
