"""Prints the two lines that run the example with a model's folder: ONNX Runtime's library, and the program.

python examples/engine/prepare.py [--model NAME]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import onnxruntime

from interpose.runtime.model_folder import load

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--model", help="an installed model's name or a folder, of method dcmoe")
model = load(parser.parse_args().model)
here = Path(__file__).parent
library = next((Path(onnxruntime.__file__).parent / "capi").glob("*onnxruntime.*"))
print(f"export ORT_DYLIB_PATH='{library}'")
print(f"cargo run --release --manifest-path '{here / 'Cargo.toml'}' -- '{model.path}' '{here / 'route.json'}' out.html")
