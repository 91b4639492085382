"""What comes out of the studio as a file."""

from __future__ import annotations

import numpy as np
import pytest
from commandline import bvh_text
from numpy import ndarray
from pygltflib import GLTF2
from studio_rigs import envelope, moved, no_humanoid, opened, walk

from interpose import io
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.studio import messages, pose_rows
from interpose.studio.export import EXPORT, export
from interpose.studio.protocol import Export
from interpose.studio.rigs import Clip, RigStore


def written(clip: Clip, frames: ndarray, same: list[tuple[int, int]], kind: str = "bvh") -> bytes:
    """As the browser asks for it, through an envelope."""
    header = {"rig": clip.id, "format": kind, "rows": same, "arrays": {"frames": list(frames.shape)}}
    return export(*messages.unpack(envelope(header, frames), EXPORT), clip)


def lines(data: bytes) -> list[str]:
    return data.decode().split("Frame Time:")[1].splitlines()[1:]


@pytest.fixture
def text() -> str:
    """A file with digits that no program would choose."""
    return bvh_text(20, frame_time="0.0083333")


@pytest.fixture
def clip(text: str) -> Clip:
    return RigStore().open(text.encode(), "walk.bvh")


def test_rows_of_the_file_come_out_digit_for_digit_wherever_they_go(text: str, clip: Clip) -> None:
    frames = pose_rows.of_motion(clip.motion)
    order = [3, 4, 19, 0, 11]
    data = written(clip, frames[order], [(i, row) for i, row in enumerate(order)])
    given = lines(text.encode())
    assert lines(data) == [given[row] for row in order]
    assert data.decode().split("MOTION")[0] == text.split("MOTION")[0]
    assert "Frame Time: 0.0083333" in data.decode()


def test_all_rows_of_a_file_give_the_file_again(text: str, clip: Clip) -> None:
    data = written(clip, pose_rows.of_motion(clip.motion), [(i, i) for i in range(20)])
    assert data == text.encode()


def test_a_file_that_animates_joints_comes_out_again() -> None:
    text = io.serialize(moved(walk()), "clip.bvh")
    clip = RigStore().open(text, "moved.bvh")
    frames = pose_rows.of_motion(clip.motion)
    assert written(clip, frames, [(i, i) for i in range(len(frames))]) == text
    frames[1, 91 + 3 * 5] += 0.01
    made = lines(written(clip, frames, [(i, i) for i in range(len(frames))]))
    given = lines(text)
    assert [made[i] == given[i] for i in range(4)] == [True, False, True, True]


@pytest.mark.parametrize("column", [0, 1, 2, 3, 50, 90])
def test_a_row_that_is_not_the_files_pose_any_more_is_not_passed_off(text: str, clip: Clip, column: int) -> None:
    frames = pose_rows.of_motion(clip.motion)
    frames[7, column] += 1e-3
    frames[7, 3:91] /= np.repeat(np.linalg.norm(frames[7, 3:91].reshape(22, 4), axis=-1), 4)
    made = lines(written(clip, frames, [(i, i) for i in range(20)]))
    given = lines(text.encode())
    assert [i for i in range(20) if made[i] != given[i]] == [7]
    again = io.parse(written(clip, frames, [(7, 7)]), "it")
    shown = pose_rows.to_motion(frames, clip.motion, "it")
    np.testing.assert_allclose(again.global_positions(), shown.global_positions(), atol=1e-5)


def test_another_row_of_the_file_is_not_passed_off(text: str, clip: Clip) -> None:
    frames = pose_rows.of_motion(clip.motion)
    made = lines(written(clip, frames[[3, 4]], [(0, 4), (1, 4)]))
    given = lines(text.encode())
    assert made[0] != given[4]
    assert made[1] == given[4]


def test_a_quaternion_of_the_other_sign_is_the_same_pose(text: str, clip: Clip) -> None:
    frames = pose_rows.of_motion(clip.motion)
    frames[2, 3:91] *= -1.0
    assert lines(written(clip, frames[[2]], [(0, 2)])) == [lines(text.encode())[2]]


def test_rows_far_from_the_origin_are_known_again_as_far_as_32_bits_tell() -> None:
    text = bvh_text(5)
    head, _, body = text.partition("Frame Time: 0.033333\n")
    moved_far = [" ".join(["123456.789", *row.split()[1:]]) for row in body.splitlines()]
    data = (head + "Frame Time: 0.033333\n" + "\n".join(moved_far) + "\n").encode()
    clip = RigStore().open(data, "far.bvh")
    frames = pose_rows.of_motion(clip.motion)
    assert abs(frames[0, 0]) > 1000.0
    assert written(clip, frames, [(i, i) for i in range(5)]) == data


def test_what_is_no_row_is_written_from_the_pose(clip: Clip) -> None:
    frames = pose_rows.of_motion(clip.motion)[:3]
    again = io.parse(written(clip, frames, []), "it")
    shown = pose_rows.to_motion(frames, clip.motion, "it")
    np.testing.assert_allclose(again.global_positions(), shown.global_positions(), atol=1e-5)
    assert again.rate == clip.motion.rate


@pytest.mark.parametrize(("frame", "row"), [(3, 0), (0, 20), (1_000_000, 0)])
def test_rows_that_are_not_there_are_told(clip: Clip, frame: int, row: int) -> None:
    frames = pose_rows.of_motion(clip.motion)[:3]
    with pytest.raises(InputError, match=f"frame {frame} is given as row {row} of .* there are 3 frames and 20 rows"):
        written(clip, frames, [(frame, row)])


def test_an_export_has_frames_and_nothing_else(clip: Clip) -> None:
    frames = pose_rows.of_motion(clip.motion)
    ask = Export(rig=clip.id, format="bvh", rows=[], arrays={})
    with pytest.raises(InputError, match="one array, frames"):
        export(ask, {}, clip)
    with pytest.raises(InputError, match="one array, frames"):
        export(ask, {"frames": frames, "more": frames}, clip)
    with pytest.raises(InputError, match="it needs one row of 91 numbers"):
        written(clip, frames[:, :-1], [])
    with pytest.raises(InputError, match="the rotation of Hips in frame 0"):
        written(clip, np.zeros((1, 91)), [])


@pytest.mark.parametrize("header", [{}, {"format": "fbx"}, {"rows": [[0]]}, {"rows": [[-1, 0]]}, {"more": 1}])
def test_an_export_is_one_that_is_known(clip: Clip, header: dict[str, object]) -> None:
    whole = {"rig": clip.id, "format": "bvh", "rows": [], "arrays": {"frames": [1, 91]}}
    if not header:
        del whole["format"]
    with pytest.raises(InputError, match="header of the message is invalid"):
        messages.unpack(envelope({**whole, **header}, np.zeros((1, 91))), EXPORT)


@pytest.mark.parametrize("motion", [walk(), moved(walk()), no_humanoid()], ids=["fixed", "moved", "other"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_glb_has_the_figure_and_the_frames(motion: Motion, count: int) -> None:
    clip = opened(motion)
    data = written(clip, pose_rows.of_motion(clip.motion)[:count], [], "glb")
    file = GLTF2.load_from_bytes(data)
    (animation,) = file.animations
    times = {file.accessors[sampler.input].count for sampler in animation.samplers}
    assert times == {count}
    (skin,) = file.skins
    assert [file.nodes[joint].name for joint in skin.joints] == list(motion.skeleton.names)
    assert file.meshes
