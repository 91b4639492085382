"""The scene of a first visit can be opened as any project."""

from __future__ import annotations

import numpy as np

from interpose.studio import projects
from interpose.studio.methods import Offer
from interpose.studio.rigs import Clip, RigStore, identity
from interpose.studio.sample import sample


def test_the_sample_is_a_project_like_any_other() -> None:
    store = RigStore()
    made = projects.read(sample().model_dump_json().encode(), store)
    assert made == sample()
    clip = store.get(identity(made.source.text.encode()))
    assert isinstance(clip, Clip)
    assert len(clip.motion) == len(made.keys)
    assert clip.humanoid.profile == "LaFAN1"
    low = clip.motion.global_positions()[..., 1].min(axis=1)
    np.testing.assert_allclose(low, 0.02, atol=2e-3)


def test_its_styles_are_those_of_the_models(models: Offer) -> None:
    for key in sample().keys:
        if key.after.style is not None:
            model = models.model_of(key.after.method, key.after.model)
            assert model is not None
            assert key.after.style in model.styles
