from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from interpose import InputError, Motion, Skeleton, render, rotation
from interpose.mannequin import mannequin
from interpose.render import drawing
from interpose.render.cast import cast
from interpose.skeleton import HUMANOID


def walk(frames: int = 20) -> Motion:
    """A figure that glides 1.5 m along +Z and swings its legs."""
    turned = np.tile(rotation.IDENTITY, (frames, 22, 1))
    swing = 0.4 * np.sin(np.linspace(0.0, 2.0 * np.pi, frames))
    for name, sign in (("LeftUpLeg", 1.0), ("RightUpLeg", -1.0)):
        turned[:, HUMANOID.index(name)] = rotation.from_rotation_vector(sign * swing[:, None] * np.array([1.0, 0, 0]))
    root = np.stack([np.zeros(frames), np.full(frames, 0.952), np.linspace(0.0, 1.5, frames)], axis=1)
    return Motion(HUMANOID, root, turned, 30.0)


def snake(frames: int) -> Motion:
    """A chain of bones without limbs."""
    names = tuple(f"bone{k}" for k in range(6))
    skeleton = Skeleton(names, (-1, 0, 1, 2, 3, 4), np.array([[0.0, 0.0, 0.0], *[[0.0, 0.0, 0.3]] * 5]))
    bend = 0.3 * np.sin(np.arange(frames)[:, None] + np.arange(6)[None, :])
    turned = rotation.from_rotation_vector(bend[..., None] * np.array([0.0, 1.0, 0.0]))
    return Motion(skeleton, np.tile([0.0, 0.1, 0.0], (frames, 1)), turned, 24.0)


def opened(path: Path) -> Image.Image:
    with Image.open(path) as image:
        return image.convert("RGB")


def mean_colour(image: Image.Image, box: tuple[int, int, int, int]) -> np.ndarray:
    """Of what is darker or more colourful than the paper in a part of the picture."""
    pixels = np.asarray(image.crop(box)).reshape(-1, 3).astype(float)
    return pixels[np.ptp(pixels, axis=1) > 40].mean(axis=0)


def test_a_sheet_has_a_blue_start_at_the_left_and_an_orange_target_at_the_right(tmp_path: Path) -> None:
    path = tmp_path / "sheet.png"
    render.contact_sheet(
        path, [render.SheetRow(walk(), "Walk", ("20 frames",)), render.SheetRow(walk(5), "Short")], "Two", "rows"
    )
    image = opened(path)
    assert image.width == 1800
    top = 28 + 82
    start = mean_colour(image, (280, top, 400, top + 270))
    target = mean_colour(image, (1640, top, 1790, top + 270))
    assert start[2] > start[0] + 30
    assert target[0] > target[2] + 60


def test_a_creature_and_a_single_frame_can_be_drawn(tmp_path: Path) -> None:
    render.contact_sheet(tmp_path / "a.png", [render.SheetRow(snake(12), "Snake"), render.SheetRow(walk(1), "One")])
    render.scene(tmp_path / "b.png", snake(12), size=(400, 200))
    assert opened(tmp_path / "b.png").size == (400, 200)


def test_what_cannot_be_drawn_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "out.png"
    with pytest.raises(InputError, match="at least one motion"):
        render.contact_sheet(path, [])
    with pytest.raises(InputError, match="without frames"):
        render.contact_sheet(path, [render.SheetRow(walk()[0:0], "Empty")])
    with pytest.raises(InputError, match=r"key 20 lies outside a motion of 20 frames \(0 to 19\)"):
        render.scene(path, walk(20), keys=(0, 20))
    with pytest.raises(InputError, match="frame 20 lies outside"):
        render.filmstrip(path, walk(20), 20)
    with pytest.raises(InputError, match="feet of this skeleton are not known"):
        render.curves(path, snake(5))
    with pytest.raises(InputError, match="at least three frames"):
        render.curves(path, walk(2))
    with pytest.raises(InputError, match="does not exist"):
        render.scene(tmp_path / "nowhere" / "out.png", walk(2), size=(80, 60))
    assert list(tmp_path.iterdir()) == []


def test_close_looks_are_written(tmp_path: Path) -> None:
    render.filmstrip(tmp_path / "strip.png", walk(), around=1, before=3, after=2, keys=(1,))
    render.curves(tmp_path / "curves.png", walk(), keys=(0, 19))
    assert opened(tmp_path / "strip.png").width == 2 * 28 + 4 * 150
    assert opened(tmp_path / "curves.png").width == 1400


def test_the_camera_puts_its_heading_right_and_what_is_near_in_front() -> None:
    camera = drawing.look(np.array([0.0, 0.0, 2.0]), np.zeros(3), (100.0, 200.0), 50.0, elevation=0.0)
    points = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    expected = np.array([[150.0, 200.0, 0.0], [100.0, 150.0, 0.0], [100.0, 200.0, 1.0]])
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-12)
    tilted = drawing.look(np.array([1.0, 0.0, 0.3]), np.zeros(3), (0.0, 0.0), 1.0)
    frame = np.stack([tilted.right, tilted.up, tilted.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_nearer_figure_hides_the_farther_whatever_the_order() -> None:
    shape, motion = mannequin(HUMANOID, 3), walk(1)
    at, turned = motion.global_positions()[0], motion.global_rotations()[0]
    toward = np.array([0.0, 0.0, 2.0])
    camera = drawing.look(np.array([1.0, 0.0, 0.0]), np.zeros(3), (60.0, 110.0), 55.0, elevation=0.0)
    red, blue = (230, 40, 40), (40, 40, 230)
    actors = [drawing.Actor(shape, shape, at + toward, turned, red), drawing.Actor(shape, shape, at, turned, blue)]
    pictures = [np.asarray(drawing.picture(camera, order, (120, 120), 0.0)) for order in (actors, actors[::-1])]
    np.testing.assert_array_equal(pictures[0], pictures[1])
    colourful = pictures[0].astype(int)
    assert np.count_nonzero(colourful[..., 0] > colourful[..., 2] + 60) > 300
    assert np.count_nonzero(colourful[..., 2] > colourful[..., 0] + 60) == 0


def test_rasterised_triangles_cover_their_area_with_weights_that_give_the_pixel_back() -> None:
    rng = np.random.default_rng(0)
    corners = rng.uniform(2.0, 60.0, size=(40, 3, 2)).astype(np.float32)
    area = np.zeros(40)
    for pixel, which, weights in drawing._rasterise(corners, 64, 64):
        centre = np.stack([pixel % 64 + 0.5, pixel // 64 + 0.5], axis=1)
        np.testing.assert_allclose(np.einsum("fk,fkc->fc", weights, corners[which]), centre, atol=2e-3)
        np.add.at(area, which, 1.0)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    true = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    around = sum(np.linalg.norm(corners[:, k] - corners[:, (k + 1) % 3], axis=1) for k in range(3))
    assert np.all(np.abs(area - true) < 0.5 * around)
    assert area.sum() == pytest.approx(true.sum(), rel=0.01)


def test_feet_and_heading_are_found() -> None:
    motion = walk()
    played = cast(motion)
    assert played.floor == 0.0
    assert played.feet is not None
    assert played.facing is not None
    assert [motion.skeleton.names[j] for j in played.feet[:, 1]] == ["LeftToe", "RightToe"]
    np.testing.assert_allclose(played.facing[0], [0.0, 1.0], atol=1e-6)
    assert played.heading() @ np.array([0.0, 0.0, 1.0]) > 0.8
    assert cast(snake(4)).feet is None
