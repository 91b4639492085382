"""The judge of styles: what it learns from, what it is shown, and what is told of it."""

import json
from dataclasses import replace

import learning
import numpy as np
import pytest

from interpose.data.split import training_ranges
from interpose.errors import InputError
from interpose.evaluate import style
from interpose.evaluate.style import Found, Verdicts, cut, evaluate_style, middle, sides
from interpose.evaluate.style_tables import confusion, to_markdown


@pytest.fixture(scope="module")
def long_clips(tmp_path_factory):
    """Two clips that can spare their ends, and one that cannot."""
    return learning.write_database(tmp_path_factory.mktemp("style") / "db", (1100, 1060, 300))


def frames_of(ranges):
    return {frame for a, b in ranges for frame in range(a, b)}


def test_no_judge_learns_from_the_frames_that_it_judges_nor_from_what_the_generator_learned(long_clips):
    trained, _ = training_ranges(long_clips)
    main, first, second = sides(long_clips, "held-out")
    for side in (main, first, second):
        assert not frames_of(side.judge) & (frames_of(side.keys) | frames_of(trained))
    assert frames_of(main.keys) == frames_of(trained) - frames_of(
        [(2160, 2460)]
    )  # of the third, the judge knows nothing
    assert not frames_of(first.keys + second.keys) & frames_of(trained)
    assert [side.unseen for side in (main, first, second)] == [False, True, True]
    assert frames_of(first.keys) == frames_of(second.judge)


def test_halves_judge_one_another_where_all_of_a_database_may_be_used(database):
    first, second = sides(database, "all")
    assert first.judge == second.keys == [(0, 75), (150, 195), (240, 300)]
    assert first.keys == second.judge == [(75, 150), (195, 240), (300, 360)]


def test_gaps_are_spread_over_styles_and_ask_for_every_other_one(database, monkeypatch):
    monkeypatch.setattr(style, "GAPS", 12)
    starts, shows = np.arange(0, 100), np.repeat([0, 1, 2], [60, 38, 2])
    gaps = cut(database, starts, shows, 30, 3)
    assert gaps.root.shape == (10, 32, 3)
    assert np.bincount(gaps.shows).tolist() == [4, 4, 2]
    np.testing.assert_allclose(gaps.root[3, 0], database.root_positions[59])
    for shown, others in zip(gaps.shows, gaps.others, strict=True):
        assert sorted([shown, *others]) == [0, 1, 2]
    many = cut(database, starts, shows, 30, 6)
    asked = [set(row) for row in many.others[many.shows == 0].tolist()]
    assert asked == [{1, 2, 3}, {4, 5, 1}, {2, 3, 4}, {5, 1, 2}]


def test_only_the_middle_second_is_judged(database):
    motion = database.motion(0, 62)
    root, local = motion.root_positions[None], motion.local_rotations[None]
    shown = middle(root, local)
    assert shown.shape == (1, style.WINDOW, 132)
    other = local.copy()
    other[:, :15] = other[:, -15:] = local[:, 30:31]
    np.testing.assert_array_equal(middle(root, other)[:, 1:], shown[:, 1:])
    other[:, 20] = local[:, 40]
    assert not np.array_equal(middle(root, other), shown)


def test_the_whole_command_writes_tables_and_asks_with_every_strength(database, session, tmp_path, monkeypatch):
    monkeypatch.setattr(style, "STEPS", 3)
    monkeypatch.setattr(style, "GAPS", 8)
    asked = []
    fill = style.fill

    def watched(*given, **more):
        if "styles" in more:
            asked.append((tuple(more["styles"]), more["style_strength"]))
        return fill(*given, **more)

    monkeypatch.setattr(style, "fill", watched)
    out = tmp_path / "out"
    rows = evaluate_style(database, session, out, strengths=(1.0, 2.0), lengths=(30,), part="all")
    assert {strength for _, strength in asked} == {1.0, 2.0}
    assert {one for called, _ in asked for one in called} == {None, "Old", "Young"}
    told = {(row.protocol, row.method, row.metric): row for row in rows}
    for case in ("own", "other"):
        for method in ("recorded", "interp", "free", "x1", "x2"):
            share = told[f"style-{case}-keys", method, "style_called"]
            assert 0.0 <= share.ci_low <= share.value <= share.ci_high <= 1.0
            assert share.frames == 30
            assert (f"style-{case}-keys", method, "style_called/Young") in told
    recorded = [told[f"style-{case}-keys", "recorded", "style_called"].value for case in ("own", "other")]
    assert sum(recorded) == pytest.approx(1.0)  # of two styles, what is not called the one is called the other
    assert len(json.loads((out / "results.json").read_text())) == len(rows)
    assert "chance is 50%" in (out / "results.md").read_text()
    assert (out / "confusion.png").stat().st_size > 1000


def found(verdicts):
    return Found(["A", "B", "C"], verdicts, np.array([0, 1, 2, 2]), np.array([0, 1, 2, 0]))


def test_tables_count_what_was_called():
    own = Verdicts("own", "x1", 60, False, np.array([0, 0, 1, 2]), np.array([0, 1, 1, 2]))
    far = Verdicts("other", "x1", 90, False, np.array([0, 1]), np.array([0, 2]))
    both = found([own, replace(own, frames=90), far])
    np.testing.assert_array_equal(confusion(both, "own", "x1"), [[2, 2, 0], [0, 2, 0], [0, 0, 2]])
    text = to_markdown(both, "mine")
    assert "names 75.0% of 4 recorded windows" in text
    assert "(A 100%, B 100%, C 50%)" in text
    assert "| of the style asked for | x1 | 75% | 75% |" in text
    assert "| of another style | x1 | - | 50% |" in text
    assert "| A | 50% | 100% |" in text
    assert "| C | 100% | - |" in text
    sure = found([replace(own, called=own.asked)])
    assert "| of the style asked for | x1 | 100% ✓ |" in to_markdown(sure, "mine")


def test_what_cannot_be_judged_is_refused(database, long_clips, session, tmp_path):
    def refused(match, data=database, model=session, **more):
        with pytest.raises(InputError, match=match):
            evaluate_style(data, model, tmp_path / "out", **more)

    refused("unknown part 'half'", part="half")
    refused("too short to hold anything out; --part all")
    refused("have 30 frames or more, got 20", part="all", lengths=(20,))
    refused("strength is 0 to 3, got 1, 4", part="all", strengths=(1.0, 4.0))
    refused("judging needs two", long_clips, replace(session, info=session.info | {"styles": ["Young"]}))
    assert not (tmp_path / "out").exists()
