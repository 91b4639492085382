"""How well a gallery performs on gaps: known answers, and the files that are written."""

import json

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.evaluate import gallery as protocol
from interpose.evaluate.gallery import case_rows, cut, duration_errors, evaluate_gallery
from interpose.gallery import store
from interpose.gallery.tracks import from_database


@pytest.fixture(scope="module")
def gallery(database):
    return store.of_tracks(from_database(database))


@pytest.fixture(scope="module")
def gaps(database):
    return cut(database, [(0, 150), (150, 240), (240, 360)], 30, 9)


def test_gaps_are_centred_and_begin_facing_ahead(gaps, database):
    assert gaps.frames == 30
    assert len(gaps) == len(range(0, 119, 9)) + len(range(150, 209, 9)) + len(range(240, 329, 9))
    np.testing.assert_allclose(gaps.windows.root[..., ::2].mean(axis=1), 0.0, atol=1e-9)
    np.testing.assert_allclose([path[0, 2] for path in gaps.true_paths], 0.0, atol=1e-6)
    same = np.linalg.norm(np.diff(gaps.windows.root[0], axis=0), axis=-1)
    np.testing.assert_allclose(same, np.linalg.norm(np.diff(database.root_positions[:32], axis=0), axis=-1), atol=1e-5)


def test_a_gallery_of_the_very_clips_suggests_their_durations_better_than_chance(gaps, gallery):
    away = duration_errors(gaps, gallery)
    assert np.isfinite(away).all()
    assert np.median(away) < 0.6


def test_rows_of_every_kind_of_path(gaps, gallery, session):
    rows = {(row.method, row.metric): row for row in case_rows(gaps, gallery, session)}
    for method in ("none", "straight", "random", "gallery", "true"):
        assert rows[method, "L2P"].value > 0.0
        assert rows[method, "L2P"].ratio_to_interp == pytest.approx(
            rows[method, "L2P"].value / rows["interp", "L2P"].value
        )
    assert ("none", "path_deviation") not in rows
    assert rows["straight", "path_deviation"].value != rows["true", "path_deviation"].value
    assert rows["gallery", "path_deviation"].value > 0.0
    assert rows["interp", "ADE"].ratio_to_interp == 1.0
    assert np.isnan(rows["truth", "foot_slide"].ratio_to_interp)
    assert rows["gallery", "diversity"].value > rows["phases", "diversity"].value


def test_interpolations_error_is_what_the_straight_line_leaves(gaps, gallery, session):
    rows = {(row.method, row.metric): row.value for row in case_rows(gaps, gallery, session)}
    root = gaps.windows.root
    straight = np.linspace(0.0, 1.0, 32)[:, None] * (root[:, -1:] - root[:, :1]) + root[:, :1]
    hips = np.linalg.norm(root - straight, axis=-1)[:, 1:-1].mean()
    assert rows["interp", "ADE"] > 0.5 * hips


def test_the_whole_command_writes_tables(database, gallery, session, tmp_path, monkeypatch):
    monkeypatch.setattr(protocol, "DIVERSITY_GAPS", 2)
    messages = []
    rows = evaluate_gallery(database, gallery, session, tmp_path / "out", lengths=(20, 30), progress=messages.append)
    assert len(messages) == 2
    written = json.loads((tmp_path / "out" / "results.json").read_text())
    assert len(written) == len(rows)
    text = (tmp_path / "out" / "results.md").read_text()
    assert "## diversity" in text
    assert "| all |" in text.split("## duration_within_20")[1]
    assert {row["frames"] for row in written if row["metric"] == "duration_within_20"} == {0, 20, 30}


def test_what_cannot_be_measured_is_refused(database, gallery, session, tmp_path):
    with pytest.raises(InputError, match="unknown part 'half'"):
        evaluate_gallery(database, gallery, session, tmp_path / "out", part="half")
    with pytest.raises(InputError, match="holds a gap of 400 frames"):
        evaluate_gallery(database, gallery, session, tmp_path / "out", lengths=(400,))
    assert not (tmp_path / "out").exists()
