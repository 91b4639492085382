"""How long after an edit the studio shows new frames, and how long until all candidates are there.

    python benchmarks/studio.py [--repeats N] [--port P]

Starts a studio. The first table asks its websocket as the browser does, from the question's first byte to the answer's
last: one candidate while something is dragged (`live`), and eight. The second table, where there is a Chromium, drives
the page: a key pose is moved by a few centimetres as if by a drag, and what is timed is from that change to the first
new frames of the gap before it, to a picture of them, and from letting go to all four candidates. The gap after the key
is made anew at the same time, and the browser draws in software here, on the same cores. The budget is 150 ms to the
first frames. Medians of N, best and worst beside.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from urllib.request import Request, urlopen

import numpy as np
from websockets.sync.client import ClientConnection, connect

from interpose import io
from interpose.studio import messages
from interpose.studio.pose_rows import of_motion
from interpose.studio.protocol import (
    CLIENT_MESSAGE,
    SERVER_MESSAGE,
)
from interpose.studio.sample import sample

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from browsing import find_chromium, launch, settle, somebody_known, start

GAPS = (30, 60, 120, 300)
MOVE = """async ([frames, repeats]) => {
    const { studio } = window.interpose;
    const now = () => performance.now();
    const picture = () => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(now()))));
    const until = async (met) => { while (!met()) await new Promise((go) => setTimeout(go, 2)); return now(); };
    const [{ id }] = studio.gaps();
    const gap = () => studio.gaps()[0];
    const whole = () => studio.result(id)?.candidates.length === 4 && studio.state(gap()) === "ready";
    studio.setFrames(id, frames);
    studio.selectGap(id);
    studio.playback.goTo(gap().right.frame);
    await until(() => studio.settled);
    const told = [];
    for (let i = 0; i < repeats; i++) {
        await picture();
        const had = studio.result(id);
        const pose = gap().right.pose.slice();
        pose[0] += i % 2 ? 0.04 : -0.04;
        const began = now();
        studio.changePose(pose, "drag");
        const answer = await until(() => studio.result(id) !== had);
        const first = await picture();
        const free = now();
        studio.release();
        const all = await until(whole);
        told.push([answer - began, first - began, all - free]);
        await until(() => studio.settled);
    }
    return told;
}"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--port", type=int, default=0, help="of a studio that runs; one is started where left out")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        server = None if given.port else start(Path(scratch) / "log.txt")
        port = given.port if server is None else server.port
        try:
            _socket(port, given.repeats)
            _page(port, given.repeats)
        finally:
            if server is not None:
                server.stop()


def _socket(port: int, repeats: int) -> None:
    home = f"http://127.0.0.1:{port}"
    project = sample()
    post = Request(f"{home}/api/rigs?name=sample.bvh", project.source.text.encode(), {"Origin": home})
    with urlopen(post) as answer:
        rig = answer.read()
    clip = io.parse(project.source.text.encode(), "sample.bvh")
    ends = {"start": of_motion(clip[0]), "target": of_motion(clip[1])}
    (length,) = np.frombuffer(rig[:4], "<u4")
    number = json.loads(rig[4 : 4 + int(length)])["id"]
    print("websocket              one candidate, live        eight candidates")
    with connect(f"ws://127.0.0.1:{port}/api/socket", origin=home, max_size=None) as socket:  # type: ignore[arg-type]
        socket.recv()
        for frames in GAPS:
            told = []
            for variants, live in ((1, True), (8, False)):
                told.append([_ask(socket, number, ends, frames, variants, live) for _ in range(repeats + 2)][2:])
            print(f"{frames:4} frames        " + "     ".join(_spread(each) for each in told))


def _ask(
    socket: ClientConnection, rig: str, ends: dict[str, np.ndarray], frames: int, variants: int, live: bool
) -> float:
    message = CLIENT_MESSAGE.validate_python(
        {
            "type": "generate",
            "id": 1,
            "rig": rig,
            "gap": "gap",
            "frames": frames,
            "settings": {"method": "dcmoe", "style": "Chicken", "variants": variants, "seed": 1},
            "live": live,
            "arrays": messages.shapes(ends),
        }
    )
    began = time.perf_counter()
    socket.send(messages.pack(message, ends))
    data = socket.recv()
    seconds = time.perf_counter() - began
    assert isinstance(data, bytes)
    header, _ = messages.unpack(data, SERVER_MESSAGE)
    assert header.type == "candidates", header
    return 1000 * seconds


def _page(port: int, repeats: int) -> None:
    chromium = find_chromium()
    if chromium is None:
        print("no Chromium on PATH: the page is not timed")
        return
    from playwright.sync_api import sync_playwright

    print("page               edit to first frames    to their picture       letting go to four candidates")
    with sync_playwright() as playwright:
        browser = launch(playwright, chromium)
        context = somebody_known(browser)
        for frames in GAPS:
            page = context.new_page()
            page.goto(f"http://127.0.0.1:{port}/")
            settle(page)
            told = page.evaluate(MOVE, [frames, repeats])
            print(f"{frames:4} frames        " + "     ".join(_spread([row[i] for row in told]) for i in range(3)))
            page.close()
        browser.close()


def _spread(ms: list[float]) -> str:
    return f"{median(ms):5.0f} ms ({min(ms):.0f} to {max(ms):.0f})"


if __name__ == "__main__":
    main()
