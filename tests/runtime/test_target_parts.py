"""Targets given in part: met in that part on any rig, whole and plausible in the rest. The network is a stand-in."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from learning import march

from interpose import features, parts, retarget, rotation
from interpose.errors import InputError
from interpose.runtime import inbetween, target_parts
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID, Skeleton

CLIP = march(60, 1.0, 0.3)
GIVEN = ["hips", "hands", "left-foot", "feet", "head", "upper", "lower", "ground", "ground,left-hand", "LeftLeg,Spine1"]


def rig():
    """Other proportions, a joint above the hips, a finger and an eye that no model knows."""
    names = ("World", *HUMANOID.names, "LeftFinger", "Eye")
    above = (-1, *(p + 1 for p in HUMANOID.parents), 1 + HUMANOID.index("LeftHand"), 1 + HUMANOID.index("Head"))
    offsets = np.concatenate([np.zeros((1, 3)), HUMANOID.offsets, [[0.1, 0.0, 0.0], [0.0, 0.05, 0.08]]])
    offsets[1:] *= 1.3
    offsets[[1 + HUMANOID.index(n) for n in ("LeftForeArm", "RightForeArm", "Neck")]] *= 0.8
    return Skeleton(names, above, offsets)


def on_rig(motion, seed=0):
    """The motion on that rig, finger and eye turned by chance."""
    skeleton = rig()
    mapping = retarget.map_skeleton(skeleton)
    made = retarget.from_humanoid(motion, mapping)
    local = made.local_rotations.copy()
    local[:, -2:] = rotation.from_rotation_vector(np.random.default_rng(seed).normal(size=(len(made), 2, 3)))
    return replace(made, local_rotations=local), mapping


@pytest.fixture
def completing(monkeypatch):
    """A request to a model whose completion says the start pose at the given place, knees bent and both feet down."""
    heard = []

    def run(self, name, feed):
        assert name == "target"
        shapes = features.target_shapes(len(self.styles), 3)
        assert {k: v.shape[1:] for k, v in feed.items()} == shapes
        assert all(v.dtype == np.float32 for v in feed.values())
        heard.append(feed)
        hips = feed["start_hips"] + feed["noise"] * np.float32(0.05) - np.array([0, 0.05, 0], np.float32)
        hips[:, ::2] = feed["target_hips"][:, ::2]
        return {"hips": hips, "rotations": feed["start_rotations"], "contacts": np.ones((len(hips), 4), np.float32)}

    monkeypatch.setattr(Session, "run", run)
    info = {"name": "stand-in", "method": "dcmoe", "styles": ["Old"], "target": {"latent": 3}}
    return Request("dcmoe", Session(Path("nowhere"), info)), heard


@pytest.mark.parametrize("text", GIVEN)
@pytest.mark.parametrize("other", [False, True], ids=["humanoid", "rig"])
def test_what_is_given_is_met(completing, text, other):
    clip, mapping = on_rig(CLIP) if other else (CLIP, retarget.map_skeleton(CLIP))
    given = parts.parse(text)
    (end,) = target_parts.complete(clip[:10], clip[40], given, completing[0], mapping, 30)
    assert end.note is None
    far, turned = target_parts.missed(end.pose, clip[40], given, mapping)
    assert far < 1e-6
    assert turned < 1e-4
    far, turned = target_parts.missed(clip[10], clip[40], given, mapping)
    assert far > 0.01 or turned > 1.0


def test_the_network_is_told_what_is_known(completing):
    request, heard = completing
    request = replace(request, style="Old", style_strength=1.5)
    given = parts.parse("left-hand,ground")
    fast = replace(CLIP, rate=60.0)
    ends = target_parts.complete(fast[:10], fast[40], given, request, retarget.map_skeleton(fast), 30, 3)
    (feed,) = heard
    np.testing.assert_array_equal(feed["joints"], np.tile(given.known, (3, 1)))
    np.testing.assert_array_equal(feed["ground"], np.ones((3, 1)))
    np.testing.assert_array_equal(feed["frames"], np.full((3, 1), 30.0))
    np.testing.assert_array_equal(feed["style"], [[-0.5, 1.5]] * 3)
    at = CLIP.global_positions()
    np.testing.assert_allclose(feed["start_velocities"][0], (at[9] - at[7]) * 30.0, atol=1e-4)
    assert not feed["noise"][0].any()
    assert len({tuple(row) for row in feed["noise"]}) == 3
    assert len({tuple(end.pose.root_positions[0]) for end in ends}) == 3
    again = target_parts.complete(fast[:10], fast[40], given, request, retarget.map_skeleton(fast), None)
    np.testing.assert_array_equal(again[0].pose.root_positions, ends[0].pose.root_positions)
    assert 15 <= heard[1]["frames"][0, 0] <= 90


def test_feet_that_stand_are_on_the_floor(completing):
    pose = replace(CLIP[30], root_positions=CLIP[30].root_positions - [0.0, 0.04, 0.0])
    (end,) = target_parts.complete(pose, pose, parts.parse("head"), completing[0], retarget.map_skeleton(CLIP), 30)
    feet = end.pose.global_positions()[0, [HUMANOID.index(n) for n in ("LeftFoot", "LeftToe", "RightFoot", "RightToe")]]
    np.testing.assert_allclose(feet[:, 1], [0.075, 0.015, 0.075, 0.015], atol=1e-6)


def test_fingers_follow_the_hand_that_is_given(completing):
    clip, mapping = on_rig(CLIP)
    (end,) = target_parts.complete(clip[9], clip[40], parts.parse("left-hand"), completing[0], mapping, 30)
    np.testing.assert_allclose(end.pose.local_rotations[0, -2], clip[40].local_rotations[0, -2], atol=1e-9)
    np.testing.assert_allclose(end.pose.local_rotations[0, -1], clip[9].local_rotations[0, -1], atol=1e-9)


@pytest.mark.parametrize("text", GIVEN)
def test_without_a_network_the_start_pose_is_carried_along(text):
    given, mapping = parts.parse(text), retarget.map_skeleton(CLIP)
    (end,) = target_parts.complete(CLIP[9], CLIP[40], given, Request("interp"), mapping, 30)
    assert end.note == "method 'interp' completes no partial targets; the rest of the target is as in the start pose"
    assert max(target_parts.missed(end.pose, CLIP[40], given, mapping)) < 1e-4


def test_what_cannot_be_reached_is_told():
    wide = CLIP.global_positions()[0]
    hands = [HUMANOID.index("LeftHand"), HUMANOID.index("RightHand")]
    assert np.linalg.norm(wide[hands[0]] - wide[hands[1]]) < 2.0
    stretched = replace(CLIP[40], translations=np.repeat(HUMANOID.offsets[None] * 2.0, 1, axis=0))
    stretched.translations[:, 0] = CLIP[40].root_positions
    start = replace(CLIP[9], translations=np.repeat(HUMANOID.offsets[None], 1, axis=0))
    start.translations[:, 0] = CLIP[9].root_positions
    (end,) = target_parts.complete(
        start, stretched, parts.parse("hips,head"), Request("interp"), retarget.map_skeleton(CLIP), 30
    )
    assert "the target's given part cannot be reached by" in end.note


def test_a_candidate_leads_to_a_whole_pose_with_the_given_part():
    request = Request("interp", parts=parts.parse("hips"))
    (made,) = inbetween.inbetween(CLIP[5], CLIP[45], 20, request)
    assert (made.info.target_joints, made.info.method) == ("Hips", "interp")
    assert made.info.arrival_position_error_m == 0.0
    assert "completes no partial targets" in made.info.fallback
    np.testing.assert_allclose(made.target.root_positions, CLIP[45].root_positions, atol=1e-9)
    assert len(made.motion) == 20
    legs = made.target.local_rotations[0, 1:9] - CLIP[45].local_rotations[0, 1:9]
    assert np.abs(legs).max() > 0.05
    (whole,) = inbetween.inbetween(CLIP[5], CLIP[45], 20, replace(request, parts=parts.parse("upper,lower")))
    assert whole.target is None


def test_what_cannot_be_served_is_refused():
    with pytest.raises(InputError, match="kept whole"):
        inbetween.fill(CLIP, (0, 20), Request("interp", parts=parts.parse("hips")))
    with pytest.raises(InputError, match="on a humanoid only: no legs; give all of it"):
        target_parts.complete(CLIP[0], CLIP[9], parts.parse("hips"), Request("interp"), "no legs", None)
    bad = replace(CLIP[9], root_positions=np.full((1, 3), np.nan))
    with pytest.raises(InputError, match="not finite"):
        inbetween.inbetween(CLIP[0], bad, 20, Request("interp", parts=parts.parse("hips")))
    mapping = retarget.map_skeleton(CLIP)
    short = replace(mapping, joints=(*mapping.joints[:21], None))
    with pytest.raises(InputError, match="no joint that stands for RightHand"):
        target_parts.complete(CLIP[0], CLIP[9], parts.parse("right-hand"), Request("interp"), short, None)
