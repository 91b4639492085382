from __future__ import annotations

import numpy as np
import pytest
from render.clips import walk

from interpose.mannequin import mannequin
from interpose.render import drawing
from interpose.skeleton import HUMANOID


def test_the_camera_puts_its_heading_right_and_what_is_near_in_front() -> None:
    camera = drawing.look(np.array([0.0, 0.0, 2.0]), np.zeros(3), (100.0, 200.0), 50.0, elevation=0.0)
    points = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    expected = np.array([[150.0, 200.0, 0.0], [100.0, 150.0, 0.0], [100.0, 200.0, 1.0]])
    np.testing.assert_allclose(camera.project(points), expected, atol=1e-12)
    tilted = drawing.look(np.array([1.0, 0.0, 0.3]), np.zeros(3), (0.0, 0.0), 1.0)
    frame = np.stack([tilted.right, tilted.up, tilted.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_the_nearer_character_hides_the_farther_whatever_the_order() -> None:
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
