"""The reader against upc-pymotion's, an independent implementation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pymotion.io.bvh import BVH
from pymotion.ops.skeleton import fk
from scipy.spatial.transform import Rotation

from interpose import io
from interpose.io import bvh


def assert_same_as_pymotion(path: Path) -> None:
    """Same names, parents, world positions and world rotations of every joint; pymotion reckons in single precision."""
    motion = io.read(path)
    other = BVH()
    other.load(str(path))
    turned, positions, parents, offsets, _, _ = other.get_data()
    assert tuple(other.data["names"]) == motion.skeleton.names
    assert tuple(parents[1:]) == motion.skeleton.parents[1:]
    assert other.data["frame_time"] == pytest.approx(1.0 / motion.rate, abs=1e-6)
    if motion.translations is None:
        places, matrices = fk(turned, positions[:, 0], np.concatenate([np.zeros((1, 3)), offsets[1:]]), parents)
        np.testing.assert_allclose(motion.global_positions() / motion.layout.metres_per_unit, places, rtol=0, atol=5e-5)
        ours = Rotation.from_quat(motion.global_rotations()).as_matrix()
        np.testing.assert_allclose(ours, matrices, rtol=0, atol=1e-6)
    else:
        # Their forward kinematics has fixed offsets, so files that animate joint positions are compared locally.
        np.testing.assert_allclose(motion.translations / motion.layout.metres_per_unit, positions, rtol=0, atol=1e-9)
        ours = Rotation.from_quat(motion.local_rotations).as_matrix()
        theirs = Rotation.from_quat(turned[..., [1, 2, 3, 0]]).as_matrix()
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-6)


def test_a_made_file_means_the_same_to_pymotion(tmp_path: Path, humanoid_text: Callable[..., str]) -> None:
    (tmp_path / "clip.bvh").write_text(humanoid_text(20))
    assert_same_as_pymotion(tmp_path / "clip.bvh")


def test_generated_rows_mean_the_same_to_pymotion(tmp_path: Path, humanoid_text: Callable[..., str]) -> None:
    motion = bvh.parse(humanoid_text(20).encode(), "clip")
    io.write(tmp_path / "made.bvh", motion, unchanged_rows={})
    assert_same_as_pymotion(tmp_path / "made.bvh")


@pytest.mark.parametrize("data_set", ["lafan1", "lafan1-excerpts", "100style", "bandai-namco-1", "bandai-namco-2"])
def test_a_real_file_means_the_same_to_pymotion(data_set: str, data_dir: Path) -> None:
    files = sorted((data_dir / data_set).glob("*.bvh"), key=lambda path: (path.stat().st_size, path))
    if not files:
        pytest.skip(f"INTERPOSE_DATA holds no {data_set}")
    assert_same_as_pymotion(files[0])
