"""The presets of S-CVAE and the rows of table 6."""

from dataclasses import asdict

from interpose.train.stitch.config import PRESETS, ablations


def test_the_papers_recipe_is_that_of_section_4_3():
    config = PRESETS["paper"]
    assert (config.stitch.learning_rate, config.stitch.rows) == (1e-4, 32)
    assert (config.betas, config.weight_decay) == ((0.5, 0.9), 1e-5)
    assert (config.shortest, config.longest) == (5, 50)
    assert (config.size.form, config.size.latents, config.size.planned, config.size.interpolated) == (
        *("paper", "frame", False, True),
    )
    assert (config.size.experts, config.size.latent, config.size.recurrent) == (4, 16, True)
    assert (config.chains.aligned, config.chains.both) == (True, True)
    assert config.warmup == 0  # a constant rate
    assert config.average == 0.0
    assert (config.sampling.velocity, config.sampling.path, config.sampling.style_dropout) == (0.0, 0.0, 1.0)


def test_each_row_of_table_6_takes_one_thing_away():
    ours = PRESETS["small"]
    rows = ablations(ours)
    assert rows["ours"] == ours
    assert not rows["w/o BS"].chains.both
    assert rows["w/o SL"].weights.stitch == 0.0
    assert not rows["w/o BA"].chains.aligned
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
