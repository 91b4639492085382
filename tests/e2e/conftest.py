"""A studio that runs, and pages of a real Chromium on it; any error on a page's console fails its test."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from browsing import Server, Watched, find_chromium, launch, settle, somebody_known, start
from playwright.sync_api import Browser, BrowserContext, Page, Playwright, sync_playwright

import interpose as ip
from interpose.demo import poses
from interpose.motion import concatenate


@pytest.fixture(scope="session")
def chromium() -> str:
    """The machine's own Chromium; skips where there is none."""
    found = find_chromium()
    if found is None:
        pytest.skip("needs a Chromium on PATH, or its path in INTERPOSE_CHROMIUM")
    return found


# For one module and not for the whole session: as long as Playwright runs, the process has an event loop, and no other
# test can have one of its own.


@pytest.fixture(scope="module")
def playwright() -> Iterator[Playwright]:
    with sync_playwright() as made:
        yield made


@pytest.fixture(scope="module")
def browser(playwright: Playwright, chromium: str) -> Iterator[Browser]:
    made = launch(playwright, chromium)
    yield made
    made.close()


@pytest.fixture
def context(browser: Browser) -> Iterator[BrowserContext]:
    """A browser of somebody who was here before."""
    made = somebody_known(browser)
    yield made
    made.close()


@pytest.fixture(scope="session")
def start_studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Server]]:
    """Starts a studio: ``start_studio(clip=None, port=None)``; all are stopped in the end, and have not failed."""
    started: list[Server] = []

    def begin(clip: Path | None = None, port: int | None = None) -> Server:
        started.append(start(tmp_path_factory.mktemp("studio") / "log.txt", clip, port))
        return started[-1]

    yield begin
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
