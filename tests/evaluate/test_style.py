"""The classifier of styles: what it is trained on, what it sees, and the shares that come of it."""

import json
from dataclasses import replace

import learning
import numpy as np
import pytest

from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.evaluate import style
from interpose.evaluate.case import Windows
from interpose.evaluate.style import cut, evaluate_style, middle, splits
from interpose.skeleton import HUMANOID


@pytest.fixture(scope="module")
def long_clips(tmp_path_factory):
    """Two clips that can spare their ends, and one that cannot."""
    return learning.write_database(tmp_path_factory.mktemp("style") / "db", (1100, 1060, 300))


def frames_of(ranges):
    return {frame for a, b in ranges for frame in range(a, b)}


def test_no_classifier_is_trained_on_frames_of_its_gaps_nor_on_the_generators(long_clips):
    trained, _ = training_ranges(long_clips)
    main, first, second = splits(long_clips, "held-out")
    for split in (main, first, second):
        assert not frames_of(split.training) & (frames_of(split.gaps) | frames_of(trained))
    assert frames_of(main.gaps) == frames_of(trained) - frames_of(
        [(2160, 2460)]
    )  # of the third, the classifier learns nothing
    assert not frames_of(first.gaps + second.gaps) & frames_of(trained)
    assert [split.unseen for split in (main, first, second)] == [False, True, True]
    assert frames_of(first.gaps) == frames_of(second.training)


def test_halves_test_one_another_where_all_of_a_database_may_be_used(database):
    first, second = splits(database, "all")
    assert first.training == second.gaps == [(0, 75), (150, 195), (240, 300)]
    assert first.gaps == second.training == [(75, 150), (195, 240), (300, 360)]


def test_gaps_are_spread_over_styles_and_request_every_other_one(database, monkeypatch):
    monkeypatch.setattr(style, "MOST_STYLE_GAPS", 12)
    starts, shows = np.arange(0, 100), np.repeat([0, 1, 2], [60, 38, 2])
    gaps = cut(database, starts, shows, 30, 3)
    assert gaps.case.windows.root.shape == (10, 32, 3)
    assert np.bincount(gaps.shown).tolist() == [4, 4, 2]
    np.testing.assert_allclose(gaps.case.windows.root[3, 0], database.root_positions[59])
    for shown, others in zip(gaps.shown, gaps.others, strict=True):
        assert sorted([shown, *others]) == [0, 1, 2]
    many = cut(database, starts, shows, 30, 6)
    requested = [set(row) for row in many.others[many.shown == 0].tolist()]
    assert requested == [{1, 2, 3}, {4, 5, 1}, {2, 3, 4}, {5, 1, 2}]


def test_only_the_middle_second_is_classified(database):
    motion = database.motion(0, 62)
    root, local = motion.root_positions[None], motion.local_rotations[None]
    shown = middle(Windows(HUMANOID, 30.0, root, local))
    assert shown.shape == (1, style.CLASSIFIED_FRAMES, 132)
    other = local.copy()
    other[:, :15] = other[:, -15:] = local[:, 30:31]
    np.testing.assert_array_equal(middle(Windows(HUMANOID, 30.0, root, other))[:, 1:], shown[:, 1:])
    other[:, 20] = local[:, 40]
    assert not np.array_equal(middle(Windows(HUMANOID, 30.0, root, other)), shown)


def test_the_whole_command_writes_tables_and_requests_every_strength(database, session, tmp_path, monkeypatch):
    monkeypatch.setattr(style, "CLASSIFIER_STEPS", 3)
    monkeypatch.setattr(style, "MOST_STYLE_GAPS", 8)
    requested = []
    fill = style.fill

    def watched(*given, **more):
        if "styles" in more:
            requested.append((tuple(more["styles"]), more["style_strength"]))
        return fill(*given, **more)

    monkeypatch.setattr(style, "fill", watched)
    out = tmp_path / "out"
    rows = evaluate_style(database, session, out, strengths=(1.0, 2.0), lengths=(30,), part="all")
    assert {strength for _, strength in requested} == {1.0, 2.0}
    assert {one for styles, _ in requested for one in styles} == {"Old", "Young"}
    found = {(row.protocol, row.method, row.metric): row for row in rows}
    for case in ("own", "other"):
        for method in ("recorded", "interp", "free", "x1", "x2"):
            share = found[f"style-{case}-keys", method, "style_accuracy"]
            assert 0.0 <= share.ci_low <= share.value <= share.ci_high <= 1.0
            assert share.frames == 30
            assert (f"style-{case}-keys", method, "style_accuracy/Young") in found
    recorded = [found[f"style-{case}-keys", "recorded", "style_accuracy"].value for case in ("own", "other")]
    assert sum(recorded) == pytest.approx(
        1.0
    )  # of two styles, what is not recognised as the one is recognised as the other
    assert len(json.loads((out / "results.json").read_text())) == len(rows)
    assert "chance is 50%" in (out / "results.md").read_text()
    assert (out / "confusion.png").stat().st_size > 1000


def test_what_cannot_be_classified_is_refused(database, long_clips, session, tmp_path):
    def refused(match, data=database, model=session, **more):
        with pytest.raises(InputError, match=match):
            evaluate_style(data, model, tmp_path / "out", **more)

    refused("unknown part 'half'", part="half")
    refused("too short to hold anything out; --part all")
    refused("have 30 frames or more, got 20", part="all", lengths=(20,))
    refused("strength is 0 to 3, got 1, 4", part="all", strengths=(1.0, 4.0))
    refused("a classifier needs two", long_clips, replace(session, info=session.info | {"styles": ["Young"]}))
    assert not (tmp_path / "out").exists()
