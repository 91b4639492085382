"""Imports run one way (the contracts are in pyproject.toml), and running a model needs neither torch nor matplotlib."""

from __future__ import annotations

import pkgutil
import subprocess
import sys
from pathlib import Path

import interpose

ROOT = Path(__file__).parent.parent
TRAINING = ("interpose.models", "interpose.train", "interpose.export")
"""What needs the extra `train`; everything else runs without it."""
HEAVY = {"torch", "matplotlib", "roma", "onnx", "onnxscript", "cleanlab", "tensorboard"}


def run(code: str) -> subprocess.CompletedProcess[str]:
    """A fresh interpreter, warnings as errors, started where the project lies."""
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_imports_run_one_way() -> None:
    linted = run("from importlinter.cli import lint_imports_command; lint_imports_command(['--no-logo', '--no-cache'])")
    assert linted.returncode == 0, linted.stdout + linted.stderr
    assert "0 broken" in linted.stdout


def test_no_run_time_module_imports_torch_or_matplotlib() -> None:
    found = [m.name for m in pkgutil.walk_packages(interpose.__path__, "interpose.") if not m.name.startswith(TRAINING)]
    modules = [name for name in found if not name.endswith("__main__")]
    assert {"interpose.runtime", "interpose.cli", "interpose.evaluate", "interpose.io.registry"} <= set(modules)
    done = run(
        f"import importlib, sys\n"
        f"for name in {modules}:\n"
        f"    importlib.import_module(name)\n"
        f"    heavy = {HEAVY} & sys.modules.keys()\n"
        f"    if heavy:\n"
        f"        sys.exit(f'importing {{name}} brings in {{sorted(heavy)}}')\n"
    )
    assert done.returncode == 0, done.stderr
