"""Both chains of a gap: who sees whom, that they meet, that keys stay keys, and how they are stitched."""

import copy
from typing import NamedTuple

import numpy as np
import pytest
import stitch_learning
import torch
from stitch_learning import drawn

from interpose.features.stitch import schedule, seam, shares
from interpose.models.geometry import joint_positions, to_matrix, to_six
from interpose.models.stitch_forms import Aim, Body
from interpose.models.stitching_cvae import Latent, Memory
from interpose.train.common import gaps
from interpose.train.stitch.rollout import ChainLayout, Stitched, roll
from interpose.train.stitch.truth import chain_ends, paper_motion, yaw_motion

ROWS = 5
LAYOUTS = [
    ChainLayout(),
    ChainLayout(0),
    ChainLayout(5),
    ChainLayout(aligned=False),
    ChainLayout(both=False),
    ChainLayout(3, aligned=False),
]


class Situation(NamedTuple):
    front: Body
    back: Body
    base: torch.Tensor
    style: torch.Tensor
    latents: torch.Tensor


class Call(NamedTuple):
    """What a generator was given and what it made of it."""

    body: Body
    aim: Aim
    memory: Memory
    latent: Latent
    after: Body
    kept: Memory


@pytest.fixture(scope="module")
def paper_network(frames):
    """The paper's form; not to be changed."""
    return stitch_learning.network_for(frames, stitch_learning.PAPER)


def gap(frames, steps, model, layout=None, seed=0) -> Situation:
    """Real keys; a base that wanders off interpolation between them."""
    some = drawn(frames, ROWS, steps, seed=seed)
    paper = model.size.form == "paper"
    true = paper_motion(frames, some, steps, model.mean_quaternions) if paper else yaw_motion(frames, some, steps)
    front, back = chain_ends(frames, some, true)
    draws = torch.Generator().manual_seed(seed)
    base = gaps.base(frames, some, (torch.arange(steps + 1) / steps).expand(ROWS, -1))
    base[:, 1:-1] += 0.05 * torch.randn(ROWS, 1, 135, generator=draws)
    base[..., 3:] = to_six(to_matrix(base[..., 3:].unflatten(-1, (22, 6)))).flatten(2)
    shape = (ROWS, model.size.latent)
    if model.size.latents == "frame":
        moves = schedule(steps, layout.buffer, layout.aligned, layout.both)
        shape = (ROWS, len(moves), model.size.latent)
    return Situation(front, back, base, some.style, torch.randn(shape, generator=draws))


def listened(model, layout, situation) -> tuple[Stitched, list[list[Call]]]:
    """The roll-out, and every call of the forward and of the backward generator."""
    calls: list[list[Call]] = [[], []]
    hooks = [
        side.register_forward_hook(lambda _, given, made, heard=heard: heard.append(Call(*given, *made[:2])))
        for side, heard in zip((model.front, model.back), calls, strict=True)
    ]
    made = roll(model, *situation, layout)
    for hook in hooks:
        hook.remove()
    return made, calls


def equal(one, other):
    return all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("steps", [2, 3, 4, 9, 20])
def test_the_ends_are_the_keys_and_each_chain_makes_its_frames(stitch_network, frames, layout, steps):
    given = gap(frames, steps, stitch_network)
    made = roll(stitch_network, *given, layout)
    assert made.positions.shape == (ROWS, steps + 1, 22, 3)
    assert torch.equal(made.positions[:, 0], given.front.positions)
    assert torch.equal(made.positions[:, -1], given.back.positions)
    ends = seam(steps, layout.buffer, layout.both)
    assert made.front.frames.tolist() == list(range(1, ends.forward + 1))
    assert made.front.rotations.shape == (ROWS, ends.forward, 22, 6)
    if made.back is None:
        assert steps == 2 or not layout.both
    else:
        assert made.back.frames.tolist() == list(range(steps - 1, ends.backward - 1, -1))
    assert float((made.positions[:, 1:-1] - _placed(given.base)[:, 1:-1]).abs().amax()) > 0.005


@pytest.mark.parametrize("form", ["yaw", "paper"])
@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("steps", [3, 11, 16])
def test_the_stitched_motion_is_the_chains_by_their_shares(stitch_network, paper_network, frames, form, layout, steps):
    model = stitch_network if form == "yaw" else paper_network
    given = gap(frames, steps, model, layout)
    made = roll(model, *given, layout)
    share = shares(steps, layout.buffer, layout.both)
    one, other = torch.full_like(made.positions, 1e6), torch.full_like(made.positions, 1e6)
    one[:, 0], other[:, -1] = given.front.positions, given.back.positions
    one[:, made.front.frames] = made.front.positions
    if made.back is not None:
        other[:, made.back.frames] = made.back.positions
    wanted = torch.zeros_like(one)
    for frame in range(steps + 1):
        if share[frame] < 1.0:
            wanted[:, frame] += float(1.0 - share[frame]) * one[:, frame]
        if share[frame] > 0.0:
            wanted[:, frame] += float(share[frame]) * other[:, frame]
    torch.testing.assert_close(made.positions, wanted, atol=1e-5, rtol=0)


@pytest.mark.parametrize("steps", [2, 4, 8, 14, 30])
@pytest.mark.parametrize("buffer", [1, 2, 5])
def test_chains_meet_in_the_middle_of_even_gaps(stitch_network, frames, steps, buffer):
    made = roll(stitch_network, *gap(frames, steps, stitch_network), ChainLayout(buffer))
    if steps == 2:
        assert made.back is None  # no room for two
        return
    middle = seam(steps, buffer).middle
    assert float(made.apart([middle]).abs().max()) < 1e-5
    elsewhere = [frame for frame in seam(steps, buffer).overlap if frame != middle]
    assert float(made.apart(elsewhere).abs().max()) > 1e-3
    by_hand = made.front.positions[:, elsewhere[0] - 1] - made.back.positions[:, steps - 1 - elsewhere[0]]
    assert torch.equal(made.apart(elsewhere)[:, 0], by_hand)


def test_chains_meet_in_the_frame_past_the_middle_of_odd_gaps(stitch_network, frames):
    for steps in (3, 9, 15):
        made = roll(stitch_network, *gap(frames, steps, stitch_network), ChainLayout())
        assert float(made.apart([steps // 2 + 1]).abs().max()) < 1e-5


def test_without_aligning_they_do_not(stitch_network, frames):
    made = roll(stitch_network, *gap(frames, 14, stitch_network), ChainLayout(aligned=False))
    assert min(float(made.apart([frame]).abs().mean()) for frame in seam(14, 2).overlap) > 1e-3


@pytest.mark.parametrize("form", ["yaw", "paper"])
@pytest.mark.parametrize("steps", [10, 13])
def test_each_generator_follows_itself_and_is_led_to_the_newest_of_the_other(
    stitch_network, paper_network, frames, form, steps
):
    """Equation 3, from what the generators were really given."""
    model, layout = (stitch_network if form == "yaw" else paper_network), ChainLayout(2)
    given = gap(frames, steps, model, layout)
    _, calls = listened(model, layout, given)
    keys = given.front, given.back
    have = [{0: keys[0]}, {steps: keys[1]}]
    newest, memory = [0, steps], [model.front.begin(ROWS, given.base), model.back.begin(ROWS, given.base)]
    turns = [0, 0]
    for side in [0, 1] * (steps // 2 + 2):
        if turns[side] == len(calls[side]):
            continue
        call = calls[side][turns[side]]
        turns[side] += 1
        at, other = newest[side], newest[1 - side]
        passed = at >= other if side == 0 else at <= other
        aim = (steps if side == 0 else 0) if passed else other
        there = keys[1 - side] if passed else have[1 - side][other]
        following = at + (1 if side == 0 else -1)
        assert equal(call.body, have[side][at])
        assert equal(call.memory, memory[side])
        assert equal(call.aim[:3], (there.hips, there.rotations, there.positions))
        assert torch.all(call.aim.left == abs(aim - at))
        assert equal(call.aim[4:], (given.base[:, at], given.base[:, following], given.base[:, aim]))
        assert torch.equal(call.latent.style, given.style)
        have[side][following], memory[side], newest[side] = call.after, call.kept, following
    assert turns == [len(c) for c in calls]
    assert newest == [seam(steps, 2).forward, seam(steps, 2).backward]


@pytest.mark.parametrize("steps", [12, 13, 40])
def test_gamma_is_equation_2(paper_network, frames, steps):
    layout = ChainLayout(3)
    _, calls = listened(paper_network, layout, gap(frames, steps, paper_network, layout))
    middle = steps // 2
    for heard in calls:
        for t, call in enumerate(heard):
            wanted = t / middle if t < middle else t / (middle + 3)
            assert torch.all(call.latent.share == torch.tensor(wanted)), t
        assert float(heard[0].latent.share.max()) == 0.0
        assert float(heard[-1].latent.share.max()) < 1.0


def test_one_latent_for_the_gap_or_one_for_each_move(stitch_network, paper_network, frames):
    given = gap(frames, 12, stitch_network)
    _, calls = listened(stitch_network, ChainLayout(), given)
    assert all(torch.equal(call.latent.value, given.latents) for heard in calls for call in heard)
    given = gap(frames, 12, paper_network, ChainLayout())
    made, calls = listened(paper_network, ChainLayout(), given)
    for side, heard in enumerate(calls):
        mine = [i for i, move in enumerate(schedule(12, 2)) if move.backward == bool(side)]
        assert [torch.equal(c.latent.value, given.latents[:, i]) for c, i in zip(heard, mine, strict=True)] == [
            True
        ] * len(mine)
    assert len(made.front.latents) == len(calls[0])
    assert len(made.back.latents) == len(calls[1])
    assert not roll(stitch_network, *gap(frames, 12, stitch_network), ChainLayout()).front.latents


def _placed(base):
    matrices = to_matrix(base[..., 3:].unflatten(-1, (22, 6)))
    return joint_positions(base[..., :3].flatten(0, 1), matrices.flatten(0, 1)).unflatten(0, base.shape[:2])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_silent_generators_walk_along_the_base(stitch_network, frames, layout):
    model = copy.deepcopy(stitch_network)
    for side in (model.front, model.back):
        side.experts[-1].linear.weight.zero_()
        side.experts[-1].linear.bias.zero_()
    given = gap(frames, 13, model)
    made = roll(model, *given, layout)
    torch.testing.assert_close(made.positions, _placed(given.base), atol=1e-4, rtol=0)


def test_the_papers_quaternions_are_unit_and_its_keys_its_own(paper_network, frames):
    for layout in LAYOUTS:
        given = gap(frames, 15, paper_network, layout)
        made = roll(paper_network, *given, layout)
        for chain in [made.front] if made.back is None else [made.front, made.back]:
            assert chain.rotations.shape[-1] == 4
            torch.testing.assert_close(chain.rotations.norm(dim=-1), torch.ones(chain.rotations.shape[:3]))
        assert torch.equal(made.positions[:, 0], given.front.positions)
        assert torch.equal(made.positions[:, -1], given.back.positions)
        other = roll(paper_network, *given._replace(base=given.base + 1.0), layout)
        assert torch.equal(other.positions, made.positions)  # it has no base


@pytest.mark.parametrize("form", ["yaw", "paper"])
def test_gradients_reach_both_generators_through_one_another(stitch_network, paper_network, frames, form):
    model = copy.deepcopy(stitch_network if form == "yaw" else paper_network).requires_grad_()
    made = roll(model, *gap(frames, 8, model, ChainLayout()), ChainLayout())
    made.front.positions[:, 2:].square().sum().backward()  # led by the backward chain's frames
    for name, side in (("front", model.front), ("back", model.back)):
        grads = {n: p.grad for n, p in side.named_parameters()}
        assert grads["experts.3.linear.weight"] is not None, name
        assert float(grads["experts.3.linear.weight"].abs().max()) > 0.0, name
        assert all(torch.isfinite(g).all() for g in grads.values() if g is not None)
        assert float(grads["state_encoder.0.weight"].abs().max()) > 0.0, name


def test_contacts_are_logits_and_a_gap_is_the_same_alone(stitch_network, frames):
    given = gap(frames, 10, stitch_network)
    made = roll(stitch_network, *given, ChainLayout())
    assert float(made.front.contacts.min()) < 0.0
    one = Situation(*(Body(*(x[2:3] for x in body)) for body in given[:2]), *(x[2:3] for x in given[2:]))
    alone = roll(stitch_network, *one, ChainLayout())
    torch.testing.assert_close(alone.positions[0], made.positions[2], atol=1e-4, rtol=0)
    np.testing.assert_allclose(alone.back.contacts[0], made.back.contacts[2], atol=1e-3)
