"""Where the built front end is found, and that its files, and nothing else of the disk, are served."""

from __future__ import annotations

from pathlib import Path

import pytest
from starlette.exceptions import HTTPException

from interpose.errors import InputError
from interpose.studio import front
from interpose.studio.front import serve_file

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


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    page = tmp_path / "page"
    (page / "assets").mkdir(parents=True)
    (page / "index.html").write_text("<title>Page</title>")
    (page / "assets" / "main-AbC_12-x.js").write_text("let a;")
    (page / "assets" / "plain.css").write_text("a {}")
    (page / "icon.svg").write_text("<svg/>")
    (page / "notes").write_text("no kind")
    (page / "key.pem").write_text("secret")
    (page / ".hidden.html").write_text("secret")
    (tmp_path / "secret.html").write_text("secret")
    (page / "link.html").symlink_to(tmp_path / "secret.html")
    (tmp_path / "beyond").mkdir()
    (tmp_path / "beyond" / "x.html").write_text("secret")
    (page / "away").symlink_to(tmp_path / "beyond")
    return page


def test_the_page_is_asked_for_anew_and_what_is_named_by_its_contents_is_kept(folder: Path) -> None:
    page = serve_file(folder, "")
    assert page.body == b"<title>Page</title>"
    assert page.headers["content-type"] == "text/html; charset=utf-8"
    assert page.headers["cache-control"] == "no-cache"
    assert serve_file(folder, "index.html").headers["cache-control"] == "no-cache"
    script = serve_file(folder, "assets/main-AbC_12-x.js")
    assert script.headers["content-type"] == "text/javascript; charset=utf-8"
    assert script.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert serve_file(folder, "assets/plain.css").headers["cache-control"] == "no-cache"
    assert serve_file(folder, "icon.svg").headers["content-type"] == "image/svg+xml"


@pytest.mark.parametrize(
    "path",
    [
        "..", "../secret.html", "assets/../../secret.html", "assets/../index.html", "./index.html", ".", "/index.html",
        "//index.html", "assets//plain.css", "assets/", "assets", "/etc/passwd", "etc/passwd", "C:/x.html",
        "..\\secret.html",
        "assets\\plain.css", "link.html", "away/x.html", ".hidden.html", "notes", "key.pem", "none.html", "index.html/",
        "index.html/x.html", "index.html\0", "index.html\n", "%2e%2e/secret.html",
        "a" * 300 + ".html", "a/" * 3000 + "a.html",
        "ındex.html", "index.html ", "~/x.html", "-/x.html",
    ],
)  # fmt: skip
def test_nothing_else_is_found(folder: Path, path: str) -> None:
    with pytest.raises(HTTPException) as caught:
        serve_file(folder, path)
    assert caught.value.status_code == 404


def test_an_absolute_path_is_no_way_out(folder: Path) -> None:
    with pytest.raises(HTTPException):
        serve_file(folder, str(folder.parent / "secret.html"))


def test_without_a_front_end_the_page_says_so() -> None:
    with pytest.raises(HTTPException, match="without its front end") as caught:
        serve_file(None, "")
    assert caught.value.status_code == 503
