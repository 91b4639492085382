"""How long somebody new waits, from an installation to an exported BVH of a clip of their own.

    python benchmarks/new_user.py CLIP.bvh

Makes an empty environment, installs this checkout into it by pip, starts its studio on the clip, and does in a real
Chromium what docs/studio.md lists, click by click, waiting for nothing but the studio. Prints the seconds of each step.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

import interpose as ip

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from browsing import find_chromium, launch, settle, somebody_known, start

ROOT = Path(__file__).resolve().parents[1]


def timed(what: str, act: Callable[[], object]) -> None:
    began = time.perf_counter()
    act()
    print(f"{time.perf_counter() - began:6.1f} s  {what}", flush=True)


def main(clip: Path) -> None:
    chromium = find_chromium()
    if chromium is None:
        raise SystemExit("needs a Chromium on PATH, or its path in INTERPOSE_CHROMIUM")
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as playwright:
        home = Path(scratch)
        python = home / "venv" / "bin" / "python"
        subprocess.run([sys.executable, "-m", "venv", str(home / "venv")], check=True)
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(ROOT)]
        timed("pip install .", lambda: subprocess.run(install, check=True))
        page = somebody_known(launch(playwright, chromium)).new_page()
        began = time.perf_counter()
        server = start(home / "log.txt", clip.resolve(), python=python)
        try:
            page.goto(server.url)
            settle(page)
            print(f"{time.perf_counter() - began:6.1f} s  interpose studio {clip.name}, until the page shows it")
            steps(page, home / "out.bvh")
        finally:
            server.stop()
        print(f"the exported file has {len(ip.read(home / 'out.bvh'))} frames, the clip {len(ip.read(clip))}")


def steps(page: Page, out: Path) -> None:
    """Two keys, a gap between them, a style, a candidate, and out."""

    def key(share: float) -> None:
        ruler = page.get_by_test_id("ruler").bounding_box()
        assert ruler is not None
        page.mouse.click(ruler["x"] + share * ruler["width"], ruler["y"] + 10)
        page.keyboard.press("k")
        settle(page)

    def gap() -> None:
        frame = page.evaluate("() => window.interpose.studio.document.keys[1].frame")
        page.get_by_test_id(f"gap-{frame}").click()
        page.get_by_test_id("generate").click()
        page.get_by_test_id("style").select_option("Angry")
        settle(page)

    def choose() -> None:
        page.get_by_test_id("candidate-1").click()
        page.keyboard.press("Space")

    def export() -> None:
        page.get_by_test_id("export-menu").click()
        with page.expect_download() as held:
            page.get_by_test_id("export-bvh").click()
        held.value.save_as(out)

    timed("click the ruler, K, click the ruler, K", lambda: (key(0.3), key(0.7)))
    timed("click the bar, Generate in-between, a style", gap)
    timed("a candidate, Space", choose)
    timed("Export, BVH", export)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
