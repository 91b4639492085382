"""What tests in a real browser share with the studio's benchmark and its pictures: a studio that runs, a Chromium, and
pages that are watched."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from urllib.error import URLError
from urllib.request import urlopen

from playwright.sync_api import Browser, BrowserContext, ConsoleMessage, Page, Playwright, ViewportSize, expect

SIZE: ViewportSize = {"width": 1280, "height": 720}
PATIENCE_MS = 30_000
"""How long a page may take over anything; software WebGL on two busy cores is slow."""
expect.set_options(timeout=PATIENCE_MS)
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
STARTING = 120.0
"""Seconds that a studio may take until it answers; its front end may have to be built first."""


@dataclass
class Server:
    """A studio in a process of its own. log: what it writes."""

    port: int
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait(20)


def start(log: Path, clip: Path | None = None, port: int | None = None, python: Path = Path(sys.executable)) -> Server:
    """A studio of that Python's installation that answers. Raises RuntimeError, with what it wrote, if it does not."""
    port = port or free_port()
    command = [str(python), "-m", "interpose", "studio", "--no-browser", "--port", str(port)]
    command += [] if clip is None else [str(clip)]
    with log.open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=out, cwd=log.parent)
    server = Server(port, process, log)
    began = time.monotonic()
    while process.poll() is None and time.monotonic() - began < STARTING:
        try:
            urlopen(server.url, timeout=5).close()
            return server
        except (URLError, OSError):
            time.sleep(0.1)
    process.kill()
    raise RuntimeError(f"the studio does not answer: {log.read_text()}")


def find_chromium() -> str | None:
    """The machine's own Chromium: the one that INTERPOSE_CHROMIUM names, or one on PATH."""
    return os.environ.get("INTERPOSE_CHROMIUM") or next(filter(None, map(shutil.which, NAMES)), None)


def launch(playwright: Playwright, chromium: str) -> Browser:
    return playwright.chromium.launch(executable_path=chromium, args=[*FLAGS])


def somebody_new(browser: Browser) -> BrowserContext:
    """A browser without a past; where that can be told, nothing moves by itself."""
    return browser.new_context(viewport=SIZE, reduced_motion="reduce", color_scheme="light")


def somebody_known(browser: Browser) -> BrowserContext:
    """The same for somebody who was here before: no tour."""
    made = somebody_new(browser)
    made.add_init_script("localStorage.setItem('interpose-toured', '1')")
    return made


class Watched:
    """What went wrong on pages, so far."""

    def __init__(self) -> None:
        self.errors: list[str] = []

    def page(self, page: Page) -> Page:
        page.set_default_timeout(PATIENCE_MS)
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.errors.append(f"{error}"))
        return page

    def _said(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.errors.append(f"{message.text} ({message.location.get('url')})")


def settle(page: Page) -> None:
    """Waits until every gap shows what was asked for."""
    page.wait_for_function("() => window.interpose?.studio.document && window.interpose.studio.settled")


def free_port() -> int:
    """A port that nobody listens at."""
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        return held.getsockname()[1]
