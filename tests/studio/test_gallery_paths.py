"""FindPaths as lines of few points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from interpose.errors import InputError
from interpose.gallery.matching import Query, Trace, Window
from interpose.gallery.proposals import PathRequest, Proposal, Unreachable
from interpose.gallery.store import Gallery
from interpose.gallery.weighing import EndStates
from interpose.runtime.request import Request
from interpose.studio import gallery_paths
from interpose.studio.gallery_paths import MOST_PATH_POINTS, POINT_SPACING, point_path
from interpose.studio.methods import Offer
from interpose.studio.rigs import Clip


def followed(path: ndarray, seconds: float) -> tuple[ndarray, ndarray]:
    """Where the line is at the path's times, with straight ways between its points, and how it faces."""
    line = point_path(path, seconds)
    assert line.times is not None
    assert line.facing is not None
    assert len(line.points) == len(line.times) == len(line.facing) <= MOST_PATH_POINTS
    assert line.times[0] == 0.0
    assert (np.diff(line.times) > 0.0).all()
    at = np.linspace(0.0, seconds, len(path))
    points = np.array(line.points)
    place = np.stack([np.interp(at, line.times, points[:, i]) for i in (0, 1)], axis=-1)
    return place, np.interp(at, line.times, line.facing)


def test_a_bend_and_a_halt_are_kept() -> None:
    t = np.linspace(0.0, 1.0, 90)
    bend = np.stack([np.sin(3.0 * t), 1.0 - np.cos(3.0 * t), 3.0 * t], axis=-1)
    on = bend[-1:] + np.array([0.02, 0.0, 0.0]) * np.arange(50)[:, None]
    path = np.concatenate([bend, np.tile(bend[-1:], (60, 1)), on])
    place, facing = followed(path, 4.0)
    assert np.abs(place - path[:, :2]).max() < 0.1
    assert np.abs(facing - path[:, 2]).max() < 0.15


def test_points_are_places_of_the_path_with_their_times_and_facings() -> None:
    t = np.linspace(0.0, 1.0, 61)
    path = np.stack([t**2, np.sin(3.0 * t), 2.0 * t], axis=-1)
    line = point_path(path, 3.0)
    assert line.times is not None
    rows = np.rint(np.array(line.times) * 20.0).astype(int)
    np.testing.assert_allclose(line.times, rows / 20.0, atol=1e-4)
    np.testing.assert_allclose(line.points, path[rows, :2], atol=1e-4)
    np.testing.assert_allclose(np.asarray(line.facing), path[rows, 2], atol=1e-4)
    assert (rows[0], rows[-1]) == (0, 60)


def test_where_somebody_stands_one_point_is_enough() -> None:
    path = np.zeros((60, 3))
    path[:, 0] = np.linspace(0.0, 0.01, 60)
    line = point_path(path, 2.0)
    assert line.points == [(0.0, 0.0)]
    assert line.times == [0.0]


def test_a_path_that_returns_to_where_it_began_has_both_ends() -> None:
    t = np.linspace(0.0, 2.0 * np.pi, 60)
    path = np.stack([np.sin(t), 1.0 - np.cos(t), t], axis=-1)
    line = point_path(path, 2.0)
    assert line.points[0] == line.points[-1] == (0.0, 0.0)
    assert line.times is not None
    assert line.times[-1] == 2.0
    assert len(line.points) > 20


@given(st.integers(0, 10_000), st.integers(2, 200), st.floats(0.0, 0.05))
def test_points_are_few_and_apart_and_lead_along_the_path(seed: int, count: int, pace: float) -> None:
    rng = np.random.default_rng(seed)
    yaw = np.cumsum(rng.normal(0.0, 0.1, count))
    step = pace * np.stack([np.sin(yaw), np.cos(yaw)], axis=-1)
    path = np.concatenate([np.cumsum(step, axis=0), yaw[:, None]], axis=-1)
    place, _ = followed(path, count / 30)
    assert np.abs(place - path[:, :2]).max() < 2.0 * POINT_SPACING + 8.0 * pace
    points = np.array(point_path(path, count / 30).points)
    if len(points) > 2:
        assert np.linalg.norm(np.diff(points, axis=0), axis=-1).min() > POINT_SPACING - 2e-4


def found_of(styles: list[str | None], refuses: str | None) -> Callable[..., list[Proposal]]:
    """In place of the search: one path of 61 frames that took 40 and 30 when it was walked. It notes the styles that it
    is asked for, and finds nothing in the one that it refuses."""

    def propose(gallery: Gallery, query: Query, asked: PathRequest, ends: EndStates, **_: int) -> list[Proposal]:
        styles.append(asked.style)
        if asked.style is not None and asked.style == refuses:
            raise Unreachable("nothing leads there")
        path = np.linspace([*query.start], [*query.target], 61)
        trace = Trace((Window(0, 40, False), Window(100, 30, False)), 0.0)
        return [Proposal(path, trace, "Angry", 0.5)]

    return propose


@pytest.mark.parametrize(("refuses", "asked"), [(None, ["Angry"]), ("Angry", ["Angry", None])])
def test_a_way_tells_what_it_took_and_another_style_serves_where_its_own_leads_nowhere(
    models: Offer, clip: Clip, monkeypatch: pytest.MonkeyPatch, refuses: str | None, asked: list[str | None]
) -> None:
    styles: list[str | None] = []
    monkeypatch.setattr(gallery_paths.proposals, "propose", found_of(styles, refuses))
    request = Request("dcmoe", models.models[0], "Angry")
    (way,) = gallery_paths.find_paths(request, clip, clip.motion[:1], clip.motion[3:], 60, 1)
    assert styles == asked
    assert (way.frames, way.style, way.fit, way.composed) == (69, "Angry", 0.5, True)


def test_without_a_gallery_no_ways_are_known(clip: Clip) -> None:
    with pytest.raises(InputError, match="the model has no gallery; draw a path"):
        gallery_paths.find_paths(Request("interp"), clip, clip.motion[:1], clip.motion[2:], 30, 4)
