"""The losses of stitched gaps by hand: nothing for the truth, and each term for what it is of."""

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from interpose.data.contacts import CONTACT_INDICES as FEET
from interpose.features.stitch import seam
from interpose.train.stitch.losses import PAPER_WEIGHTS, StitchWeights, chains
from interpose.train.stitch.rollout import Chain, Stitched
from interpose.train.stitch.truth import TrueMotion

ROWS, STEPS = 3, 8
SHARED = list(seam(STEPS, 2).overlap)
ALL = torch.ones(ROWS)


@pytest.fixture
def true() -> TrueMotion:
    """Joints that accelerate more and more; feet still, those on the left in contact."""
    draws = torch.Generator().manual_seed(0)
    time = torch.arange(STEPS + 1.0)
    positions = torch.randn(ROWS, 1, 22, 3, generator=draws) + 0.01 * time[:, None, None] ** 3 / 6.0
    positions[:, :, FEET] = positions[:, :1, FEET]
    contacts = torch.zeros(ROWS, STEPS + 1, 4)
    contacts[..., :2] = 1.0
    rotations = torch.randn(ROWS, STEPS + 1, 22, 6, generator=draws)
    return TrueMotion(positions[:, :, 0].clone(), rotations, positions, contacts)


def chain(true: TrueMotion, frames: list[int]) -> Chain:
    at = torch.tensor(frames)
    logits = 100.0 * (2.0 * true.contacts[:, at] - 1.0)
    return Chain(at, true.hips[:, at], true.rotations[:, at], true.positions[:, at], logits, [])


@pytest.fixture
def perfect(true) -> Stitched:
    """Chains that make the truth."""
    ends = seam(STEPS, 2)
    front = chain(true, list(range(1, ends.forward + 1)))
    back = chain(true, list(range(STEPS - 1, ends.backward - 1, -1)))
    return Stitched(front, back, true.positions.clone())


def terms(made: Stitched, true: TrueMotion, known: Tensor = ALL, entropy: bool = True) -> dict[str, float]:
    return {k: float(v) for k, v in chains(made, true, SHARED, known, entropy).items()}


def off(made: Stitched, of: str, by: Tensor | float, side: str = "front") -> Stitched:
    """One field of a chain moved."""
    one = getattr(made, side)
    return replace(made, **{side: replace(one, **{of: getattr(one, of) + by})})


@pytest.mark.parametrize("entropy", [True, False])
def test_the_truth_costs_nothing(perfect, true, entropy):
    each = terms(perfect, true, entropy=entropy)
    named = {"position", "rotation", "root", "contact", "displacement", "foot", "skate", "energy", "stitch"}
    assert set(each) == named
    assert list(each.values()) == pytest.approx([0.0] * len(named), abs=3e-5)
    assert set(each) <= set(StitchWeights.__dataclass_fields__)


def test_what_each_chain_makes_wrong_is_averaged_over_the_frames_of_both(perfect, true):
    front, back = len(perfect.front.frames), len(perfect.back.frames)
    share = front / (front + back)
    for of, name in (("positions", "position"), ("rotations", "rotation")):
        assert terms(off(perfect, of, -0.2), true)[name] == pytest.approx(0.2 * share, rel=1e-5)
        both = off(off(perfect, of, 0.2), of, -0.4, "back")
        assert terms(both, true)[name] == pytest.approx(0.2 * share + 0.4 * (1 - share), rel=1e-5)


def test_the_root_is_held_by_its_velocity_alone(perfect, true):
    assert terms(off(perfect, "hips", 5.0), true)["root"] == pytest.approx(0.0, abs=1e-6)
    count = len(perfect.front.frames)
    drift = 0.3 * torch.arange(float(count))[:, None].expand(count, 3)
    share = (count - 1) / (count - 1 + len(perfect.back.frames) - 1)
    assert terms(off(perfect, "hips", drift), true)["root"] == pytest.approx(0.3 * share, rel=1e-5)


def test_contacts_by_cross_entropy_or_as_printed(perfect, true):
    unsure = replace(perfect, front=replace(perfect.front, contacts=torch.zeros_like(perfect.front.contacts)))
    share = len(perfect.front.frames) / (len(perfect.front.frames) + len(perfect.back.frames))
    assert terms(unsure, true)["contact"] == pytest.approx(math.log(2.0) * share, rel=1e-5)
    assert terms(unsure, true, entropy=False)["contact"] == pytest.approx(0.5 * share, rel=1e-5)


def test_steps_and_standing_feet_are_looked_at_in_the_stitched_motion(perfect, true):
    moved = perfect.positions.clone()
    moved[:, 4:] += torch.tensor([0.0, 0.6, 0.0])  # one step wrong of eight, one axis of three
    each = terms(replace(perfect, positions=moved), true)
    assert each["displacement"] == pytest.approx(0.6 / 8 / 3, rel=1e-4)
    assert each["foot"] == pytest.approx(0.6 / 8 / 3 / 2, rel=1e-4)  # half of the feet stand
    assert each["position"] == pytest.approx(0.0, abs=1e-6)
    lifted = replace(true, contacts=true.contacts.clone())
    lifted.contacts[:, 4] = 0.0  # a step is standing where both its frames are
    assert terms(replace(perfect, positions=moved), lifted)["foot"] == pytest.approx(0.0, abs=1e-7)


def test_stitch_is_what_the_chains_are_apart_in_the_frames_of_both(perfect, true):
    assert SHARED == [3, 4, 5, 6]
    assert terms(off(perfect, "positions", 0.5), true)["stitch"] == pytest.approx(0.5, rel=1e-5)
    together = off(off(perfect, "positions", 0.5), "positions", 0.5, "back")
    assert terms(together, true)["stitch"] == pytest.approx(0.0, abs=1e-6)
    by = torch.zeros(len(perfect.front.frames), 1, 1)
    by[:2] = 9.0  # frames 1 and 2, which the backward chain does not make
    assert terms(off(perfect, "positions", by), true)["stitch"] == pytest.approx(0.0, abs=1e-6)
    by[3] = 1.0  # frame 4, one of four
    assert terms(off(perfect, "positions", by), true)["stitch"] == pytest.approx(0.25, rel=1e-5)
    assert "stitch" not in chains(perfect, true, [], ALL)
    assert "stitch" not in chains(replace(perfect, back=None), true, SHARED, ALL)


def test_skating_is_how_far_low_toes_move(perfect, true):
    """0.5 m along x in one of eight steps; weight 2 - 2^(h/H), H 2.5 cm: 1 on the ground, nil from H on."""
    for height, weight in ((-0.1, 1.0), (0.0, 1.0), (0.0125, 2.0 - math.sqrt(2.0)), (0.025, 0.0), (1.0, 0.0)):
        moved = torch.full_like(perfect.positions, 5.0)
        moved[:, :, FEET, 1] = height
        moved[:, 3:, FEET[1], 0] += 0.5  # the left toe
        moved[:, :4, FEET[0], 0] += 0.7  # ankles do not count
        each = terms(replace(perfect, positions=moved), true)
        assert each["skate"] == pytest.approx(weight * 0.5 / 8 / 2, abs=3e-5)


def test_energy_is_the_jerks_ratio_of_each_joint(perfect, true):
    """Jerk 1 along each axis of all joints but the feet, which are still; less than a millimetre is still."""
    real = replace(true, positions=100.0 * true.positions)
    for scale, wanted in ((1.0, 0.0), (2.0, math.log(2.0)), (0.25, math.log(4.0))):
        energy = terms(replace(perfect, positions=scale * real.positions), real)["energy"]
        assert energy == pytest.approx(wanted * 18 / 22, abs=2e-3)
    tremble = 1e-4 * torch.randn(true.positions.shape, generator=torch.Generator().manual_seed(1))
    assert terms(replace(perfect, positions=true.positions + tremble), true)["energy"] < 0.5
    assert terms(replace(perfect, positions=true.positions + 300.0 * tremble), true)["energy"] > 2.0
    short = TrueMotion(true.hips[:, :4], true.rotations[:, :4], true.positions[:, :4], true.contacts[:, :4])
    little = Stitched(chain(short, [1, 2]), chain(short, [2, 1]), short.positions * 2.0)
    assert float(chains(little, short, [1, 2], ALL)["energy"]) == 0.0


def test_jerk_where_there_is_none_is_not_made_up_for_elsewhere(true):
    time = torch.arange(31.0)
    joints = torch.zeros(1, 31, 22, 3)
    waves = joints + 0.2 * torch.sin(1.3 * time)[:, None, None]
    real = TrueMotion(joints[:, :, 0], torch.zeros(1, 31, 22, 6), waves, torch.zeros(1, 31, 4))
    uneven = waves * torch.where(time < 15, 0.1, 1.9)[:, None, None]
    made = Stitched(chain(real, [1, 2]), chain(real, [29, 28]), uneven)
    assert float(chains(made, real, [], torch.ones(1))["energy"]) > 0.8


@pytest.mark.parametrize("of", ["positions", "rotations", "contacts", "hips"])
def test_rows_count_by_how_much_they_are_held_to_the_truth(perfect, true, of):
    by = torch.tensor([0.1, 0.2, 0.4])[:, None, None, None]
    by = by[..., 0] if of in ("contacts", "hips") else by
    names = {"positions": "position", "rotations": "rotation", "contacts": "contact", "hips": "root"}
    start = perfect
    if of == "contacts":
        start = replace(perfect, front=replace(perfect.front, contacts=0.0 * perfect.front.contacts))
    if of == "hips":
        by = by * torch.arange(float(len(perfect.front.frames)))[:, None]
    made = off(start, of, by)
    alone = [terms(made, true, torch.eye(3)[row])[names[of]] for row in range(3)]
    assert terms(made, true)[names[of]] == pytest.approx(sum(alone) / 3, rel=1e-5)
    assert terms(made, true, 0.2 * ALL)[names[of]] == pytest.approx(sum(alone) / 3, rel=1e-5)  # shares, not a factor
    mixed = terms(made, true, torch.tensor([1.0, 1.0, 0.5]))[names[of]]
    assert mixed == pytest.approx((alone[0] + alone[1] + 0.5 * alone[2]) / 2.5, rel=1e-5)
    if of != "contacts":
        assert alone[1] == pytest.approx(2 * alone[0], rel=1e-4)


def test_the_weights_of_section_4_3():
    """beta 1, 1, 0.1 of equation 5; KL 1, stitching 0.5, FK 0.5, adversarial 0.1 of equation 10; nothing else."""
    weights = PAPER_WEIGHTS
    assert (weights.rotation, weights.root, weights.contact) == (1.0, 1.0, 0.1)
    assert (weights.divergence, weights.stitch, weights.position, weights.adversarial) == (1.0, 0.5, 0.5, 0.1)
    assert (weights.displacement, weights.foot, weights.skate, weights.energy) == (0.0, 0.0, 0.0, 0.0)
    assert weights.entropy is False
