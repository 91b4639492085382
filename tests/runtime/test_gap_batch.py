"""Batches of gaps: what is left out, rows taken out of them, several lengths, and draws."""

import learning
import numpy as np
import pytest

from interpose.runtime.gap_batch import Generated, batch_of, by_length, draws

CLIPS = [learning.march(40, 0.8 + 0.3 * i, 2.0 * i) for i in range(4)]


def frames_of(at):
    return tuple(
        np.stack([getattr(clip, name)[at] for clip in CLIPS]) for name in ("root_positions", "local_rotations")
    )


CONTEXT, TARGET = frames_of(slice(3, 6)), frames_of(slice(20, 22))


def test_what_is_left_out_is_the_same_for_all_rows():
    batch = batch_of(CONTEXT, TARGET, 14)
    assert len(batch) == 4
    assert batch.frames == (14,) * 4
    assert batch.styles == batch.paths == batch.draws == (None,) * 4
    assert (batch.style_strength, batch.path_control, batch.arriving) == (1.0, 1.0, None)
    assert batch_of(CONTEXT, TARGET, 14, styles="Old").styles == ("Old",) * 4
    np.testing.assert_array_equal(batch.target_root, TARGET[0][:, 0])
    (root, local), _ = batch.keys
    np.testing.assert_array_equal(root, CONTEXT[0][:, -1])
    np.testing.assert_array_equal(batch.start.positions, batch.context.positions[:, -1])
    np.testing.assert_allclose(batch.start.positions[2], CLIPS[2][5].global_positions()[0], atol=1e-9)
    np.testing.assert_array_equal(local, CONTEXT[1][:, -1])


def test_the_velocity_at_the_start_is_known_from_two_frames_on():
    wanted = np.stack([np.diff(clip[4:6].global_positions(), axis=0)[0] * 30.0 for clip in CLIPS])
    np.testing.assert_allclose(batch_of(CONTEXT, TARGET, 5).leaving, wanted, atol=1e-9)
    assert batch_of(tuple(x[:, -1:] for x in CONTEXT), TARGET, 5).leaving is None


def test_rows_are_taken_with_all_that_belongs_to_them():
    paths = [np.full((frames + 2, 3), float(row)) for row, frames in enumerate((3, 5, 0, 3))]
    arriving = np.arange(4.0)[:, None, None] * np.ones((4, 22, 3))
    whole = batch_of(
        CONTEXT,
        TARGET,
        (3, 5, 0, 3),
        styles=["a", None, "b", "c"],
        paths=paths,
        draws=draws(7, 4),
        arriving=arriving,
        style_strength=2.0,
        path_control=0.5,
    )
    some = whole.take([3, 1])
    assert (some.frames, some.styles, some.draws) == ((3, 5), ("c", None), ((7, 3), (7, 1)))
    assert (some.style_strength, some.path_control, some.longest, whole.longest) == (2.0, 0.5, 5, 5)
    assert [path[0, 0] for path in some.paths] == [3.0, 1.0]
    np.testing.assert_array_equal(some.arriving[:, 0, 0], [3.0, 1.0])
    np.testing.assert_array_equal(some.target_root, whole.target_root[[3, 1]])
    np.testing.assert_array_equal(some.context_local, whole.context_local[[3, 1]])


def test_gaps_go_by_their_length_and_end_in_their_targets():
    asked = []

    def make(batch):
        length = float(batch.longest)
        asked.append((batch.draws, batch.frames))
        shape = len(batch), batch.longest
        apart = np.full(len(batch), 0.1 * length)
        return Generated(np.full((*shape, 3), length), np.full((*shape, 22, 4), length), np.ones((*shape, 4)), apart)

    target = np.full((4, 1, 3), -1.0), np.full((4, 1, 22, 4), -2.0)
    made = by_length(batch_of(CONTEXT, target, (3, 5, 0, 3), draws=draws(1, 4)), make)
    assert asked == [(((1, 0), (1, 3)), (3, 3)), (((1, 1),), (5,))]
    np.testing.assert_array_equal(made.root[:, :, 0], [[3, 3, 3, -1, -1], [5] * 5, [-1] * 5, [3, 3, 3, -1, -1]])
    np.testing.assert_array_equal(made.local[2], np.full((5, 22, 4), -2.0))
    np.testing.assert_array_equal(made.contacts[:, :, 0].sum(axis=1), [3, 5, 0, 3])
    np.testing.assert_allclose(made.chain_distance, [0.3, 0.5, np.nan, 0.3])
    some = made.take([1, 3], 2)
    np.testing.assert_array_equal(some.root[:, :, 0], [[5, 5], [3, 3]])


@pytest.mark.parametrize("seed", [0, 5])
def test_the_first_draw_of_seed_0_is_the_likeliest_motion(seed):
    assert draws(seed, 3) == (None if seed == 0 else (5, 0), (seed, 1), (seed, 2))
    assert draws(seed, 5)[:3] == draws(seed, 3)
