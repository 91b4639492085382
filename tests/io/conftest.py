"""A small humanoid as BVH text, in centimetres, that the tests of this folder bend into other dialects."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from interpose.io.bvh_layout import default_layout
from interpose.skeleton import HUMANOID

TWO_JOINTS = """\
HIERARCHY
ROOT Hips
{
  OFFSET 1.0 2.0 3.0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Spine
  {
    OFFSET 0.0 10.0 0.0
    CHANNELS 3 Zrotation Yrotation Xrotation
    End Site
    {
      OFFSET 0.0 5.0 0.0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.033333
10.0 90.0 -5.0 10.0 20.0 30.0 1.5 -2.5 3.5
11.0 91.0 -4.0 11.0 21.0 31.0 2.5 -3.5 4.5
"""


@pytest.fixture
def two_joints() -> str:
    """Two joints, two frames, 9 channels; line 19 is the first row."""
    return TWO_JOINTS


@pytest.fixture
def save(tmp_path: Path) -> Callable[[str | bytes], Path]:
    """Writes text or bytes to a file named clip.bvh and gives its path."""

    def write(content: str | bytes) -> Path:
        path = tmp_path / "clip.bvh"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def humanoid_text() -> Callable[..., str]:
    """The 22 joints in a file of random poses: ``(frames, metres_per_unit=0.01, seed=0)``."""

    def text(frames: int, metres_per_unit: float = 0.01, seed: int = 0) -> str:
        scale = 0.01 / metres_per_unit
        layout = default_layout(HUMANOID)
        head = []
        for line in layout.head[0].splitlines():
            tab, offset, numbers = line.partition("OFFSET ")
            head.append(
                f"{tab}OFFSET {' '.join(f'{float(x) * scale:.6f}' for x in numbers.split())}" if offset else line
            )
        values = np.random.default_rng(seed).uniform(-80.0, 80.0, (frames, layout.channel_count))
        rows = [" ".join(f"{x:.6f}" for x in row) for row in values]
        return "\n".join([*head, ""])[:-1] + f"{frames}\nFrame Time: 0.033333\n" + "\n".join(rows) + "\n"

    return text
