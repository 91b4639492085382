"""`interpose info` and `interpose models`."""

import json

import pytest
from mocap_files import amass_arrays, h36m_text, npz, t_pose

from interpose.runtime import model_folder


def test_info_shows_the_mapping(run, clip):
    status, out, err = run("info", clip)
    assert (status, err) == (0, "")
    assert "22 joints, 100 frames at 30 Hz (3.30 s), unit cm" in out
    assert "profile LaFAN1" in out
    assert "missing: none" in out
    assert out.count("LeftForeArm    LeftForeArm") == 1


def test_info_goes_on_after_a_bad_file(tmp_path, run, clip):
    bad = tmp_path / "bad.bvh"
    bad.write_text("nothing")
    status, out, err = run("info", clip, bad, tmp_path / "none.bvh", clip, "--json")
    assert status == 1
    told = [json.loads(line) for line in out.splitlines()]
    assert [t["file"] for t in told] == [str(clip)] * 2
    assert told[0]["joints"] == 22
    assert told[0]["frames"] == 100
    assert told[0]["rate"] == 30.0
    assert told[0]["unit_m"] == 0.01
    assert told[0]["mapping"]["LeftUpLeg"] == "LeftUpLeg"
    assert told[0]["missing"] == []
    assert [line.startswith("interpose: ") for line in err.splitlines()] == [True, True]


def test_info_says_what_a_rig_lacks(tmp_path, run):
    path = tmp_path / "legless.bvh"
    path.write_text(
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: 0.04\n0 0 0\n"
    )
    status, out, _ = run("info", path)
    assert status == 0
    assert "not a humanoid" in out
    assert "LeftUpLeg" in out


FILES = {
    "clip.npz": (npz(amass_arrays(61)), "22 joints, 61 frames at 120 Hz (0.50 s), unit m", "SMPL", []),
    "walking_1.txt": (h36m_text(t_pose(51)), "21 joints, 51 frames at 50 Hz (1.00 s), unit mm", None, ["Spine1"]),
}


@pytest.mark.parametrize("name", FILES)
def test_info_describes_files_of_other_formats(tmp_path, run, name):
    data, summary, profile, missing = FILES[name]
    (tmp_path / name).write_bytes(data)
    status, out, err = run("info", tmp_path / name)
    assert (status, err) == (0, "")
    assert summary in out
    report = json.loads(run("info", tmp_path / name, "--json")[1])
    assert profile in (None, report["profile"])
    assert (report["missing"], report["problem"]) == (missing, None)


def test_info_names_the_formats_where_none_is_recognised(tmp_path, run):
    (tmp_path / "notes.md").write_text("nothing")
    status, _, err = run("info", tmp_path / "notes.md")
    assert status == 1
    assert "BVH (.bvh), AMASS (.npz) or Human3.6M exponential maps (.txt) can be read" in err


def test_models_lists_what_is_installed(run, model, monkeypatch):
    monkeypatch.setattr(model_folder, "INSTALLED", model.parent)
    status, out, err = run("models")
    assert (status, err) == (0, "")
    assert "swaying: 30 Hz" in out
    assert "methods     dcmoe: mixture of experts" in out
    assert "gaps up to 20 s" in out
    assert "plan" not in out.partition("trained on")[0].replace("along the plan", "")  # it has no planner
    assert "trained on  walks" in out
    assert "licence     MIT" in out
    assert "styles      Angry, Old" in out
    status, out, _ = run("models", "--json")
    told = json.loads(out)
    assert (status, told["name"], told["folder"]) == (0, "swaying", str(model))
    assert (told["methods"], told["training_data"]) == (["dcmoe"], ["walks"])


def test_models_lists_every_method_that_one_serves(run):
    status, out, _ = run("models", "--json")
    served = {json.loads(line)["name"]: json.loads(line)["methods"] for line in out.splitlines()}
    assert status == 0
    assert served["default"] == ["dcmoe", "plan"]
    assert served["stitch"] == ["stitch", "plan"]


def test_an_installed_model_is_called_by_its_name(tmp_path, run, clip, model, monkeypatch):
    monkeypatch.setattr(model_folder, "INSTALLED", model.parent)
    status, out, _ = run("fill", clip, "--keys", "0,50", "--model", "swaying", "--json", "-o", tmp_path / "out.bvh")
    assert (status, json.loads(out)["method"]) == (0, "dcmoe")


def test_no_model_is_installed(tmp_path, run, monkeypatch):
    monkeypatch.setattr(model_folder, "INSTALLED", tmp_path)
    status, out, err = run("models")
    assert (status, out) == (0, "")
    assert "no model is installed" in err
