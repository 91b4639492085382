"""The command itself: exit status, usage, streams that fail, start-up."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from commandline import command, rows

MAKE_MOTION = ("demo", "info", "fill", "between", "models", "studio", "gallery")
TRAIN_AND_MEASURE = ("prepare", "labels", "train", "export", "evaluate")


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
    from interpose import io

    def stop(error):
        def raised(*_):
            raise error

        return raised

    monkeypatch.setattr(io, "read", stop(KeyboardInterrupt()))
    assert run("info", clip) == (130, "", "interpose: interrupted\n")
    monkeypatch.setattr(io, "read", stop(MemoryError()))
    assert run("info", clip)[0] == 1
    monkeypatch.setattr(io, "read", stop(PermissionError(13, "Permission denied", "a.bvh")))
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
        ("gallery", "frobnicate"),
        ("gallery", "build", "db"),
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
    make, measure = out.split("make motion:")[1].split("train and measure:")
    for name in (*MAKE_MOTION, *TRAIN_AND_MEASURE):
        assert f"\n  {name} " in (make if name in MAKE_MOTION else measure)
        status, told, _ = run(name, "--help")
        assert status == 0
        assert f"interpose {name}" in told


def test_version(run):
    from importlib.metadata import version

    assert run("--version") == (0, f"interpose {version('interpose')}\n", "")


def test_the_package_runs_as_the_command():
    done = subprocess.run([sys.executable, "-m", "interpose", "info"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "interpose info: name at least one FILE\n")


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
