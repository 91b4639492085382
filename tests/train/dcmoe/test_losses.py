"""Each term of equations 3 to 5 of the DC-MoE paper, and of our own loss, by cases small enough to work out by hand."""

from dataclasses import replace

import pytest
import torch

from interpose.data.contacts import CONTACT_JOINTS
from interpose.features import RATE
from interpose.models.dcmoe import Prediction
from interpose.skeleton import HUMANOID
from interpose.train.dcmoe import losses
from interpose.train.dcmoe.losses import RollOutWeights, paper, terms, unrolled
from interpose.train.dcmoe.sequences import Truth

ROWS, JOINTS, KEYS = 3, 22, 7
LEFT_TOE = HUMANOID.index("LeftToe")
SURE = 200.0
"""A logit whose probability is 1 in single precision."""


@pytest.fixture
def case():
    """(prediction, truth, here), perfectly predicted: three rows alive, five of seven keys inside, no foot planted."""
    torch.manual_seed(0)
    here, positions = torch.randn(ROWS, JOINTS, 3), torch.randn(ROWS, JOINTS, 3)
    rotations = torch.randn(ROWS, JOINTS, 6)
    trajectory, phases = torch.randn(ROWS, KEYS, 6), torch.randn(ROWS, KEYS, 10, 3)
    contacts = torch.zeros(ROWS, KEYS, 4)
    contacts[:, 1:, 0] = 1.0
    velocities = (positions - here) * RATE
    within = torch.ones(ROWS, KEYS)
    within[:, 5:] = 0.0
    truth = Truth(positions, rotations, velocities, contacts, trajectory, phases, torch.ones(ROWS), within)
    said = Prediction(
        positions=positions.clone(),
        raw_positions=positions.clone(),
        rotations=rotations.clone(),
        velocities=velocities.clone(),
        contacts=torch.where(contacts > 0.5, SURE, -SURE),
        trajectory=trajectory.clone(),
        phases=phases.clone(),
        frame=torch.eye(3).expand(ROWS, 3, 3),
        origin=torch.zeros(ROWS, 3),
    )
    return said, truth, here


def changed(said, field, index, by):
    value = getattr(said, field).clone()
    value[index] += torch.tensor(by)
    return said._replace(**{field: value})


def only(each, name, value):
    """``name`` has that value and everything else is nought."""
    for other, got in each.items():
        assert float(got) == pytest.approx(value if other == name else 0.0, abs=1e-5), other


def test_a_perfect_prediction_costs_nothing(case):
    said, truth, here = case
    total, each = paper(said, truth, here)
    assert set(each) == {"pos", "rot", "vel", "contacts", "traj", "phase", "contacts'", "pos'"}
    only(each, None, 0.0)
    assert float(total) == pytest.approx(0.0, abs=1e-5)
    total, each = unrolled(said, truth, here, RollOutWeights())
    only(each, None, 0.0)
    assert float(total) == pytest.approx(0.0, abs=1e-4)


# Of three rows, one joint of 22, one key of the five inside: the L2 norm 5 comes out as its share of a mean.
def test_the_pose_terms_are_mean_norms(case):
    said, truth, here = case
    each = terms(changed(said, "rotations", (1, 4), [3.0, 0.0, 0.0, 0.0, 4.0, 0.0]), truth, here)
    only(each, "rot", 5.0 / JOINTS / ROWS)
    moved = changed(said, "raw_positions", (1, 4), [3.0, 4.0, 0.0])
    each = terms(moved, truth, here)
    assert float(each["pos"]) == pytest.approx(5.0 / JOINTS / ROWS)
    each = terms(changed(said, "velocities", (2, 4), [3.0, 0.0, 4.0]), truth, here)
    assert float(each["vel"]) == pytest.approx(5.0 / JOINTS / ROWS, rel=1e-4)


def test_the_terms_over_the_second_ahead_are_mean_norms_of_keys(case):
    said, truth, here = case
    keys = 5 * ROWS
    each = terms(changed(said, "trajectory", (0, 2), [0.0, 3.0, 0.0, 0.0, 4.0, 0.0]), truth, here)
    only(each, "traj", 5.0 / keys)
    each = terms(changed(said, "phases", (0, 2, 9), [0.0, 3.0, 4.0]), truth, here)
    only(each, "phase", 5.0 / keys)
    wrong = said.contacts.clone()
    wrong[1, 3, :2] *= -1.0
    only(terms(said._replace(contacts=wrong), truth, here), "contacts", 2.0**0.5 / keys)


def test_a_foot_that_is_said_to_stand_must_not_move(case):
    """Equation 4: the velocity of feet times the predicted contact, at the next frame."""
    said, truth, here = case
    half = said.contacts.clone()
    half[0, 0, CONTACT_JOINTS.index("LeftToe")] = 0.0
    speed = said.velocities[0, LEFT_TOE].norm()
    each = terms(said._replace(contacts=half), truth, here)
    assert float(each["contacts'"]) == pytest.approx(float(0.5 * speed / 4 / ROWS), rel=1e-5)
    later = said.contacts.clone()
    later[:, 1:] = SURE
    assert float(terms(said._replace(contacts=later), truth, here)["contacts'"]) == 0.0


def test_positions_and_velocities_must_agree(case):
    """Equation 5: the squared distance, of the pose that the velocity leads to from the present one."""
    said, truth, here = case
    each = terms(changed(said, "velocities", (2, 4), [0.3 * RATE, 0.0, 0.4 * RATE]), truth, here)
    assert float(each["pos'"]) == pytest.approx(0.25 / JOINTS / ROWS, rel=1e-4)
    each = terms(changed(said, "raw_positions", (2, 4), [0.3, 0.0, 0.4]), truth, here)
    assert float(each["pos'"]) == pytest.approx(0.25 / JOINTS / ROWS, rel=1e-4)
    assert float(terms(said, truth, here - 1.0)["pos'"]) == pytest.approx(3.0, rel=1e-4)


def test_the_papers_weights_are_1_and_2_5(case):
    said, truth, here = case
    torch.manual_seed(1)
    off = said._replace(
        **{
            name: getattr(said, name) + torch.randn_like(getattr(said, name))
            for name in ("raw_positions", "rotations", "velocities", "trajectory", "phases")
        }
    )
    off = off._replace(contacts=torch.randn_like(said.contacts))
    total, each = paper(off, truth, here)
    assert all(float(value) > 1e-3 for value in each.values())
    consistency = each["contacts'"] + each["pos'"]
    torch.testing.assert_close(total, sum(each.values()) + 1.5 * consistency)


@pytest.mark.parametrize("weighed", [terms, lambda *args: unrolled(*args, RollOutWeights())[1]])
def test_rows_that_have_arrived_have_no_influence(case, weighed):
    said, truth, here = case
    torch.manual_seed(2)
    dead = [0, 2]
    truth = replace(truth, alive=torch.tensor([0.0, 1.0, 0.0]), contacts=torch.ones_like(truth.contacts))
    off = said._replace(
        **{
            name: getattr(said, name).index_fill(0, torch.tensor([1]), 0.3)
            for name in ("positions", "raw_positions", "rotations", "velocities", "contacts", "trajectory", "phases")
        }
    )
    wanted = weighed(off, truth, here)
    for name in ("positions", "raw_positions", "rotations", "velocities", "contacts", "trajectory", "phases"):
        value = getattr(off, name).clone()
        value[dead] += 7.0
        off = off._replace(**{name: value})
    got = weighed(off, truth, here)
    assert all(float(value) > 0.0 for value in wanted.values())
    for name, value in wanted.items():
        torch.testing.assert_close(got[name], value, msg=name)
    alone = weighed(
        Prediction(*(x[1:2] for x in off)),
        Truth(**{name: getattr(truth, name)[1:2] for name in Truth.__dataclass_fields__}),
        here[1:2],
    )
    for name, value in wanted.items():
        torch.testing.assert_close(alone[name], value, msg=name)


def test_nothing_alive_is_nought_and_finite(case):
    said, truth, here = case
    truth = replace(truth, alive=torch.zeros(ROWS))
    for total, each in (paper(said, truth, here + 1.0), unrolled(said, truth, here + 1.0, RollOutWeights())):
        assert float(total) == 0.0
        only(each, None, 0.0)


def test_keys_beyond_the_target_have_no_influence(case):
    said, truth, here = case
    far = changed(said, "trajectory", (slice(None), slice(5, None)), 9.0)
    far = changed(far, "phases", (slice(None), slice(5, None)), 9.0)
    far = changed(far, "contacts", (slice(None), slice(5, None)), 90.0)
    only(terms(far, truth, here), None, 0.0)
    only(unrolled(far, truth, here, RollOutWeights())[1], None, 0.0)


# Our own loss: the mean of absolute differences, so one number off by v of 66 in one row of three comes out as v / 198.
@pytest.mark.parametrize(
    ("field", "index", "name", "numbers"),
    [
        ("rotations", (1, 4, 2), "rotation", JOINTS * 6 * ROWS),
        ("trajectory", (1, 4, 2), "trajectory", 6 * 5 * ROWS),
        ("phases", (1, 4, 2, 0), "phase", 30 * 5 * ROWS),
    ],
)
def test_our_terms_are_mean_absolute_differences(case, field, index, name, numbers):
    said, truth, here = case
    total, each = unrolled(changed(said, field, index, 0.6), truth, here, RollOutWeights())
    only(each, name, 0.6 / numbers)
    assert float(total) == pytest.approx(getattr(RollOutWeights(), name) * 0.6 / numbers, abs=1e-4)


def test_a_joint_off_its_place_costs_position_displacement_and_consistency(case):
    said, truth, here = case
    _, each = unrolled(changed(said, "positions", (1, 4, 2), 0.6), truth, here, RollOutWeights())
    share = 0.6 / (JOINTS * 3 * ROWS)
    wanted = {"position": share, "displacement": share, "consistency": share}
    for name, value in each.items():
        assert float(value) == pytest.approx(wanted.get(name, 0.0), abs=1e-6), name


def test_a_truly_planted_foot_must_not_move(case):
    said, truth, here = case
    contacts = truth.contacts.clone()
    contacts[2, 0, CONTACT_JOINTS.index("LeftToe")] = 1.0
    moved = float((said.positions - here)[2, LEFT_TOE].norm())
    _, each = unrolled(said, replace(truth, contacts=contacts), here, RollOutWeights())
    assert float(each["foot"]) == pytest.approx(moved / 4 / ROWS, rel=1e-5)


def test_contacts_are_judged_by_cross_entropy(case):
    said, truth, here = case
    unsure = said.contacts.clone()
    unsure[0, 2, 3] = 0.0
    _, each = unrolled(said._replace(contacts=unsure), truth, here, RollOutWeights())
    only(each, "contact", 0.6931472 / (4 * 5 * ROWS))


def test_every_term_has_a_weight(case):
    said, truth, here = case
    torch.manual_seed(3)
    off = Prediction(*(x + 0.1 * torch.randn_like(x) for x in said))
    off = off._replace(contacts=torch.randn_like(said.contacts))
    truth = replace(truth, contacts=torch.ones_like(truth.contacts))
    total, each = unrolled(off, truth, here, RollOutWeights())
    assert set(each) == set(RollOutWeights.__dataclass_fields__) - {"skate", "energy"}
    assert all(float(value) > 0.0 for value in each.values())
    torch.testing.assert_close(total, sum(getattr(RollOutWeights(), name) * value for name, value in each.items()))
    for name in each:
        without, _ = unrolled(off, truth, here, replace(RollOutWeights(), **{name: 0.0}))
        torch.testing.assert_close(total - without, getattr(RollOutWeights(), name) * each[name], atol=1e-5, rtol=1e-4)


def test_feet_are_found_by_name():
    assert [HUMANOID.names[joint] for joint in losses._FOOT_JOINTS] == list(CONTACT_JOINTS)


def still(frames, height=0.0):
    """One row of a figure whose joints all rest at that height."""
    positions = torch.zeros(1, frames, JOINTS, 3)
    positions[..., 1] = height
    return positions


@pytest.mark.parametrize(("share", "weight"), [(0.0, 1.0), (0.5, 2.0 - 2.0**0.5), (1.0, 0.0), (3.0, 0.0)])
def test_a_toe_that_moves_while_it_is_low_skates(share, weight):
    made = still(4, share * losses.SLIDE_HEIGHT)
    made[0, :, LEFT_TOE, 0] = 0.01 * torch.arange(4.0)
    made[0, :, HUMANOID.index("LeftFoot"), 0] = torch.arange(4.0)  # ankles are free
    assert float(losses.skate(made)) == pytest.approx(0.01 / 2 * weight, abs=2e-5)


def test_energy_is_the_logarithm_of_the_jerks_ratio():
    true = torch.randn(2, 12, JOINTS, 3, generator=torch.Generator().manual_seed(0))
    for scale in (2.0, 0.5):
        torch.testing.assert_close(losses.energy(scale * true, true), torch.full((2,), 2.0).log(), atol=1e-3, rtol=0)
    assert losses.energy(true, true).abs().max() == 0.0
    moved = true + torch.arange(12.0)[:, None, None] * torch.tensor([0.3, 0.0, 0.1])  # speed is no jerk
    assert losses.energy(moved, true).max() < 1e-3
    assert losses.energy(still(12), still(12)).max() == 0.0
    assert losses.energy(2.0 * true[:, :4], true[:, :4]).max() == 0.0  # too short to tell
    # Loud in one half and still in the other does not even out.
    true = torch.cat([true, true], dim=1)
    uneven = torch.cat([2.0 * true[:, :12], 0.0 * true[:, 12:]], dim=1)
    assert losses.energy(uneven, true).min() > 1.0


def test_windows_count_the_rows_that_are_inside_their_gap():
    true = torch.randn(2, 12, JOINTS, 3, generator=torch.Generator().manual_seed(0))
    made = torch.stack([2.0 * true[0], 50.0 * true[1]])
    total, each = losses.windows(made, true, torch.tensor([1.0, 0.0]), RollOutWeights(skate=0.0, energy=3.0))
    assert float(each["energy"]) == pytest.approx(float(losses.energy(made, true)[0]))
    assert float(total) == pytest.approx(3.0 * float(each["energy"]))
    assert float(losses.windows(made, true, torch.zeros(2), RollOutWeights())[0]) == 0.0
