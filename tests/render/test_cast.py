from __future__ import annotations

import numpy as np
from render.clips import snake, walk

from interpose.render.cast import cast


def test_floor_and_heading_are_found() -> None:
    played = cast(walk())
    assert played.floor == 0.0
    assert played.facing is not None
    np.testing.assert_allclose(played.facing[0], [0.0, 1.0], atol=1e-6)
    assert played.heading() @ np.array([0.0, 0.0, 1.0]) > 0.8
    assert cast(snake(4)).down is None
