"""The presets of S-CVAE and the rows of table 6."""

import json
from dataclasses import asdict, replace

import pytest

from interpose.train.stitch.config import PRESETS, ablations, config_of, size_of


def test_the_papers_recipe_is_that_of_section_4_3():
    config = PRESETS["paper"]
    assert (config.stitch.learning_rate, config.stitch.rows) == (1e-4, 32)
    assert (config.betas, config.weight_decay) == ((0.5, 0.9), 1e-5)
    assert (config.shortest, config.longest) == (5, 50)
    assert (config.size.form, config.size.latents, config.size.planned, config.size.interpolated) == (
        *("paper", "frame", False, True),
    )
    assert (config.size.experts, config.size.latent, config.size.recurrent) == (4, 16, True)
    assert (config.course.aligned, config.course.both) == (True, True)
    assert config.warmup == 0  # a constant rate
    assert config.average == 0.0
    assert (config.sampling.velocity, config.sampling.path, config.sampling.style_dropout) == (0.0, 0.0, 1.0)


@pytest.mark.parametrize("name", list(PRESETS))
def test_a_config_survives_being_saved(name):
    for config in ablations(replace(PRESETS[name], styles=("Old",), seed=4)).values():
        told = json.loads(json.dumps(asdict(config)))
        assert config_of(told) == config
        assert size_of(told["size"]) == config.size
    assert PRESETS[name].preset == name


def test_each_row_of_table_6_takes_one_thing_away():
    ours = PRESETS["small"]
    rows = ablations(ours)
    assert rows["ours"] == ours
    assert not rows["w/o BS"].course.both
    assert rows["w/o SL"].weights.stitch == 0.0
    assert not rows["w/o BA"].course.aligned
    assert rows["w/o PM"].size.experts == 1
    assert rows["w/o D"].weights.adversarial == 0.0
    assert not rows["w/o LSTM"].size.recurrent
    assert rows["z a frame"].size.latents == "frame"
    assert not rows["z a frame, w/o LI"].size.interpolated
    assert not rows["w/o plan"].size.planned

    def changes(a, b):
        pairs = [(k, v, asdict(b)[k]) for k, v in asdict(a).items()]
        inner = [(f"{k}.{i}", v[i], w[i]) for k, v, w in pairs if isinstance(v, dict) for i in v]
        return [k for k, v, w in inner + [p for p in pairs if not isinstance(p[1], dict)] if v != w]

    single = {name: changes(ours, row) for name, row in rows.items() if name not in ("ours", "as printed")}
    assert all(len(c) == (2 if "LI" in name else 1) for name, c in single.items()), single
