"""Who makes which frame of a stitched gap, led to what, and how the chains become one: for every length and buffer."""

from itertools import groupby

import numpy as np
import pytest

from interpose.features.stitch import (
    Move,
    memory_shapes,
    network_shapes,
    schedule,
    seam,
    shares,
)
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Latent, Memory

LENGTHS = range(2, 121)
BUFFERS = range(9)


def every(both=(True, False)):
    return [(steps, buffer, side) for steps in LENGTHS for buffer in BUFFERS for side in both]


def test_a_gap_of_six_by_hand():
    assert schedule(6, 1) == (
        Move(False, 1, 6, 6, True),
        Move(True, 5, 5, 1, False),
        Move(False, 2, 4, 5, False),
        Move(True, 4, 3, 2, False),
        Move(False, 3, 2, 4, False),
        Move(True, 3, 1, 3, False),  # the chains meet
        Move(False, 4, 3, 6, True),  # and go on to the keys
    )
    assert shares(6, 1).tolist() == pytest.approx([0, 0, 0, 1 / 3, 2 / 3, 1, 1])
    assert (seam(6, 1).forward, seam(6, 1).backward, seam(6, 1).middle) == (4, 3, 3)


def test_each_chain_makes_its_frames_one_after_the_other_and_no_others():
    for steps, buffer, both in every():
        for aligned in (True, False):
            moves, ends = schedule(steps, buffer, aligned, both), seam(steps, buffer, both)
            made = [[m.made for m in moves if m.backward is side] for side in (False, True)]
            assert made[0] == list(range(1, ends.forward + 1))
            assert made[1] == list(range(steps - 1, ends.backward - 1, -1))
            assert set(made[0]) | set(made[1]) == set(range(1, steps)), (steps, buffer, both)
            assert set(made[0]) & set(made[1]) == set(ends.overlap)
            assert bool(made[1]) == (both and steps > 2)


def test_the_chains_take_turns():
    for steps, buffer, _ in every([True]):
        turns = [(side, len(list(run))) for side, run in groupby(m.backward for m in schedule(steps, buffer))]
        assert turns[0][0] is False
        assert all(count == 1 for _, count in turns[:-1]), (steps, buffer)
        assert turns[-1][1] <= 2  # the middle of an even gap is the forward chain's


def test_the_overlap_is_twice_the_buffer_about_the_middle():
    for steps, buffer, _ in every([True]):
        ends = seam(steps, buffer)
        count = len(ends.overlap)
        assert count % 2 == 0
        assert count // 2 == buffer or (count // 2 < buffer and (steps + 1) / 4 - 1 < count // 2)
        assert count // 2 <= (steps + 1) / 4
        assert list(ends.overlap) == list(range(steps // 2 - count // 2 + 1, steps // 2 + count // 2 + 1))  # equation 4
        assert not seam(steps, buffer, both=False).overlap


def test_each_frame_is_led_to_the_newest_of_the_other_chain_and_past_it_to_the_key():
    for steps, buffer, _ in every([True]):
        newest = {False: 0, True: steps}
        for move in schedule(steps, buffer):
            here, other = newest[move.backward], newest[not move.backward]
            ahead = other < here if move.backward else other > here
            key = 0 if move.backward else steps
            assert move.aim == (other if ahead else key), (steps, buffer, move)
            assert move.to_key is (move.aim == key)
            assert move.left == abs(move.aim - here) >= 1
            assert move.made == here + (-1 if move.backward else 1)
            newest[move.backward] = move.made


def test_the_chains_meet_in_one_frame_of_every_gap_with_a_buffer():
    for steps, buffer, _ in every([True]):
        met = [m for m in schedule(steps, buffer) if m.left == 1]
        if not seam(steps, buffer).overlap:
            assert not met or steps == 2
            continue
        assert len(met) == 1
        assert met[0].made == met[0].aim
        assert not met[0].to_key
        assert met[0].made == (steps + 1) // 2
        assert met[0].made in seam(steps, buffer).overlap


@pytest.mark.parametrize("both", [True, False])
def test_without_aligning_every_frame_is_led_to_the_key(both):
    for steps, buffer, _ in every([True]):
        for move in schedule(steps, buffer, aligned=False, both=both):
            assert move.to_key
            assert move.aim == (0 if move.backward else steps)
            assert move.left == abs(move.made - move.aim) + 1


def test_one_chain_alone_goes_all_the_way():
    for steps, buffer, _ in every([False]):
        moves = schedule(steps, buffer, both=False)
        assert moves == tuple(Move(False, made, steps - made + 1, steps, True) for made in range(1, steps))
        assert shares(steps, buffer, False).tolist() == [0.0] * steps + [1.0]


def test_shares_go_from_one_chain_to_the_other_in_a_straight_line():
    for steps, buffer, _ in every([True]):
        share, ends = shares(steps, buffer), seam(steps, buffer)
        assert share.shape == (steps + 1,)
        assert not share[: ends.backward].any()
        assert np.all(share[ends.forward + 1 :] == 1.0)
        blend = np.diff(share[ends.backward - 1 : ends.forward + 2])
        np.testing.assert_allclose(blend, 1.0 / (len(ends.overlap) + 1), atol=1e-12)


def test_the_inputs_are_the_networks_own():
    assert tuple(memory_shapes(3, 4)) == Memory._fields
    network = {"form": "paper", "memory": 5, "decoder_memory": 7, "latent": 3, "planned": False, "latents": "frame"}
    paper = network_shapes(network, 2)
    assert set(paper) == {"front", "back"}
    assert paper["front"] == paper["back"]
    step = paper["front"]
    plain = [name.removeprefix("aim_").removeprefix("base_") for name in step]
    assert plain == [*Body._fields, *Aim._fields, *Memory._fields, "latent", *Latent._fields[1:]]
    assert (step["rotations"], step["aim_rotations"]) == ((22, 4), (22, 4))
    assert (step["encoder_cell"], step["decoder_hidden"], step["latent"], step["style"]) == ((5,), (7,), (3,), (3,))
    yaw = network_shapes(network | {"form": "yaw", "latents": "gap"}, 2)
    assert yaw["back"]["rotations"] == (22, 6)
