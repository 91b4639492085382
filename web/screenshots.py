"""The pictures of docs/studio.md, taken in a real Chromium: `python web/screenshots.py docs`.

Starts a studio of its own; what is generated is generated then. Needs the development tools and a Chromium.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from browsing import find_chromium, launch, settle, somebody_known, start

DRAW = """() => {
    const points = [[0.9, 2.3], [1.8, 2.6], [2.6, 2.0]];
    const path = { kind: "waypoints", points, times: null, facing: null, drawn: true };
    const { studio } = window.interpose;
    studio.setGap(studio.selectedGap.id, { path }, "Draw");
}"""


def whole(page: Page) -> None:
    """The sample scene with a gap's candidates."""
    page.get_by_test_id("gap-39").click()
    settle(page)
    page.evaluate("() => window.interpose.studio.playback.goTo(72)")
    page.keyboard.press("f")


def paths(page: Page) -> None:
    """A drawn path with its control points, in dark."""
    page.get_by_test_id("theme").click()
    page.get_by_test_id("gap-39").click()
    page.evaluate(DRAW)
    page.get_by_test_id("frames").fill("99")
    page.get_by_test_id("frames").press("Enter")
    page.get_by_test_id("frames").blur()
    settle(page)
    page.evaluate("() => window.interpose.studio.playback.goTo(84)")
    page.evaluate("() => (window.interpose.studio.show = { ...window.interpose.studio.show, others: false })")
    page.evaluate("() => window.interpose.viewport().frameAll()")


def pose(page: Page) -> None:
    """A key pose that is changed by its hands, feet and hips."""
    page.get_by_test_id("key-103").click()
    page.get_by_test_id("tool-reach").click()
    page.evaluate("() => window.interpose.viewport().focus()")


PICTURES: dict[str, Callable[[Page], None]] = {"studio": whole, "studio-paths": paths, "studio-pose": pose}


def main(folder: Path) -> None:
    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("needs a Chromium on PATH, or its path in INTERPOSE_CHROMIUM")
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as playwright:
        server = start(Path(scratch) / "log.txt")
        browser = launch(playwright, chromium)
        try:
            for name, show in PICTURES.items():
                context = somebody_known(browser)
                page = context.new_page()
                page.goto(f"{server.url}?draw=full")
                settle(page)
                show(page)
                page.mouse.move(640, 715)
                page.wait_for_timeout(2500)
                path = folder / f"{name}.png"
                page.screenshot(path=path)
                _small(path)
                context.close()
        finally:
            server.stop()


def _small(path: Path) -> None:
    """A palette in place of true colours: a third of the bytes, and the same to the eye."""
    Image.open(path).convert("RGB").quantize(256, kmeans=2, dither=Image.Dither.NONE).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs"))
