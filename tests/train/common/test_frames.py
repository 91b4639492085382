"""The frames that training sees: those of the databases, mirrored, and their labels."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose import rotation
from interpose.data import label_issues, root
from interpose.models.geometry import to_matrix
from interpose.skeleton import HUMANOID, MIRROR
from interpose.train.common.frames import load_frames


@pytest.fixture
def distilled(database, tmp_path):
    """The database with every fifth frame's label dropped."""
    data = replace(database, path=tmp_path)
    label_issues.save(data, np.arange(data.frames) % 5 > 0)
    return data


def test_frames_that_were_dropped_have_their_label_set_free(database, distilled):
    ranges = [(30, 120), (240, 360)]
    plain = load_frames(database, None, list(learning.STYLES), ranges).style.numpy()
    made = load_frames(distilled, None, list(learning.STYLES), ranges).style.numpy()
    assert (plain > 0).all()
    at = np.concatenate([np.arange(*r) for r in ranges])
    dropped = np.tile(at % 5 == 0, 2)  # as recorded, and in the mirror
    np.testing.assert_array_equal(made, np.where(dropped, 0, plain))


def test_frames_without_a_label_are_free(database):
    unlabelled = replace(database, clips=tuple(replace(clip, style="") for clip in database.clips))
    assert (load_frames(unlabelled, None, list(learning.STYLES), [(30, 120)]).style == 0).all()


def test_frames_are_the_databases(database, frames):
    assert len(frames) == 2 * database.frames
    for clip, (start, stop) in enumerate(database.ranges):
        motion = database.clip(clip)
        np.testing.assert_allclose(frames.positions[start:stop], motion.global_positions(), atol=1e-6)
        np.testing.assert_allclose(frames.rotations[start:stop], rotation.to_6d(motion.global_rotations()), atol=1e-6)
        yaw = root.pose_yaw(motion.global_rotations()[:, 0])
        np.testing.assert_allclose(frames.facing[start:stop], np.stack([np.sin(yaw), np.cos(yaw)], -1), atol=1e-6)
        assert set(frames.style[start:stop].tolist()) == {1 + clip % 2}
        assert set(frames.first[start:stop].tolist()) == {start}
        assert set(frames.last[start:stop].tolist()) == {stop - 1}
        np.testing.assert_allclose(frames.local[start:stop], motion.local_rotations, atol=1e-6)
    np.testing.assert_array_equal(frames.contacts[: database.frames], database.contacts)
    np.testing.assert_array_equal(frames.phases[: database.frames], learning.phases_of(database)[0])


def test_mirrored_copies_follow_and_are_mirrored_throughout(database, frames):
    count = database.frames
    flip = torch.tensor([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(frames.positions[count:], frames.positions[:count][:, MIRROR] * flip, atol=1e-6)
    np.testing.assert_allclose(frames.hips[count:], frames.hips[:count] * flip, atol=1e-6)
    np.testing.assert_allclose(frames.facing[count:], frames.facing[:count] * flip[:2], atol=1e-6)
    plain, turned = to_matrix(frames.rotations[:count]), to_matrix(frames.rotations[count:])
    reflect = torch.diag(torch.tensor([-1.0, 1.0, 1.0]))
    torch.testing.assert_close(turned, reflect @ plain[:, MIRROR] @ reflect, atol=1e-5, rtol=0)
    swapped = [["LeftFoot", "LeftToe", "RightFoot", "RightToe"].index(n) for n in _other_side()]
    torch.testing.assert_close(frames.contacts[count:], frames.contacts[:count][:, swapped])
    np.testing.assert_array_equal(frames.phases[count:], learning.phases_of(database)[1])
    torch.testing.assert_close(frames.style[count:], frames.style[:count])
    torch.testing.assert_close(frames.first[count:], frames.first[:count] + count)


def _other_side():
    return [HUMANOID.names[MIRROR[HUMANOID.index(n)]] for n in ("LeftFoot", "LeftToe", "RightFoot", "RightToe")]


def test_unlisted_styles_are_free_and_missing_phases_zero(database):
    made = load_frames(database, None, ["Young"], [(10, 60), (150, 240)])
    assert len(made) == 2 * (50 + 90)
    assert made.style[:50].tolist() == [0] * 50
    assert made.style[50:140].tolist() == [1] * 90
    assert not made.phases.any()
    assert made.first[55] == 50
