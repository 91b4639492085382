"""The performer's size and the floor, on rigid bodies with toes in known positions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from interpose import rotation
from interpose.io import grounding
from interpose.motion import Motion, SourceLayout
from interpose.skeleton import HUMANOID

TOES = [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")]


def rocking(size: float, frames: int = 200, rate: float = 60.0, height: float = 0.3) -> Motion:
    """A T-pose that rocks about its toes, which stay at ``height``: the root moves like that of a body of ``size``, the
    skeleton is ours."""
    angle = 0.4 * np.sin(2.0 * np.arange(frames) / rate)
    turned = np.tile(rotation.IDENTITY, (frames, len(HUMANOID), 1))
    turned[:, 0] = rotation.from_rotation_vector(angle[:, None] * np.array([1.0, 0.0, 0.0]))
    still = Motion(HUMANOID, np.zeros((frames, 3)), turned, rate)
    middle = size * still.global_positions()[:, TOES].mean(axis=1)
    return replace(still, root_positions=np.array([0.5, height, -2.0]) - middle)


@pytest.mark.parametrize("size", [0.8, 0.93, 1.0, 1.2])
def test_the_size_is_that_at_which_standing_toes_do_not_slide(size: float) -> None:
    motion = rocking(size)
    assert grounding.size(motion, TOES) == pytest.approx(size, abs=1e-6)
    fitted = grounding.grounded(motion, TOES)
    toes = fitted.global_positions()[:, TOES]
    np.testing.assert_allclose(toes, np.broadcast_to(toes[0], toes.shape), atol=1e-6)
    np.testing.assert_allclose(toes[..., 1], size * grounding.TOE_HEIGHT, atol=1e-6)
    np.testing.assert_allclose(fitted.root_positions[:, [0, 2]], motion.root_positions[:, [0, 2]])
    np.testing.assert_allclose(fitted.skeleton.offsets, size * HUMANOID.offsets)


def test_implausible_sizes_are_clipped() -> None:
    assert grounding.size(rocking(0.65), TOES) == grounding.SIZE_RANGE[0]


def test_feet_that_do_not_show_the_size_leave_it_as_it_is() -> None:
    motion = rocking(0.9)
    standing = motion[:1]
    assert grounding.size(standing, TOES) == 1.0
    assert grounding.size(rocking(0.9, frames=8), TOES) == 1.0  # too short
    on_a_treadmill = replace(motion, root_positions=motion.root_positions * 0.0)
    assert grounding.size(on_a_treadmill, TOES) == 1.0
    flying = replace(motion, root_positions=motion.root_positions + np.arange(200)[:, None] * np.array([0.0, 0.0, 0.1]))
    assert grounding.size(flying, TOES) == 1.0


def test_the_floor_is_under_still_toes_and_not_under_moving_ones() -> None:
    motion = rocking(1.0)
    dipping = motion.root_positions.copy()
    dipping[50:60, 1] -= 0.05 * np.arange(10)
    toes = grounding.grounded(replace(motion, root_positions=dipping), TOES).global_positions()[:50, TOES, 1]
    np.testing.assert_allclose(toes, grounding.TOE_HEIGHT, atol=1e-3)


def test_where_no_toe_is_still_the_floor_is_under_the_lowest() -> None:
    motion = rocking(1.0)
    falling = motion.root_positions - np.arange(200)[:, None] * np.array([0.0, 0.01, 0.0])
    toes = grounding.grounded(replace(motion, root_positions=falling), TOES).global_positions()[:, TOES, 1]
    assert np.percentile(toes.min(axis=1), 5.0) == pytest.approx(grounding.TOE_HEIGHT)


def test_it_holds_a_unit_and_joins_nothing() -> None:
    layout = grounding.UnitLayout(0.001)
    assert isinstance(layout, SourceLayout)
    assert (layout.metres_per_unit, layout.nbytes) == (0.001, 0)
    assert layout.joined(0, grounding.UnitLayout(0.001), 3) == (layout, False)
