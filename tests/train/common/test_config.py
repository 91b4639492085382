"""Configs to JSON and back, over presets, from runs and from models."""

import json
from dataclasses import replace

import learning
import pytest
import stitch_learning

from interpose.errors import InputError
from interpose.export import folder
from interpose.models.planner import PlannerSize
from interpose.train.common.config import check_data, from_plain, preset_of, read, to_plain
from interpose.train.dcmoe.config import PRESETS as DCMOE
from interpose.train.dcmoe.config import DCMoEConfig, Stage
from interpose.train.phases.recipe import PRESETS as PHASES
from interpose.train.planner.config import PRESETS as PLAN
from interpose.train.planner.config import PlannerConfig
from interpose.train.stitch.config import PRESETS as STITCH
from interpose.train.stitch.config import ablations
from interpose.train.stitch.detail import PRESETS as DETAIL
from interpose.train.target.recipe import PRESETS as TARGET

ALL = {
    f"{recipe} {name}": config
    for recipe, presets in (
        ("pae", PHASES),
        ("plan", PLAN),
        ("dcmoe", DCMOE),
        ("stitch", STITCH),
        ("detail", DETAIL),
        ("target", TARGET),
    )
    for name, config in presets.items()
}
WHOLE = {"dcmoe with a planner": learning.PLANNED, "stitch with a planner": stitch_learning.CONFIG}
WHOLE |= {f"stitch {name}": config for name, config in ablations(stitch_learning.CONFIG).items()}


@pytest.mark.parametrize("config", (ALL | WHOLE).values(), ids=(ALL | WHOLE).keys())
def test_a_config_survives_json(config):
    config = replace(config, seed=4, styles=("Old", "Young"), databases=("synthetic 1234",), licence="MIT")
    plain = to_plain(config)
    assert json.loads(json.dumps(plain)) == plain
    assert from_plain(type(config), plain) == config


@pytest.mark.parametrize(("name", "config"), ALL.items())
def test_a_preset_has_its_own_name(name, config):
    assert config.preset == name.split()[1]
    assert preset_of(ALL, name) is config
    with pytest.raises(InputError, match="no preset 'huge'; there are pae full, pae small"):
        preset_of(ALL, "huge")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"depth": 3}, "the config has no field 'depth'; it has preset, learning_rate"),
        ({"size": {"width": 3}}, "the config has no field 'size.width'; it has latent, hidden"),
        ({"steps": "many"}, "the config's 'steps' cannot be 'many'"),
        ({"steps": 1.5}, "the config's 'steps' cannot be 1.5"),
        ({"steps": True}, "the config's 'steps' cannot be True"),
        ({"half": 1}, "the config's 'half' cannot be 1"),
        ({"size": 3}, "the config's 'size' cannot be 3"),
        ({"styles": "Old"}, "the config's 'styles' cannot be 'Old'"),
        ({"styles": ["Old", 3]}, r"the config's 'styles\[1\]' cannot be 3"),
    ],
)
def test_values_that_do_not_fit(values, message):
    with pytest.raises(InputError, match=message):
        from_plain(PlannerConfig, values)


def test_tuples_of_classes_and_of_fixed_length():
    made = from_plain(DCMoEConfig, {"stages": [{"steps": 3, "unroll": 2, "rows": 8}], "gate": [8, 4], "fresh": 1})
    assert made.stages == (Stage(3, 2, 8),)
    assert (made.gate, made.fresh, made.plan) == ((8, 4), 1.0, None)
    assert isinstance(made.fresh, float)
    with pytest.raises(InputError, match=r"the config's 'gate' cannot be \[8\]"):
        from_plain(DCMoEConfig, {"gate": [8]})


@pytest.fixture
def write(tmp_path):
    def write(values, name="settings.json"):
        path = tmp_path / name
        path.write_text(values if isinstance(values, str) else json.dumps(values))
        return path

    return write


def test_a_partial_file_is_laid_over_the_preset(write):
    base = PLAN["tiny"]
    made = read(write({"steps": 99, "size": {"latent": 3}}), base)
    assert made == replace(base, steps=99, size=replace(base.size, latent=3))
    assert made.size.hidden == PLAN["tiny"].size.hidden != PlannerSize().hidden


def test_a_runs_config_gives_its_settings_but_not_its_data(write):
    config = replace(learning.PLANNED, seed=7, hidden=24)
    made = read(write(to_plain(config), "config.json"), DCMOE["full"])
    assert made == replace(config, databases=(), styles=(), licence="")


def test_a_models_config_gives_its_settings_and_its_planners(write, tmp_path, network):
    saved = {"config": to_plain(stitch_learning.CONFIG), "step": 3}
    made = folder.write(tmp_path / "model", saved, "stitch", network, lambda _: {}) / "model.json"
    assert read(made, STITCH["small"]) == replace(stitch_learning.CONFIG, databases=(), styles=(), licence="")
    planner = read(made, PLAN["small"], part="plan")
    assert planner == replace(learning.PLANNER, databases=(), styles=(), licence="")


def test_what_completes_a_model_has_its_own_config_there(write):
    config = replace(DETAIL["tiny"], rows=12)
    info = {"training": to_plain(learning.PLANNED), "detail": {"steps": 3, "training": to_plain(config)}}
    assert read(write(info), DETAIL["full"], part="detail") == config
    old = {"former_training": {}, "detail": {"steps": 3, "training": to_plain(config)}}
    assert read(write(old), DETAIL["full"], part="detail") == config


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "settings.json: cannot be read as JSON"),
        ("[3]", "settings.json: holds no JSON object; give config.json, model.json or an object of settings"),
        ({"steps": "x"}, "settings.json: the config's 'steps' cannot be 'x'"),
        (
            {"format": 2, "former_training": {"preset": "small"}},
            "settings.json: this model was trained by an older recipe, which cannot be repeated",
        ),
    ],
)
def test_files_that_cannot_be_used(write, content, message):
    with pytest.raises(InputError, match=message):
        read(write(content), PLAN["tiny"])


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match=r"none\.json: cannot be read as JSON"):
        read(tmp_path / "none.json", PLAN["tiny"])


def test_a_warning_where_the_data_differ(write, tmp_path, capsys):
    run = tmp_path / "run"
    run.mkdir()
    (run / "config.json").write_text(json.dumps(to_plain(learning.PLANNER)))
    check_data(write({"steps": 3}), run)
    check_data(write({"training": to_plain(learning.PLANNER)}), run)
    assert capsys.readouterr().err == ""
    path = write({"training": to_plain(replace(learning.PLANNER, databases=("other 5678",)))})
    check_data(path, run)
    assert (
        f"warning: {path} was made from other data: other 5678; this run has synthetic 1234" in capsys.readouterr().err
    )


def test_a_warning_where_the_planner_differs(write, tmp_path, capsys):
    run = tmp_path / "run"
    run.mkdir()
    (run / "config.json").write_text(json.dumps(to_plain(learning.PLANNED)))
    check_data(write({"training": to_plain(learning.PLANNED)}), run)
    assert capsys.readouterr().err == ""
    other = replace(learning.PLANNED, plan=replace(learning.PLANNER, steps=77))
    path = write({"training": to_plain(other)})
    check_data(path, run)
    assert f"warning: {path} was made along a planner of other settings (steps)" in capsys.readouterr().err
