"""What the tests of the commands share: a BVH file, its rows, and what a refused command looks like."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from interpose.skeleton import HUMANOID

RATES = {24: "0.041667", 25: "0.04", 29.97: "0.0333667", 30: "0.033333", 50: "0.02", 60: "0.016667", 120: "0.008333"}


def bvh_text(frames, frame_time="0.033333", names=HUMANOID.names, seed=0):
    """A BVH of the 22 joints with digits that no program would choose, in an unusual channel order."""
    children = {j: [c for c, p in enumerate(HUMANOID.parents) if p == j] for j in range(22)}

    def joint(j, depth):
        tab = "  " * depth
        x, y, z = HUMANOID.offsets[j] * 100.0
        position = "6 Xposition Zposition Yposition" if j == 0 else "3"
        inner = "".join(joint(c, depth + 1) for c in children[j])
        inner = inner or f"{tab}  End Site\n{tab}  {{\n{tab}    OFFSET 0 5.0 0\n{tab}  }}\n"
        return (
            f"{tab}{'ROOT' if j == 0 else 'JOINT'} {names[j]}\n{tab}{{\n{tab}  OFFSET {x:.4f} {y:.4f} {z:.4f}\n"
            f"{tab}  CHANNELS {position} Yrotation Xrotation Zrotation\n{inner}{tab}}}\n"
        )

    hierarchy = "HIERARCHY\n" + joint(0, 0)
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / 30.0
    angles = 20.0 * np.sin(4.0 * t + rng.uniform(0, 6, size=(1, 66)))
    root = np.concatenate([3.0 * np.sin(t), 120.0 * t, 92.0 + np.cos(6 * t)], axis=1)
    forms = ["%.3f", "%.5f", "%.4f", "%g", "%.6e"]
    rows = [
        " ".join(forms[(i + k) % 5] % value for k, value in enumerate(row))
        for i, row in enumerate(np.concatenate([root, angles], axis=1))
    ]
    body = "".join(row + "\n" for row in rows)
    return f"{hierarchy}MOTION\nFrames: {frames}\nFrame Time: {frame_time}\n{body}"


def rows(path):
    return Path(path).read_text().split("Frame Time:")[1].splitlines()[1:]


def fails(result, said, folder=None, left=()):
    """One line on standard error that says ``said``, status 1, and no new file in ``folder``."""
    status, out, err = result
    assert status == 1, err
    assert err.startswith("interpose: ")
    assert err.count("\n") == 1
    assert said in err
    assert out == ""
    if folder is not None:
        assert sorted(p.name for p in folder.iterdir()) == sorted(left)


def command(*arguments, stdout=subprocess.PIPE):
    code = "import sys; from interpose.cli import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
