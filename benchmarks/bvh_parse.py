"""How long reading a BVH file takes, as a ratio to NumPy parsing the same numbers. The budget is 1.5.

    python benchmarks/bvh_parse.py [FILE.bvh ...]

Without files a synthetic one is written: 22 joints, 4000 frames, six decimals. The reference is the quickest of NumPy's
own parsers (``fromstring`` with a separator, ``loadtxt``) on the motion block alone, already in memory; reading
includes the file, its hierarchy, the checks and the conversion to quaternions.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from interpose.io import read, write
from interpose.motion import Motion
from interpose.skeleton import HUMANOID

REPEATS = 7


def seconds(run: Callable[[], object]) -> float:
    """The shortest of several runs."""
    best = float("inf")
    for _ in range(REPEATS):
        start = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - start)
    return best


def synthetic(folder: Path) -> Path:
    """A file of random poses."""
    draw = np.random.default_rng(0)
    turns = draw.normal(size=(4000, len(HUMANOID), 4))
    turns /= np.linalg.norm(turns, axis=-1, keepdims=True)
    path = folder / "synthetic.bvh"
    write(path, Motion(HUMANOID, draw.normal(size=(4000, 3)), turns, 30.0))
    return path


def measure(path: Path) -> None:
    """Prints one line for one file."""
    rows = path.read_bytes().partition(b"Frame Time:")[2].partition(b"\n")[2]
    numbers = len(rows.split())
    parsers = {
        "fromstring": seconds(lambda: np.fromstring(rows, sep=" ")),
        "loadtxt": seconds(lambda: np.loadtxt(io.BytesIO(rows))),
    }
    quickest = min(parsers, key=lambda name: parsers[name])
    own = seconds(lambda: read(path))
    print(
        f"{path.name}: {numbers} numbers, read in {own * 1e3:.1f} ms, "
        f"numpy.{quickest} {parsers[quickest] * 1e3:.1f} ms, ratio {own / parsers[quickest]:.2f}"
    )


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        for path in [Path(name) for name in sys.argv[1:]] or [synthetic(Path(folder))]:
            measure(path)


if __name__ == "__main__":
    main()
