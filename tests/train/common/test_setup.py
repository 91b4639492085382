"""What a training takes from its databases."""

from dataclasses import replace

import learning
import numpy as np
import pytest
import torch

from interpose.data import label_issues
from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.train.common import setup
from interpose.train.common.frames import load_frames


def test_a_config_keeps_names_styles_and_licences(database, tmp_path):
    other = learning.write_database(tmp_path / "other", lengths=(60,), licence="CC BY-NC-ND 4.0")
    loaded, kept = setup.load([database.path, other.path])
    assert kept == {
        "databases": (f"synthetic {database.fingerprint}", f"synthetic {other.fingerprint}"),
        "styles": learning.STYLES,
        "licence": "CC BY 4.0; CC BY-NC-ND 4.0",
    }
    assert [one.fingerprint for one in loaded] == [database.fingerprint, other.fingerprint]
    with pytest.raises(InputError, match="nowhere"):
        setup.load([tmp_path / "nowhere"])


def test_it_keeps_which_labels_counted(tmp_path):
    data = learning.write_database(tmp_path / "db")

    def name():
        return setup.load([data.path])[1]["databases"][0]

    assert name() == f"synthetic {data.fingerprint}"
    label_issues.save(data, np.arange(data.frames) % 5 > 0)
    assert name().startswith(f"synthetic {data.fingerprint} labels kept 0.8000 ")
    before = name()
    label_issues.save(data, np.arange(data.frames) % 5 > 1)
    assert name() != before


def test_styles_that_differ_in_case_alone_are_one_label(database):
    def spelled(style):
        return replace(database, clips=tuple(replace(clip, style=style) for clip in database.clips))

    styles = setup.joined_styles([spelled("Walk"), database, spelled("walk")])
    assert styles == tuple(sorted({"Walk", *learning.STYLES}))
    assert (load_frames(spelled("walk"), None, ["Run", "Walk"], [(30, 120)]).style == 2).all()


def test_frames_are_split_into_training_and_held_out(database, tmp_path):
    other = learning.write_database(tmp_path / "other", lengths=(200, 90))
    parts = setup.split([database, other], learning.STYLES, "cpu")
    for i, frames in enumerate(parts):
        counts = [sum(stop - start for start, stop in training_ranges(d)[i]) for d in (database, other)]
        assert len(frames) == 2 * sum(counts)
        assert int(frames.first[2 * counts[0]]) == 2 * counts[0]  # the second database's own indices
        assert not frames.phases.any()
    with_phases, _ = setup.split([database], learning.STYLES, "cpu", [learning.phases_of(database)])
    assert with_phases.phases.any()
    assert torch.equal(with_phases.hips, setup.split([replace(database)], learning.STYLES, "cpu")[0].hips)
