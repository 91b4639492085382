from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from render.clips import snake, walk

from interpose import InputError, render


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
    assert opened(tmp_path / "a.png").width == 1800


def test_bad_sheets_are_refused_and_leave_no_file(tmp_path: Path) -> None:
    path = tmp_path / "out.png"
    with pytest.raises(InputError, match="at least one motion"):
        render.contact_sheet(path, [])
    with pytest.raises(InputError, match="without frames"):
        render.contact_sheet(path, [render.SheetRow(walk()[0:0], "Empty")])
    with pytest.raises(InputError, match="does not exist"):
        render.contact_sheet(tmp_path / "nowhere" / "out.png", [render.SheetRow(walk(2), "Walk")])
    assert list(tmp_path.iterdir()) == []
