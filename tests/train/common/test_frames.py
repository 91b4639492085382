"""Which labels training sees."""

from dataclasses import replace

import learning
import numpy as np
import pytest

from interpose.data import label_issues
from interpose.train.common.frames import joined_styles, load_frames, origin


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


def test_styles_that_differ_in_case_alone_are_one_label(database):
    def spelled(style):
        return replace(database, clips=tuple(replace(clip, style=style) for clip in database.clips))

    assert joined_styles([spelled("Walk"), database, spelled("walk")]) == tuple(sorted({"Walk", *learning.STYLES}))
    assert (load_frames(spelled("walk"), None, ["Run", "Walk"], [(30, 120)]).style == 2).all()


def test_a_run_remembers_which_labels_counted(database, distilled):
    assert origin([database])["databases"] == (f"synthetic {database.fingerprint}",)
    (name,) = origin([distilled])["databases"]
    assert name.startswith(f"synthetic {distilled.fingerprint} labels kept 0.8000 ")
    label_issues.save(distilled, np.arange(distilled.frames) % 5 > 1)
    assert origin([distilled])["databases"] != (name,)
