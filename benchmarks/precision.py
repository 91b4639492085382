"""What weights in 8 bits cost in accuracy, beside the exported network in single precision.

    python benchmarks/precision.py RUN DATA [--frames 15,30,60,90]

RUN: a run of `interpose train dcmoe` on LaFAN1 without subject 5; DATA: the folder of LaFAN1's BVH files. The run is
exported twice, once with its weights left as they are, and both are measured as `interpose evaluate lafan1` does.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from unittest import mock

from interpose.evaluate.lafan1 import evaluate_lafan1
from interpose.export import export, onnx_file


def main() -> None:
    parser = argparse.ArgumentParser(description="Compares 8-bit weights with single precision.")
    parser.add_argument("run", type=Path, help="of interpose train dcmoe")
    parser.add_argument("data", type=Path, help="the folder of LaFAN1's BVH files")
    parser.add_argument("--frames", default="15,30,60,90", help="lengths of the gaps")
    asked = parser.parse_args()
    lengths = [int(text) for text in asked.frames.split(",")]
    with tempfile.TemporaryDirectory() as folder:
        small = export(asked.run, Path(folder) / "small")
        with mock.patch.object(onnx_file, "quantise", lambda model: model):
            exact = export(asked.run, Path(folder) / "exact")
        rows = evaluate_lafan1(
            asked.data, [f"exact={exact}", f"small={small}"], Path(folder) / "results", lengths=lengths
        )
    found = {(row.method, row.frames): row.value for row in rows if row.metric == "L2P"}
    print(f"{'L2P':12} {'float32':>10} {'8 bits':>10} {'change':>10}")
    for frames in lengths:
        one, other = found["exact", frames], found["small", frames]
        print(f"{frames:>5} frames {one:>10.4f} {other:>10.4f} {other / one - 1.0:>10.2%}")


if __name__ == "__main__":
    main()
