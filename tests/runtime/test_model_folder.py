"""Model folders: what is told of a bad one, and what a good one gives."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from interpose.errors import InputError
from interpose.runtime import model_folder as module
from interpose.runtime.model_folder import Session, load

INFO = {"format": 2, "name": "few", "method": "dcmoe", "styles": ["Old"], "licence": "MIT"}


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "few").mkdir()
    (tmp_path / "few" / "model.json").write_text(json.dumps(INFO))
    return tmp_path / "few"


@pytest.fixture
def copied(model_folder, tmp_path):
    return shutil.copytree(model_folder, tmp_path / "copy")


def test_a_folder_is_loaded_by_its_path(folder):
    for name in (folder, str(folder)):
        loaded = load(name)
        assert loaded.path == folder
        assert (loaded.name, loaded.method, loaded.styles) == ("few", "dcmoe", ("Old",))
        assert not loaded.feeds_path_back
    (folder / "model.json").write_text(json.dumps(INFO | {"absolute": True}))
    assert load(folder).feeds_path_back


def test_an_installed_model_is_loaded_by_its_name_the_default_one_first(folder, monkeypatch, tmp_path):
    monkeypatch.setattr(module, "INSTALLED", tmp_path)
    assert load("few").path == folder
    with pytest.raises(InputError, match="no model 'default'; installed models: few"):
        load()
    shutil.copytree(folder, tmp_path / "default")
    shutil.copytree(folder, tmp_path / "another")
    assert [p.name for p in module.installed()] == ["default", "another", "few"]
    assert load().path == tmp_path / "default"


def test_what_is_no_model(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "INSTALLED", tmp_path / "none")
    with pytest.raises(InputError, match="no model 'Nobody'; installed models: none"):
        load("Nobody")
    with pytest.raises(InputError, match="exists but is not a model folder"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", r"model\.json cannot be read"),
        ("\xff", r"model\.json cannot be read"),
        ("3", r"model\.json cannot be read"),
        ("[]", r"model\.json cannot be read"),
        ("{}", r"model\.json lacks format, name, method, styles, licence; export the model again"),
        (json.dumps({k: v for k, v in INFO.items() if k != "licence"}), "lacks licence"),
        (json.dumps(INFO | {"format": 0}), "has format 0, this program needs 2; export the model again"),
        (json.dumps(INFO | {"method": "stitch"}), "lacks network, chains; export the model again"),
    ],
)
def test_a_model_json_that_cannot_serve(folder, text, said):
    (folder / "model.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match=said):
        load(folder)


def test_a_network_that_cannot_be_loaded(folder):
    for content in (None, b"", b"no network"):
        if content is not None:
            (folder / "step.onnx").write_bytes(content)
        with pytest.raises(InputError, match=r"step\.onnx cannot be loaded .*; export the model again"):
            _ = load(folder).network("step")


def test_a_network_of_another_program(copied, monkeypatch):
    assert load(copied).network("step") is not None
    info = json.loads((copied / "model.json").read_text())
    (copied / "model.json").write_text(json.dumps(info | {"styles": ["Old"]}))
    with pytest.raises(InputError, match=r"has incompatible inputs \(style\); export the model again"):
        _ = load(copied).network("step")
    (copied / "model.json").write_text(json.dumps(info))
    monkeypatch.setattr(module, "control_shapes", lambda styles: {"wind": (3,)})
    with pytest.raises(InputError, match=r"has incompatible inputs \(.*base.*wind\)"):
        _ = load(copied).network("step")


def test_phases_that_cannot_be_read(copied, folder):
    assert load(copied).phase_bank.shape[1:] == (13, 10, 2)
    assert load(folder).phase_bank.shape == (0, 13, 10, 2)
    for content in (b"no array", b""):
        (copied / "phases.npy").write_bytes(content)
        with pytest.raises(InputError, match=r"phases\.npy cannot be read"):
            _ = load(copied).phase_bank
    np.save(copied / "phases.npy", np.zeros((4, 7, 10, 2)))
    with pytest.raises(InputError, match=r"phases\.npy has windows of \(7, 10, 2\), not \(13, 10, 2\)"):
        _ = load(copied).phase_bank


def test_style_weights_are_a_single_one():
    model = Session(Path("nowhere"), INFO | {"styles": ["Old", "Angry"]})
    weights = model.style_weights([None, "Angry", "Old"])
    np.testing.assert_array_equal(weights, [[1, 0, 0], [0, 0, 1], [0, 1, 0]])
    assert weights.dtype == np.float32
    np.testing.assert_array_equal(model.style_weights([None, "Angry"], 0.0), [[1, 0, 0], [1, 0, 0]])
    np.testing.assert_array_equal(model.style_weights([None, "Angry+Old"], 3.0), [[1, 0, 0], [-2, 1.5, 1.5]])
    np.testing.assert_array_equal(model.style_weights(["angry", "OLD"]), [[0, 0, 1], [0, 1, 0]])
    with pytest.raises(InputError, match="the model 'few' has no style 'Sad'; it has Old, Angry"):
        model.style_weights(["Sad"])
    with pytest.raises(InputError, match="no style 'Angy'; did you mean 'Angry'\\? it has Old, Angry"):
        model.style_weights(["Angy"])
    with pytest.raises(InputError, match="it has none"):
        Session(Path("nowhere"), INFO | {"styles": []}).style_weights(["Old"])


def test_a_step_gives_its_outputs_by_name(session):
    shapes = module.state_shapes() | module.control_shapes(len(session.styles))
    feed = {name: np.full((2, *shape), 0.1, dtype=np.float32) for name, shape in shapes.items()}
    feed["rotations"][...] = feed["target_rotations"][...] = [1, 0, 0, 0, 1, 0]
    said = session.step(feed)
    carried = {f"next_{name}" for name in module.state_shapes()} - {"next_velocity_known"}
    assert set(said) == carried | {"contacts", "next_path"}
    for name in carried:
        assert said[name].shape == (2, *shapes[name.removeprefix("next_")])
    assert np.all((said["contacts"] >= 0.0) & (said["contacts"] <= 1.0))
    assert said["next_path"].shape == (2, 6, 6)


def test_a_network_is_opened_once() -> None:
    """Opening one takes as long as many frames."""
    loaded = load()
    assert loaded.network("plan") is loaded.network("plan")


def test_onnx_runtime_sends_nothing() -> None:
    """It writes a device id and looks up a collector, unless its telemetry is off before its import."""
    code = """
import os, sys
class Watch:
    def find_spec(self, name, path=None, target=None):
        if name == "onnxruntime":
            print(os.environ.get("ORT_DISABLE_TELEMETRY"))
sys.meta_path.insert(0, Watch())
import interpose
interpose.load_model()
"""
    environment = {name: value for name, value in os.environ.items() if name != "ORT_DISABLE_TELEMETRY"}
    told = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["1"]
