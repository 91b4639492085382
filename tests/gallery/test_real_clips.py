"""Galleries of real motion: the same answers as the full scan, and a model that keeps to their paths."""

from __future__ import annotations

import numpy as np
import pytest
from gallery import full_scan

from interpose import io, load_model, retarget
from interpose.gallery import index, matching, store
from interpose.gallery.matching import Query
from interpose.gallery.tracks import from_motions
from interpose.gallery.windows import SHORTEST_WINDOW
from interpose.motion import Motion, resample


def on22(path, frames) -> Motion:
    """A part of a clip on the 22 joints at 30 Hz."""
    clip = io.read(path)[frames]
    return resample(retarget.to_humanoid(clip, retarget.map_skeleton(clip)), 30.0)


@pytest.fixture(scope="module")
def walks(style100_dir):
    names = ("Angry_FW", "Angry_SW", "Drunk_FR")
    return [on22(style100_dir / f"{name}.bvh", slice(600, 2000)) for name in names]


@pytest.fixture(scope="module")
def gallery(walks):
    return store.of_tracks(from_motions(walks, ["Angry", "Angry", "Drunk"]))


def test_index_and_scan_agree_on_real_motion(gallery):
    draw = np.random.default_rng(0)
    for i in range(24):
        way, turn = draw.uniform(0.05, 3.0), draw.normal(0.0, 0.3 if i % 2 else 1.5, 2)
        styles = (int(i % 4 == 3),) if i % 4 > 1 else None
        asked = matching.window_query(
            Query((0.0, 0.0, turn[0]), (0.0, way, turn[1])), (SHORTEST_WINDOW, 60 + i), styles
        )
        fast, plain = index.best(gallery.index, asked, 40), full_scan.best(gallery.tracks, asked, 40)
        for name in ("start", "steps", "mirrored", "error"):
            np.testing.assert_array_equal(getattr(fast, name), getattr(plain, name))


def test_the_model_keeps_to_the_path_and_arrives(walks, gallery):
    model = load_model()
    for walk, start, frames in ((walks[0], 100, 60), (walks[1], 250, 45), (walks[2], 300, 90)):
        for path in (None, "straight"):
            keys = walk[start], walk[start + frames + 1]
            (made,) = model.inbetween(*keys, frames, path=path, gallery=None if path else gallery)
            assert made.info.trajectory == ("straight" if path else "matched")  # a given gallery is followed
            assert not path or made.info.path_deviation_m < 0.1
            assert made.info.arrival_position_error_m < 1e-6
            assert len(made.motion) == frames


def test_a_walk_is_given_about_the_time_it_took(walks, gallery):
    model, off = load_model(), []
    for walk in walks:
        for start in range(100, 500, 80):
            told = model.suggest(walk[start], walk[start + 46], style=None, gallery=gallery)
            off.append(abs(told.frames + 1 - 46) / 46)
    assert np.median(off) < 0.25
