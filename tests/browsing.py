"""What tests in a real browser share: a studio that runs, pages that are watched, and how they are used."""

from __future__ import annotations

import socket
import subprocess
from dataclasses import dataclass
from pathlib import Path

from playwright.sync_api import ConsoleMessage, Page, ViewportSize, expect

SIZE: ViewportSize = {"width": 1280, "height": 720}
PATIENCE_MS = 30_000
"""How long a page may take over anything; software WebGL on two busy cores is slow."""
expect.set_options(timeout=PATIENCE_MS)


@dataclass
class Server:
    """A studio in a process of its own."""

    port: int
    process: subprocess.Popen[bytes]
    log: Path

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/"

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait(20)


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
