"""Methods and models brought together: what is chosen, what is refused, what each model serves."""

import json

import pytest

from interpose.errors import InputError
from interpose.runtime import model_folder
from interpose.runtime.backends import backend
from interpose.runtime.backends.registry import BACKENDS, DEFAULT_METHOD
from interpose.runtime.model_folder import load

PLANNER = {"planner": {"latent": 4}}
STITCH = {"method": "stitch", "network": {}, "chains": {}}


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installed models of each kind: the default one, its like without a planner, stitching with and without detail."""
    models = {
        "default": {"method": "dcmoe", **PLANNER},
        "bare": {"method": "dcmoe"},
        "detailed": {**STITCH, **PLANNER, "detail": {}},
        "stitched": {**STITCH, **PLANNER},
        "paper": STITCH,
        "planner": {"method": "plan", **PLANNER},
    }
    for name, info in models.items():
        (tmp_path / name).mkdir()
        whole = {"format": model_folder.FORMAT, "name": name, "styles": ["Old"], "licence": "MIT", **info}
        (tmp_path / name / "model.json").write_text(json.dumps(whole))
    monkeypatch.setattr(model_folder, "INSTALLED", tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("name", "served"),
    [
        ("default", ("dcmoe", "plan")),
        ("bare", ("dcmoe",)),
        ("detailed", ("stitch", "stitch+detail", "plan")),
        ("stitched", ("stitch", "plan")),
        ("paper", ("stitch",)),
        ("planner", ("plan",)),
    ],
)
def test_a_model_serves_its_own_method_first_and_the_others_that_it_has_networks_for(installed, name, served):
    model = load(name)
    assert backend.methods_of(model) == served
    for method in BACKENDS:
        if method in served:
            assert backend.choose(method, name)[0] == method
            assert backend.abilities_of(method, model).styles == ("Old",)
        elif method != "interp":
            with pytest.raises(
                InputError, match=f"the model '{name}' serves {' and '.join(served)}, not".replace("+", r"\+")
            ):
                backend.choose(method, name)


@pytest.mark.parametrize(
    ("method", "model", "chosen", "served_by"),
    [
        (None, None, "dcmoe", "default"),
        (None, "stitched", "stitch", "stitched"),
        (None, "planner", "plan", "planner"),
        ("dcmoe", None, "dcmoe", "default"),
        ("stitch", None, "stitch", "detailed"),
        ("stitch+detail", None, "stitch+detail", "detailed"),
        ("plan", None, "plan", "default"),
        ("plan", "stitched", "plan", "stitched"),
        ("interp", None, "interp", None),
        ("interp", "bare", "interp", "bare"),
    ],
)
def test_what_is_left_out_is_chosen(installed, method, model, chosen, served_by):
    found, session = backend.choose(method, model)
    assert found == chosen
    assert (None if session is None else session.name) == served_by


def test_what_cannot_be_chosen(installed):
    with pytest.raises(InputError, match="unknown method 'magic'; choose one of dcmoe, stitch"):
        backend.choose("magic", None)
    with pytest.raises(InputError, match="no model 'nowhere'"):
        backend.choose("dcmoe", "nowhere")
    (installed / "detailed" / "model.json").unlink()
    with pytest.raises(InputError, match=r"no installed model serves method 'stitch\+detail'; name a model that does"):
        backend.choose("stitch+detail", None)
    with pytest.raises(InputError, match="method 'plan' needs a model"):
        backend.abilities_of("plan", None)


def test_backends_are_what_the_registry_names():
    assert DEFAULT_METHOD == "dcmoe"
    for name in BACKENDS:
        found = backend.backend_of(name)
        assert found.name == name
        assert found.summary
        assert backend.needs_model(name) == (name != "interp")


def test_what_methods_can_do(installed):
    model = load("detailed")
    assert backend.abilities_of("interp", None).longest_seconds is None
    assert backend.abilities_of("interp", None).any_rig
    assert backend.abilities_of("stitch", model).latent_variants
    assert not backend.abilities_of("plan", model).latent_variants
    assert backend.abilities_of("plan", model).longest_steps == 92
    assert backend.abilities_of("stitch", model).longest_seconds == pytest.approx(20.0)
    assert not backend.abilities_of("stitch", model).partial_targets
