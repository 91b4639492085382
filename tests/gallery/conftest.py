"""Galleries of synthetic walks, made once; not to be changed."""

from __future__ import annotations

import pytest
from gallery.walks import arc, even, tracks_of, wander

from interpose.gallery import store
from interpose.gallery.store import Gallery


@pytest.fixture(scope="session")
def wandering() -> Gallery:
    """Some 1000 frames in three styles, and a clip too short for any window."""
    clips = [wander(frames, seed) for seed, frames in enumerate((300, 260, 12, 220, 200))]
    return store.of_tracks(tracks_of(clips, ["Old", "Young", "Old", "Proud", "Young"]))


@pytest.fixture(scope="session")
def marching() -> Gallery:
    """Straight even walks: thousands of windows of equal errors."""
    return store.of_tracks(tracks_of([even(150), even(170, heading=2.0), even(90, pace=0.8)], ["Old", "Young", "Old"]))


@pytest.fixture(scope="session")
def strolling() -> Gallery:
    """Few frames, short ways: straight, bent, wandering; what is farther than a few metres takes several windows."""
    return store.of_tracks(tracks_of([even(90), arc(90), wander(90, 3)], ["Old", "Young", "Young"]))
