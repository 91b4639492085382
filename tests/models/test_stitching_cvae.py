"""One step of a generator: its sizes, what each part is for, and the latents of equations 1 and 2."""

import copy
from dataclasses import replace

import pytest
import stitch_learning
import torch
from stitch_learning import Elsewhere, latent, loud, situation
from torch import nn

from interpose.models.normal import normal
from interpose.models.planner import PlannerSize
from interpose.models.stitching_cvae import LONGEST_CHAIN, Generator, LocalPhase, Memory, StitchingCVAE, StitchSize
from interpose.train.stitch.config import PRESETS

BATCH = 6
SIZE = stitch_learning.CONFIG.size
FRAME = stitch_learning.paper_form(SIZE)


@pytest.fixture(scope="module")
def paper_network(frames):
    """The paper's form; not to be changed."""
    return stitch_learning.network_for(frames, stitch_learning.PAPER)


@pytest.fixture
def yaw(frames):
    return situation(frames, BATCH)


@pytest.fixture
def paper(frames):
    return situation(frames, BATCH, form="paper")


def made(size: StitchSize, seed: int = 0) -> Generator:
    """A loud generator."""
    torch.manual_seed(seed)
    return loud(StitchingCVAE(size)).front.eval().requires_grad_(False)


def remembering(generator: Generator) -> Memory:
    """Memories that hold something."""
    draws = torch.Generator().manual_seed(5)
    empty = generator.begin(BATCH, torch.zeros(1))
    return Memory(*(0.5 * torch.randn(x.shape, generator=draws) for x in empty))


def same(one, other):
    return all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


def test_the_papers_sizes_are_the_papers():
    with torch.device("meta"):
        model = StitchingCVAE(PRESETS["paper"].size)
    for side in (model.front, model.back):
        for encoder, width in ((side.state_encoder, 95), (side.offset_encoder, 91), (side.target_encoder, 88)):
            shapes = [tuple(layer.weight.shape) for layer in encoder if isinstance(layer, nn.Linear)]
            assert shapes == [(512, width), (512, 512), (256, 512)]
        assert side.memory.linear.weight.shape == (4 * 768, 3 * 256 + 768)
        for head in (side.current_head, side.arrived_head):
            assert [tuple(x.weight.shape) for x in head if isinstance(x, nn.Linear)] == [(768, 768), (32, 768)]
        assert side.decoder_memory.linear.weight.shape == (4 * 528, (16 + 256 + 256) + 528)
        gate = [x for x in side.gate if isinstance(x, nn.Linear)]
        assert [gate[0].in_features, *(x.out_features for x in gate)] == [4, 64, 32, 4]
        experts = [(x.linear.in_features, x.linear.out_features // 4) for x in side.experts]
        assert experts == [(528, 768), (768, 512), (512, 256), (256, 95)]
        assert not hasattr(side, "style")
    assert model.plan is None


@pytest.mark.parametrize("name", ["full", "small", "tiny", "paper"])
def test_the_generators_share_no_weights(name):
    config = PRESETS[name]
    size = replace(config.size, plan=PlannerSize() if config.needs_plan else None)
    with torch.device("meta"):
        model = StitchingCVAE(size)
    front, back = ({id(p) for p in side.parameters()} for side in (model.front, model.back))
    assert not front & back
    assert len(front) == len(back) > 30
    assert (model.plan is None) == (name == "paper")


def test_a_step_is_the_same_everywhere(stitch_network, yaw):
    there = Elsewhere()
    body, aim = yaw
    side, z = stitch_network.front, latent(SIZE)
    memory = remembering(side)
    after, kept, contacts, made = side(body, aim, memory, z)
    moved, alike, also, _ = side(there.body(body), there.aim(aim), memory, z)
    assert made is None
    for one, other in zip(there.body(after), moved, strict=True):
        torch.testing.assert_close(other, one, atol=2e-3, rtol=1e-3)
    for one, other in zip([*kept, contacts], [*alike, also], strict=True):
        torch.testing.assert_close(other, one, atol=2e-3, rtol=1e-3)
    assert float((after.hips - body.hips).abs().mean()) > 0.005


def test_the_last_step_makes_the_aim(stitch_network, yaw):
    body, aim = yaw
    aim = aim._replace(left=torch.ones(BATCH, 1), following=aim.there)
    for side in (stitch_network.front, stitch_network.back):
        after, *_ = side(body, aim, remembering(side), latent(SIZE))
        torch.testing.assert_close(after.hips, aim.hips, atol=1e-6, rtol=0)
        torch.testing.assert_close(after.rotations, aim.rotations, atol=1e-6, rtol=0)
        torch.testing.assert_close(after.positions, aim.positions, atol=1e-5, rtol=0)


def test_every_input_is_heard(stitch_network, yaw):
    body, aim = yaw
    side, z = stitch_network.front, latent(SIZE)
    memory = remembering(side)
    plain = side(body, aim, memory, z)[0]

    def heard(*changed):
        after = side(*changed)[0]
        return float((after.hips - plain.hips).abs().max()) > 1e-6

    assert not heard(body, aim, memory, z)
    turns = {"hips", "rotations", "positions"}
    for name in body._fields:
        other = body._replace(**{name: getattr(body, name) + 0.3 * (1.0 if name not in turns else 0.1)})
        assert heard(other, aim, memory, z), name
    for name in aim._fields:
        assert heard(body, aim._replace(**{name: getattr(aim, name) * 1.1}), memory, z), name
    for name in ("encoder_cell", "decoder_cell", "encoder_hidden", "decoder_hidden"):
        assert heard(body, aim, memory._replace(**{name: getattr(memory, name) * 0.5}), z), name
    assert heard(body, aim, memory, z._replace(value=z.value + 0.5))
    assert heard(body, aim, memory, z._replace(style=z.style.roll(1, dims=1)))
    assert not heard(body, aim, memory, z._replace(share=z.share + 0.5))  # one latent a gap has nothing to interpolate


def test_memories_begin_empty_and_are_kept(stitch_network, yaw):
    side = stitch_network.front
    empty = side.begin(BATCH, torch.zeros(1))
    assert [tuple(x.shape) for x in empty] == [(BATCH, SIZE.memory)] * 2 + [(BATCH, SIZE.decoder_memory)] * 2
    assert not any(x.any() for x in empty)
    first = side(*yaw, empty, latent(SIZE))
    second = side(*yaw, first[1], latent(SIZE))
    assert float((first[0].hips - second[0].hips).abs().max()) > 1e-5
    assert all(float((a - b).abs().max()) > 1e-4 for a, b in zip(first[1], second[1], strict=True))


def test_without_the_lstm_the_encoder_remembers_nothing(yaw):
    side = made(replace(SIZE, recurrent=False))
    assert isinstance(side.memory, nn.Linear)
    memory = remembering(side)
    plain = side(*yaw, memory, latent(SIZE))
    forgot = memory._replace(encoder_hidden=0.0 * memory.encoder_hidden, encoder_cell=0.0 * memory.encoder_cell)
    assert same(side(*yaw, forgot, latent(SIZE))[0], plain[0])
    other = memory._replace(decoder_cell=0.0 * memory.decoder_cell)
    assert not same(side(*yaw, other, latent(SIZE))[0], plain[0])
    assert torch.equal(plain[1].encoder_cell, memory.encoder_cell)


@pytest.mark.parametrize("size", [SIZE, FRAME])
def test_the_phase_modulates_the_experts_and_a_lone_one_has_none(frames, size):
    body, aim = situation(frames, BATCH, form=size.form)
    turned = body._replace(phase=-body.phase)
    for experts, modulated in ((2, True), (1, False)):
        side = made(replace(size, experts=experts))
        memory, z = remembering(side), latent(size)
        one, other = (side(b, aim, memory, z)[0] for b in (body, turned))
        assert torch.equal(one.hips, other.hips) != modulated
        assert not torch.equal(one.phase, other.phase)


def test_the_phase_goes_on_by_its_own_network(paper_network, paper):
    body, aim = paper
    side = paper_network.front
    after = side(body, aim, side.begin(BATCH, torch.zeros(1)), latent(FRAME))[0]
    state = side.normalised("state", side.form.features(body, aim).state)
    torch.testing.assert_close(after.phase, side.phases(state, body.phase))
    silent = LocalPhase(7)
    nn.init.zeros_(silent.layers[-1].weight)
    nn.init.zeros_(silent.layers[-1].bias)
    torch.testing.assert_close(silent(torch.randn(3, 7), body.phase[:3]), body.phase[:3])


def test_features_are_normalised_and_clamped(paper_network):
    side = copy.deepcopy(paper_network.front)
    side.target_mean.fill_(1.0)
    side.target_std.fill_(2.0)
    x = torch.tensor([[1.0, 2.0, -50.0, 50.0]]).repeat(1, 22)
    assert side.normalised("target", x)[0, :4].tolist() == [0.0, 0.5, -6.0, 6.0]


def test_more_frames_than_trained_for_are_seen_as_the_most(paper_network, paper):
    body, aim = paper
    side = paper_network.front
    memory, z = remembering(side), latent(FRAME)

    def step(left):
        return side(body, aim._replace(left=torch.full((BATCH, 1), left)), memory, z)[0]

    assert same(step(LONGEST_CHAIN), step(500.0))
    assert not same(step(LONGEST_CHAIN), step(LONGEST_CHAIN - 1.0))


def test_the_papers_form_does_not_see_the_style(paper_network, paper):
    side = paper_network.front
    memory, z = remembering(side), latent(FRAME)
    assert same(side(*paper, memory, z)[0], side(*paper, memory, z._replace(style=z.style.roll(1, dims=1)))[0])


def test_at_the_start_the_latent_is_the_current_frames(paper_network, paper):
    side = paper_network.front
    _, memory, _, made = side(*paper, remembering(side), latent(FRAME, share=0.0))
    now = normal(side.current_head(memory.encoder_hidden))
    torch.testing.assert_close(made.mean, now.mean)
    torch.testing.assert_close(made.log_deviation, now.log_deviation)
    other = copy.deepcopy(side)
    nn.init.normal_(other.arrived_head[-1].weight)
    assert same(other(*paper, remembering(side), latent(FRAME, share=0.0))[3], made)


def test_at_the_seam_the_latent_is_that_of_having_arrived(paper_network, paper):
    body, aim = paper
    side = paper_network.front
    memory = remembering(side)
    end, start = (side(body, aim, memory, latent(FRAME, share=share))[3] for share in (1.0, 0.0))
    # Wherever the chain is now: the target stands in the current frame's place.
    elsewhere = body._replace(
        hips=body.hips + 1.0, rotations=body.rotations.roll(1, dims=0), velocities=-body.velocities
    )
    torch.testing.assert_close(side(elsewhere, aim, memory, latent(FRAME, share=1.0))[3], end, atol=1e-5, rtol=0)
    assert float((side(elsewhere, aim, memory, latent(FRAME, share=0.0))[3].mean - start.mean).abs().max()) > 0.05
    assert float((end.mean - start.mean).abs().max()) > 0.05
    other = copy.deepcopy(side)
    nn.init.normal_(other.current_head[-1].weight)
    torch.testing.assert_close(other(body, aim, memory, latent(FRAME, share=1.0))[3], end, atol=1e-4, rtol=1e-4)
    # It is the second head's, from the same memory.
    nn.init.zeros_(other.arrived_head[-1].weight)
    made = other(body, aim, memory, latent(FRAME, share=1.0))[3]
    bias = other.arrived_head[-1].bias
    torch.testing.assert_close(torch.cat(made, dim=1), bias.expand(BATCH, -1), atol=1e-5, rtol=0)


def test_between_them_distributions_are_blended_in_a_straight_line(paper_network, paper):
    side = paper_network.front
    start, third, end = (side(*paper, remembering(side), latent(FRAME, share=s))[3] for s in (0.0, 0.3, 1.0))
    for a, b, c in zip(start, third, end, strict=True):
        torch.testing.assert_close(b, 0.7 * a + 0.3 * c)
    rows = latent(FRAME)._replace(share=torch.linspace(0.0, 1.0, BATCH)[:, None])
    mixed = side(*paper, remembering(side), rows)[3]
    torch.testing.assert_close(mixed.mean[[0, -1]], torch.stack([start.mean[0], end.mean[-1]]))


def test_without_interpolation_the_latent_is_always_the_current_frames(paper):
    side = made(replace(FRAME, interpolated=False))
    memory = remembering(side)
    start, end = (side(*paper, memory, latent(FRAME, share=s)) for s in (0.0, 1.0))
    assert same(start[3], end[3])
    assert same(start[0], end[0])


def test_noise_counts_by_the_deviation(paper_network, paper):
    side = copy.deepcopy(paper_network.front)
    for head in (side.current_head, side.arrived_head):
        head[-1].weight[8:] = 0.0
        head[-1].bias[8:] = -100.0  # clamped: next to certain
    memory, z = remembering(side), latent(FRAME)
    certain, again = (side(*paper, memory, z._replace(value=v))[0] for v in (z.value, -z.value))
    unsure, otherwise = (paper_network.front(*paper, memory, z._replace(value=v))[0] for v in (z.value, -z.value))
    apart = [float((a.rotations - b.rotations).norm()) for a, b in ((certain, again), (unsure, otherwise))]
    assert 0.0 < apart[0] < 0.1 * apart[1]


@pytest.mark.parametrize("form", ["yaw", "paper"])
def test_half_products_give_nearly_the_same(request, form, stitch_network, paper_network):
    model = copy.deepcopy(stitch_network if form == "yaw" else paper_network)
    body, aim = request.getfixturevalue(form)
    z = latent(model.size)
    whole = model.front(body, aim, remembering(model.front), z)[0]
    model.halve(True)
    assert model.back.half_products
    assert model.plan is None or model.plan.half_products
    half = model.front(body, aim, remembering(model.front), z)[0]
    assert all(x.dtype == torch.float32 for x in half)
    torch.testing.assert_close(half.positions, whole.positions, atol=0.05, rtol=0)
    assert not same(half, whole)
