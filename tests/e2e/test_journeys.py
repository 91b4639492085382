"""What somebody does in the studio, in a real browser, and what comes of it in files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from browsing import PATIENCE_MS, SIZE, Server, Watched, settle, somebody_new
from playwright.sync_api import Browser, BrowserContext, Download, Page, expect

import interpose as ip

pytestmark = pytest.mark.xdist_group("browser")  # one browser at a time: two share two cores badly


def keys(page: Page) -> list[int]:
    return page.evaluate("() => window.interpose.studio.document.keys.map((key) => key.frame)")


def gap(page: Page, frame: int) -> dict[str, Any]:
    """What is asked of the gap that begins at a frame."""
    return page.evaluate(
        "(frame) => window.interpose.studio.document.keys.find((key) => key.frame === frame).after", frame
    )


def shown(page: Page, frame: int) -> list[float]:
    """The pose that is shown at a frame."""
    script = "(frame) => { const s = window.interpose.studio; s.playback.goTo(frame); return [...s.pose]; }"
    return page.evaluate(script, frame)


def open_file(page: Page, path: Path) -> None:
    page.get_by_test_id("open-file").set_input_files(path)
    expect(page.get_by_test_id("name")).to_contain_text(path.stem)
    settle(page)


def add_key(page: Page, frame: int) -> None:
    page.get_by_test_id("frame").fill(str(frame))
    page.get_by_test_id("frame").press("Enter")
    page.get_by_test_id("frame").blur()
    page.keyboard.press("k")
    expect(page.get_by_test_id(f"key-{frame}")).to_be_visible()


def export(page: Page, format: str, into: Path) -> Path:
    page.get_by_test_id("export-menu").click()
    with page.expect_download() as held:
        page.get_by_test_id(f"export-{format}").click()
    download: Download = held.value
    path = into / download.suggested_filename
    download.save_as(path)
    return path


def on_canvas(page: Page, point: list[float]) -> tuple[float, float]:
    """Where a point of the world is on the page."""
    box = page.get_by_test_id("viewport").bounding_box()
    assert box is not None
    at = page.evaluate("(point) => window.interpose.viewport().project(point)", point)
    return box["x"] + at["x"], box["y"] + at["y"]


def drag(page: Page, points: list[tuple[float, float]], steps: int = 4) -> None:
    page.mouse.move(*points[0])
    page.mouse.down()
    for point in points[1:]:
        page.mouse.move(*point, steps=steps)
    page.mouse.up()


def test_a_clip_is_opened_keyed_shaped_and_exported(page: Page, walk: Path, tmp_path: Path) -> None:
    open_file(page, walk)
    source = ip.read(walk)
    assert keys(page) == [0, 90]
    add_key(page, 30)
    add_key(page, 60)
    assert keys(page) == [0, 30, 60, 90]

    # The gap between the two is made anew, in a style, and slower: later keys move along.
    page.get_by_test_id("gap-30").click()
    expect(page.get_by_test_id("gap-panel")).to_be_visible()
    page.get_by_test_id("generate").click()
    page.get_by_test_id("style").select_option("Angry")
    settle(page)
    before = shown(page, 45)
    page.get_by_test_id("speed-slow").click()
    settle(page)
    assert gap(page, 30)["style"] == "Angry"
    assert gap(page, 30)["speed"] == "slow"
    end = keys(page)[2]
    assert keys(page) == [0, 30, end, end + 30]
    page.get_by_test_id("frames").fill("44")
    page.get_by_test_id("frames").press("Enter")
    settle(page)
    assert keys(page) == [0, 30, 75, 105]

    # A trajectory of the gallery, then a drawn path.
    page.get_by_test_id("path-gallery").click()
    page.get_by_test_id("gallery-path-1").click()
    settle(page)
    path = gap(page, 30)["path"]
    assert path["kind"] == "waypoints"
    assert not path["drawn"]
    page.get_by_test_id("path-draw").click()
    start, target = (shown(page, frame)[:3] for frame in (30, 75))
    middle = [(start[0] + target[0]) / 2 + 0.6, 0.0, (start[2] + target[2]) / 2]
    on_ground = [[start[0], 0.0, start[2]], middle, [target[0], 0.0, target[2]]]
    drag(page, [on_canvas(page, point) for point in on_ground], steps=8)
    settle(page)
    path = gap(page, 30)["path"]
    assert path["drawn"]
    halfway = shown(page, 52)
    assert abs(halfway[0] - middle[0]) < 0.3, "the root follows the drawn path"

    # Four variants: thumbnails to choose from.
    box = page.get_by_test_id("gap-30").bounding_box()
    assert box is not None
    page.get_by_test_id("gap-30").click(
        position={"x": 0.25 * box["width"], "y": 0.5 * box["height"]}
    )  # not the playhead
    page.get_by_test_id("path-auto").click()
    page.get_by_test_id("variants").fill("4")
    page.get_by_test_id("variants").press("Enter")
    settle(page)
    expect(page.get_by_test_id("candidate-3")).to_be_visible()
    first = shown(page, 52)
    page.get_by_test_id("candidate-2").click()
    chosen = shown(page, 52)
    assert not np.allclose(first, chosen, atol=1e-3)
    assert not np.allclose(before, chosen, atol=1e-3)

    # Scrub by the ruler, undo and redo.
    ruler = page.get_by_test_id("ruler").bounding_box()
    assert ruler is not None
    drag(page, [(ruler["x"] + 200, ruler["y"] + 8), (ruler["x"] + 420, ruler["y"] + 8)])
    assert page.evaluate("() => window.interpose.studio.playback.frame") not in (0, 52)
    page.get_by_test_id("undo").click()
    assert shown(page, 52) == first
    page.get_by_test_id("redo").click()
    assert shown(page, 52) == chosen

    # Out again: on the own skeleton, the kept frames digit for digit.
    written = export(page, "bvh", tmp_path)
    clip = ip.read(written)
    assert len(clip) == 106
    assert clip.rate == source.rate
    assert clip.skeleton.names == source.skeleton.names
    rows, had = (path.read_text().splitlines()[-n:] for path, n in ((written, 106), (walk, 91)))
    assert rows[:31] == had[:31]
    assert rows[75:] == had[60:]
    # The file's Euler angles have six digits behind the point.
    assert np.abs(clip.root_positions[52] - np.array(chosen[:3])).max() < 1e-5
    made = export(page, "glb", tmp_path)
    scene = pygltflib.GLTF2().load(str(made))
    assert scene is not None
    times = scene.accessors[scene.animations[0].samplers[0].input]
    assert times.count == 106
    assert times.max[0] == pytest.approx(105 / source.rate)
    assert scene.skins


def test_a_broken_file_is_told_in_words_and_nothing_is_lost(
    page: Page, walk: Path, tmp_path: Path, watched: Watched
) -> None:
    open_file(page, walk)
    add_key(page, 20)
    broken = tmp_path / "broken.bvh"
    broken.write_text("\n".join(walk.read_text().splitlines()[:-4]) + "\n1.0 2.0 three\n")
    script = """([name, text]) => {
        const held = new DataTransfer();
        held.items.add(new File([text], name));
        for (const type of ["dragenter", "dragover", "drop"]) {
            window.dispatchEvent(new DragEvent(type, { dataTransfer: held, bubbles: true, cancelable: true }));
        }
    }"""
    page.evaluate(script, ["broken.bvh", broken.read_text()])
    expect(page.get_by_test_id("notice").last).to_contain_text("broken.bvh")
    assert keys(page) == [0, 20, 90]
    page.evaluate(script, ["notes.txt", "hello"])
    expect(page.get_by_test_id("notice").last).to_contain_text("only .bvh clips and .interpose projects can be opened")
    page.evaluate(script, ["torn.interpose", '{"format": 1, "keys": ['])
    expect(page.get_by_test_id("notice").last).to_contain_text("torn.interpose")
    assert keys(page) == [0, 20, 90]
    # Chromium itself writes down that the server refused the two.
    refused = [error for error in watched.errors if "the server responded with a status of 400" in error]
    assert len(refused) == 2
    watched.errors[:] = [error for error in watched.errors if error not in refused]


def test_a_reload_loses_nothing(page: Page, walk: Path) -> None:
    open_file(page, walk)
    add_key(page, 45)
    page.get_by_test_id("gap-45").click()
    page.get_by_test_id("generate").click()
    page.get_by_test_id("style").select_option("Drunk")
    settle(page)
    assert gap(page, 45)["style"] == "Drunk"
    motion = shown(page, 70)
    kept(page)
    page.reload()
    settle(page)
    expect(page.get_by_test_id("name")).to_contain_text("walk")
    assert keys(page) == [0, 45, 90]
    assert gap(page, 45)["style"] == "Drunk"
    assert shown(page, 70) == motion


def test_what_a_crash_left_behind_is_offered(context: BrowserContext, page: Page, walk: Path, watched: Watched) -> None:
    open_file(page, walk)
    add_key(page, 33)
    kept(page)
    url = page.url
    page.close()
    other = watched.page(context.new_page())
    other.goto(url)
    settle(other)
    notice = other.get_by_test_id("notice").filter(has_text="walk")
    notice.get_by_test_id("notice-action").click()
    expect(other.get_by_test_id("key-33")).to_be_visible()
    assert keys(other) == [0, 33, 90]


def test_a_project_file_opens_as_it_was(page: Page, walk: Path, tmp_path: Path) -> None:
    open_file(page, walk)
    add_key(page, 40)
    page.get_by_test_id("gap-0").click()
    page.get_by_test_id("generate").click()
    settle(page)
    motion = shown(page, 20)
    with page.expect_download() as held:
        page.get_by_test_id("save").click()
    path = tmp_path / held.value.suggested_filename
    held.value.save_as(path)
    assert json.loads(path.read_text())["source"]["text"] == walk.read_text()
    page.get_by_test_id("help").click()
    page.get_by_test_id("help-sample").click()
    expect(page.get_by_test_id("name")).to_contain_text("Sample")
    page.get_by_test_id("open-file").set_input_files(path)
    expect(page.get_by_test_id("name")).to_contain_text("walk")
    settle(page)
    assert keys(page) == [0, 40, 90]
    assert shown(page, 20) == motion


def test_two_tabs_work_side_by_side(context: BrowserContext, page: Page, walk: Path, watched: Watched) -> None:
    other = watched.page(context.new_page())
    other.goto(page.url)
    settle(other)
    open_file(other, walk)
    add_key(other, 45)
    other.get_by_test_id("gap-0").click()
    other.get_by_test_id("generate").click()
    page.locator("[data-testid^=gap-]").first.click()
    page.get_by_test_id("reroll").click()
    for each in (page, other):
        settle(each)
    assert len(keys(page)) == 5
    assert keys(other) == [0, 45, 90]
    assert other.evaluate("() => window.interpose.studio.gaps().map((gap) => window.interpose.studio.state(gap))") == [
        "ready",
        "clip",
    ]
    for each in (page, other):
        kept(each)
        each.reload()
        settle(each)
    assert len(keys(page)) == 5
    assert keys(other) == [0, 45, 90]


def test_dragging_a_key_generates_live_and_is_one_step(page: Page) -> None:
    first = keys(page)
    diamond = page.get_by_test_id(f"key-{first[1]}").bounding_box()
    assert diamond is not None
    x, y = diamond["x"] + diamond["width"] / 2, diamond["y"] + diamond["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y, steps=5)
    page.mouse.move(x + 60, y, steps=5)
    page.mouse.up()
    settle(page)
    moved = keys(page)
    assert moved[1] > first[1]
    assert [moved[0], *moved[2:]] == [first[0], *first[2:]]
    frames = page.evaluate("() => window.interpose.studio.rows(window.interpose.studio.gaps()[0]).length") / (
        3 + 4 * 22
    )
    assert frames == moved[1] - moved[0] - 1
    page.keyboard.press("Control+z")
    assert keys(page) == first
    page.keyboard.press("Control+Shift+z")
    assert keys(page) == moved


def test_a_hand_is_dragged_and_the_pose_follows(page: Page) -> None:
    page.locator("[data-testid^=key-]").nth(1).click()
    page.get_by_test_id("tool-reach").click()
    page.keyboard.press("f")
    page.wait_for_timeout(1200)  # the camera comes to rest
    frame = page.evaluate("() => window.interpose.studio.playback.frame")
    before = shown(page, frame)
    at = on_canvas(page, joint(page, "RightHand"))
    drag(page, [at, (at[0] - 20, at[1] - 40), (at[0] - 30, at[1] - 70)])
    settle(page)
    after = shown(page, frame)
    assert not np.allclose(before, after, atol=1e-3)
    assert before[:3] == after[:3], "the root stays"
    assert page.evaluate("() => window.interpose.studio.undoLabel") == "Change pose"
    page.keyboard.press("Control+z")
    assert shown(page, frame) == before


def test_a_pose_is_moved_by_numbers_and_taken_from_the_library(page: Page) -> None:
    page.locator("[data-testid^=key-]").nth(1).click()
    frame = page.evaluate("() => window.interpose.studio.playback.frame")
    before = shown(page, frame)
    page.get_by_test_id("place-x").fill(f"{before[0] + 0.5:.2f}")
    page.get_by_test_id("place-x").press("Enter")
    settle(page)
    after = shown(page, frame)
    assert after[0] - before[0] == pytest.approx(0.5, abs=0.01)
    assert after[1:3] == before[1:3]
    assert after[7:] == before[7:], "nothing but the root has moved"
    page.get_by_test_id("pose-3").click()
    settle(page)
    posed = shown(page, frame)
    assert not np.allclose(posed[7:], after[7:], atol=0.1)
    assert np.hypot(posed[0] - after[0], posed[2] - after[2]) < 0.02, "it stands where the other one stood"


CREATURE = """HIERARCHY
ROOT body
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT neck
  {
    OFFSET 0 20 60
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 10 30
    }
  }
}
MOTION
Frames: 40
Frame Time: 0.0333333
"""


def test_a_rig_that_is_no_humanoid_is_told_and_interpolated(page: Page, tmp_path: Path) -> None:
    path = tmp_path / "creature.bvh"
    path.write_text(CREATURE + "\n".join(f"0 50 {frame * 2} 0 0 {frame} 0 {frame} 0" for frame in range(40)) + "\n")
    open_file(page, path)
    expect(page.get_by_test_id("notice").filter(has_text="creature.bvh")).to_contain_text("gaps are interpolated")
    page.get_by_test_id("gap-0").click()
    page.get_by_test_id("generate").click()
    settle(page)
    assert gap(page, 0)["method"] == "interp"
    expect(page.get_by_test_id("method").locator("option[value=dcmoe]")).to_be_disabled()
    pose = shown(page, 13)
    assert pose[2] == pytest.approx(13 * 0.02, abs=1e-4)
    written = ip.read(export(page, "bvh", tmp_path))
    assert len(written) == 40
    assert written.root_positions[13] == pytest.approx([0.0, 0.5, 0.26], abs=1e-5)


def test_the_keyboard_alone_is_enough(page: Page) -> None:
    first = keys(page)
    page.keyboard.press("Home")
    for _ in range(2):
        page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("k")
    settle(page)
    assert keys(page) == sorted([*first, first[0] + 20])
    page.keyboard.press("m")
    expect(page.get_by_test_id("undo")).to_have_attribute("aria-label", "Undo: Mirror pose")
    page.keyboard.press("Control+d")
    assert len(keys(page)) == len(first) + 2
    page.keyboard.press("Delete")
    page.keyboard.press("Control+z")
    page.keyboard.press("g")
    settle(page)
    page.keyboard.press("l")
    assert gap(page, page.evaluate("() => window.interpose.studio.selectedGap.left.frame"))["locked"]
    for _ in range(9):
        page.keyboard.press("Control+z")
    assert keys(page) == first
    page.keyboard.press("Space")
    page.wait_for_function("() => { const p = window.interpose.studio.playback; return p.playing && p.time > 1; }")
    page.keyboard.press("Space")
    page.keyboard.press("?")
    expect(page.get_by_test_id("help-dialog")).to_be_visible()
    page.keyboard.press("Escape")
    expect(page.get_by_test_id("help-dialog")).to_be_hidden()


def test_the_first_visit_is_in_motion_and_led_by_a_tour(browser: Browser, studio: Server, watched: Watched) -> None:
    context = somebody_new(browser)
    page = watched.page(context.new_page())
    page.emulate_media(reduced_motion="no-preference")
    page.goto(studio.url)
    settle(page)
    expect(page.get_by_test_id("tour")).to_be_visible()
    page.wait_for_function("() => { const p = window.interpose.studio.playback; return p.playing && p.time > 2; }")
    for step in range(4):
        expect(page.get_by_test_id("tour")).to_contain_text(f"{step + 1} of 4")
        box = page.get_by_test_id("tour-next").bounding_box()
        assert box is not None
        assert 0 <= box["y"] <= SIZE["height"] - box["height"]
        page.get_by_test_id("tour-next").click()
    expect(page.get_by_test_id("tour")).to_be_hidden()
    page.reload()
    settle(page)
    expect(page.get_by_test_id("tour")).to_be_hidden()
    context.close()


def test_a_server_that_was_started_again_is_found_again(
    context: BrowserContext, watched: Watched, start_studio: Callable[..., Server], walk: Path
) -> None:
    server = start_studio(walk)
    page = watched.page(context.new_page())
    page.goto(server.url)
    settle(page)
    expect(page.get_by_test_id("name")).to_contain_text("walk")
    server.stop()
    expect(page.get_by_test_id("connection")).to_contain_text("Disconnected")
    add_key(page, 45)
    page.get_by_test_id("gap-45").click()
    page.get_by_test_id("generate").click()
    start_studio(port=server.port)
    page.wait_for_function("() => window.interpose.studio.connection === 'open'")
    settle(page)
    states = page.evaluate("() => window.interpose.studio.gaps().map((gap) => window.interpose.studio.state(gap))")
    assert states == ["clip", "ready"]
    watched.errors[:] = [error for error in watched.errors if "ERR_CONNECTION_REFUSED" not in error]


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_everything_fits_and_has_a_name(page: Page, theme: str) -> None:
    page.evaluate("(theme) => (window.interpose.studio.theme = theme)", theme)
    for select in ("[data-testid^=gap-]", "[data-testid^=key-]"):
        page.locator(select).nth(1).click()
        page.wait_for_timeout(300)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= SIZE["width"]
        assert page.evaluate("() => document.documentElement.scrollHeight") <= SIZE["height"]
        nameless = page.evaluate(
            """() => [...document.querySelectorAll("button, input:not([hidden]), select, [role=button]")]
                .filter((each) => !(each.getAttribute("aria-label") ?? each.textContent).trim()
                    && !each.labels?.length && !each.getAttribute("aria-labelledby"))
                .map((each) => each.outerHTML.slice(0, 120))"""
        )
        assert nameless == []


def kept(page: Page) -> None:
    """Waits until the project is in the browser's own store as it is now."""
    script = """async () => {
        const { studio } = window.interpose;
        const saved = await new Promise((resolve) => {
            const opening = indexedDB.open("interpose-studio", 1);
            opening.onerror = () => resolve([]);
            opening.onupgradeneeded = () => opening.transaction.abort();
            opening.onsuccess = () => {
                const all = opening.result.transaction("projects").objectStore("projects").getAll();
                all.onsuccess = () => { opening.result.close(); resolve(all.result); };
            };
        });
        const mine = saved.find(({ tab }) => tab === sessionStorage.getItem("interpose-tab"));
        const frames = (keys) => JSON.stringify(keys.map(({ frame, after }) => [frame, after]));
        return Boolean(mine) && studio.settled && frames(mine.project.keys) === frames(studio.document.keys);
    }"""
    for _ in range(PATIENCE_MS // 100):
        if page.evaluate(script):  # `wait_for_function` takes the promise itself for a yes
            return
        page.wait_for_timeout(100)
    raise AssertionError("the project was not kept")


def joint(page: Page, name: str) -> list[float]:
    """Where a joint of the shown pose is, from its own kinematics here."""
    values = page.evaluate("() => [...window.interpose.studio.pose]")
    offsets, parents, index = page.evaluate(
        "(name) => { const r = window.interpose.studio.rig; return [[...r.offsets], r.parents, r.humanoid[name]]; }",
        name,
    )
    count = len(parents)
    skeleton = ip.Skeleton(tuple(map(str, range(count))), tuple(parents), np.array(offsets).reshape(count, 3))
    turned = np.array(values[3 : 3 + 4 * count]).reshape(1, count, 4)
    motion = ip.Motion(skeleton, np.array(values[:3])[None], turned, 30.0)
    return motion.global_positions()[0, index].tolist()
