"""Planted feet stand still on the floor, keys stay as they are, and nothing moves that need not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from interpose import io, retarget, rotation
from interpose.data import contacts
from interpose.motion import Motion, resample
from interpose.runtime.feet import lock
from interpose.runtime.feet.lock import heel_lift, lifted, smooth_field
from interpose.runtime.feet.stances import FOOT_DEFAULTS
from interpose.skeleton import HUMANOID

TOES = [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")]
ANKLES = [HUMANOID.index("LeftFoot"), HUMANOID.index("RightFoot")]
LEGS = [HUMANOID.index(side + joint) for side in ("Left", "Right") for joint in ("UpLeg", "Leg", "Foot", "Toe")]
FRAMES = 42
SWING_FRAMES = 40


def plant(motion: Motion, down: ndarray) -> Motion:
    """One motion with its feet locked."""
    local = lock.plant_batch(motion.root_positions[None], motion.local_rotations[None], down[None])
    return replace(motion, local_rotations=local[0])


def standing(frames: int = FRAMES, bend: float = 0.5, height: float = 0.0) -> Motion:
    """A figure with bent knees whose feet are flat on a floor at ``height``."""
    local = np.tile(rotation.IDENTITY, (frames, 22, 1))
    for side in ("Left", "Right"):
        for joint, turn in (("UpLeg", -bend / 2), ("Leg", bend), ("Foot", -bend / 2)):
            local[:, HUMANOID.index(side + joint)] = rotation.from_rotation_vector(np.array([turn, 0.0, 0.0]))
    motion = Motion(HUMANOID, np.zeros((frames, 3)), local, 30.0)
    return raised(motion, height - motion.global_positions()[0, TOES[0], 1])


def raised(motion: Motion, by: float) -> Motion:
    return replace(motion, root_positions=motion.root_positions + np.array([0.0, by, 0.0]))


def drifting(motion: Motion, by: ndarray) -> Motion:
    """The whole figure carried along ``by`` and back, smoothly, keys unmoved."""
    bell = np.sin(np.pi * np.linspace(0.0, 1.0, len(motion))) ** 2
    return replace(motion, root_positions=motion.root_positions + bell[:, None] * by)


def down(frames: int = FRAMES, joints: tuple[int, ...] = (0, 1, 2, 3)) -> ndarray:
    """Certain contacts of the given columns in all frames."""
    out = np.zeros((frames, 4))
    out[:, joints] = 1.0
    return out


def largest_acceleration(motion: Motion) -> float:
    """m/s^2, over the joints of the legs."""
    return float(np.linalg.norm(np.diff(motion.global_positions()[:, LEGS], n=2, axis=0), axis=-1).max() * 900.0)


@pytest.mark.parametrize("by", [(0.08, 0.0, 0.03), (-0.05, -0.02, 0.1), (0.0, 0.03, 0.0)])
def test_a_figure_that_sways_keeps_its_feet_where_they_stand(by: tuple[float, float, float]) -> None:
    still = standing(bend=0.8)
    swaying = drifting(still, np.array(by))
    planted = plant(swaying, down())
    expected = still.global_positions()[:, [*TOES, *ANKLES]]
    assert np.abs(swaying.global_positions()[:, [*TOES, *ANKLES]] - expected).max() > 0.02
    np.testing.assert_allclose(planted.global_positions()[:, [*TOES, *ANKLES]], expected, atol=1e-6)
    np.testing.assert_array_equal(planted.root_positions, swaying.root_positions)
    assert largest_acceleration(planted) < 3.0 * largest_acceleration(swaying)


def test_the_keys_are_kept_to_the_last_bit() -> None:
    swaying = drifting(standing(), np.array([0.1, -0.05, 0.1]))
    planted = plant(swaying, down())
    for frame in (0, -1):
        np.testing.assert_array_equal(planted.local_rotations[frame], swaying.local_rotations[frame])
        np.testing.assert_array_equal(planted.root_positions[frame], swaying.root_positions[frame])


def test_feet_that_stand_already_are_left_alone() -> None:
    motion = standing()
    np.testing.assert_array_equal(plant(motion, down()).local_rotations, motion.local_rotations)


def test_a_foot_in_the_air_moves_only_where_it_comes_too_near_the_floor() -> None:
    swaying = drifting(standing(height=0.06), np.array([0.1, 0.0, 0.1]))
    np.testing.assert_array_equal(plant(swaying, np.zeros((FRAMES, 4))).local_rotations, swaying.local_rotations)
    sinking = drifting(standing(height=0.06), np.array([0.0, -0.12, 0.0]))
    planted = plant(sinking, np.zeros((FRAMES, 4)))
    assert sinking.global_positions()[:, TOES, 1].min() < -0.05
    assert planted.global_positions()[:, TOES, 1].min() > -1e-6
    assert largest_acceleration(planted) < 20.0


@pytest.mark.parametrize("depth", [-0.02, 0.0, 0.015])
def test_nothing_sinks_farther_than_the_keys(depth: float) -> None:
    sinking = drifting(standing(height=depth), np.array([0.05, -0.08, 0.0]))
    toes = plant(sinking, down()).global_positions()[1:-1, TOES, 1]
    assert toes.min() > min(0.0, depth) - 1e-6
    assert toes[10:-10].min() > -1e-6


def test_beside_a_key_in_the_air_a_contact_leaves_time_to_come_down() -> None:
    motion = standing(bend=0.8, height=0.07)
    root = motion.root_positions.copy()
    root[[0, -1], 1] += 0.08
    motion = replace(motion, root_positions=root)
    toe, before = (m.global_positions()[:, TOES[0]] for m in (plant(motion, down()), motion))
    assert np.linalg.norm(toe[1] - before[1]) < FOOT_DEFAULTS.pace
    np.testing.assert_allclose(toe[6:-6, 1], FOOT_DEFAULTS.toe_heights[1], atol=1e-6)


def test_quaternions_keep_their_signs() -> None:
    motion = drifting(standing(), np.array([0.05, 0.0, 0.0]))
    flipped = replace(motion, local_rotations=-motion.local_rotations)
    for seen in (motion, flipped):
        planted = plant(seen, down())
        assert np.all(np.sum(planted.local_rotations * seen.local_rotations, axis=-1) > 0.0)


def test_only_the_legs_turn_and_the_toes_keep_their_direction() -> None:
    swaying = drifting(standing(), np.array([0.1, 0.0, 0.0]))
    planted = plant(swaying, down())
    others = [j for j in range(22) if j not in LEGS]
    np.testing.assert_array_equal(planted.local_rotations[:, others], swaying.local_rotations[:, others])
    turned = rotation.multiply(
        rotation.inverse(planted.global_rotations()[:, TOES[0]]), swaying.global_rotations()[:, TOES[0]]
    )
    assert rotation.angle(turned).max() < 1e-6


def test_a_contact_within_the_gap_is_brought_to_the_floor_and_fades_out() -> None:
    hovering = drifting(standing(), np.array([0.06, 0.04, 0.0]))
    planted = plant(hovering, np.where(np.arange(FRAMES)[:, None] // 8 == 2, down(), 0.0))
    toe, before = planted.global_positions()[:, TOES[0]], hovering.global_positions()[:, TOES[0]]
    np.testing.assert_allclose(toe[16:24], np.broadcast_to(toe[16], (8, 3)), atol=1e-6)
    assert -1e-6 <= toe[16, 1] <= 0.02 + 1e-6
    assert np.linalg.norm(toe - before, axis=-1)[[1, -2]].max() < 0.004
    assert largest_acceleration(planted) < 30.0


def test_the_heel_comes_up_where_the_leg_is_too_short() -> None:
    away = drifting(standing(bend=0.3), np.array([0.0, 0.06, 0.0]))
    planted = plant(away, down())
    positions, toes = planted.global_positions(), standing(bend=0.3).global_positions()[:, TOES]
    np.testing.assert_allclose(positions[:, TOES], toes, atol=1e-6)
    assert positions[FRAMES // 2, ANKLES, 1].min() > positions[0, ANKLES, 1].max() + 0.02
    reach = np.linalg.norm(positions[:, ANKLES] - positions[:, [LEGS[0], LEGS[4]]], axis=-1)
    assert reach.max() < 0.4350 + 0.4237


def test_where_even_that_is_too_short_the_foot_points_at_its_place() -> None:
    hip, toe = np.array([[0.0, 1.2, 0.0]]), np.array([[0.0, 0.0, 0.1]])
    ankle = lock.reachable_ankle(hip, toe, np.array([[0.0, 0.07, -0.05]]), np.array([0.8]))
    to_toe = (toe - hip) / np.linalg.norm(toe - hip)
    reach = np.linalg.norm(ankle - hip)
    np.testing.assert_allclose(ankle, hip + reach * to_toe, atol=1e-9)
    assert 0.98 * 0.8587 < reach < 0.8587


def test_a_place_too_far_away_is_let_go() -> None:
    walking = standing()
    root = walking.root_positions + np.linspace(0.0, 2.0, FRAMES)[:, None] * np.array([0.0, 0.0, 1.0])
    dragged = replace(walking, root_positions=root)
    planted = plant(dragged, down())
    apart = np.linalg.norm(planted.global_positions()[:, TOES] - dragged.global_positions()[:, TOES], axis=-1)
    assert 0.01 < apart.max() < FOOT_DEFAULTS.stretch + 0.05
    assert largest_acceleration(planted) < 120.0


def test_one_foot_steps_between_two_places() -> None:
    sliding = standing()
    root = sliding.root_positions + np.linspace(0.0, 0.3, FRAMES)[:, None] * np.array([0.0, 0.0, 1.0])
    planted = plant(replace(sliding, root_positions=root), down())
    toe = planted.global_positions()[:, TOES[0]]
    still = np.linalg.norm(np.diff(toe, axis=0), axis=-1) < 1e-6
    assert still[:5].all()
    assert still[-5:].all()
    assert not still.all()


def test_a_foot_on_a_box_stays_on_the_box() -> None:
    swaying = drifting(standing(height=0.4), np.array([0.06, 0.0, 0.0]))
    inside = np.where((np.arange(FRAMES) > 10) & (np.arange(FRAMES) < 30), 1.0, 0.0)[:, None] * down()
    toe = plant(swaying, inside).global_positions()[12:28, TOES[0]]
    np.testing.assert_allclose(toe, np.broadcast_to(toe[0], toe.shape), atol=1e-6)
    assert abs(toe[0, 1] - 0.4) < 0.01


def test_transitions_at_once_are_as_one_by_one() -> None:
    motions = [drifting(standing(), np.array(by)) for by in ((0.1, 0.0, 0.0), (0.0, -0.05, 0.1), (0.0, 0.0, 0.0))]
    seen = [down(), down(joints=(1, 2)), np.zeros((FRAMES, 4))]
    together = lock.plant_batch(
        np.stack([m.root_positions for m in motions]), np.stack([m.local_rotations for m in motions]), np.stack(seen)
    )
    for motion, contact, local in zip(motions, seen, together, strict=True):
        np.testing.assert_allclose(local, plant(motion, contact).local_rotations, atol=1e-12)


@pytest.mark.parametrize("frames", [1, 2, 3, 4, 5])
def test_the_shortest_gaps(frames: int) -> None:
    motion = drifting(standing(frames), np.array([0.05, 0.0, 0.0]))
    planted = plant(motion, down(frames))
    assert len(planted) == frames
    np.testing.assert_array_equal(planted.local_rotations[[0, -1]], motion.local_rotations[[0, -1]])


def test_a_figure_that_glides_walks() -> None:
    frames = 62
    gliding = standing(frames, bend=0.6)
    way = np.linspace(0.0, 1.2, frames)[:, None] * np.array([0.0, 0.0, 1.0])
    gliding = replace(gliding, root_positions=gliding.root_positions + way)
    planted = plant(gliding, np.full((frames, 4), 0.5))
    slides = [contacts.foot_slide(motion.global_positions()[:, TOES]) for motion in (gliding, planted)]
    (travel, low), (less, fewer) = [(float(a), float(b)) for a, b in slides]
    assert less / fewer < 0.35 * travel / low
    toes = planted.global_positions()[:, TOES]
    still = np.linalg.norm(np.diff(toes, axis=0), axis=-1) < 1e-6
    assert np.all(still.sum(axis=0) > 12)
    assert toes[..., 1].max() > 0.03  # it lifts its feet
    assert largest_acceleration(planted) < 50.0


def test_a_folded_leg_is_not_thrown_about() -> None:
    kneeling = standing(bend=2.9)
    swaying = drifting(kneeling, np.array([0.1, 0.0, 0.1]))
    planted = plant(swaying, down())
    knees = [LEGS[1], LEGS[5]]
    apart = np.linalg.norm(planted.global_positions()[:, knees] - swaying.global_positions()[:, knees], axis=-1)
    assert apart.max() < 0.4


@pytest.mark.parametrize("first", [600, 1500, 2700])
def test_a_real_walk_that_drifts_slides_no_more_than_it_did(lafan1_dir: Path, first: int) -> None:
    clip = io.read(lafan1_dir / "walk4_subject1.bvh")
    walk = resample(retarget.to_humanoid(clip, retarget.map_skeleton(clip)), 30.0)[first : first + 62]
    stands = contacts.detect(walk.global_positions(), 30.0)
    drifted = drifting(walk, np.array([0.08, -0.02, 0.08]))
    planted = plant(drifted, stands.astype(float))

    def slide(motion: Motion) -> float:
        """Centimetres a frame that planted toes travel."""
        step = np.linalg.norm(np.diff(motion.global_positions()[:, TOES], axis=0), axis=-1)
        return float(100.0 * step[stands[1:, [1, 3]] & stands[:-1, [1, 3]]].mean())

    assert slide(drifted) > 3.0 * slide(walk)
    assert slide(planted) < slide(walk) + 1e-3
    assert largest_acceleration(planted) < 1.2 * largest_acceleration(walk)


@pytest.mark.parametrize("name", ["walk4_subject1", "fallAndGetUp1_subject1", "ground1_subject1"])
def test_real_motion_hardly_changes(lafan1_dir: Path, name: str) -> None:
    clip = io.read(lafan1_dir / f"{name}.bvh")
    clip = resample(retarget.to_humanoid(clip, retarget.map_skeleton(clip)), 30.0)
    changes = []
    for first in range(300, 3900, 600):
        gap = clip[first : first + 62]
        stands = contacts.detect(clip[first - 5 : first + 67].global_positions(), 30.0)[5:-5]
        planted = plant(gap, stands.astype(float))
        legs, before = (motion.global_positions()[:, LEGS] for motion in (planted, gap))
        changes.append(np.linalg.norm(legs - before, axis=-1))
        assert np.ptp(np.linalg.norm(legs[:, 3] - legs[:, 2], axis=-1)) < 1e-9  # bones keep their lengths
    assert np.mean(changes) < 0.01
    assert np.quantile(changes, 0.99) < 0.05


def smoothest(values: ndarray, held: ndarray, decay: float) -> ndarray:
    """The field of one leg by dense least squares."""
    frames = len(values)
    bend = np.diff(np.eye(frames + 2), n=2, axis=0)
    fixed = np.concatenate([[True, True], held[1:-1], [True, True]])
    known = np.zeros((frames + 2, values.shape[1]))
    known[2:-2][held[1:-1]] = values[1:-1][held[1:-1]]
    rows = np.concatenate([bend, 2.0 / decay**2 * np.eye(frames + 2)])
    free = np.linalg.lstsq(rows[:, ~fixed], -rows[:, fixed] @ known[fixed], rcond=None)[0]
    known[~fixed] = free
    return known[1:-1]


def test_the_field_is_the_smoothest_of_each_leg() -> None:
    draw = np.random.default_rng(0)
    values = draw.normal(size=(4, SWING_FRAMES, 3))
    held = np.zeros((4, SWING_FRAMES), dtype=bool)
    held[0, 10:20] = held[1, 1:4] = held[1, 30:39] = held[3] = True
    field = smooth_field(values, held, 6.0)
    for leg in range(4):
        np.testing.assert_allclose(field[leg], smoothest(values[leg], held[leg], 6.0), atol=1e-9)
    np.testing.assert_array_equal(field[:, [0, -1]], 0.0)
    np.testing.assert_array_equal(field[2], 0.0)


def dragging(way: float, height: float = 0.005) -> tuple[ndarray, ndarray]:
    """A toe that is dragged along the floor between two stances of ten frames, and where it stands."""
    toe = np.zeros((1, SWING_FRAMES, 3))
    share = np.clip((np.arange(SWING_FRAMES) - 9) / 21.0, 0.0, 1.0)
    toe[0, :, 0], toe[0, :, 1] = way * share**2 * (3.0 - 2.0 * share), height
    held = np.zeros((1, SWING_FRAMES), dtype=bool)
    held[0, :10] = held[0, 30:] = True
    return toe, held


def test_a_toe_that_drags_is_lifted_over_the_floor_and_higher_on_a_long_step() -> None:
    toe, held = dragging(0.1)
    heights = lifted(toe, held, FOOT_DEFAULTS)[0]
    np.testing.assert_array_equal(heights[held[0]], 0.005)
    assert np.all(heights[12:28] >= FOOT_DEFAULTS.clear)
    far, _ = dragging(1.0)
    assert lifted(far, held, FOOT_DEFAULTS)[0].max() > heights.max() + 0.02
    assert np.abs(np.diff(lifted(far, held, FOOT_DEFAULTS)[0])).max() < 0.02


def test_a_toe_that_is_clear_of_the_floor_keeps_its_height() -> None:
    toe, held = dragging(0.8)
    toe[0, :, 1] += 0.1 * np.sin(np.pi * np.clip((np.arange(SWING_FRAMES) - 9) / 21.0, 0.0, 1.0))
    heights = lifted(toe, held, FOOT_DEFAULTS)[0]
    np.testing.assert_array_equal(heights[13:27], toe[0, 13:27, 1])


def test_a_foot_on_a_box_is_not_lifted() -> None:
    toe, held = dragging(0.3, height=0.4)
    np.testing.assert_array_equal(lifted(toe, held, FOOT_DEFAULTS), toe[..., 1])


@pytest.mark.parametrize("depth", [0.0, -0.02, -0.1])
def test_beside_a_key_that_swings_a_toe_rises_slowly(depth: float) -> None:
    toe, held = dragging(0.5, height=depth)
    held[:, :10] = False
    heights = lifted(toe, held, FOOT_DEFAULTS)[0]
    assert heights[0] == depth
    assert heights[1] - heights[0] < 0.008
    assert np.abs(np.diff(heights, n=2))[:8].max() < 0.01
    assert heights[12:26].min() > min(depth + FOOT_DEFAULTS.clear, FOOT_DEFAULTS.clear) - 1e-9


def test_the_heel_goes_before_the_toe_and_keeps_to_the_keys() -> None:
    toe, held = dragging(0.5)
    lift = lifted(toe, held, FOOT_DEFAULTS) - toe[..., 1]
    rise = heel_lift(lift)
    moves = np.flatnonzero(lift[0] > 1e-6)
    rises = np.flatnonzero(rise[0] > 1e-6)
    assert rises[0] < moves[0]
    assert rises[-1] == moves[-1]
    early, late = (
        rise[0, moves[:3]].sum() / lift[0, moves[:3]].sum(),
        rise[0, moves[-3:]].sum() / lift[0, moves[-3:]].sum(),
    )
    assert early > 1.0 > late
    at_once = heel_lift(np.full((1, SWING_FRAMES), 0.03))
    np.testing.assert_array_equal(at_once[:, [0, -1]], 0.0)
    assert np.abs(np.diff(at_once[0], n=2)).max() < 0.02
