from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image
from render.clips import snake, walk

from interpose import InputError, render


def test_filmstrip_and_curves_are_written(tmp_path: Path) -> None:
    render.filmstrip(tmp_path / "strip.png", walk(), around=1, before=3, after=2, keys=(1,))
    render.curves(tmp_path / "curves.png", walk(), keys=(0, 19))
    with Image.open(tmp_path / "strip.png") as strip, Image.open(tmp_path / "curves.png") as curves:
        assert strip.width == 2 * 28 + 4 * 150
        assert curves.width == 1400


def test_bad_motions_are_refused_and_leave_no_file(tmp_path: Path) -> None:
    path = tmp_path / "out.png"
    with pytest.raises(InputError, match="frame 20 is outside"):
        render.filmstrip(path, walk(20), 20)
    with pytest.raises(InputError, match="feet of this skeleton are not known"):
        render.curves(path, snake(5))
    with pytest.raises(InputError, match="at least three frames"):
        render.curves(path, walk(2))
    assert list(tmp_path.iterdir()) == []
