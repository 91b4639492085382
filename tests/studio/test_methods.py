"""The methods that are offered."""

from __future__ import annotations

import pytest

from interpose.errors import InputError
from interpose.studio import methods
from interpose.studio.methods import Sessions


def test_each_model_that_is_there_and_interpolation_are_offered(models: Sessions) -> None:
    found = methods.offered(models)
    assert [one.method for one in found] == ["dcmoe", "stitch", "interp"]
    for one in found[:2]:
        assert one.model == models[one.method].name
        assert one.licence
        assert one.styles == list(models[one.method].styles)
        assert one.paths
    assert (found[2].model, found[2].styles, found[2].paths) == (None, [], False)


def test_without_models_interpolation_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object, **__: object) -> None:
        raise InputError("it is not installed")

    monkeypatch.setattr(methods, "choose", none)
    assert dict(methods.load()) == {}
    assert [one.method for one in methods.offered(methods.load())] == ["interp"]
    with pytest.raises(InputError, match="no model for method 'dcmoe' is installed; choose one of interp"):
        methods.session_of({}, "dcmoe")


def test_models_are_warmed(models: Sessions) -> None:
    methods.warm(models)
