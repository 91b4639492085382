"""The bundled models, loaded once; tests that need them are skipped if they are not installed."""

from __future__ import annotations

import pytest
from studio_rigs import no_humanoid, opened, walk

from interpose.studio.methods import Offer
from interpose.studio.rigs import Clip


@pytest.fixture(scope="session")
def models() -> Offer:
    found = Offer()
    if not {"default", "stitch"} <= {model.name for model in found.models}:
        pytest.skip("needs the bundled models")
    return found


@pytest.fixture(scope="session")
def clip() -> Clip:
    """Walking poses of the 22 joints as an opened file."""
    return opened(walk())


@pytest.fixture(scope="session")
def other() -> Clip:
    """A rig that is not a humanoid."""
    return opened(no_humanoid())
