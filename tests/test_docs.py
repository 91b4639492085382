"""The documentation keeps up with the code: its links, its names of functions and its commands are looked up there."""

from __future__ import annotations

import ast
import re
import shlex
from functools import cache
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest

from interpose import cli

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "interpose"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMANDS = {
    "demo", "info", "fill", "between", "studio", "models", "gallery", "prepare", "labels", "train",
    "export", "evaluate",
}  # fmt: skip

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_SPAN = re.compile(r"`([^`\n]+)`")
_NAME = re.compile(r"(?:interpose\.)?([a-z_]\w*(?:\.\w+)+)(?:\(\))?")


def prose(page: Path) -> str:
    """The page without its fenced blocks."""
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def command_lines(page: Path) -> list[str]:
    """The lines of its shell blocks that call interpose."""
    blocks = [
        body for language, body in _FENCE.findall(page.read_text(encoding="utf-8")) if language in ("", "sh", "bash")
    ]
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if re.match(r"(\./)?interpose\s", line.strip())]


def slug(heading: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


@cache
def names_in(module: Path) -> frozenset[str]:
    """Functions, classes, constants of a module, and of its classes the methods and fields, as Class.name."""
    found: set[str] = set()

    def add(body: list[ast.stmt], prefix: str) -> None:
        for node in body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found.add(prefix + node.name)
            if isinstance(node, ast.ClassDef):
                add(node.body, f"{prefix}{node.name}.")
            elif isinstance(node, ast.ImportFrom) and module.name == "__init__.py":
                found.update(alias.asname or alias.name for alias in node.names)
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                parts = [part for t in targets for part in (t.elts if isinstance(t, ast.Tuple) else [t])]
                found.update(prefix + part.id for part in parts if isinstance(part, ast.Name))

    add(ast.parse(module.read_text(encoding="utf-8")).body, "")
    return frozenset(found)


def module_of(name: str) -> tuple[Path, str] | None:
    """The file and what follows it in a dotted name relative to the package; None where it begins with no module."""
    parts = name.split(".")
    place = PACKAGE
    for i, part in enumerate(parts):
        if (place / f"{part}.py").is_file():
            return place / f"{part}.py", ".".join(parts[i + 1 :])
        if not (place / part).is_dir():
            return (place / "__init__.py", ".".join(parts[i:])) if i else None
        place /= part
    return place / "__init__.py", ""


def missing(span: str) -> str:
    """What is not there of a dotted name of this package; empty where all is, or where it is no such name."""
    match = None if span.endswith((".npz", ".npy", ".json", ".ts")) else _NAME.fullmatch(span)
    found = module_of(match[1]) if match else None
    if found is None or not found[1] or found[1] in names_in(found[0]):
        return ""
    return f"{found[0].relative_to(ROOT)} has no {found[1]}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_link_leads_somewhere(page: Path) -> None:
    for link in _LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = unquote(link).partition("#")
        target = page.parent / path if path else page
        assert target.exists(), f"{page.name} links to {link}"
        if anchor:
            headings = re.findall(r"^#+ (.+)$", _FENCE.sub("", target.read_text(encoding="utf-8")), re.MULTILINE)
            assert anchor in {slug(h) for h in headings}, f"{page.name} links to {link}, which has no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_name_of_code_exists(page: Path) -> None:
    for span in _SPAN.findall(prose(page)):
        assert not missing(span), f"{page.name} names {span}; {missing(span)}"


@pytest.mark.parametrize("picture", sorted((ROOT / "docs").glob("*.svg")), ids=lambda p: p.name)
def test_every_name_in_a_picture_exists(picture: Path) -> None:
    texts = [node for node in ElementTree.parse(picture).iter() if node.get("class") == "code"]
    assert texts
    for node in texts:
        assert not missing(node.text or ""), f"{picture.name} names {node.text}; {missing(node.text or '')}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_path_exists(page: Path) -> None:
    for span in _SPAN.findall(prose(page)):
        if re.fullmatch(r"(?:src|docs|tests|examples|benchmarks|requirements)/[\w./-]+", span):
            assert (ROOT / span).exists(), f"{page.name} names {span}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_command_is_known(page: Path) -> None:
    for span in _SPAN.findall(prose(page)):
        command = re.fullmatch(r"(?:\./)?interpose ([a-z]\w*)(?: .*)?", span)
        assert command is None or command[1] in COMMANDS, f"{page.name} names `{span}`"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_command_line_is_understood(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its options are parsed by the real parser; the work behind the commands is left out."""
    for work in (
        "cli.generate.fill",
        "cli.generate.between",
        "cli.studio.studio",
        "cli.inspect.info",
        "cli.inspect.models",
        "cli.develop.prepare",
        "cli.develop.labels",
        "cli.develop.train",
        "cli.develop.export",
        "cli.develop.evaluate",
        "cli.develop.evaluate_dcmoe",
        "cli.develop.evaluate_gallery",
        "cli.develop.evaluate_stitch",
        "cli.develop.evaluate_style",
        "cli.trajectories.build",
        "cli.trajectories.query",
        "cli.trajectories.plot",
        "cli.trajectories.generate",
        "demo.run.show",
    ):
        monkeypatch.setattr(f"interpose.{work}", lambda *_: 0)
    for line in command_lines(page):
        arguments = shlex.split(re.split(r" [|>] ", line)[0], comments=True)[1:]
        assert cli.main(arguments) == 0, f"{page.name}: {line}"


def test_the_method_page_covers_the_paper() -> None:
    """Every numbered part that the paper has, and every note that the code cites, is on the page."""
    page = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("|")]
    for section in ("3.1", "3.1.1", "3.1.2", "3.2", "4", "5.1", "5.2", "6.1", "6.2", "6.4"):
        assert any(re.match(rf"{re.escape(section)}[ ,]", row) for row in rows), f"section {section}"
    for equation in range(1, 9):
        assert any(re.match(rf"(?:\d, )*{equation}\b", row) for row in rows), f"equation {equation}"
    for picture in ("Figure 1", "Figure 2", "Figure 3", "Figure 4", "Figure 5", "Figure 6", "Table 1", "Table 2"):
        assert any(picture in row for row in rows), picture
    cited: set[str] = set()
    for module in PACKAGE.rglob("*.py"):
        cited |= set(re.findall(r"docs/method\.md,\s+([A-F]\d*)\b", module.read_text(encoding="utf-8")))
    assert cited
    for note in cited:
        assert f"**{note}." in page, f"the code cites {note} of docs/method.md"


def test_every_module_has_its_line_in_the_architecture() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = {span for line in page.splitlines() if line.startswith("|") for span in _SPAN.findall(line)}
    for file in PACKAGE.rglob("*.py"):
        parts = file.relative_to(PACKAGE).with_suffix("").parts
        if parts[-1] == "__init__":
            continue
        full = ".".join(parts)
        short = parts[0] in named and parts[-1] in named
        grouped = any(full.startswith(f"{name}_") or full == name for name in named)
        assert full in named or short or grouped, f"{full} has no line in docs/architecture.md"
