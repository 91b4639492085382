"""Makes the folder that the example runs: a model with the graphs for engines in it.

    python examples/engine/prepare.py [--model NAME] [-o build/engine]

Prints the two lines that are then to be run.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import onnxruntime

from interpose.export.engine import write_engine
from interpose.runtime.model_folder import load

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--model", help="an installed model's name or a folder")
parser.add_argument("-o", "--out", type=Path, default=Path("build/engine"))
given = parser.parse_args()

model = load(given.model)
given.out.mkdir(parents=True, exist_ok=True)
for file in ("model.json", "step.onnx", "begin.onnx", "aim.onnx", "pose.onnx"):
    if (model.path / file).exists():
        shutil.copy2(model.path / file, given.out / file)
if not (given.out / "aim.onnx").exists():
    write_engine(given.out)

here = Path(__file__).parent
library = next((Path(onnxruntime.__file__).parent / "capi").glob("*onnxruntime.*"))
print(f"export ORT_DYLIB_PATH={library}")
print(f"cargo run --release --manifest-path {here / 'Cargo.toml'} -- {given.out} {here / 'route.json'} out.html")
