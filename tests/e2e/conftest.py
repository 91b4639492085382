"""A studio that runs, and pages of a real Chromium on it; any error on a page's console fails its test."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

import pytest
from browsing import SIZE, Server, Watched, free_port, settle
from playwright.sync_api import Browser, BrowserContext, Page, Playwright, sync_playwright

import interpose as ip
from interpose.demo import poses
from interpose.motion import concatenate

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
)
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@pytest.fixture(scope="session")
def chromium() -> str:
    """The machine's own Chromium: the one that INTERPOSE_CHROMIUM names, or one on PATH; skips where there is none."""
    found = os.environ.get("INTERPOSE_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip("needs a Chromium on PATH, or its path in INTERPOSE_CHROMIUM")
    return found


# As in pytest-playwright, but for one module and not for the whole session: as long as Playwright runs, the process has
# an event loop, and no other test can have one of its own.


@pytest.fixture(scope="module")
def playwright() -> Iterator[Playwright]:
    with sync_playwright() as made:
        yield made


@pytest.fixture(scope="module")
def browser(playwright: Playwright, chromium: str) -> Iterator[Browser]:
    made = playwright.chromium.launch(executable_path=chromium, args=[*FLAGS])
    yield made
    made.close()


@pytest.fixture
def new_context(browser: Browser) -> Iterator[Callable[[], BrowserContext]]:
    """Makes browsers of somebody new; where that can be told, nothing moves by itself."""
    made: list[BrowserContext] = []

    def new() -> BrowserContext:
        made.append(browser.new_context(viewport=SIZE, reduced_motion="reduce", color_scheme="light"))
        return made[-1]

    yield new
    for context in made:
        context.close()


@pytest.fixture
def context(new_context: Callable[[], BrowserContext]) -> BrowserContext:
    """A browser of somebody who was here before: no tour."""
    made = new_context()
    made.add_init_script("localStorage.setItem('interpose-toured', '1')")
    return made


@pytest.fixture(scope="session")
def start_studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Server]]:
    """Starts a studio: ``start_studio(clip=None, port=None)``; all are stopped in the end."""
    started: list[Server] = []

    def start(clip: Path | None = None, port: int | None = None) -> Server:
        port = port or free_port()
        log = tmp_path_factory.mktemp("studio") / "log.txt"
        command = [sys.executable, "-m", "interpose", "studio", "--no-browser", "--port", str(port)]
        with log.open("wb") as out:
            process = subprocess.Popen([*command, *([] if clip is None else [str(clip)])], stdout=out, stderr=out)
        server = Server(port, process, log)
        started.append(server)
        for _ in range(1200):  # the front end may have to be built first
            if process.poll() is not None:
                raise RuntimeError(f"the studio stopped: {log.read_text()}")
            try:
                urlopen(server.url, timeout=5).close()
                return server
            except (URLError, OSError):
                time.sleep(0.1)
        raise RuntimeError(f"the studio does not answer: {log.read_text()}")

    yield start
    for server in started:
        server.stop()
        assert "Traceback" not in server.log.read_text(), server.log.read_text()


@pytest.fixture(scope="session")
def studio(chromium: str, start_studio: Callable[..., Server]) -> Server:
    """A studio for all tests that do not need one of their own."""
    return start_studio()


@pytest.fixture(scope="session")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clip of 91 frames that our own model made: from standing into a walk."""
    start, target = poses.pose(poses.STAND), poses.pose(poses.WALK_LEFT, (0.4, 2.6), 10.0)
    (made,) = ip.load_model().inbetween(start, target, 89, style="InTheDark")
    path = tmp_path_factory.mktemp("clips") / "walk.bvh"
    ip.write(path, concatenate(start, made.motion, target))
    return path


@pytest.fixture
def watched() -> Iterator[Watched]:
    found = Watched()
    yield found
    assert found.errors == []


@pytest.fixture
def page(context: BrowserContext, watched: Watched, studio: Server) -> Page:
    """The studio with its sample scene, all of it generated."""
    made = watched.page(context.new_page())
    made.goto(studio.url)
    settle(made)
    return made
