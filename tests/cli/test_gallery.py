"""`interpose gallery`, and what a gallery adds to `fill` and `between`."""

import json
import shutil

import learning
import numpy as np
import pytest
from commandline import fails, rows

import interpose
from interpose import io
from interpose.gallery import store


@pytest.fixture(scope="module")
def walks(tmp_path_factory):
    """A database of marches long enough for any window."""
    return learning.write_database(tmp_path_factory.mktemp("walks") / "db", lengths=(400, 300, 250)).path


@pytest.fixture
def gallery(tmp_path, run, walks):
    out = tmp_path / "gallery"
    status, said, err = run("gallery", "build", walks, "-o", out)
    assert status == 0, err
    assert "2 styles" in said
    return out


@pytest.fixture
def march(tmp_path):
    """A BVH of the marching figure."""
    path = tmp_path / "march.bvh"
    io.write(path, learning.march(200, 0.9, 0.4))
    return path


def between(run, march, model, out, *options):
    status, said, err = run("between", f"{march}:20", f"{march}:70", "--model", model, "-o", out, "--json", *options)
    assert status == 0, err
    return [json.loads(line) for line in said.splitlines()]


def test_build_writes_what_can_be_loaded(gallery, walks):
    made = store.load(gallery)
    assert len(made.tracks) == 950
    assert made.styles == learning.STYLES
    assert made.info["bytes_a_window"] > 12


def test_query_tells_durations_and_trajectories(run, gallery, march):
    status, said, err = run("gallery", "query", gallery, "0,0,0", "0,2,0", "--count", 3, "--json")
    assert status == 0, err
    told = json.loads(said)
    assert told["start"] == [0.0, 0.0, 0.0]
    assert 1 <= len(told["found"]) <= 3
    for one in told["found"]:
        assert one["path"][0] == [0.0, 0.0, 0.0]
        np.testing.assert_allclose(one["path"][-1][:2], [0.0, 2.0], atol=1e-3)
        assert len(one["path"]) == one["frames"] + 2
    assert told["found"][0]["frames"] == told["suggested"]["frames"]
    status, said, _ = run("gallery", "query", gallery, "0,0,0", "0,2,0", "--frames", 59)
    assert status == 0
    assert "\n| 59 | 2.00 |" in said
    status, said, _ = run("gallery", "query", gallery, f"{march}:20", f"{march}:70")
    assert status == 0
    assert "frames at 30 Hz suggested" in said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("0,0,0", "0,900,0"), "set a key in between"),
        (("0,0,0", "0,2,0", "--style", "Sad"), "no trajectory in style 'Sad'; it has Old, Young"),
        (("0,0,0", "0,2,0", "--speed", "hasty"), "unknown speed 'hasty'"),
        (("0,0,0", "0,2,0", "--speed", "fast", "--frames", "30"), "give one of them"),
        (("0,0,0", "0,5,0", "--frames", "4"), "the nearest takes"),
        (("0,0,nan", "0,5,0"), "not a finite position"),
        (("0,0,x", "0,5,0"), "'0,0,x' is no place"),
        (("0,0,0", "none.bvh:3"), "not one of each"),
        (("none.bvh:1", "none.bvh:3"), "no such file"),
        (("0,0,0", "0,2,0", "--count", "0"), "--count must be 1 to 100"),
        (("0,0,0", "0,2,0", "--seed", "-1"), "--seed must be 0 or more"),
    ],
)
def test_bad_queries(run, gallery, arguments, said):
    fails(run("gallery", "query", gallery, *arguments), said)


def test_what_is_no_gallery_is_refused(run, tmp_path, model, march):
    fails(run("gallery", "query", tmp_path / "none", "0,0,0", "0,1,0"), "is no gallery and no model with one")
    fails(run("gallery", "query", model, "0,0,0", "0,1,0"), "has no gallery")
    fails(run("gallery", "build", tmp_path / "none", "-o", tmp_path / "g"), "not a finished database")
    result = run("between", f"{march}:0", f"{march}:9", "--gallery", tmp_path, "--frames", 20, "-o", tmp_path / "o.bvh")
    fails(result, "is no gallery")
    assert run("gallery", "frobnicate")[0] == 2


def test_between_without_frames_takes_the_suggested_time(run, gallery, march, model, tmp_path):
    out = tmp_path / "out.bvh"
    told = between(run, march, model, out, "--gallery", gallery)[0]
    assert told["frames"] == told["suggested"]["frames"]
    assert len(rows(out)) == told["frames"] + 2
    assert rows(out)[0] == rows(march)[20]
    assert rows(out)[-1] == rows(march)[70]
    assert told["trajectory"] == "matched"
    assert 0.0 < told["fit"] <= 1.0
    fits = [each["fit"] for each in told["suggested"]["alternatives"]]
    assert sum(fits) == pytest.approx(1.0, abs=0.01)
    assert told["path_deviation_m"] >= 0.0
    by_interp = between(run, march, model, out, "--gallery", gallery, "--method", "interp")[0]
    assert by_interp["frames"] == told["frames"]


def test_speeds_order_the_durations(run, gallery, march, model, tmp_path):
    taken = {
        speed: between(run, march, model, tmp_path / "out.bvh", "--gallery", gallery, "--speed", speed)[0]["frames"]
        for speed in ("fast", "medium", "slow")
    }
    assert taken["fast"] <= taken["medium"] <= taken["slow"]
    assert taken["fast"] < taken["slow"]


def test_a_time_and_a_speed_contradict(run, gallery, march, model, tmp_path):
    arguments = ("--gallery", gallery, "--model", model, "--frames", 30, "--speed", "fast", "-o", tmp_path / "o.bvh")
    fails(run("between", f"{march}:20", f"{march}:70", *arguments), "give one of them")


def test_without_a_gallery_a_time_is_needed(run, march, model, tmp_path):
    result = run("between", f"{march}:20", f"{march}:70", "--model", model, "-o", tmp_path / "o.bvh")
    fails(result, "give a number of frames", tmp_path, ["march.bvh"])


def test_variants_take_ways_and_times_of_their_own(run, gallery, march, model, tmp_path):
    told = between(run, march, model, tmp_path / "out.bvh", "--gallery", gallery, "--variants", 4)
    assert [t["variant"] for t in told] == [1, 2, 3, 4]
    made = [interpose.read(tmp_path / f"out-{i}.bvh") for i in (1, 2, 3, 4)]
    assert [len(m) for m in made] == [t["frames"] + 2 for t in told]
    assert len({t["frames"] for t in told}) > 1


def test_a_demand_that_cannot_be_met_is_served_and_told(run, gallery, march, model, tmp_path):
    told = between(run, march, model, tmp_path / "out.bvh", "--gallery", gallery, "--frames", 1)[0]
    assert told["trajectory"] == "model"
    assert "frames would do" in told["fallback"]


def test_retime_moves_the_keys_and_keeps_their_rows(run, gallery, march, model, tmp_path):
    out = tmp_path / "out.bvh"
    status, said, err = run(
        "fill", march, "--keys", "10,60,61,120", "--retime", "--model", model, "--gallery", gallery, "-o", out, "--json"
    )
    assert status == 0, err
    first, second = (json.loads(line) for line in said.splitlines())
    before, after = rows(march), rows(out)
    assert after[:11] == before[:11]
    at = 10 + first["frames"] + 1
    assert after[at : at + 2] == before[60:62]
    last = at + 1 + second["frames"] + 1
    assert after[last:] == before[120:]
    assert (first["start"], first["target"], second["start"], second["target"]) == (10, 60, 61, 120)


def test_fill_keeps_the_clips_own_times(run, gallery, march, model, tmp_path):
    out = tmp_path / "out.bvh"
    status, said, _ = run(
        "fill", march, "--keys", "10,60,120", "--model", model, "--gallery", gallery, "-o", out, "--json"
    )
    assert status == 0
    assert [json.loads(line)["trajectory"] for line in said.splitlines()] == ["matched", "matched"]
    assert len(rows(out)) == 200


def test_a_drawn_line_is_taken_from_a_file(run, gallery, march, model, tmp_path):
    clip = interpose.read(march)
    middle = clip.root_positions[[20, 70]].mean(axis=0)[::2] + np.array([0.6, 0.0])
    line = tmp_path / "line.json"
    line.write_text(json.dumps({"points": [middle.tolist()]}))
    told = between(run, march, model, tmp_path / "out.bvh", "--path", line, "--frames", 60)[0]
    assert (told["trajectory"], told["path"]) == ("drawn", str(line))
    line.write_text(json.dumps({"gaps": [{"start": 10, "points": [middle.tolist()]}]}))
    status, said, err = run(
        "fill", march, "--keys", "10,60,120", "--path", line, "--model", model, "-o", tmp_path / "out.bvh", "--json"
    )
    assert status == 0, err
    assert [json.loads(text)["trajectory"] for text in said.splitlines()] == ["drawn", "model"]


@pytest.mark.parametrize(
    ("points", "said"),
    [([[0, 0], [0, 0]], "line.json"), ([[0, float("nan")]], "line.json"), ([], "line.json"), ("x", "line.json")],
)
def test_bad_lines(run, march, model, tmp_path, points, said):
    line = tmp_path / "line.json"
    line.write_text(json.dumps({"points": points}))
    result = run("between", march, march, "--frames", 20, "--path", line, "--model", model, "-o", tmp_path / "o.bvh")
    fails(result, said, tmp_path, ["line.json", "march.bvh"])


def test_generate_gives_a_model_a_gallery(run, walks, model_folder, tmp_path):
    folder = tmp_path / "model"
    shutil.copytree(model_folder, folder)
    status, said, err = run("gallery", "generate", walks, "--model", folder, "--frames", 600)
    assert status == 0, err
    assert "2 styles" in said
    assert interpose.load_model(folder).session.gallery is not None
    fails(run("gallery", "generate", walks, "--model", folder, "--frames", 5), "too small")
    fails(run("gallery", "generate", walks, "--model", folder, "--seed", -1), "--seed must be 0 or more")


def test_plot_draws_the_papers_figures(run, gallery, tmp_path):
    out = tmp_path / "figures"
    status, _, err = run("gallery", "plot", gallery, "-o", out)
    assert status == 0, err
    assert len(list(out.glob("*.png"))) == 3
    fails(run("gallery", "plot", gallery, "-o", out, "--distance", 0), "--distance must be 0.1 to 100 m")


def test_evaluate_gallery(run, gallery, walks, model_folder, tmp_path, monkeypatch):
    from interpose.evaluate import gallery as protocol

    monkeypatch.setattr(protocol, "DIVERSITY_GAPS", 1)
    monkeypatch.setattr(protocol, "MOST_GALLERY_GAPS", 4)
    status, said, err = run(
        "evaluate", "gallery", "--data", walks, "--gallery", gallery, "--model", model_folder, "-o", tmp_path / "out"
    )
    assert status == 0, err
    assert "# Paths and durations" in said
    assert (tmp_path / "out" / "results.json").exists()


def test_the_library_takes_points_and_suggests(gallery, march, model_folder):
    model, clip, ways = interpose.load_model(model_folder), interpose.read(march), store.load(gallery)
    told = model.suggest(clip[20], clip[70], gallery=ways)
    assert model.inbetween(clip[20], clip[70], gallery=ways)[0].info.frames == told.frames
    middle = clip.root_positions[45, ::2] + [0.3, 0.0]
    made = model.inbetween(clip[20], clip[70], 50, path=[middle.tolist()])[0]
    assert made.info.trajectory == "drawn"
    with pytest.raises(interpose.InputError, match="unknown path"):
        model.inbetween(clip[20], clip[70], 50, path="zigzag")
    broken = clip[20]
    broken.root_positions[0, 0] = np.nan
    with pytest.raises(interpose.InputError, match="not finite"):
        model.inbetween(broken, clip[70], 50)
