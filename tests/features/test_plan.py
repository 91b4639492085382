"""The spline over a plan's anchors, and the planner's inputs."""

import numpy as np

from interpose.features.plan import ANCHORS, anchor_weights, gap_shapes, planner_shapes
from interpose.models.planner import GapInput

LENGTHS = range(2, 121)


def test_weights_have_the_anchors_values_at_their_times_and_are_zero_at_the_keys():
    for steps in LENGTHS:
        weights = anchor_weights(steps)
        assert weights.shape == (steps + 1, ANCHORS)
        assert not weights[[0, -1]].any()
        fine = anchor_weights(9 * steps)
        np.testing.assert_allclose(fine[steps : 9 * steps : steps], np.eye(ANCHORS), atol=1e-12)
        np.testing.assert_allclose(fine[::9], weights, atol=1e-12)  # the same curve, whatever the number of frames


def test_the_weights_are_a_natural_cubic_spline():
    fine = 50
    curve = anchor_weights((ANCHORS + 1) * fine)
    bend = np.diff(curve, 2, axis=0)
    third = np.diff(bend, axis=0)
    for piece in range(ANCHORS + 1):  # a cubic between anchors
        inside = third[piece * fine : (piece + 1) * fine - 2]
        np.testing.assert_allclose(inside, inside[:1].repeat(len(inside), axis=0), atol=1e-9)
    # The second derivative, carried to the knots from either side: no jump inside, nothing at the ends.
    for knot in range(fine, ANCHORS * fine + 1, fine):
        before, after = bend[knot - 2] + third[knot - 3], bend[knot] - third[knot]
        np.testing.assert_allclose(before, after, atol=1e-9)
    np.testing.assert_allclose(bend[0], third[0], atol=1e-9)
    np.testing.assert_allclose(bend[-1], -third[-1], atol=1e-9)


def test_the_inputs_are_the_networks_own():
    assert tuple(gap_shapes(2)) == GapInput._fields
    assert planner_shapes(3, 2) == gap_shapes(2) | {"noise": (3,), "frames": (-1,)}
    assert (gap_shapes(2)["style"], gap_shapes(2)["path"]) == ((3,), (ANCHORS, 4))
