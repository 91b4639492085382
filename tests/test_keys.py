"""Keys as a person types them."""

import pytest

from interpose.errors import InputError
from interpose.keys import frame_in_clip, gaps, parse_keys, parse_pose


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("0,45", (0, 45)),
        ("0,45,90-93", (0, 45, 90, 91, 92, 93)),
        (" 0 , 45 ", (0, 45)),
        ("3-3,99", (3, 99)),
        ("0,-1", (0, 99)),
        ("0,97--1", (0, 97, 98, 99)),
        ("0--1", tuple(range(100))),
        ("007,8", (7, 8)),
    ],
)
def test_keys_are_numbers_and_ranges_with_both_ends(text, keys):
    assert parse_keys(text, 100) == keys


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("  ", "empty"),
        ("5", "single key"),
        ("5-5", "single key"),
        ("0,100", "frame 100 is outside"),
        ("0,-101", "frame -101 is outside"),
        ("45,0", "comes after 45"),
        ("0-10,5", "comes after 10"),
        ("0,45,45", "named twice"),
        ("0-10,10-20", "named twice"),
        ("20-10,50", "runs backward"),
        ("0,abc", "'abc' is neither"),
        ("0,,5", "'' is neither"),
        ("0,4.5", "'4.5' is neither"),
        ("0;5", "'0;5' is neither"),
        ("0,1e3", "'1e3' is neither"),
        ("0," + "9" * 5000, "is neither"),
        ("0,999999999999", "outside"),
        ("0-999999999999", "outside"),
    ],
)
def test_bad_keys_are_named_with_the_frames_of_the_clip(text, said):
    with pytest.raises(InputError, match="frames 0 to 99") as caught:
        parse_keys(text, 100)
    assert said in str(caught.value)
    assert len(str(caught.value)) < 300


def test_gaps_lie_between_keys_that_are_not_neighbours():
    assert gaps((0, 1, 2, 10, 12, 13)) == [(2, 10), (10, 12)]


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("walk.bvh", ("walk.bvh", None)),
        ("walk.bvh:10", ("walk.bvh", 10)),
        ("walk.bvh:-1", ("walk.bvh", -1)),
        (r"C:\clips\walk.bvh", (r"C:\clips\walk.bvh", None)),
        (r"C:\clips\walk.bvh:3", (r"C:\clips\walk.bvh", 3)),
        ("take:two.bvh", ("take:two.bvh", None)),
        (":5", (":5", None)),
    ],
)
def test_a_pose_is_a_file_and_perhaps_a_frame(text, pose):
    assert parse_pose(text) == pose


def test_a_frame_counts_from_the_end_when_negative():
    assert frame_in_clip(-1, 10, "a.bvh") == 9
    with pytest.raises(InputError, match=r"a\.bvh:10.*frames 0 to 9"):
        frame_in_clip(10, 10, "a.bvh")
