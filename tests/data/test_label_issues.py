"""Folds of whole recordings, window verdicts joined to frames, and the file that trainings honour."""

from dataclasses import replace

import numpy as np
import pytest

from interpose.data import label_issues
from interpose.data.label_issues import JudgedWindows
from interpose.errors import InputError


def named(database, clips):
    """The database with other clips' names: (file, subject, style) each, ten frames long."""
    infos = [replace(database.clips[0], name=f, file=f"{f}.bvh", subject=s, style=y) for f, s, y in clips]
    stops = 10 * np.arange(1, len(clips) + 1)
    frames = {name: getattr(database, name)[: stops[-1]] for name in FRAMES}
    return replace(database, clips=tuple(infos), ranges=np.stack([stops - 10, stops], axis=1), **frames)


FRAMES = ("root_positions", "local_rotations", "root", "contacts")
LAFAN = [
    ("walk1_subject1_walk", "subject1", "walk"),
    ("walk1_subject1_walk2", "subject1", "walk"),
    ("walk2_subject1_proud", "subject1", "walk"),
    ("run2_subject4_run", "subject4", "run"),
    ("run2_subject4_run2", "subject4", "run"),
    ("dance1_subject2", "subject2", "dance"),
    ("dance1_subject3", "subject3", "dance"),
]


def test_clips_of_one_recording_are_in_one_fold_and_recordings_of_one_style_in_several(database):
    data = named(database, LAFAN)
    assert label_issues.recording(data.clips[0]) == label_issues.recording(data.clips[1]) == "walk1_subject1"
    fold = label_issues.folds(data, 3)
    assert fold[0] == fold[1] != fold[2]
    assert fold[5] != fold[6]
    assert fold[3] == fold[4] == -1  # one recording alone shows how to run


def test_a_clip_without_a_subject_is_its_own_recording(database):
    data = named(database, [("Angry_FW", "", "Angry"), ("Angry_BW", "", "Angry")])
    assert [label_issues.recording(clip) for clip in data.clips] == ["Angry_FW", "Angry_BW"]


def judged_of(starts, issues, length=4):
    starts, issue = np.array(starts), np.zeros(len(starts), dtype=bool)
    issue[issues] = True
    zeros = np.zeros(len(starts), dtype=np.int64)
    return JudgedWindows(length, starts, zeros, zeros + issue, issue, issue * 0.5)


def test_a_frame_is_dropped_where_most_windows_on_it_are_issues():
    judged = judged_of([0, 2, 4, 6], [1, 2])
    # Frames 2-3 have one issue of two windows, 4-5 two of two, 6-7 one of two, 10 and 11 no window at all.
    assert np.flatnonzero(label_issues.dropped_frames(judged, 12)).tolist() == [4, 5]
    assert not label_issues.dropped_frames(judged_of([0, 2], []), 12).any()
    assert label_issues.dropped_frames(judged_of([8], [0]), 12)[8:].all()


def test_stretches_end_with_their_clip_and_say_what_is_believed(database):
    data = named(database, [("a", "", "Old"), ("b", "", "Young"), ("c", "", "Old")])
    judged = judged_of([0, 6, 10, 16, 20], [1, 2])
    dropped = label_issues.dropped_frames(judged, 30)
    found = label_issues.stretches(data, judged, dropped)
    assert [(run.clip, run.start, run.stop, run.believed, run.doubt) for run in found] == [
        (0, 6, 10, 1, 0.5),
        (1, 10, 14, 1, 0.5),
    ]


def test_what_is_kept_comes_back_and_only_for_the_same_contents(database, tmp_path):
    data = replace(database, path=tmp_path)
    assert label_issues.kept(data) is None
    mask = np.arange(data.frames) % 3 > 0
    label_issues.save(data, mask)
    np.testing.assert_array_equal(label_issues.kept(data), mask)
    with pytest.raises(InputError, match="other contents"):
        label_issues.kept(replace(data, fingerprint="another"))
    (tmp_path / label_issues.KEPT_LABELS_FILE).write_bytes(b"PK\x03\x04 cut short")
    with pytest.raises(InputError, match="run 'interpose labels' again"):
        label_issues.kept(data)


def test_the_report_tells_what_was_not_judged(database):
    data = named(database, LAFAN)
    judged = replace(judged_of([0, 10, 20, 50, 60], [0], 10), given=np.array([2, 2, 2, 0, 0]))
    text = label_issues.report(data, judged, label_issues.folds(data, 3), label_issues.dropped_frames(judged, 70))
    assert "85.71% of 70 frames keep their label; the DC-MoE paper keeps 75.14% of LaFAN1" in text
    assert "| walk | 2 | 30 | 100% | 0% | 66.7% | run 10 |" in text
    assert "| run | 1 | 20 | 0% | - | 100.0% | - |" in text
    assert "there is only one recording: run." in text
    short = label_issues.report(data, replace(judged, length=11), label_issues.folds(data, 3), np.zeros(70, dtype=bool))
    assert "shorter than a window: 7 clips" in short
