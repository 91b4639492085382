"""Where the built front end is found."""

from __future__ import annotations

from pathlib import Path

import pytest

from interpose.errors import InputError
from interpose.studio import front

BUILDS = """
from pathlib import Path
class Failed(Exception): ...
def build():
    {body}
"""


def builder(tmp_path: Path, body: str) -> Path:
    path = tmp_path / "build.py"
    path.write_text(BUILDS.format(body=body))
    return path


def test_an_installed_package_brings_it(tmp_path: Path) -> None:
    page = tmp_path / "page"
    page.mkdir()
    (page / "index.html").touch()
    assert front.find(page, builder(tmp_path, "raise AssertionError")) == page


def test_a_source_checkout_builds_it(tmp_path: Path) -> None:
    (tmp_path / "page").mkdir()  # an empty folder is no page
    assert front.find(tmp_path / "page", builder(tmp_path, "return Path('made')")) == Path("made")


@pytest.mark.parametrize("error", ["Failed('npm ci failed: no network')", "PermissionError(13, 'no network')"])
def test_what_cannot_be_built_is_told(tmp_path: Path, error: str) -> None:
    with pytest.raises(InputError, match=r"front end could not be built: .*no network"):
        front.find(tmp_path / "page", builder(tmp_path, f"raise {error}"))


def test_an_installation_without_it_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="missing from this installation"):
        front.find(tmp_path / "page", tmp_path / "build.py")
