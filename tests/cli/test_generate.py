"""`interpose fill` and `interpose between` from end to end."""

import json
import os
import shutil
from dataclasses import replace

import numpy as np
import pytest
from commandline import RATES, bvh_text, fails, rows
from mocap_files import amass_arrays, exponential_maps, h36m_text, npz, standing

import interpose
from interpose import rotation
from interpose.io.registry import WRITERS, listed
from interpose.runtime import model_folder
from interpose.skeleton import HUMANOID

FIELDS = [
    "start",
    "target",
    "frames",
    "method",
    "style",
    "path",
    "seed",
    "arrival_position_error_m",
    "arrival_rotation_error_deg",
    "foot_slide_cm_per_frame",
    "seconds",
    "fallback",
]


@pytest.mark.parametrize("rate", RATES)
def test_fill_keeps_key_rows_digit_for_digit(tmp_path, run, rate):
    source, out = tmp_path / "in.bvh", tmp_path / "out.bvh"
    source.write_text(bvh_text(100, RATES[rate]))
    status, _, err = run("fill", source, "--keys", "5,45,80-89", "--method", "interp", "-o", out)
    assert status == 0, err
    before, after = rows(source), rows(out)
    kept = [*range(6), 45, *range(80, 100)]
    assert [after[i] for i in kept] == [before[i] for i in kept]
    assert len(after) == len(before)
    assert all(after[i] != before[i] for i in range(100) if i not in kept)
    assert out.read_text().split("MOTION")[0] == source.read_text().split("MOTION")[0]
    assert f"Frame Time: {RATES[rate]}\n" in out.read_text()
    assert interpose.read(out).rate == pytest.approx(rate, rel=1e-4)


def swaying_files():
    """A body that sways, as AMASS and as Human3.6M: the file's name, its contents, how far its frames are off."""
    angle = 0.3 * np.sin(np.arange(61) / 9.0)
    content = amass_arrays(61)
    content["poses"][:, 48] = angle
    content["trans"][:, 0] = 0.01 * np.arange(61)
    turned = standing(61).local_rotations.copy()
    turned[:, 1] = rotation.from_rotation_vector(angle[:, None] * np.array([1.0, 0.0, 0.0]))
    maps = exponential_maps(replace(standing(61), local_rotations=turned))
    return {"walk.npz": npz(content), "walking_1.txt": h36m_text(maps)}


@pytest.mark.parametrize("name", swaying_files())
@pytest.mark.parametrize("method", ["interp", "dcmoe"])
def test_fill_takes_other_formats_and_writes_bvh(tmp_path, run, model, name, method):
    source, out = tmp_path / name, tmp_path / "out.bvh"
    source.write_bytes(swaying_files()[name])
    options = ("--method", method, *(("--model", model) if method == "dcmoe" else ()))
    status, printed, err = run("fill", source, "--keys", "5,30,50-55", *options, "-o", out, "--json")
    assert status == 0, err
    assert [json.loads(line)["method"] for line in printed.splitlines()] == [method] * 2
    made, given = interpose.read(out), interpose.read(source)
    assert (len(made), made.rate) == (61, given.rate)
    joints = [made.skeleton.names.index(name) for name in given.skeleton.names]  # depth first in BVH
    kept = [*range(6), 30, *range(50, 61)]
    np.testing.assert_allclose(made.global_positions()[kept][:, joints], given.global_positions()[kept], atol=1e-5)


def test_between_takes_poses_of_other_formats(tmp_path, run):
    source, out = tmp_path / "walking_1.txt", tmp_path / "out.bvh"
    source.write_bytes(swaying_files()["walking_1.txt"])
    ends = f"{source}:0", f"{source}:40"
    status, _, err = run("between", *ends, "--frames", 9, "--method", "interp", "-o", out)
    assert status == 0, err
    made, given = interpose.read(out), interpose.read(source)
    np.testing.assert_allclose(made.global_positions()[[0, -1]], given.global_positions()[[0, 40]], atol=1e-5)


@pytest.mark.parametrize("frames", [1, 2, 37, 600])
@pytest.mark.parametrize("rate", RATES)
def test_between_writes_start_the_frames_and_target(tmp_path, run, rate, frames):
    source, out = tmp_path / "in.bvh", tmp_path / "out.bvh"
    source.write_text(bvh_text(100, RATES[rate]))
    status, _, err = run("between", f"{source}:7", f"{source}:-3", "--frames", frames, "--method", "interp", "-o", out)
    assert status == 0, err
    made, given = rows(out), rows(source)
    assert len(made) == frames + 2
    assert (made[0], made[-1]) == (given[7], given[97])


def test_interpolation_is_straight_and_even(tmp_path, run, clip):
    out = tmp_path / "out.bvh"
    assert run("fill", clip, "--keys", "0,50,99", "--method", "interp", "-o", out)[0] == 0
    made = interpose.read(out)
    for start, target in ((0, 50), (50, 99)):
        t = np.linspace(0.0, 1.0, target - start + 1)[:, None]
        line = (1 - t) * made.root_positions[start] + t * made.root_positions[target]
        np.testing.assert_allclose(made.root_positions[start : target + 1], line, atol=1e-7)


def test_two_files_of_one_skeleton(tmp_path, run, clip):
    other, out = tmp_path / "other.bvh", tmp_path / "out.bvh"
    other.write_text(bvh_text(10, seed=1))
    status, printed, err = run("between", clip, f"{other}:0", "--frames", 20, "--method", "interp", "-o", out, "--json")
    assert status == 0, err
    assert (rows(out)[0], rows(out)[-1]) == (rows(clip)[-1], rows(other)[0])
    told = json.loads(printed)
    assert (told["start"], told["target"]) == (f"{clip}:99", f"{other}:0")


def test_json_has_one_object_a_gap(tmp_path, run, clip):
    out = tmp_path / "out.bvh"
    status, printed, err = run(
        "fill", clip, "--keys", "0,45,90-99", "--method", "interp", "--seed", 3, "--json", "-o", out
    )
    assert status == 0, err
    told = [json.loads(line) for line in printed.splitlines()]
    assert [(g["start"], g["target"], g["frames"]) for g in told] == [(0, 45, 44), (45, 90, 44)]
    for gap in told:
        assert set(FIELDS) <= set(gap)
        assert (gap["method"], gap["style"], gap["path"], gap["seed"]) == ("interp", None, "auto", 3)
        assert gap["arrival_position_error_m"] == 0.0
        assert gap["arrival_rotation_error_deg"] == 0.0
        assert gap["foot_slide_cm_per_frame"] >= 0.0
        assert gap["seconds"] > 0.0
        assert gap["fallback"] is None
        assert gap["output"] == str(out)
    assert "wrote" in err


def test_several_variants_are_numbered(tmp_path, run, clip):
    out = tmp_path / "out.bvh"
    status, printed, _ = run("fill", clip, "--keys", "0,99", "--method", "interp", "--variants", 3, "--json", "-o", out)
    assert status == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out-1.bvh", "out-2.bvh", "out-3.bvh", "walk.bvh"]
    assert [json.loads(line)["variant"] for line in printed.splitlines()] == [1, 2, 3]


def test_an_existing_file_is_replaced(tmp_path, run, clip):
    out = tmp_path / "out.bvh"
    out.write_text("old")
    assert run("fill", clip, "--keys", "0,99", "--method", "interp", "-o", out)[0] == 0
    assert out.read_text().startswith("HIERARCHY")


def test_an_output_that_is_an_input_is_refused_unless_forced(tmp_path, run, clip):
    before, second = rows(clip), tmp_path / "walk-2.bvh"
    in_place = "fill", clip, "--keys", "0,99", "--method", "interp", "-o", clip
    fails(
        run(*in_place), "is one of the inputs; name another file, or overwrite it with --force", tmp_path, [clip.name]
    )
    second.write_text(clip.read_text())
    ends = "between", f"{clip}:0", f"{second}:9", "--frames", 5, "--method", "interp"
    fails(run(*ends, "-o", clip, "--variants", 2), "walk-2.bvh is one of the inputs")
    fails(run(*ends, "-o", tmp_path / "." / "walk.bvh"), "walk.bvh is one of the inputs")
    assert rows(clip) == rows(second) == before
    assert run(*in_place, "--force")[0] == 0
    assert rows(clip)[0] == before[0]
    assert rows(clip)[50] != before[50]


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("0,100", "frame 100 is outside the clip, which has frames 0 to 99"),
        ("45,0", "comes after 45"),
        ("7", "single key"),
        ("", "empty"),
        ("0,x", "'x' is neither"),
        ("0,5,5", "named twice"),
        ("0-99", "no frame to fill"),
    ],
)
def test_bad_keys(tmp_path, run, clip, keys, said):
    result = run("fill", clip, "--keys", keys, "--method", "interp", "-o", tmp_path / "out.bvh")
    fails(result, said, tmp_path, ["walk.bvh"])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--method", "magic"), "unknown method 'magic'"),
        (("--method", "interp", "--style", "Angry"), "no styles"),
        (("--method", "interp", "--path", "straight"), "method 'interp' follows no path; leave it out"),
        (("--path", "sideways"), "unknown path 'sideways'; use auto, gallery, straight, none, or a file"),
        (("--path", "none.json"), "none.json"),
        (("--speed", "fast"), "speed 'fast' needs --retime"),
        (("--speed", "hasty", "--retime"), "unknown speed 'hasty'; there are fast, medium, slow"),
        (("--path-control", "2"), "control must be 0 to 1, got 2"),
        (("--gallery", "nowhere"), "nowhere is no gallery"),
        (("--method", "interp", "--variants", "0"), "--variants must be 1 to 100, got 0"),
        (("--method", "interp", "--seed", "-1"), "seed must be 0 or more"),
        (("--model", "no-such-model"), "no-such-model"),
        (("--method", "stitch", "--model", "default"), "the model 'default' serves dcmoe and plan, not 'stitch'"),
        (("--method", "stitch+detail"), "no installed model serves method 'stitch+detail'; name a model that does"),
        (("--style", "chiken"), "the model 'default' has no style 'chiken'; did you mean 'Chicken'? it has"),
        (("--style", "Angry:0.5+Drnk"), "no style 'Drnk'; did you mean 'Drunk'?"),
        (("--gallery", "default", "--path", "straight"), "path 'straight' with a given duration uses no gallery"),
        (("--gallery", "default", "--method", "interp"), "method 'interp' with a given duration uses no gallery"),
    ],
)
def test_bad_options(tmp_path, run, clip, options, said):
    result = run("fill", clip, "--keys", "0,99", *options, "-o", tmp_path / "out.bvh")
    fails(result, said, tmp_path, ["walk.bvh"])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("out.fbx", f"must end in {listed(WRITERS)}"),
        ("out", f"must end in {listed(WRITERS)}"),
        ("no/such/folder/out.bvh", "there is no folder"),
        ("folder.bvh", "is a folder"),
    ],
)
def test_bad_outputs(tmp_path, run, clip, name, said):
    (tmp_path / "folder.bvh").mkdir()
    result = run("fill", clip, "--keys", "0,99", "--method", "interp", "-o", tmp_path / name)
    fails(result, said, tmp_path, ["folder.bvh", "walk.bvh"])


def damaged(kind):
    text = bvh_text(20)
    head, motion = text.split("MOTION\n")
    match kind:
        case "empty":
            return b""
        case "binary":
            return bytes(range(256)) * 40
        case "truncated":
            return text[: int(len(text) * 0.8)].encode()
        case "count":
            return text.replace("Frames: 20", "Frames: 21").encode()
        case "word":
            return text.replace("Frame Time: 0.033333\n", "Frame Time: 0.033333\nabc ").encode()
        case "nan":
            lines = text.splitlines()
            lines[-1] = "nan " + lines[-1].split(" ", 1)[1]
            return "\n".join(lines).encode()
        case "duplicate":
            return text.replace("JOINT RightLeg", "JOINT LeftLeg").encode()
        case "unclosed":
            return (head.rstrip().rstrip("}") + "MOTION\n" + motion).encode()
        case "channels":
            return text.replace("CHANNELS 3", "CHANNELS 7", 1).encode()
    raise AssertionError(kind)


@pytest.mark.parametrize(
    "kind", ["empty", "binary", "truncated", "count", "word", "nan", "duplicate", "unclosed", "channels"]
)
def test_damaged_files(tmp_path, run, kind):
    source = tmp_path / "bad.bvh"
    source.write_bytes(damaged(kind))
    result = run("fill", source, "--keys", "0,9", "--method", "interp", "-o", tmp_path / "out.bvh")
    fails(result, "bad.bvh", tmp_path, ["bad.bvh"])
    result = run("between", f"{source}:0", f"{source}:1", "--frames", 5, "--method", "interp", "-o", tmp_path / "o.bvh")
    fails(result, "bad.bvh", tmp_path, ["bad.bvh"])


@pytest.mark.parametrize(
    ("start", "target", "frames", "said"),
    [
        ("walk.bvh:100", "walk.bvh:0", 5, "there is no such frame; the clip has frames 0 to 99"),
        ("walk.bvh:0", "walk.bvh:-101", 5, "there is no such frame"),
        ("none.bvh:0", "walk.bvh:0", 5, "none.bvh: no such file"),
        ("walk.bvh:0", "walk.bvh:9", 0, "got 0"),
        ("walk.bvh:0", "walk.bvh:9", -5, "got -5"),
        ("walk.bvh:0", "walk.bvh:9", 10**12, "got 1000000000000"),
        ("walk.bvh:0", "other.bvh:0", 5, "share one skeleton"),
        (".", "walk.bvh:9", 5, "folder"),
    ],
)
def test_bad_poses(tmp_path, run, clip, monkeypatch, start, target, frames, said):
    names = ("Pelvis", *HUMANOID.names[1:])
    (tmp_path / "other.bvh").write_text(bvh_text(3, names=names))
    monkeypatch.chdir(tmp_path)
    result = run("between", start, target, "--frames", frames, "--method", "interp", "-o", "out.bvh")
    fails(result, said, tmp_path, ["other.bvh", "walk.bvh"])


@pytest.mark.parametrize("variants", [1, 3])
def test_a_full_disk_leaves_nothing_behind(tmp_path, run, clip, monkeypatch, variants):
    out, written = tmp_path / "out.bvh", []
    replace = os.replace

    def full(source, target):
        written.append(source)
        if len(written) == variants:
            raise OSError(28, "No space left on device")
        return replace(source, target)

    monkeypatch.setattr(os, "replace", full)
    result = run("fill", clip, "--keys", "0,99", "--method", "interp", "--variants", variants, "-o", out)
    fails(result, "no space left on device", tmp_path, ["walk.bvh"])
    assert ".bvh: cannot be written" in result[2]
    assert str(os.getpid()) not in result[2]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may write anywhere")
def test_an_unwritable_folder(tmp_path, run, clip):
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(0o500)
    result = run("fill", clip, "--keys", "0,99", "--method", "interp", "-o", locked / "out.bvh")
    fails(result, "cannot be written to", locked)


def test_a_model_fills_a_clip(tmp_path, run, clip, model):
    out = tmp_path / "out.bvh"
    status, printed, err = run(
        "fill", clip, "--keys", "0,45,90-99", "--model", model, "--style", "Old", "--variants", 2, "--json", "-o", out
    )
    assert status == 0, err
    told = [json.loads(line) for line in printed.splitlines()]
    assert [(t["variant"], t["start"], t["target"]) for t in told] == [(1, 0, 45), (1, 45, 90), (2, 0, 45), (2, 45, 90)]
    for gap in told:
        assert (gap["method"], gap["style"], gap["fallback"]) == ("dcmoe", "Old", None)
        assert gap["arrival_position_error_m"] < 1e-6
        assert gap["arrival_rotation_error_deg"] < 1e-4
    kept = [0, 45, *range(90, 100)]
    before, first, second = rows(clip), rows(tmp_path / "out-1.bvh"), rows(tmp_path / "out-2.bvh")
    assert [first[i] for i in kept] == [second[i] for i in kept] == [before[i] for i in kept]
    assert first[20] != second[20]


@pytest.mark.parametrize(
    ("rate", "frames"), [*((rate, 1) for rate in RATES), *((rate, 40) for rate in RATES), (24, 450), (120, 600)]
)
def test_a_model_at_any_rate(tmp_path, run, model, rate, frames):
    source, out = tmp_path / "in.bvh", tmp_path / "out.bvh"
    source.write_text(bvh_text(100, RATES[rate]))
    arguments = ("between", f"{source}:0", f"{source}:60", "--frames", frames, "--model", model, "-o", out, "--json")
    status, printed, err = run(*arguments)
    assert status == 0, err
    made, given = rows(out), rows(source)
    assert (made[0], made[-1], len(made)) == (given[0], given[60], frames + 2)
    told = json.loads(printed)
    assert told["method"] == ("interp" if frames == 1 and rate > 40 else "dcmoe")
    assert run(*arguments)[0] == 0
    assert rows(out) == made, "the same seed gives the same motion"


def test_an_unknown_style_is_refused(tmp_path, run, clip, model):
    result = run("fill", clip, "--keys", "0,99", "--model", model, "--style", "Sad", "-o", tmp_path / "out.bvh")
    fails(result, "the model 'swaying' has no style 'Sad'; it has Angry, Old", tmp_path, ["walk.bvh"])


@pytest.mark.parametrize(("given", "spelled"), [("ANGRY", "Angry"), ("old:3+angry", "Old:0.75+Angry:0.25")])
def test_a_style_is_found_in_any_case(tmp_path, run, clip, model, given, spelled):
    status, printed, err = run(
        "fill", clip, "--keys", "0,50", "--model", model, "--style", given, "--json", "-o", tmp_path / "out.bvh"
    )
    assert status == 0, err
    assert json.loads(printed)["style"] == spelled


def test_a_path_from_a_gallery(tmp_path, run, clip, model):
    """--path gallery takes the model's own or the one given, which implies it; what was used is reported."""
    gap = "between", f"{clip}:3", f"{clip}:60", "--frames", 40, "--model", model, "--json", "-o", tmp_path / "out.bvh"
    fails(run(*gap, "--path", "gallery"), "there is no gallery to match a path from; give one, or another path")

    def used(*options):
        status, printed, err = run(*gap, *options)
        assert status == 0, err
        return [json.loads(printed)[name] for name in ("path", "trajectory")]

    assert used() == ["auto", "model"]
    path, trajectory = used("--gallery", "default")
    assert path == "gallery"
    assert trajectory in ("matched", "composed")
    shutil.copy(model_folder.INSTALLED / "default" / "gallery.npz", model)
    assert used("--path", "gallery") == [path, trajectory]
    assert used("--path", "none") == ["none", "model"]


def test_the_planner_alone_and_gaps_beyond_it(tmp_path, run, clip):
    out = tmp_path / "out.bvh"
    ends = "between", f"{clip}:3", f"{clip}:60", "--method", "plan", "--path", "none", "--json", "-o", out
    status, printed, err = run(*ends, "--frames", 40)
    assert status == 0, err
    served = json.loads(printed)
    assert (served["method"], served["model"], served["fallback"]) == ("plan", "default", None)
    assert served["arrival_position_error_m"] < 1e-6
    straight = interpose.read(clip).root_positions[[3, 60]].mean(axis=0)
    assert np.linalg.norm(interpose.read(out).root_positions[20:22].mean(axis=0) - straight) > 0.005
    status, printed, err = run(*ends, "--frames", 92)
    assert status == 0, err
    served = json.loads(printed)
    assert (served["method"], served["model"], served["trajectory"]) == ("interp", None, None)
    assert served["fallback"] == "the gap is longer than 3.03 s, the most for method 'plan'"
    assert "falls back to interpolation" in run(*[a for a in (*ends, "--frames", 92) if a != "--json"])[2]


def test_a_rig_without_legs_is_interpolated(tmp_path, run, model):
    source, out = tmp_path / "in.bvh", tmp_path / "out.bvh"
    source.write_text(
        "HIERARCHY\nROOT crate\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
        "End Site\n{\nOFFSET 0 9 0\n}\n}\nMOTION\nFrames: 3\nFrame Time: 0.04\n0 0 0\n9 9 9\n10 20 30\n"
    )
    status, printed, err = run("fill", source, "--keys", "0,2", "--model", model, "-o", out, "--json")
    assert status == 0, err
    assert json.loads(printed)["method"] == "interp"
    assert "no humanoid" in json.loads(printed)["fallback"]
    assert [float(x) for x in rows(out)[1].split()] == [5.0, 10.0, 15.0]


def test_a_target_may_be_given_in_part(tmp_path, run, clip, model):
    out = tmp_path / "out.bvh"
    asked = ("between", f"{clip}:3", f"{clip}:60", "--frames", 20, "--model", model, "--path", "none", "-o", out)
    status, said, err = run(*asked, "--target-joints", "hips,left-foot", "--variants", 2, "--json")
    assert status == 0, err
    told = [json.loads(line) for line in said.splitlines()]
    assert [t["target_joints"] for t in told] == ["Hips,LeftFoot,LeftToe"] * 2
    assert max(t["arrival_position_error_m"] for t in told) < 1e-6
    assert all("completes no partial targets" in t["fallback"] for t in told)
    made, given = interpose.read(tmp_path / "out-1.bvh"), interpose.read(clip)
    assert len(made) == 22
    foot = HUMANOID.index("LeftFoot")
    apart = np.linalg.norm(made[-1].global_positions() - given[60].global_positions(), axis=-1)[0]
    assert max(apart[0], apart[foot]) < 1e-5
    assert apart.max() > 0.01
    fails(run(*asked, "--target-joints", "wings"), "there is no target joint 'wings'")


def test_a_style_can_be_exaggerated(tmp_path, run, clip, model):
    out = tmp_path / "out.bvh"
    asked = ("between", f"{clip}:3", f"{clip}:60", "--frames", 20, "--path", "none", "-o", out)
    status, said, err = run(*asked, "--model", model, "--style", "Old", "--style-strength", 2, "--json")
    assert status == 0, err
    assert json.loads(said)["style_strength"] == 2.0
    fails(run(*asked, "--model", model, "--style-strength", 4), "the style's strength must be 0 to 3, got 4")
    plain = ("between", f"{clip}:3", f"{clip}:60", "--frames", 20, "--method", "interp", "-o", out)
    fails(run(*plain, "--style-strength", 2), "needs a method and a model with styles")
