from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import io, rotation
from interpose.errors import InputError
from interpose.evaluate import windows as benchmark

from .conftest import MakeClip


@pytest.mark.parametrize(("frames", "windows"), [(66, 1), (105, 1), (106, 2), (146, 3)])
def test_a_window_that_ends_with_its_clip_is_left_out(make_clip: MakeClip, frames: int, windows: int) -> None:
    assert len(benchmark.cut((make_clip(frames),))) == windows


def test_a_clip_as_long_as_a_window_has_none(make_clip: MakeClip) -> None:
    with pytest.raises(InputError, match="longer than a window of 65 frames"):
        benchmark.cut((make_clip(65),))


def test_windows_come_file_by_file(make_clip: MakeClip) -> None:
    one, other = make_clip(146, 1), make_clip(106, 2)
    np.testing.assert_array_equal(
        benchmark.cut((one, other)).positions,
        np.concatenate([benchmark.cut((one,)).positions, benchmark.cut((other,)).positions]),
    )


def test_windows_are_centred_on_the_ground_and_face_x_in_the_last_past_frame(make_clip: MakeClip) -> None:
    windows = benchmark.cut((make_clip(200),))
    np.testing.assert_allclose(windows.root[:, :, [0, 2]].mean(axis=1), 0.0, atol=1e-12)
    hips_y = rotation.rotate(windows.rotations[:, 9, 0], np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(hips_y[:, 2], 0.0, atol=1e-12)
    assert (hips_y[:, 0] > 0.0).all()


def test_windows_are_the_clip_moved_and_turned_about_the_vertical(make_clip: MakeClip) -> None:
    clip = make_clip(200)
    windows = benchmark.cut((clip,))
    whole = clip.global_positions()[40:105]
    np.testing.assert_allclose(windows.positions[1, ..., 1], whole[..., 1], atol=1e-12)
    apart, whole_apart = (np.linalg.norm(x[0, 0] - x, axis=-1) for x in (windows.positions[1], whole))
    np.testing.assert_allclose(apart, whole_apart, atol=1e-12)
    np.testing.assert_allclose(windows.root[1], windows.positions[1, :, 0])


def test_signs_are_continuous_whatever_the_reader_gave(make_clip: MakeClip) -> None:
    clip = make_clip(100)
    clip.local_rotations[30:33] *= -1.0
    local = benchmark.cut((clip,)).local
    assert (np.sum(local[:, 1:] * local[:, :-1], axis=-1) > 0.0).all()


def test_scale_is_the_deviation_over_the_training_windows(make_clip: MakeClip) -> None:
    clips = (make_clip(130, 1), make_clip(50, 2), make_clip(90, 3))
    windows = benchmark.cut((clips[0], clips[2]), benchmark.SCALE_WINDOW, benchmark.SCALE_OFFSET)
    np.testing.assert_allclose(benchmark.position_scale(clips), windows.positions.std(axis=(0, 1)), rtol=1e-9)


def test_scale_needs_a_training_clip_longer_than_its_window(make_clip: MakeClip) -> None:
    with pytest.raises(InputError, match="longer than 50 frames"):
        benchmark.position_scale((make_clip(50),))


@pytest.mark.parametrize(
    ("frames", "window", "protocol"),
    [(5, 65, "lafan1"), (45, 65, "lafan1"), (46, 66, "lafan1-extended"), (90, 110, "lafan1-extended")],
)
def test_only_gaps_that_do_not_fit_get_longer_windows(
    lafan1_like: Path, frames: int, window: int, protocol: str
) -> None:
    (case,) = benchmark.cases(benchmark.read(lafan1_like), [frames])
    assert case.windows.root.shape[1] == benchmark.window_length(frames) == window
    assert (case.protocol, case.length, case.frames) == (protocol, frames, frames)
    assert (case.start, case.target, case.known) == (9, 10 + frames, 10)


def test_read_splits_by_subject(lafan1_like: Path) -> None:
    data = benchmark.read(lafan1_like)
    assert [len(clip) for clip in data.clips] == [150, 131]
    train = io.read(lafan1_like / "walk1_subject1.bvh")
    np.testing.assert_array_equal(data.scale, benchmark.position_scale((train,)))


def test_read_says_what_the_folder_lacks(tmp_path: Path, make_clip: MakeClip) -> None:
    with pytest.raises(InputError, match="nowhere is not a folder"):
        benchmark.read(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"no \*_subject1\.bvh to \*_subject4\.bvh"):
        benchmark.read(tmp_path)
    io.write(tmp_path / "a_subject2.bvh", make_clip(60))
    with pytest.raises(InputError, match=r"no \*_subject5\.bvh"):
        benchmark.read(tmp_path)


def test_read_refuses_another_skeleton(tmp_path: Path) -> None:
    channels = "CHANNELS 3 Zrotation Yrotation Xrotation"
    text = f"HIERARCHY\nROOT Hips\n{{\nOFFSET 0 0 0\n{channels}\nEnd Site\n{{\nOFFSET 0 1 0\n}}\n}}\n"
    (tmp_path / "a_subject1.bvh").write_text(text + "MOTION\nFrames: 1\nFrame Time: 0.033333\n0 0 0\n")
    with pytest.raises(InputError, match=r"a_subject1\.bvh has 1 joints"):
        benchmark.read(tmp_path)
