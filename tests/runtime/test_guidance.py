"""What guides each variant, and that the network is shown its path as it was in training."""

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
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.guidance import Gap, guide
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID
from interpose.train.common.gaps import GapSampling
from interpose.train.dcmoe.sequences import RollOutSampling, draw


@pytest.fixture(scope="module")
def gallery(database):
    return store.of_tracks(from_database(database))


def request_of(session, gallery, **more):
    """By a model whose own gallery that is."""
    own = Session(session.path, session.info)
    own.__dict__["gallery"] = gallery
    return Request("dcmoe", own, **more)


def generate(session, context, target, frames, **more):
    return dcmoe.BACKEND.generate(session, batch_of(context, target, frames, **more))


def gap_of(frames=45, begin=20, context=1):
    walk = learning.march(200, 0.9, 0.4)
    return Gap(walk[begin - context + 1 : begin + 1], walk[begin + frames + 1 :])


def test_the_path_is_shown_as_in_training(frames):
    rule = RollOutSampling(gaps=GapSampling(path=1.0, velocity=0.5))
    rows = draw(frames, 12, len(learning.STYLES), rule, torch.Generator().manual_seed(1))
    wanted = learning.steering(frames, rows).path.numpy()
    for i in range(12):
        begin, gone, total = int(rows.gaps.start[i]), int(rows.gone[i]), int(rows.gaps.steps[i])
        span = slice(begin, begin + total + 1)
        facing = frames.facing[span].numpy()
        yaw = np.unwrap(np.arctan2(facing[:, 0], facing[:, 1]))
        path = np.concatenate([frames.hips[span, ::2].numpy(), yaw[:, None]], axis=-1).astype(float)
        shown = dcmoe.path_keys([path], max(total, 1))[0, min(gone, total - 1)]
        np.testing.assert_allclose(shown, wanted[i], atol=2e-4)


def test_rows_without_a_path_are_shown_none():
    path = np.zeros((4, 3))
    shown = dcmoe.path_keys([None, path], 3)
    assert not shown[0].any()
    assert np.all(shown[1, ..., 3] == 1.0)


def test_rows_of_different_lengths_are_those_of_separate_calls(session):
    walk = learning.march(120, 1.0, 0.0)
    lengths = [20, 33, 7]
    whole = walk.root_positions, walk.local_rotations
    start = tuple(x[np.zeros((3, 1), dtype=int)] for x in whole)
    goals = tuple(x[[60, 80, 100], None] for x in whole)
    given = [None, paths.straight(paths.query_of(track_of(walk)[[0, 80]]), 34), None]
    together = generate(session, start, goals, lengths, paths=given)
    assert together.root.shape == (3, 33, 3)
    for row, frames in enumerate(lengths):
        mine = slice(row, row + 1)
        alone = generate(session, *(tuple(x[mine] for x in key) for key in (start, goals)), frames, paths=given[mine])
        for name in ("root", "local", "contacts"):
            np.testing.assert_allclose(getattr(together, name)[row, :frames], getattr(alone, name)[0], atol=2e-4)
    np.testing.assert_allclose(together.root[2, 7:], np.repeat(goals[0][2], 26, axis=0), atol=1e-5)


def test_a_path_changes_what_the_network_does_and_its_control_is_gradual(session):
    gap = gap_of()
    keys = [(x.root_positions[None], x.local_rotations[None]) for x in (gap.context, gap.target)]
    line = paths.straight(gap.query, 46)
    made = [generate(session, *keys, 45, paths=[line], path_control=w).root for w in (1.0, 0.999, 0.5)]
    free = generate(session, *keys, 45).root
    assert np.abs(made[0] - free).max() > 1e-3
    assert np.abs(made[0] - made[1]).max() < 0.1 * np.abs(made[0] - made[2]).max()


def test_a_matched_path_ends_exactly_at_the_keys(session, gallery):
    gap = gap_of()
    made = guide(request_of(session, gallery), gap, 46, 3)
    assert [one.steps for one in made] == [46] * 3
    assert made[0].trajectory == "matched"
    assert made[0].style is None
    for one in made:
        if one.path is not None:
            assert len(one.path) == 47
            np.testing.assert_allclose(one.path[0], gap.query.start, atol=1e-9)
            np.testing.assert_allclose(one.path[-1, :2], gap.query.target[:2], atol=1e-9)
            assert 0.0 < one.fit <= 1.0


def test_the_first_is_the_trajectory_nearest_to_the_unconstrained_root(session, gallery):
    gap = gap_of()
    own = guidance._unconstrained_root(request_of(session, gallery), gap, 46)
    np.testing.assert_allclose(own[[0, -1]], [gap.query.start, gap.query.target], atol=1e-9)
    near = guide(request_of(session, gallery), gap, 46, 1)[0].path
    others = [one.path for one in guide(request_of(session, gallery), gap, 46, 6)[1:] if one.path is not None]
    assert others
    assert all(paths.apart(near, own) <= paths.apart(other, own) + 0.02 for other in others)


def test_without_a_time_the_gallery_suggests_one(session, gallery):
    gap = gap_of()
    told = guidance.suggest_duration(request_of(session, gallery), gap)
    assert guide(request_of(session, gallery), gap, None, 1)[0].steps == told.steps
    for path in ("straight", "none"):
        assert guide(request_of(session, gallery, path=path), gap, None, 1)[0].steps == told.steps
    fast = guide(request_of(session, gallery, speed="fast"), gap, None, 1)[0].steps
    slow = guide(request_of(session, gallery, speed="slow"), gap, None, 1)[0].steps
    assert fast <= told.steps <= slow
    with pytest.raises(InputError, match="give a number of frames"):
        guide(request_of(session, None), gap, None, 1)


def test_straight_and_none_are_what_they_say(session, gallery):
    gap = gap_of()
    line = guide(request_of(session, gallery, path="straight"), gap, 30, 2)
    assert [one.trajectory for one in line] == ["straight"] * 2
    np.testing.assert_allclose(np.diff(line[0].path, n=2, axis=0), 0.0, atol=1e-12)
    none = guide(request_of(session, gallery, path="none"), gap, 30, 2)
    assert [(one.path, one.trajectory) for one in none] == [(None, "model")] * 2


def test_variants_of_a_free_style_take_styles_and_one_of_a_given_style_keeps_it(session, gallery):
    free = guide(request_of(session, gallery, path="none"), gap_of(), 46, 3)
    assert free[0].style is None
    assert {free[1].style, free[2].style} == set(learning.STYLES)
    asked = guide(request_of(session, gallery, style="Old"), gap_of(), 46, 3)
    assert [one.style for one in asked] == ["Old"] * 3


def test_a_style_that_the_gallery_lacks_is_matched_from_all_and_told(session, database):
    tracks = from_database(database)
    renamed = store.of_tracks(type(tracks)(tracks.root, tracks.posture, tracks.ranges, tracks.clip_styles, ("a", "b")))
    one = guide(request_of(session, renamed, style="Old"), gap_of(), 46, 1)[0]
    assert one.trajectory == "matched"
    assert "no trajectory in style 'Old'" in one.note


@pytest.mark.parametrize("steps", [6, 20])
def test_what_cannot_be_is_left_to_the_model_with_the_nearest_that_can(session, gallery, steps):
    gap = gap_of()
    far = gap.target[:1]
    far = Motion(HUMANOID, far.root_positions + np.array([40.0, 0.0, 0.0]), far.local_rotations, 30.0)
    one = guide(request_of(session, gallery), Gap(gap.context, far), steps, 1)[0]
    assert (one.steps, one.path, one.trajectory) == (steps, None, "model")
    assert "the path is unconstrained" in one.note
    assert any(word in one.note for word in ("frames would do", "set a key in between", "nearest takes"))
    with pytest.raises(InputError, match="set a key in between"):
        guide(request_of(session, gallery), Gap(gap.context, far), None, 1)


def test_a_short_gap_at_a_plausible_pace_is_unconstrained_without_a_note(session, gallery):
    one = guide(request_of(session, gallery), gap_of(frames=6), 7, 1)[0]
    assert (one.steps, one.path, one.trajectory, one.note) == (7, None, "model", None)


def test_a_drawn_path_is_followed(session, gallery):
    gap = gap_of()
    middle = (np.array(gap.query.start[:2]) + np.array(gap.query.target[:2])) / 2.0 + [0.5, 0.0]
    one = guide(request_of(session, gallery), gap, 46, 2, drawn=DrawnPath(middle[None]))
    assert [p.trajectory for p in one] == ["drawn"] * 2
    assert np.linalg.norm(one[0].path[:, :2] - middle, axis=-1).min() < 0.1
    assert one[0].steps == 46


def test_known_motion_around_the_gap_gives_velocities():
    gap = gap_of(context=5)
    before, after = gap.ends.velocities
    np.testing.assert_allclose(before, np.diff(gap.context.root_positions[-2:, ::2], axis=0)[0] * 30.0)
    assert after is not None
    lone = Gap(gap.context[-1], gap.target[0])
    assert lone.ends.velocities == (None, None)


def test_a_trajectory_of_another_style_is_taken_where_it_is_clearly_nearer_to_the_unconstrained_root(gallery):
    gap = gap_of()
    (near,) = proposals.propose(gallery, gap.query, PathRequest(46), gap.ends)
    aside = 0.5 * np.sin(np.linspace(0.0, np.pi, 47))[:, None] * np.array([1.0, 1.0, 0.0])
    far = replace(near, path=near.path + aside)
    taken = guidance._of_any_style(gallery, gap.query, gap.ends, far, near.path, 0)
    assert paths.apart(taken.path, near.path) < 0.1
    assert guidance._of_any_style(gallery, gap.query, gap.ends, near, near.path, 0) is near


def test_a_model_with_a_planner_is_unconstrained_first_and_by_turns(planned_session, gallery):
    gap = gap_of()
    made = guide(request_of(planned_session, gallery), gap, 46, 4)
    assert [one.trajectory for one in made] == ["model", made[1].trajectory, "model", made[3].trajectory]
    assert {made[1].trajectory, made[3].trajectory} <= {"matched", "composed"}
    assert not np.array_equal(made[1].path, made[3].path)
    (alone,) = guide(request_of(planned_session, gallery), gap, 46, 1)
    assert (alone.path, alone.note) == (None, None)


def test_beyond_what_a_planner_predicts_the_gallery_leads(planned_session, gallery):
    gap = gap_of(frames=100)
    assert guide(request_of(planned_session, gallery), gap, 92, 1)[0].trajectory == "model"
    assert guide(request_of(planned_session, gallery), gap, 93, 1)[0].trajectory != "model"


def test_a_time_too_short_is_told_by_a_model_with_a_planner_too(planned_session, gallery):
    (made,) = guide(request_of(planned_session, gallery), gap_of(frames=100), 3, 1)
    assert made.trajectory == "model"
    assert "m/s, and the fastest trajectory" in made.note


def test_a_gallery_that_was_named_leads_every_variant(planned_session, gallery):
    request = Request("dcmoe", planned_session, gallery=gallery)
    assert request.path == "gallery"
    made = guide(request, gap_of(), 46, 3)
    assert {one.trajectory for one in made} <= {"matched", "composed"}
    assert all(one.path is not None for one in made)
    assert made[0].path is not None
    np.testing.assert_array_equal(
        made[0].path, guide(request_of(planned_session, gallery, path="gallery"), gap_of(), 46, 1)[0].path
    )


def test_a_gap_shorter_than_trajectories_says_so_where_one_was_requested(session, gallery):
    (made,) = guide(request_of(session, gallery, path="gallery"), gap_of(frames=6), 7, 1)
    assert (made.path, made.trajectory) == (None, "model")
    assert made.note == "the shortest trajectories take 15 frames at 30 Hz; the path is unconstrained"
