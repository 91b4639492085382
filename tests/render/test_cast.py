from __future__ import annotations

import numpy as np
from render.clips import snake, walk

from interpose.render.cast import cast


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
