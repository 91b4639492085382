"""Windows, cases and their scores: known errors, and windows of a database."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import windows
from interpose.evaluate.case import COMPARED, UNPAIRED, Case, check_lengths, database_windows, joined, scores
from interpose.gallery.tracks import track_of
from interpose.motion import Motion
from interpose.retarget import from_humanoid, map_skeleton, to_humanoid
from interpose.skeleton import HUMANOID

from .conftest import MakeClip


@pytest.fixture
def case(make_clip: MakeClip) -> Case:
    clips = (make_clip(200, 1), make_clip(150, 2))
    mapping = map_skeleton(clips[0].skeleton)
    return Case("any", 12, windows.cut(clips), 9, 22, 10, mapping, windows.position_scale(clips))


def test_the_truth_has_no_error(case: Case) -> None:
    found = scores(case, case.truth, list(COMPARED))
    for name in ("L2P", "L2Q", "L2Q_aligned", "NPSS", "ADE", "SLDE"):
        assert found[name].value == pytest.approx(0.0, abs=1e-12), name
    assert found["jerk_ratio"].value == pytest.approx(1.0)


def test_errors_are_those_of_the_frames_between(case: Case) -> None:
    root = case.truth.root + np.array([0.1, 0.0, 0.0])
    root[:, -1] += np.array([0.1, 0.0, 0.0])
    found = scores(case, replace(case.truth, root=root), [*COMPARED, *UNPAIRED])
    assert found["ADE"].value == pytest.approx(0.1 * 13 / 12)
    assert found["SLDE"].value == pytest.approx(0.2)
    assert found["L2P"].value > 0.0
    jump = scores(case, case.truth, ["key_acceleration"])["key_acceleration"].value
    assert found["key_acceleration"].value > jump + 0.1 * 900.0 / 8.0


def test_positions_from_key_to_key_hold_what_was_made(case: Case) -> None:
    made = replace(case.truth, root=case.truth.root + 1.0)
    around = case.positions(made, 1)
    np.testing.assert_array_equal(around[:, 1:-1], case.positions(made))
    np.testing.assert_array_equal(around[:, [0, 1, -2, -1]], case.windows.positions[:, [8, 9, 22, 23]])
    np.testing.assert_array_equal(around[:, 2:-2], made.positions)
    np.testing.assert_array_equal(case.with_keys(case.truth).root, case.windows.root[:, 9:23])


def test_the_true_path_is_the_roots(case: Case) -> None:
    whole = case.windows.retargeted(to_humanoid, case.mapping)
    wanted = track_of(Motion(HUMANOID, whole.root[2, 9:23], whole.local[2, 9:23], whole.rate))
    np.testing.assert_allclose(case.true_paths[2], wanted, atol=1e-9)
    np.testing.assert_allclose(case.gaps[2].query.start, wanted[0], atol=1e-9)
    np.testing.assert_allclose(case.gaps[2].query.target[:2], wanted[-1, :2], atol=1e-9)


def test_some_of_a_case_may_stand_several_times(case: Case) -> None:
    twice = case.take([2, 2])
    assert (len(twice), twice.frames, twice.known) == (2, 12, 10)
    np.testing.assert_array_equal(twice.windows.positions[1], case.windows.positions[2])


def test_the_humanoid_and_back(case: Case) -> None:
    back = case.windows.retargeted(to_humanoid, case.mapping).retargeted(from_humanoid, case.mapping)
    np.testing.assert_allclose(back.positions, case.windows.positions, atol=1e-6)
    assert case.windows.retargeted(to_humanoid, None) is case.windows


def test_frames_are_joined_in_time(case: Case) -> None:
    w = case.windows
    whole = joined(w.frame(0), w.frames(slice(1, 64)), w.frame(-1))
    np.testing.assert_array_equal(whole.local, w.local)


def test_windows_of_a_database(database) -> None:
    found = database_windows(database, [3, 160], 20)
    np.testing.assert_allclose(found.root[1], database.root_positions[160:180])
    assert database_windows(database, [], 20).local.shape == (0, 20, 22, 4)


def test_lengths_that_a_protocol_does_not_have() -> None:
    check_lengths([2, 90], 2)
    with pytest.raises(InputError, match="gaps have 2 frames or more, got none"):
        check_lengths([], 2)
    with pytest.raises(InputError, match="gaps have 4 to 50 frames, got 4, 51"):
        check_lengths([4, 51], 4, 50)
