"""Requests: what is refused before anything is generated, and what is normalised."""

from pathlib import Path

import pytest

from interpose.errors import InputError
from interpose.runtime.model_folder import Session, load
from interpose.runtime.request import Request


def stand_in(method="dcmoe", **more):
    return Session(Path("nowhere"), {"name": "stand-in", "method": method, "styles": ["Angry", "Old"], **more})


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda: Request("magic"),
            "unknown method 'magic'; choose one of dcmoe, stitch, stitch\\+detail, plan, interp",
        ),
        (lambda: Request("dcmoe"), "needs a model"),
        (lambda: Request("dcmoe", stand_in("stitch")), "the model 'stand-in' serves stitch, not 'dcmoe'"),
        (lambda: Request("plan", stand_in()), "the model 'stand-in' serves dcmoe, not 'plan'"),
        (lambda: Request("dcmoe", stand_in(), "Sad"), "no style 'Sad'; it has Angry, Old"),
        (lambda: Request("interp", None, "Angry"), "method 'interp' has no styles here; leave out style 'Angry'"),
        (lambda: Request("interp", path="straight"), "method 'interp' follows no path"),
        (lambda: Request("interp", path_control=0.5), "method 'interp' follows no path"),
        (lambda: Request("dcmoe", stand_in(), path="gallery"), "there is no gallery to match a path from"),
        (lambda: Request("dcmoe", stand_in(), path="sideways"), "unknown path 'sideways'"),
        (lambda: Request("dcmoe", stand_in(), speed="hasty"), "unknown speed 'hasty'"),
        (lambda: Request("dcmoe", stand_in(), path_control=1.5), "control must be 0 to 1"),
        (lambda: Request("dcmoe", stand_in(), style_strength=3.1), "strength must be 0 to 3, got 3.1"),
        (lambda: Request("dcmoe", stand_in(), style_strength=float("nan")), "strength must be 0 to 3, got nan"),
        (lambda: Request("interp", style_strength=2.0), "a style strength of 2 needs a method and a model"),
        (lambda: Request("interp", seed=-1), "seed must be 0 or more"),
    ],
)
def test_what_the_method_and_the_model_cannot_do_is_refused(ask, message):
    with pytest.raises(InputError, match=message):
        ask()


@pytest.mark.parametrize(
    ("given", "spelled"), [("ANGRY", "Angry"), ("old", "Old"), (" old + angry", "Old:0.5+Angry:0.5"), (None, None)]
)
def test_a_style_is_spelled_as_the_model_spells_it(given, spelled):
    assert Request("dcmoe", stand_in(), given).style == spelled


@pytest.mark.parametrize(
    ("given", "near"), [("Agry", "Angry"), ("OLDE", "Old"), ("Angry:0.3+Odl:0.7", "Old"), ("Angry old", "Angry")]
)
def test_a_near_miss_is_suggested(given, near):
    with pytest.raises(InputError, match=rf"did you mean '{near}'\? it has Angry, Old"):
        Request("dcmoe", stand_in(), given)


def test_a_gallery_implies_its_path():
    gallery = load().gallery
    assert gallery is not None
    assert Request("dcmoe", stand_in(), gallery=gallery).path == "gallery"
    assert Request("dcmoe", stand_in(), gallery=gallery, path="none").path == "none"
    assert Request("dcmoe", stand_in(), gallery=gallery).trajectories is gallery
    assert Request("interp", gallery=gallery).path == "auto"
    assert Request("dcmoe", load()).path == "auto"
    assert Request("dcmoe", load(), path="gallery").trajectories is not None


def test_what_the_two_can_do():
    planned = stand_in(planner={"latent": 4})
    assert Request("dcmoe", stand_in()).abilities.styles == ("Angry", "Old")
    assert Request("plan", planned).abilities.longest_steps == 92
    assert Request("dcmoe", stand_in(target={"latent": 8})).abilities.partial_targets
    assert not Request("dcmoe", planned).abilities.partial_targets
    assert Request("stitch", stand_in("stitch")).abilities.latent_variants
    assert Request("stitch+detail", stand_in("stitch", detail={})).backend.name == "stitch+detail"
    with pytest.raises(InputError, match=r"serves stitch, not 'stitch\+detail'"):
        Request("stitch+detail", stand_in("stitch"))
