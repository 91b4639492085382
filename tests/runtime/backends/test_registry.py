"""A method is one file and one line: a toy written here is seen wherever methods are listed, and generates."""

import json
import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from commandline import bvh_text, fails

import interpose
from interpose.cli import main
from interpose.evaluate import fill
from interpose.evaluate.case import Case, Windows
from interpose.runtime import model_folder
from interpose.runtime.backends import backend
from interpose.runtime.backends.backend import Backend
from interpose.runtime.backends.registry import BACKENDS
from interpose.skeleton import HUMANOID

TOY = '''
    """Method `toy`: a straight line that rises in the middle."""

    import numpy as np

    from interpose.runtime.backends.backend import trained
    from interpose.runtime.backends.interp import BACKEND as LINE
    from interpose.runtime.gap_batch import Generated


    class ToyBackend:
        name = "toy"
        summary = "a straight line that rises in the middle"

        def abilities(self, model):
            return trained(model, longest_steps=61) if model is not None and model.method == "toy" else None

        def generate(self, model, batch):
            made = LINE.generate(None, batch)
            rise = np.sin(np.pi * np.arange(1, batch.longest + 1) / (batch.longest + 1))
            made.root[..., 1] += model.info["height"] * rise
            return Generated(made.root, made.local, np.zeros((len(batch), batch.longest, 4)))


    BACKEND = ToyBackend()
'''


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """The method in a module of its own, its line in the registry, and a model that it serves."""
    (tmp_path / "toy_method.py").write_text(textwrap.dedent(TOY))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(BACKENDS, "toy", "toy_method:BACKEND")
    folder = tmp_path / "models" / "rising"
    folder.mkdir(parents=True)
    info = {"format": model_folder.FORMAT, "name": "rising", "method": "toy", "styles": ["High"], "licence": "MIT"}
    (folder / "model.json").write_text(json.dumps(info | {"height": 0.5, "training_data": ["lafan1 none"]}))
    monkeypatch.setattr(model_folder, "INSTALLED", tmp_path / "models")
    return folder


@pytest.fixture
def run(capsys):
    def run(*arguments):
        status = main([str(a) for a in arguments])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return run


def test_it_is_a_backend(toy):
    assert isinstance(backend.backend_of("toy"), Backend)
    assert backend.needs_model("toy")
    assert backend.choose("toy", None)[1].name == "rising"
    assert backend.choose(None, toy)[0] == "toy"


def test_models_lists_it(toy, run):
    status, out, _ = run("models")
    assert status == 0
    assert "toy: a straight line that rises in the middle; gaps up to 2 s" in out
    assert "toy" in json.loads(run("models", "--json")[1])["methods"]


def test_it_generates_on_a_users_clip(toy, run, tmp_path):
    clip, out = tmp_path / "walk.bvh", tmp_path / "out.bvh"
    clip.write_text(bvh_text(40))
    ends = "between", f"{clip}:0", f"{clip}:30", "--method", "toy", "--path", "none", "-o", out, "--json"
    status, printed, err = run(*ends, "--frames", 29, "--style", "high")
    assert status == 0, err
    info = json.loads(printed)
    assert (info["method"], info["model"], info["style"], info["fallback"]) == ("toy", "rising", "High", None)
    made = interpose.read(out).root_positions
    assert made[15, 1] - (made[0, 1] + made[-1, 1]) / 2.0 == pytest.approx(0.5, rel=0.1)
    status, printed, _ = run(*ends, "--frames", 61)
    assert json.loads(printed)["fallback"] == "the gap is longer than 2 s, the most for method 'toy'"
    fails(run(*ends, "--frames", 29, "--model", tmp_path / "none"), "no model")


def test_an_evaluation_takes_it(toy):
    (named,), (labelled,) = fill.parse(["toy"]), fill.parse([f"mine={toy}"])
    assert (named.name, labelled.name) == ("toy", "mine")
    assert named.backend is labelled.backend is backend.backend_of("toy")
    still = Windows(HUMANOID, 30.0, np.zeros((1, 5, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (1, 5, 22, 1)))
    made = fill.fill(Case("toy", 3, still, start=0, target=4), named).motion
    np.testing.assert_allclose(made.root[0, :, 1], 0.5 * np.sin(np.pi * np.array([0.25, 0.5, 0.75])), atol=1e-9)


def test_help_lists_it():
    """In a process of its own, since options are declared when their module is imported."""
    code = """
from interpose.runtime.backends.registry import BACKENDS
from interpose.skeleton import HUMANOID
BACKENDS["toy"] = "toy_method:BACKEND"
from interpose.cli import main
main(["between", "--help"])
"""
    environment = {**os.environ, "COLUMNS": "200"}
    shown = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert f"--method {'|'.join((*BACKENDS, 'toy'))}" in shown.stdout
