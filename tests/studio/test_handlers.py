"""What the studio answers, by the models that ship."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy import ndarray
from studio_rigs import moved, opened, question, walk

from interpose.errors import InputError
from interpose.motion import Motion, concatenate
from interpose.studio import handlers, messages, pose_rows
from interpose.studio.methods import Offer
from interpose.studio.project_format import Blend, GapSettings, PathChoice, PointPath
from interpose.studio.protocol import (
    CLIENT_MESSAGE,
    Candidates,
    GalleryPaths,
    Generate,
    LibraryPoses,
    MirroredPose,
    ServerMessage,
    SuggestedDurations,
)
from interpose.studio.rigs import Clip, RigStore, UnknownRig

FRAMES = 30
SETTINGS = {"method": "dcmoe"}


def ends(clip: Clip, start: int = 1, target: int = 2) -> dict[str, ndarray]:
    """Two of the clip's frames as the keys of a gap."""
    whole = pose_rows.of_motion(clip.motion)
    return {"start": whole[start : start + 1], "target": whole[target : target + 1]}


def ask(models: Offer, clip: Clip, kind: str, arrays: dict[str, ndarray], **fields: Any) -> tuple[ServerMessage, Any]:
    """The answer, as the browser gets it: through both envelopes."""
    store = RigStore()
    store._kept[clip.id] = clip
    header, given = messages.unpack(question(kind, clip.id, arrays, **fields), CLIENT_MESSAGE)
    told, made = handlers.answer(header, given, store, models)
    messages.pack(told, made)
    return told, made


def generate(models: Offer, clip: Clip, arrays: dict[str, ndarray] | None = None, **fields: Any):
    outer = {name: fields.pop(name) for name in ("frames", "live") if name in fields}
    given = {"gap": "g", "frames": FRAMES, "settings": {"method": "dcmoe", "variants": 1, **fields}} | outer
    told, made = ask(models, clip, "generate", ends(clip) if arrays is None else arrays, **given)
    assert isinstance(told, Candidates)
    assert (told.id, told.gap) == (1, "g")
    assert made["frames"].shape == (len(told.infos), given["frames"], pose_rows.width(clip.motion))
    assert np.isfinite(made["frames"]).all()
    return told, made["frames"]


def whole(clip: Clip, frames: ndarray, arrays: dict[str, ndarray]) -> Motion:
    """A candidate between its keys."""
    parts = [arrays["start"], frames, arrays["target"]]
    return concatenate(*(pose_rows.to_motion(part, clip.motion, "it") for part in parts))


@pytest.mark.parametrize("method", ["dcmoe", "stitch", "interp"])
def test_a_gap_is_filled_and_both_keys_are_met_smoothly(models: Offer, clip: Clip, method: str) -> None:
    told, frames = generate(models, clip, method=method)
    (info,) = told.infos
    assert info.method == method
    assert info.fallback is None
    assert (info.trajectory is None) == (method == "interp")
    assert info.foot_slide is not None
    assert told.seconds >= 0.0
    step = np.linalg.norm(np.diff(whole(clip, frames[0], ends(clip)).global_positions(), axis=0), axis=-1)
    assert step[[0, -1]].max() < 0.1
    assert step.max() < 0.2


@pytest.mark.parametrize("method", ["dcmoe", "stitch"])
def test_variants_are_several_and_differ_and_live_is_one(models: Offer, clip: Clip, method: str) -> None:
    told, frames = generate(models, clip, method=method, variants=3)
    assert len(told.infos) == 3
    assert not told.live
    for one, other in ((0, 1), (0, 2), (1, 2)):
        assert np.abs(frames[one] - frames[other]).max() > 0.01
    told, _ = generate(models, clip, method=method, variants=3, live=True)
    assert told.live
    assert len(told.infos) == 1


@pytest.mark.parametrize("method", ["dcmoe", "stitch"])
def test_a_seed_gives_the_same_again_and_another_does_not(models: Offer, clip: Clip, method: str) -> None:
    _, frames = generate(models, clip, method=method, variants=2, seed=5)
    _, again = generate(models, clip, method=method, variants=2, seed=5)
    np.testing.assert_array_equal(frames, again)
    _, other = generate(models, clip, method=method, variants=2, seed=6)
    assert np.abs(frames - other).max() > 1e-3


def test_interpolation_is_one_candidate(models: Offer, clip: Clip) -> None:
    told, frames = generate(models, clip, method="interp", variants=4)
    assert len(told.infos) == 1
    before, after = ends(clip)["start"][0], ends(clip)["target"][0]
    np.testing.assert_allclose(frames[0, :, 2], np.linspace(before[2], after[2], FRAMES + 2)[1:-1], atol=1e-5)


def test_what_had_to_be_interpolated_comes_once_and_says_why(models: Offer, clip: Clip) -> None:
    told, _ = generate(models, clip, frames=700, variants=3)
    (info,) = told.infos
    assert info.method == "interp"
    assert info.fallback is not None
    assert "longer than 20 s" in info.fallback


def test_style_and_blend_reach_the_model(models: Offer, clip: Clip) -> None:
    made = [
        generate(models, clip, live=True, **fields)
        for fields in (
            {"style": "Angry"},
            {"style": "Aeroplane"},
            {"style": "Angry", "blend": {"style": "Aeroplane", "share": 0.5}},
            {"style": "Angry", "blend": {"style": "Aeroplane", "share": 1.0}},
            {"style": "Angry", "blend": {"style": "Aeroplane", "share": 0.0}},
        )
    ]
    frames = [one for _, one in made]
    assert np.abs(frames[0] - frames[1]).max() > 0.05
    assert np.abs(frames[2] - frames[0]).max() > 0.02
    assert np.abs(frames[2] - frames[1]).max() > 0.02
    np.testing.assert_array_equal(frames[3], frames[1])
    np.testing.assert_array_equal(frames[4], frames[0])
    assert made[1][0].infos[0].style == "Aeroplane"


@pytest.mark.parametrize(
    ("style", "blend", "expected"),
    [
        (None, None, None),
        ("A", None, "A"),
        ("A", ("B", 0.3), "A:0.7+B:0.3"),
        ("A", ("B", 0.12344), "A:0.8766+B:0.1234"),
        ("A", ("B", 0.0), "A"),
        (None, ("B", 0.0), None),
        ("A", ("B", 1.0), "B"),
        ("A", ("A", 0.4), "A"),
    ],
)
def test_a_blend_is_spelled_as_requests_have_it(style: str | None, blend: Any, expected: str | None) -> None:
    held = None if blend is None else Blend(style=blend[0], share=blend[1])
    assert handlers.style_of(GapSettings(method="dcmoe", style=style, blend=held)) == expected


def test_a_share_needs_a_style(models: Offer, clip: Clip) -> None:
    with pytest.raises(InputError, match="a blend with style 'Angry' needs a first style"):
        generate(models, clip, blend={"style": "Angry", "share": 0.3})


@pytest.mark.parametrize("style", ["Nonsense", "A:0", "+", ":", "Angry+Angry", "A:nan"])
def test_a_style_that_is_none_is_told(models: Offer, clip: Clip, style: str) -> None:
    with pytest.raises(InputError, match="style"):
        generate(models, clip, style=style)


CURVE = [[0.0, 0.5], [0.5, 0.6], [0.6, 1.0], [0.1, 1.2]]


def through(points: Any, **fields: Any) -> dict[str, Any]:
    return {"kind": "waypoints", "points": points, **fields}


def test_a_drawn_line_is_followed(models: Offer, clip: Clip) -> None:
    told, frames = generate(models, clip, frames=60, path=through(CURVE))
    assert told.infos[0].trajectory == "drawn"
    assert told.infos[0].path_deviation is not None
    assert told.infos[0].path_deviation < 0.1
    root = frames[0][:, [0, 2]]
    for point in CURVE:
        assert np.linalg.norm(root - point, axis=-1).min() < 0.12
    _, straight = generate(models, clip, frames=60, path={"kind": "straight"})
    assert np.linalg.norm(straight[0][:, [0, 2]] - CURVE[1], axis=-1).min() > 0.25


def test_points_that_repeat_are_one(models: Offer, clip: Clip) -> None:
    times = [0.0, 0.1, 0.7, 0.8, 1.4, 2.0]
    twice = [CURVE[0], CURVE[0], CURVE[1], [CURVE[1][0] + 1e-7, CURVE[1][1]], CURVE[2], CURVE[3]]
    _, one = generate(models, clip, live=True, path=through(twice))
    _, other = generate(models, clip, live=True, path=through(CURVE))
    np.testing.assert_allclose(one, other, atol=1e-5)
    _, one = generate(models, clip, frames=60, live=True, path=through(twice, times=times))
    _, other = generate(models, clip, frames=60, live=True, path=through(CURVE, times=[0.0, 0.7, 1.4, 2.0]))
    np.testing.assert_allclose(one, other, atol=1e-5)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"times": [0.0, 1.0]}, "times has 2 entries for 4 points"),
        ({"facing": [0.0]}, "facing has 1 entries for 4 points"),
        ({"times": [0.0, 2.0, 1.0, 3.0]}, "not after 2 before it"),
        ({"points": [[0.0, 0.5], [2e4, 0.0]]}, "give a number of 10000 at most"),
    ],
)
def test_a_line_that_cannot_be_is_told(models: Offer, clip: Clip, fields: Any, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        generate(models, clip, path={**through(CURVE), **fields})


def test_facing_is_asked_in_radians(models: Offer, clip: Clip) -> None:
    sideways = through([[0.0, 0.5], [0.05, 0.85], [0.1, 1.2]], facing=[0.0, 1.5, 0.2])
    _, frames = generate(models, clip, frames=60, live=True, path=sideways)
    hips = frames[0][:, 3:7]
    yaw = 2.0 * np.arctan2(hips[:, 1], hips[:, 3])
    assert np.abs(np.angle(np.exp(1j * yaw))).max() > 0.8


def test_ways_asked_for_again_as_lines_lead_the_same_way(models: Offer, clip: Clip) -> None:
    told, _ = ask(models, clip, "paths", ends(clip, 0, 3), frames=60, count=4, settings=SETTINGS)
    assert isinstance(told, GalleryPaths)
    assert told.reason is None
    assert 2 <= len(told.paths) <= 4
    for way in told.paths:
        assert not way.path.drawn
        assert len(way.path.points) <= 40
        assert 0.0 < way.fit <= 1.0
        assert way.frames >= 1
        assert way.path.times is not None
        assert way.path.times[0] == 0.0
        assert way.path.times[-1] == pytest.approx(61 / 30, abs=1e-3)
        assert np.diff(way.path.times).min() > 0.0
        header, frames = generate(models, clip, ends(clip, 0, 3), frames=60, path=way.path.model_dump())
        assert header.infos[0].path_deviation < 0.15
        root = frames[0][:, [0, 2]]
        points, times = np.array(way.path.points), np.array(way.path.times)
        expected = np.stack([np.interp(np.arange(1, 61) / 30, times, points[:, i]) for i in (0, 1)], axis=-1)
        assert np.linalg.norm(root - expected, axis=-1).mean() < 0.15


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_ways_lead_from_key_to_key_on_a_rig_of_any_size(models: Offer, factor: float) -> None:
    skeleton = replace(walk().skeleton, offsets=walk().skeleton.offsets * factor)
    clip = opened(replace(walk(), skeleton=skeleton, root_positions=walk().root_positions * factor))
    keys = ends(clip, 0, 3)
    told, _ = ask(models, clip, "paths", keys, frames=60, count=4, settings=SETTINGS)
    assert isinstance(told, GalleryPaths)
    assert told.paths
    for way in told.paths:
        for point, key in ((way.path.points[0], keys["start"]), (way.path.points[-1], keys["target"])):
            assert np.linalg.norm(np.array(point) - key[0, [0, 2]]) < 0.06 * factor


def test_ways_differ_and_come_in_the_order_of_their_fit_or_say_why_not(models: Offer, clip: Clip) -> None:
    told, _ = ask(models, clip, "paths", ends(clip), frames=1, count=3, settings=SETTINGS)
    assert isinstance(told, GalleryPaths)
    assert (told.reason is None) == bool(told.paths)
    far = ends(clip)
    far["target"] = far["target"].copy()
    far["target"][0, 2] += 500.0
    told, _ = ask(models, clip, "paths", far, frames=30, count=3, settings=SETTINGS)
    assert isinstance(told, GalleryPaths)
    assert told.paths == []
    assert told.reason


def test_how_long_a_gap_should_take(models: Offer, clip: Clip) -> None:
    told, made = ask(models, clip, "suggest", ends(clip, 0, 3), settings=SETTINGS)
    assert isinstance(told, SuggestedDurations)
    assert made == {}
    assert 10 < told.frames < 200
    found = {each.speed: each.frames for each in told.alternatives}
    assert set(found) <= {"fast", "medium", "slow"}
    assert len(found) >= 2
    if {"fast", "slow"} <= set(found):
        assert found["fast"] < found["slow"]


def test_the_poses_that_ship_come_on_the_rig(models: Offer, clip: Clip) -> None:
    told, made = ask(models, clip, "library", {})
    assert isinstance(told, LibraryPoses)
    assert len(told.names) == len(made["poses"])
    with pytest.raises(InputError, match="needs the arrays none, got pose"):
        ask(models, clip, "library", {"pose": ends(clip)["start"]})


def test_a_pose_is_mirrored(models: Offer, clip: Clip) -> None:
    pose = ends(clip)["start"]
    told, made = ask(models, clip, "mirror", {"pose": pose})
    assert isinstance(told, MirroredPose)
    assert made["pose"].shape == pose.shape
    assert np.abs(made["pose"] - pose).max() > 0.05
    _, again = ask(models, clip, "mirror", {"pose": made["pose"]})
    one, other = (pose_rows.to_motion(each, clip.motion, "it") for each in (again["pose"], pose))
    np.testing.assert_allclose(one.global_positions(), other.global_positions(), atol=1e-5)


def test_places_of_joints_that_a_file_animates_come_out_too(models: Offer) -> None:
    clip = opened(moved(walk()))
    for method in ("dcmoe", "stitch", "interp"):
        _, frames = generate(models, clip, method=method, live=True)
        np.testing.assert_array_equal(frames[..., 91:94], frames[..., :3])


def test_a_rig_that_is_no_humanoid_gets_interpolation_and_words(models: Offer, other: Clip) -> None:
    keys = ends(other, 0, 2)
    for method in ("interp", "dcmoe", "stitch"):
        told, _ = generate(models, other, keys, method=method, variants=3)
        (info,) = told.infos
        assert info.method == "interp"
        assert info.foot_slide is None
        assert (info.fallback is None) == (method == "interp")
        assert info.fallback is None or "humanoid" in info.fallback
    told, _ = ask(models, other, "paths", keys, frames=30, count=3, settings=SETTINGS)  # type: ignore[assignment]
    assert isinstance(told, GalleryPaths)
    assert told.paths == []
    assert "humanoid" in str(told.reason)
    for kind, arrays in (("suggest", keys), ("mirror", {"pose": keys["start"]}), ("library", {})):
        with pytest.raises(InputError, match="humanoid"):
            ask(models, other, kind, arrays, **({"settings": SETTINGS} if kind == "suggest" else {}))


@pytest.mark.parametrize(
    ("arrays", "expected"),
    [
        ({}, "needs the arrays start, target, got none"),
        ({"start": np.zeros((1, 91))}, "got start"),
        ({"start": np.zeros((1, 91)), "target": np.zeros((1, 91)), "x": np.zeros(1)}, "got start, target, x"),
        ({"start": np.zeros((1, 91)), "target": np.zeros((1, 91))}, "start: the rotation of Hips in frame 0"),
        ({"start": np.zeros(()), "target": np.zeros((1, 91))}, "start has the shape ; it needs"),
        ({"start": np.zeros(91), "target": np.zeros((1, 91))}, "start has the shape 91; it needs"),
        ({"start": np.zeros((0, 91)), "target": np.zeros((1, 91))}, "start has the shape 0x91; it needs"),
        ({"start": np.zeros((1, 90)), "target": np.zeros((1, 91))}, "one row of 91 numbers"),
    ],
)
def test_arrays_that_are_no_poses_are_told(models: Offer, clip: Clip, arrays: Any, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        generate(models, clip, arrays)
    with pytest.raises(InputError, match="pose"):
        ask(models, clip, "mirror", {"pose": arrays.get("start", np.zeros(()))})


def test_frames_before_and_after_the_keys_count_but_only_so_many(models: Offer, clip: Clip) -> None:
    still = ends(clip)
    many = {name: np.repeat(still[name], 500, axis=0) for name in still}
    many["start"][:, 0] += np.linspace(-4.0, 0.0, 500)  # comes sideways, and goes on so
    many["target"][:, 0] += np.linspace(0.0, 4.0, 500)
    few = {"start": many["start"][-12:], "target": many["target"][:12]}
    _, one = generate(models, clip, many, live=True)
    _, other = generate(models, clip, few, live=True)
    np.testing.assert_array_equal(one, other)
    _, alone = generate(models, clip, still, live=True)
    assert np.abs(one - alone).max() > 1e-4


def test_the_last_of_the_frames_before_is_the_key(models: Offer, clip: Clip) -> None:
    keys = pose_rows.of_motion(clip.motion)
    arrays = {"start": keys[:2], "target": keys[2:]}
    _, frames = generate(models, clip, arrays, method="interp", frames=1)
    np.testing.assert_allclose(frames[0, 0, :3], (keys[1, :3] + keys[2, :3]) / 2.0, atol=1e-5)


def test_a_method_without_a_model_is_refused(models: Offer, clip: Clip) -> None:
    with pytest.raises(InputError, match="no installed model serves method 'stitch'; choose one of dcmoe, plan,"):
        generate(Offer(models=models.models[:1]), clip, method="stitch")


def test_the_model_is_the_one_that_is_named(models: Offer, clip: Clip) -> None:
    answer, frames = generate(models, clip, model="styles")
    assert (answer.infos[0].method, answer.infos[0].model) == ("dcmoe", "styles")
    assert np.abs(frames - generate(models, clip)[1]).max() > 0.01
    with pytest.raises(InputError, match="model 'stitch' is not installed for method 'dcmoe'"):
        generate(models, clip, model="stitch")


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"style": "Angry"}, {"style": "Angry", "style_strength": 2.5}),
        ({"path": {"kind": "straight"}}, {"path": {"kind": "straight"}, "path_control": 0.0}),
        ({"path": {"kind": "none"}}, {"path": {"kind": "gallery"}}),
    ],
)
def test_strength_control_and_gallery_reach_the_model(models: Offer, clip: Clip, one: Any, other: Any) -> None:
    frames = [generate(models, clip, frames=60, live=True, **fields)[1] for fields in (one, other)]
    assert np.abs(frames[0] - frames[1]).max() > 0.01


def test_what_a_method_cannot_do_is_refused(models: Offer, clip: Clip) -> None:
    for fields in ({"style": "Angry"}, {"style_strength": 2.0}, {"path": {"kind": "straight"}}, {"path_control": 0.5}):
        with pytest.raises(InputError, match=r"method 'interp'|a style strength"):
            generate(models, clip, method="interp", **fields)


def test_a_gallery_that_was_given_is_matched_unless_the_models_own_is_asked_for(models: Offer, clip: Clip) -> None:
    given = models.model_of("dcmoe", "styles")
    assert given is not None
    offer = Offer(models.models, given.gallery, "mine")
    for path in ("auto", "gallery"):
        settings = GapSettings(method="dcmoe", path=PathChoice(kind=path))
        assert handlers._request(settings, offer).trajectories is given.gallery
        own = handlers._request(settings.model_copy(update={"own_gallery": True}), offer)
        assert own.trajectories is own.model.gallery  # type: ignore[union-attr]
    generate(offer, clip, path={"kind": "straight"})
    generate(offer, clip, method="interp")


def test_a_target_in_part_leads_to_a_whole_pose(models: Offer, clip: Clip) -> None:
    keys = ends(clip)
    answer, made = ask(
        models,
        clip,
        "generate",
        keys,
        gap="g",
        frames=20,
        settings=SETTINGS | {"target_joints": "hands", "variants": 2},
    )
    assert isinstance(answer, Candidates)
    assert made["targets"].shape == (2, keys["target"].shape[1])
    reached, wanted = (pose_rows.to_motion(rows, clip.motion, "it") for rows in (made["targets"], keys["target"]))
    names = clip.motion.skeleton.names
    distance = np.linalg.norm(reached.global_positions() - wanted.global_positions(), axis=-1)
    assert distance[:, [names.index("LeftHand"), names.index("RightHand")]].max() < 0.01
    assert distance.max() > 0.02
    with pytest.raises(InputError, match="there is no target joint 'tail'"):
        generate(models, clip, target_joints="tail")


def test_a_rig_that_is_not_there_is_unknown(models: Offer) -> None:
    header, arrays = messages.unpack(question("library", "none"), CLIENT_MESSAGE)
    with pytest.raises(UnknownRig):
        handlers.answer(header, arrays, RigStore(), models)


def test_a_line_keeps_what_was_drawn() -> None:
    ask = PointPath(
        kind="waypoints", points=[(0.0, 1.0), (0.0, 1.0), (0.0, 2.0)], times=[0.0, 1.0, 2.0], facing=[3.0, 4.0, 5.0]
    )
    drawn = handlers._path_file(ask).whole
    assert drawn is not None
    assert drawn.times is not None
    assert drawn.facing is not None
    assert drawn.points.tolist() == [[0.0, 1.0], [0.0, 2.0]]
    assert (drawn.times.tolist(), drawn.facing.tolist()) == ([0.0, 2.0], [3.0, 5.0])


def test_the_questions_name_is_that_of_the_method(models: Offer, clip: Clip) -> None:
    with pytest.raises(InputError, match="'cancel' has no answer"):
        handlers.answer(
            messages.unpack(b'\x20\0\0\0{"type":"cancel","gap":"g"}     ', CLIENT_MESSAGE)[0], {}, RigStore(), models
        )
    assert Generate.model_fields["live"].default is False
