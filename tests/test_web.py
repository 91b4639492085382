"""The front end's own tests and types, by the Node that builds it."""

from __future__ import annotations

import importlib.util
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from interpose.runtime import resampling
from interpose.studio import project_format, protocol

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def build() -> ModuleType:
    """`web/build.py`."""
    spec = importlib.util.spec_from_file_location("web_build", ROOT / "web" / "build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def node(build: ModuleType) -> Any:
    """A Node, with the front end's packages; whatever is at hand, or PyPI's."""
    return build.packages()


def run(node: Any, *command: str) -> None:
    done = subprocess.run([node.node, *command], cwd=ROOT / "web", capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_vitest_passes(node: Any) -> None:
    run(node, "node_modules/vitest/vitest.mjs", "run", "--reporter=dot")


def test_types_and_components_are_sound(node: Any) -> None:
    run(node, "node_modules/svelte-check/bin/svelte-check", "--tsconfig", "tsconfig.json", "--fail-on-warnings")


def test_the_protocols_types_are_made_from_the_servers(node: Any, tmp_path: Path) -> None:
    made = tmp_path / "protocol.ts"
    path = os.pathsep.join([str(Path(node.node).parent), os.environ["PATH"]])
    command = ["sh", str(ROOT / "web" / "protocol.sh"), str(made)]
    subprocess.run(command, env={**os.environ, "PATH": path, "PYTHON": sys.executable}, check=True)
    kept = ROOT / "web" / "src" / "protocol.ts"
    assert made.read_text() == kept.read_text(), "run web/protocol.sh, and look at what changes in the page"


@pytest.mark.parametrize(
    ("file", "name", "value"),
    [
        ("app/files.ts", "LARGEST_UPLOAD", protocol.LARGEST_UPLOAD),
        ("document/document.ts", "LONGEST_GAP", protocol.MOST_FRAMES),
        ("panels/gap/Candidates.svelte", "MOST_VARIANTS", project_format.MOST_VARIANTS),
        ("engine/generator.ts", "CONTEXT", resampling.CONTEXT),
        ("engine/generator.ts", "MODEL_RATE", resampling.MODEL_RATE),
    ],
)
def test_limits_are_the_servers(file: str, name: str, value: float) -> None:
    found = re.search(rf"const {name} = ([\d *_.]+);", (ROOT / "web" / "src" / file).read_text())
    assert found is not None
    assert math.prod(float(part) for part in found[1].replace("_", "").split("*")) == value


def test_the_lock_file_holds_no_addresses() -> None:
    assert "://" not in (ROOT / "web" / "package-lock.json").read_text(), "run web/lock"


def test_what_is_built_is_made_anew_when_a_source_changes(
    build: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    web = tmp_path / "web"
    for folder in (*build.FOLDERS, "node_modules/vite/bin"):
        (web / folder).mkdir(parents=True)
    for name in build.SOURCES:
        (web / name).write_text(name)
    (web / "src" / "main.ts").write_text("one")
    # In place of Vite, a program that copies the source.
    vite = "import shutil, sys; shutil.copytree('src', sys.argv[sys.argv.index('--outDir') + 1])"
    (web / "node_modules" / "vite" / "bin" / "vite.js").write_text(vite)
    monkeypatch.setattr(build, "WEB", web)
    monkeypatch.setattr(build, "DIST", web / "dist")
    monkeypatch.setattr(build, "_packages", lambda: build.Node(sys.executable, ()))
    assert build.build() == web / "dist"
    assert (web / "dist" / "main.ts").read_text() == "one"
    (web / "dist" / "mark").touch()
    build.build()
    assert (web / "dist" / "mark").exists(), "nothing changed, nothing was built"
    (web / "src" / "main.ts").write_text("two")
    build.build()
    assert (web / "dist" / "main.ts").read_text() == "two"
    assert not (web / "dist" / "mark").exists()

    # A build that fails leaves what was there, and no lock behind.
    (web / "src" / "main.ts").write_text("three")
    (web / "node_modules" / "vite" / "bin" / "vite.js").write_text("raise SystemExit('no such export')")
    with pytest.raises(build.Failed, match="vite build failed: no such export"):
        build.build()
    assert (web / "dist" / "main.ts").read_text() == "two"
    assert sorted(path.name for path in web.iterdir() if path.name.startswith(".")) == []


def test_an_old_node_is_not_taken(build: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name, said in (("node", "v18.20.0"), ("npm", "9.0.0")):
        program = tmp_path / name
        program.write_text(f"#!/bin/sh\necho {said}\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(build.importlib.util, "find_spec", lambda _: None)
    assert build.find_node() is None
    (tmp_path / "node").write_text("#!/bin/sh\necho v22.1.0\n")
    assert build.find_node() == build.Node(str(tmp_path / "node"), (str(tmp_path / "npm"),))
