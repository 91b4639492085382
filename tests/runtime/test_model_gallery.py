"""A gallery of a model's own motion."""

import json
import shutil

import learning
import numpy as np
import pytest

from interpose.errors import InputError
from interpose.gallery.tracks import track_of
from interpose.runtime import model_folder as sessions
from interpose.runtime import model_gallery


@pytest.fixture(scope="module")
def long_database(tmp_path_factory):
    return learning.write_database(tmp_path_factory.mktemp("long") / "db", lengths=(700, 500, 90))


def test_no_frame_of_it_is_a_recorded_one(session, long_database):
    made = model_gallery.tracks(session, long_database, 600)
    assert set(made.styles) == set(learning.STYLES)
    assert len(made) >= 500
    recorded = [track_of(long_database.clip(i)) for i in range(len(long_database))]
    steps = np.concatenate([np.diff(track, axis=0) for track in recorded])
    own = np.diff(made.root.astype(float), axis=0)
    apart = np.min(np.linalg.norm(own[:, None] - steps[None], axis=-1), axis=1)
    assert np.median(apart) > 1e-5


def test_it_is_the_same_for_a_seed_and_another_for_another(session, long_database):
    a, b, c = (model_gallery.tracks(session, long_database, 600, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(a.root, b.root)
    assert a.root.shape != c.root.shape or not np.array_equal(a.root, c.root)


def test_it_goes_into_the_models_folder_which_says_what_it_is(model_folder, long_database, tmp_path):
    folder = tmp_path / "model"
    shutil.copytree(model_folder, folder)
    assert sessions.load(folder).gallery is None
    seen = []
    made = model_gallery.add_gallery(
        sessions.load(folder), long_database, 600, progress=lambda done, total: seen.append((done, total))
    )
    told = json.loads((folder / "model.json").read_text())["gallery"]
    assert "no recorded frame is in it" in told["made_from"]
    assert told["licence"] == json.loads((folder / "model.json").read_text())["licence"]
    assert told["frames"] == len(made.tracks)
    assert seen[-1][0] == seen[-1][1]
    loaded = sessions.load(folder).gallery
    np.testing.assert_array_equal(loaded.tracks.root, made.tracks.root)


def test_what_cannot_carry_a_chain_is_refused(session, database, long_database):
    with pytest.raises(InputError, match="no clip is longer than 180 frames"):
        model_gallery.tracks(session, database, 600)
    with pytest.raises(InputError, match="too small"):
        model_gallery.add_gallery(session, long_database, 10)
