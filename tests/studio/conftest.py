"""The models that ship, loaded once; tests are skipped where they are not installed."""

from __future__ import annotations

import pytest
from studio_rigs import no_humanoid, opened, walk

from interpose.studio import methods
from interpose.studio.methods import Sessions
from interpose.studio.rigs import Clip


@pytest.fixture(scope="session")
def models() -> Sessions:
    found = methods.load()
    if set(found) != set(methods.TRAINED):
        pytest.skip("needs the models that ship")
    return found


@pytest.fixture(scope="session")
def clip() -> Clip:
    """Walking poses of the 22 joints as an opened file."""
    return opened(walk())


@pytest.fixture(scope="session")
def other() -> Clip:
    """A rig that is not a humanoid."""
    return opened(no_humanoid())
