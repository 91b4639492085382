"""The command line from end to end: what it writes, what it prints, and what bad input gets."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import interpose
from interpose.cli import main
from interpose.skeleton import HUMANOID

RATES = {24: "0.041667", 25: "0.04", 29.97: "0.0333667", 30: "0.033333", 50: "0.02", 60: "0.016667", 120: "0.008333"}
FIELDS = (
    "start target frames method style path seed arrival_position_error_m arrival_rotation_error_deg "
    "foot_slide_cm_per_frame seconds fallback"
).split()


def bvh_text(frames, frame_time="0.033333", names=HUMANOID.names, seed=0):
    """A BVH of the 22 joints with digits that no program would choose, in an unusual channel order."""
    children = {j: [c for c, p in enumerate(HUMANOID.parents) if p == j] for j in range(22)}
    order = []

    def joint(j, depth):
        order.append(j)
        tab = "  " * depth
        x, y, z = HUMANOID.offsets[j] * 100.0
        position = "6 Xposition Zposition Yposition" if j == 0 else "3"
        inner = "".join(joint(c, depth + 1) for c in children[j])
        inner = inner or f"{tab}  End Site\n{tab}  {{\n{tab}    OFFSET 0 5.0 0\n{tab}  }}\n"
        return (
            f"{tab}{'ROOT' if j == 0 else 'JOINT'} {names[j]}\n{tab}{{\n{tab}  OFFSET {x:.4f} {y:.4f} {z:.4f}\n"
            f"{tab}  CHANNELS {position} Yrotation Xrotation Zrotation\n{inner}{tab}}}\n"
        )

    hierarchy = "HIERARCHY\n" + joint(0, 0)
    rng = np.random.default_rng(seed)
    t = np.arange(frames)[:, None] / 30.0
    angles = 20.0 * np.sin(4.0 * t + rng.uniform(0, 6, size=(1, 66)))
    root = np.concatenate([3.0 * np.sin(t), 120.0 * t, 92.0 + np.cos(6 * t)], axis=1)
    forms = ["%.3f", "%.5f", "%.4f", "%g", "%.6e"]
    rows = [
        " ".join(forms[(i + k) % 5] % value for k, value in enumerate(row))
        for i, row in enumerate(np.concatenate([root, angles], axis=1))
    ]
    body = "".join(row + "\n" for row in rows)
    return f"{hierarchy}MOTION\nFrames: {frames}\nFrame Time: {frame_time}\n{body}"


def rows(path):
    return Path(path).read_text().split("Frame Time:")[1].splitlines()[1:]


@pytest.fixture
def clip(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(bvh_text(100))
    return path


@pytest.fixture
def run(capsys):
    """Run a command in this process: (exit status, standard output, standard error)."""

    def run(*arguments):
        status = main([str(a) for a in arguments])
        said = capsys.readouterr()
        return status, said.out, said.err

    return run


def fails(result, said, folder=None, left=()):
    """One line on standard error that says ``said``, status 1, and no new file in ``folder``."""
    status, out, err = result
    assert status == 1, err
    assert err.startswith("interpose: ")
    assert err.count("\n") == 1
    assert said in err
    assert out == ""
    if folder is not None:
        assert sorted(p.name for p in folder.iterdir()) == sorted(left)


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


@pytest.mark.parametrize("frames", [1, 2, 37, 600])
@pytest.mark.parametrize("rate", RATES)
def test_between_writes_start_the_frames_and_target(tmp_path, run, rate, frames):
    source, out = tmp_path / "in.bvh", tmp_path / "out.bvh"
    source.write_text(bvh_text(100, RATES[rate]))
    status, _, err = run(
        "between", f"{source}:7", f"{source}:-3", "--frames", frames, "--method", "interp", "-o", out
    )
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
    status, printed, err = run(
        "between", clip, f"{other}:0", "--frames", 20, "--method", "interp", "-o", out, "--json"
    )
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
    status, printed, _ = run(
        "fill", clip, "--keys", "0,99", "--method", "interp", "--variants", 3, "--json", "-o", out
    )
    assert status == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out-1.bvh", "out-2.bvh", "out-3.bvh", "walk.bvh"]
    assert [json.loads(line)["variant"] for line in printed.splitlines()] == [1, 2, 3]


def test_an_existing_file_is_replaced(tmp_path, run, clip):
    out = tmp_path / "out.bvh"
    out.write_text("old")
    assert run("fill", clip, "--keys", "0,99", "--method", "interp", "-o", out)[0] == 0
    assert out.read_text().startswith("HIERARCHY")


def test_a_clip_can_be_filled_in_place(run, clip):
    before = rows(clip)
    assert run("fill", clip, "--keys", "0,99", "--method", "interp", "-o", clip)[0] == 0
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
        (("--method", "interp", "--path", "straight"), "path 'straight' cannot be followed"),
        (("--method", "interp", "--variants", "0"), "--variants must be 1 to 100, got 0"),
        (("--method", "interp", "--seed", "-1"), "seed must be 0 or more"),
        (("--model", "no-such-model"), "no-such-model"),
        (("--style", "No Such Style"), "No Such Style"),
    ],
)
def test_bad_options(tmp_path, run, clip, options, said):
    result = run("fill", clip, "--keys", "0,99", *options, "-o", tmp_path / "out.bvh")
    fails(result, said, tmp_path, ["walk.bvh"])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("out.fbx", "must end in .bvh or .glb"),
        ("out", "must end in .bvh or .glb"),
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
            return text.replace("\n", "\n", 1).replace("Frame Time: 0.033333\n", "Frame Time: 0.033333\nabc ").encode()
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


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_full_standard_output(tmp_path, clip):
    with open("/dev/full", "w") as full:
        done = command("info", clip, stdout=full)
    assert done.returncode == 1
    assert done.stderr == "interpose: No space left on device\n"


def test_a_reader_that_goes_away(clip):
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as gone:
        done = command("info", *[clip] * 50, stdout=gone)
    assert done.returncode == 141
    assert done.stderr == ""


def test_interruption_and_want_of_memory(run, clip, monkeypatch):
    from interpose.io import bvh

    def stop(error):
        def raised(*_):
            raise error

        return raised

    monkeypatch.setattr(bvh, "read", stop(KeyboardInterrupt()))
    assert run("info", clip) == (130, "", "interpose: interrupted\n")
    monkeypatch.setattr(bvh, "read", stop(MemoryError()))
    assert run("info", clip)[0] == 1
    monkeypatch.setattr(bvh, "read", stop(PermissionError(13, "Permission denied", "a.bvh")))
    assert run("info", clip) == (1, "", "interpose: a.bvh: Permission denied\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ("nonsense",),
        ("fill",),
        ("fill", "a.bvh"),
        ("fill", "a.bvh", "--keys", "0,1"),
        ("fill", "a.bvh", "--keys", "0,1", "-o", "o.bvh", "--variants", "many"),
        ("between", "a.bvh", "--frames", "3", "-o", "o.bvh"),
        ("between", "a.bvh", "b.bvh", "-o", "o.bvh"),
        ("fill", "a.bvh", "--keys", "0,1", "-o", "o.bvh", "--speed", "fast"),
        ("train", "gpt", "--data", "x", "-o", "y"),
        ("info",),
    ],
)
def test_wrong_usage_is_status_2(run, arguments):
    status, out, err = run(*arguments)
    assert status == 2
    assert out == ""
    assert err


def test_help_names_every_command(run):
    status, out, _ = run("--help")
    assert status == 0
    for name in ("demo", "info", "fill", "between", "models", "prepare", "train", "export", "evaluate"):
        assert f"• {name}" in out
        status, told, _ = run(name, "--help")
        assert status == 0
        assert f"interpose {name}" in told


def test_version(run):
    from importlib.metadata import version

    assert run("--version") == (0, f"interpose {version('interpose')}\n", "")


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
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\nEnd Site\n{\nOFFSET 0 1 0\n}\n"
        "}\nMOTION\nFrames: 1\nFrame Time: 0.04\n0 0 0\n"
    )
    status, out, _ = run("info", path)
    assert status == 0
    assert "not a humanoid" in out
    assert "LeftUpLeg" in out


def test_starting_up_imports_nothing_heavy():
    code = (
        "import sys, interpose.cli; interpose.cli.main(['--help']); "
        "print([m for m in ('numpy', 'scipy', 'onnxruntime', 'sklearn', 'torch') if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "[]\n"


def test_the_installed_command(tmp_path, clip):
    out = tmp_path / "out.bvh"
    done = command("fill", clip, "--keys", "0,50", "--method", "interp", "-o", out, "--json")
    assert (done.returncode, json.loads(done.stdout)["frames"]) == (0, 49)
    assert len(rows(out)) == 100
    done = command("fill", clip, "--keys", "0,500", "--method", "interp", "-o", out)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("interpose: --keys 0,500: frame 500 is outside")


def command(*arguments, stdout=subprocess.PIPE):
    code = "import sys; from interpose.cli import main; sys.exit(main())"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=stdout,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
