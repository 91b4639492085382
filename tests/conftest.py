"""What every test shares: real motion capture, where there is some, a small network, and how hypothesis draws."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from interpose.data.database import Database
    from interpose.models.dcmoe import DCMoE
    from interpose.models.stitching_cvae import StitchingCVAE
    from interpose.runtime.model_folder import Session
    from interpose.train.common.frames import Frames

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


# What is learned, made once for all tests; torch is imported by those that need it only.


@pytest.fixture(scope="session")
def database(tmp_path_factory: pytest.TempPathFactory) -> Database:
    """Three clips of marching people in two styles."""
    import learning

    return learning.write_database(tmp_path_factory.mktemp("learning") / "db")


@pytest.fixture(scope="session")
def frames(database: Database) -> Frames:
    """Every frame of them as tensors, with phases and mirror images."""
    import learning

    return learning.frames_of(database)


@pytest.fixture(scope="session")
def network(frames: Frames) -> DCMoE:
    """A small network of random weights that says a lot; not to be changed."""
    import learning

    return learning.network_for(frames)


@pytest.fixture(scope="session")
def model_folder(network: DCMoE, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That network, exported; not to be changed."""
    import learning

    from interpose import export

    folder = tmp_path_factory.mktemp("learning")
    run = learning.write_run(folder / "run", network)
    return export.export(run, folder / "marching", metrics={"valid/30": 0.9})


@pytest.fixture(scope="session")
def session(model_folder: Path) -> Session:
    """The exported network, loaded."""
    from interpose.runtime.model_folder import load

    return load(model_folder)


@pytest.fixture(scope="session")
def planned_network(frames: Frames) -> DCMoE:
    """One that has a planner; not to be changed."""
    import learning

    return learning.network_for(frames, config=learning.PLANNED)


@pytest.fixture(scope="session")
def planned_folder(planned_network: DCMoE, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That network, exported; not to be changed."""
    import learning

    from interpose import export

    folder = tmp_path_factory.mktemp("planned")
    run = learning.write_run(folder / "run", planned_network, learning.PLANNED)
    return export.export(run, folder / "planned")


@pytest.fixture(scope="session")
def planned_session(planned_folder: Path) -> Session:
    """The exported network, loaded."""
    from interpose.runtime.model_folder import load

    return load(planned_folder)


@pytest.fixture(scope="session")
def stitch_network(frames: Frames) -> StitchingCVAE:
    """A small stitching model of random weights that says a lot; not to be changed."""
    import stitch_learning

    return stitch_learning.network_for(frames)


@pytest.fixture(scope="session")
def stitch_folder(stitch_network: StitchingCVAE, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That model, exported; not to be changed."""
    import stitch_learning

    from interpose import export

    folder = tmp_path_factory.mktemp("stitching")
    run = stitch_learning.write_run(folder / "run", stitch_network)
    return export.export(run, folder / "stitching", metrics={"valid/30": 0.9})
