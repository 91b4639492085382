"""What every test shares: the folder of real motion capture, where there is one, and how hypothesis draws."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples on every run and every machine, and no time limit: a test fails for its content alone.
settings.register_profile("interpose", derandomize=True, deadline=None, max_examples=60)
settings.load_profile("interpose")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder that INTERPOSE_DATA names, which holds lafan1/, 100style/ and so on; skips where it is not set."""
    named = os.environ.get("INTERPOSE_DATA")
    if not named:
        pytest.skip("needs real motion capture: set INTERPOSE_DATA to the folder that holds lafan1/, 100style/, …")
    return Path(named)


def _data_set(data_dir: Path, name: str) -> Path:
    folder = data_dir / name
    if not folder.is_dir():
        pytest.skip(f"needs the data set {name}, which is not in INTERPOSE_DATA ({data_dir})")
    return folder


@pytest.fixture(scope="session")
def lafan1_dir(data_dir: Path) -> Path:
    """LaFAN1's BVH files, or skip."""
    return _data_set(data_dir, "lafan1")


@pytest.fixture(scope="session")
def style100_dir(data_dir: Path) -> Path:
    """100STYLE's BVH files and tables, or skip."""
    return _data_set(data_dir, "100style")


@pytest.fixture(scope="session", params=["bandai-namco-1", "bandai-namco-2"])
def bandai_dir(data_dir: Path, request: pytest.FixtureRequest) -> Path:
    """The BVH files of each Bandai-Namco set in turn, or skip."""
    return _data_set(data_dir, request.param)
