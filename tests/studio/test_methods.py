"""The methods, models and galleries that are offered."""

from __future__ import annotations

from dataclasses import replace

import pytest

from interpose.errors import InputError
from interpose.runtime.backends.backend import abilities_of
from interpose.runtime.backends.registry import BACKENDS
from interpose.studio import methods
from interpose.studio.methods import Offer


def test_each_method_is_offered_with_each_model_that_serves_it(models: Offer) -> None:
    served = {(info.method, info.model): info for info in models.methods}
    assert list(dict.fromkeys(method for method, _ in served)) == [name for name in BACKENDS if name != "stitch+detail"]
    assert {("dcmoe", "default"), ("dcmoe", "styles"), ("plan", "stitch"), ("interp", None)} <= set(served)
    assert ("stitch", "default") not in served
    for (method, name), info in served.items():
        model = models.model_of(method, name)
        abilities = abilities_of(method, model)
        assert (info.styles, info.paths) == (list(abilities.styles), abilities.paths)
        assert (info.partial_targets, info.longest_seconds) == (abilities.partial_targets, abilities.longest_seconds)
        assert (info.licence is None) == (model is None)
    assert served["dcmoe", "default"].gallery
    assert not served["interp", None].gallery


def test_the_first_model_serves_where_none_is_named(models: Offer) -> None:
    for method, name in (("dcmoe", "default"), ("stitch", "stitch"), ("plan", "default")):
        found = models.model_of(method, None)
        assert found is not None
        assert found.name == name
    assert models.model_of("interp", None) is None


def test_a_model_or_method_that_is_not_there_is_refused(models: Offer) -> None:
    with pytest.raises(InputError, match="model 'stitch' is not installed for method 'dcmoe'; choose one of default"):
        models.model_of("dcmoe", "stitch")
    with pytest.raises(InputError, match="no installed model serves method 'dcmoe'; choose one of interp"):
        Offer(models=()).model_of("dcmoe", None)
    with pytest.raises(InputError, match="no installed model serves method 'magic'"):
        models.model_of("magic", None)


def test_without_models_interpolation_is_left() -> None:
    assert [(info.method, info.any_rig) for info in Offer(models=()).methods] == [("interp", True)]


def test_models_are_warmed(models: Offer) -> None:
    methods.warm(replace(models, models=models.models[:1]))
