"""The layout that training, export and run time share, against the sizes of the DC-MoE paper (section 3.1)."""

import pytest

from interpose.features import (
    EXPERT_INPUT,
    GATE_INPUT,
    HISTORY,
    RATE,
    Layout,
    control_shapes,
    output_layout,
    state_shapes,
)


def widths(layout: Layout, *names: str) -> int:
    return sum(width for name, width in layout.blocks if name in names)


def test_the_experts_see_what_the_paper_lists_and_our_blocks_beside():
    assert widths(EXPERT_INPUT, "position", "rotation", "velocity") == 264
    assert widths(EXPERT_INPUT, "target_position", "target_rotation") == 198
    assert widths(EXPERT_INPUT, "trajectory") == 13 * 6
    ours = widths(EXPERT_INPUT, "speed_needed", "base_step", "time", "known")
    assert ours == 66 + 135 + 2 + 2
    assert EXPERT_INPUT.width == 540 + ours


def test_the_gate_sees_phases_style_and_time():
    assert GATE_INPUT.blocks == (("phase", 13 * 10 * 2), ("style", 256), ("time_to_arrival", 128))


@pytest.mark.parametrize(("absolute", "pose"), [(True, 66 + 132), (False, 3 + 132)])
def test_the_output_is_a_pose_and_seven_keys_of_what_comes(absolute, pose):
    layout = output_layout(absolute)
    assert widths(layout, "position", "hips", "rotation") == pose
    assert layout.width == pose + 66 + 7 * (4 + 6 + 10 * 3)


def test_slices_lie_side_by_side_in_order():
    layout = Layout((("a", 2), ("b", 3), ("c", 1)))
    assert layout.slices() == {"a": slice(0, 2), "b": slice(2, 5), "c": slice(5, 6)}
    assert layout.sizes() == [2, 3, 1]
    assert layout.width == 6


def test_the_window_is_a_second_of_past_at_thirty_hertz():
    assert HISTORY == RATE + 1
    assert state_shapes()["track"] == (HISTORY + 1, 4)
    assert control_shapes(5)["style"] == (6,)
    assert not set(state_shapes()) & set(control_shapes(0))
