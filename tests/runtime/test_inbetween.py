"""One gap and all gaps of a clip, on rigs of several kinds and rates. The model is a stand-in with a known answer."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose import retarget, rotation
from interpose.drawn_path.path_file import of_points
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.runtime.backends.dcmoe import DCMoEBackend, initial_phases
from interpose.runtime.gap_batch import Generated, draws
from interpose.runtime.inbetween import fill, inbetween, mapping_of
from interpose.runtime.model_folder import Session
from interpose.runtime.ranking import TOES, foot_slide, judge
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID, Skeleton

RATES = [24.0, 25.0, 30000 / 1001, 30.0, 50.0, 60.0, 120.0]


def stand_in(method="dcmoe"):
    """A session whose network is never made: the roll-out is replaced."""
    info = {"name": "stand-in", "method": method, "styles": ["Angry", "Old"]}
    return Session(Path("nowhere"), info)


def walk(frames, rate, skeleton=HUMANOID, height=0.93):
    """A smooth motion with its toes near the floor, on the humanoid or a rig that has its joints."""
    times = np.arange(frames) / rate
    root = np.stack([0.1 * np.sin(times), height + 0.02 * np.cos(6.0 * times), 1.3 * times], axis=-1)
    axes = np.random.default_rng(3).normal(size=(len(skeleton), 3))
    angles = 0.25 * np.sin(5.0 * times[:, None] + np.arange(len(skeleton)))
    axes[[name == "World" for name in skeleton.names]] = 0.0
    for name, axis in (("Leg", [1.0, 0.0, 0.0]), ("ForeArm", [0.0, 1.0, 0.0])):  # these bend one way
        for side, sign in (("Left", -1.0), ("Right", 1.0)):
            if side + name not in skeleton.names:
                continue
            joint = skeleton.names.index(side + name)
            axes[joint] = np.array(axis) * (sign if name == "ForeArm" else 1.0)
            angles[:, joint] += 0.4
    return Motion(skeleton, root, rotation.from_rotation_vector(angles[..., None] * axes), rate)


def fingered():
    """The humanoid with a finger and a prop above the hips: joints that no model knows."""
    names = ("World", *HUMANOID.names, "LeftFinger")
    parents = (-1, *(p + 1 for p in HUMANOID.parents), HUMANOID.index("LeftHand") + 1)
    offsets = np.concatenate([np.zeros((1, 3)), HUMANOID.offsets, [[0.1, 0.0, 0.0]]])
    return Skeleton(names, parents, offsets)


@pytest.fixture
def served(monkeypatch):
    """Requests that the stand-in got: SLERP and a straight line, lifted in the middle by 10 cm for each variant."""
    asked = []

    def generate(self, model, batch):
        (frames,) = set(batch.frames)
        (root, local), (goal_root, goal_local) = ((x[:, None] for x in key) for key in batch.keys)
        asked.append(
            {"context": batch.context_root.shape[1], "frames": frames, "styles": batch.styles, "draws": batch.draws}
        )
        assert (batch.paths, batch.path_control, batch.style_strength) == ((None,) * len(batch), 1.0, 1.0)
        t = (np.arange(1, frames + 1) / (frames + 1))[:, None]
        lift = np.sin(np.pi * t) * np.array([0.0, 0.1, 0.0]) * np.arange(len(batch))[:, None, None]
        return Generated(
            (1 - t) * root + t * goal_root + lift,
            rotation.slerp(local, goal_local, t),
            np.zeros((len(batch), frames, 4)),
        )

    monkeypatch.setattr(DCMoEBackend, "generate", generate)
    return asked


MODEL = Request("dcmoe", stand_in())


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("frames", [1, 3, 44, 450])
def test_a_gap_gets_its_frames_at_the_users_rate(served, rate, frames):
    clip = walk(frames + 2, rate)
    (candidate,) = inbetween(clip[0], clip[-1], frames, MODEL)
    assert len(candidate.motion) == frames
    assert candidate.motion.rate == rate
    assert candidate.motion.skeleton == clip.skeleton
    assert candidate.info.arrival_position_error_m < 1e-8
    assert candidate.info.arrival_rotation_error_deg < 1e-5
    lasts = (frames + 1) / rate
    if lasts * 30.0 < 1.5:
        assert candidate.info.fallback == "the gap is shorter than two of the model's frames (1/15 s)"
        assert candidate.info.method == "interp"
    else:
        assert candidate.info.fallback is None
        assert served[-1]["frames"] == round(lasts * 30.0) - 1 or lasts * 30.0 % 1 == 0.5


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("skeleton", [HUMANOID, fingered()], ids=["humanoid", "fingered"])
def test_the_models_motion_comes_back_on_the_rig(served, rate, skeleton):
    frames = 37
    clip = walk(frames + 2, rate, skeleton, height=1.5)  # off the floor, where no foot is moved
    (made,) = inbetween(clip[0], clip[-1], frames, MODEL)
    (straight,) = inbetween(clip[0], clip[-1], frames, Request("interp"))
    apart = np.linalg.norm(made.motion.global_positions() - straight.motion.global_positions(), axis=-1)
    assert apart.max() < 0.005  # the stand-in interpolates too, but on another skeleton and at another rate


def test_unmapped_joints_are_interpolated(served):
    clip = walk(32, 60.0, fingered())
    finger = clip.skeleton.index("LeftFinger")
    (made,) = inbetween(clip[0], clip[-1], 30, MODEL)
    (straight,) = inbetween(clip[0], clip[-1], 30, Request("interp"))
    turn = rotation.multiply(
        rotation.inverse(made.motion.local_rotations[:, finger]), straight.motion.local_rotations[:, finger]
    )
    assert np.degrees(rotation.angle(turn).max()) < 1e-4


def test_the_best_candidate_comes_first(served):
    clip = walk(62, 60.0)
    candidates = inbetween(clip[0], clip[-1], 60, MODEL, variants=4)
    heights = [c.motion.root_positions[30, 1] for c in candidates]
    steps = [np.linalg.norm(np.diff(c.motion.root_positions, axis=0), axis=-1).max() for c in candidates]
    assert len({round(h, 6) for h in heights}) == 4
    costs = [judge([clip[0]], [c.motion], clip[-1], mapping_of(clip))[1][0] for c in candidates]
    assert costs == sorted(costs)
    assert max(steps) < 0.1


def test_the_model_sees_where_the_motion_comes_from(served):
    clip = walk(200, 60.0)
    inbetween(clip[0], clip[100], 60, MODEL)
    inbetween(clip[:3], clip[100], 60, MODEL)
    inbetween(clip[:50], clip[100], 60, MODEL)
    assert [asked["context"] for asked in served] == [1, 2, 10]


def test_style_and_seed_reach_the_model(served):
    clip = walk(40, 30.0)
    (made,) = inbetween(clip[0], clip[-1], 38, Request("dcmoe", stand_in(), "Old", seed=5))
    assert served == [{"context": 1, "frames": 38, "styles": ("Old",), "draws": ((5, 0),)}]
    assert (made.info.style, made.info.seed, made.info.path) == ("Old", 5, "auto")


@pytest.mark.parametrize("rate", [24.0, 30.0, 60.0])
def test_fill_keeps_keys_and_what_lies_outside_them(served, rate):
    clip = walk(150, rate)
    keys = (10, 40, 41, 42, 100, 120)
    filled = fill(clip, keys, MODEL, variants=2)
    assert len(filled) == 2
    for one in filled:
        kept = [*range(11), *keys, *range(120, 150)]
        np.testing.assert_array_equal(one.motion.root_positions[kept], clip.root_positions[kept])
        np.testing.assert_array_equal(one.motion.local_rotations[kept], clip.local_rotations[kept])
        assert [(g.start, g.target, g.frames) for g in one.gaps] == [(10, 40, 29), (42, 100, 57), (100, 120, 19)]
        assert len(one.motion) == 150
    assert not np.array_equal(filled[0].motion.root_positions[60], filled[1].motion.root_positions[60])


def test_fill_leaves_the_clip_alone_and_shows_each_gap_what_came_before(served):
    clip = walk(150, 30.0)
    before = clip.root_positions.copy(), clip.local_rotations.copy()
    fill(clip, (0, 2, 30, 31, 32, 60), MODEL)
    np.testing.assert_array_equal(clip.root_positions, before[0])
    np.testing.assert_array_equal(clip.local_rotations, before[1])
    assert [asked["context"] for asked in served] == [1, 3, 10]


@pytest.mark.parametrize("keys", [(0, 45, 90, 135), (0, *range(40, 50), *range(90, 100), 149)])
@pytest.mark.parametrize("rate", [25.0, 30.0, 60.0])
def test_keys_do_not_pop(served, rate, keys):
    """Interpolation turns a corner at every key; on the same roll-out the filled clip goes through them smoothly."""
    clip = walk(150, rate)

    def bend(motion):
        positions = motion.global_positions()
        acceleration = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=-1).mean(axis=-1) * rate**2
        return acceleration[[k - 1 for k in keys[1:-1]]].max()

    (smooth,), (cornered,) = fill(clip, keys, MODEL), fill(clip, keys, Request("interp"))
    assert bend(smooth.motion) < 0.35 * bend(cornered.motion)


def test_fill_keeps_animated_joint_positions(served):
    rig = fingered()
    clip = walk(40, 30.0, rig)
    moved = np.repeat(rig.offsets[None], 40, axis=0)
    moved[:, 0] = clip.root_positions
    moved[:, -1, 0] = np.linspace(0.1, 0.3, 40)
    moved[5, -1, 0] = 0.7
    (filled,) = fill(replace(clip, translations=moved), (0, 39), MODEL)
    assert filled.motion.translations is not None
    np.testing.assert_allclose(filled.motion.translations[:, -1, 0], np.linspace(0.1, 0.3, 40), atol=1e-9)


def test_a_rig_that_is_no_humanoid_is_interpolated_and_told_why(served):
    arm = Skeleton(("base", "elbow", "tip"), (-1, 0, 1), np.array([[0.0, 0, 0], [0, 1, 0], [0, 1, 0]]))
    clip = walk(20, 30.0, arm)
    (made,) = inbetween(clip[0], clip[-1], 18, MODEL)
    assert made.info.method == "interp"
    assert made.info.fallback is not None
    assert "no humanoid" in made.info.fallback
    assert made.info.foot_slide_cm_per_frame is None
    assert served == []
    (plain,) = inbetween(clip[0], clip[-1], 18, Request("interp"))
    assert plain.info.fallback is None
    np.testing.assert_array_equal(plain.motion.local_rotations, made.motion.local_rotations)


def test_a_gap_too_long_for_the_model_is_interpolated(served):
    clip = walk(2, 30.0)
    (made,) = inbetween(clip[0], clip[-1], 601, MODEL)
    assert made.info.fallback == "the gap is longer than 20 s, the most for method 'dcmoe'"
    assert len(made.motion) == 601


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: fill(walk(9, 30.0), (0, 8), replace(MODEL, speed="fast")), "needs --retime"),
        (lambda: inbetween(walk(1, 30.0), walk(1, 30.0), 5, replace(MODEL, speed="fast")), "give one of them"),
        (lambda: inbetween(walk(1, 30.0), walk(1, 30.0), None, MODEL), "give a number of frames"),
        (lambda: fill(walk(9, 30.0), (0, 1, 2), Request("interp")), "leave no frame to fill"),
        (lambda: inbetween(walk(1, 30.0), walk(1, 30.0), 0, Request("interp")), "got 0"),
        (lambda: inbetween(walk(1, 30.0), walk(1, 30.0, fingered()), 5, Request("interp")), "share one skeleton"),
    ],
)
def test_what_cannot_be_had_is_refused(ask, said):
    with pytest.raises(InputError, match=said):
        ask()


def test_feet_in_contact_stay_where_they_are(served, monkeypatch):
    bent = np.zeros((22, 3))
    for name, degrees in (("UpLeg", -30.0), ("Leg", 60.0), ("Foot", -30.0)):
        bent[[HUMANOID.index(side + name) for side in ("Left", "Right")], 0] = np.radians(degrees)
    pose = Motion(HUMANOID, np.array([[0.0, 0.83, 0.0]]), rotation.from_rotation_vector(bent)[None], 60.0)

    def sway(down):
        straight = DCMoEBackend.generate

        def generate(self, model, batch):
            made = straight(self, model, batch)
            made.root[..., 0] += 0.06 * np.sin(np.linspace(0.0, 2.0 * np.pi, made.root.shape[1]))
            return replace(made, contacts=np.full_like(made.contacts, down))

        with monkeypatch.context() as patch:
            patch.setattr(DCMoEBackend, "generate", generate)
            (made,) = inbetween(pose, pose, 60, MODEL)
        return np.ptp(made.motion.global_positions()[:, TOES], axis=0).max()

    assert sway(down=0.0) > 0.1
    assert sway(down=1.0) < 0.01


def test_foot_slide_is_the_weighted_travel_of_low_toes():
    toes = np.zeros((3, 2, 3))
    toes[:, 0, 0] = [0.0, 0.01, 0.02]  # on the floor, 1 cm a frame
    toes[:, 1, 1] = 0.1  # in the air
    assert foot_slide(toes, 30.0) == pytest.approx(1.0)
    assert foot_slide(toes, 60.0) == pytest.approx(2.0)
    toes[:, 0, 1] = 0.0125
    assert foot_slide(toes, 30.0) == pytest.approx(2.0 - 2.0**0.5)
    toes[:, 0, 1] = 0.2
    assert foot_slide(toes, 30.0) == 0.0


def test_the_mapping_can_be_found_once_for_a_clip(served, monkeypatch):
    clip = walk(80, 30.0)
    mapping = retarget.map_skeleton(clip)
    monkeypatch.setattr(retarget, "map_skeleton", lambda motion: pytest.fail("the mapping was found again"))
    (made,) = inbetween(clip[0], clip[40], 39, MODEL, mapping=mapping)
    assert made.info.fallback is None


def test_variants_of_a_free_style_take_each_style_in_turn(served):
    clip = walk(32, 30.0)
    made = inbetween(clip[0], clip[-1], 30, MODEL, variants=3)
    assert {c.info.style for c in made} == {None, "Angry", "Old"}
    asked = inbetween(clip[0], clip[-1], 30, replace(MODEL, style="Old"), variants=2)
    assert [c.info.style for c in asked] == ["Old", "Old"]


def test_a_root_that_does_not_keep_to_its_path_is_told_of(served, monkeypatch):
    clip = walk(62, 30.0)
    given = DCMoEBackend.generate

    def deaf(self, model, batch):
        assert batch.paths[0].shape == (62, 3)
        return given(self, model, replace(batch, paths=(None,)))

    monkeypatch.setattr(DCMoEBackend, "generate", deaf)
    for aside, told in ((0.05, False), (2.0, True)):
        beside = clip.root_positions[30, ::2] + np.array([aside, 0.0])
        request = replace(MODEL, path="drawn", drawn=of_points([beside]))
        (made,) = inbetween(clip[0], clip[-1], 60, request)
        assert made.info.trajectory == "drawn"
        assert (made.info.path_deviation_m > 0.25) == told
        assert any("the root strays" in warning for warning in made.info.warnings) == told


def test_no_two_variants_begin_in_the_same_phases(tmp_path):
    bank = np.random.default_rng(0).normal(size=(12, 13, 10, 2))
    np.save(tmp_path / "phases.npy", bank)
    session = Session(tmp_path, {})

    def drawn(count: int, seed: int) -> list[int]:
        """Which window each row has; -1 for unknown phases."""
        phases = initial_phases(session, draws(seed, count))
        assert all(not row.any() or (row == bank).all(axis=(1, 2, 3)).any() for row in phases)
        return [int(np.argmax((row == bank).all(axis=(1, 2, 3)))) if row.any() else -1 for row in phases]

    assert drawn(13, 0)[0] == -1
    assert sorted(drawn(13, 0)) == list(range(-1, 12))
    assert sorted(drawn(12, 7)) == list(range(12))
    assert drawn(12, 7) != drawn(12, 8)
    for seed in (0, 7):
        assert drawn(3, seed) == drawn(12, seed)[:3]
    assert not initial_phases(session, [None] * 3).any()
