"""The documentation keeps up with the code: its links, names, commands and recipes are checked, and its English."""

from __future__ import annotations

import ast
import re
import shlex
import textwrap
from dataclasses import fields
from functools import cache, wraps
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest

from interpose import cli
from interpose.cli import gallery, make_motion, train_and_measure
from interpose.data import sources
from interpose.retarget import profiles
from interpose.runtime.backends.backend import Backend
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.request import Info

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "interpose"
TEXTS = (".py", ".md", ".rs", ".ts", ".svelte", ".toml", ".txt", ".svg", ".html")
"""Suffixes of the files that people read."""
MOST_WORDS = 16_000
"""Of the README and all pages."""
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMANDS = {
    "demo", "info", "fill", "between", "studio", "models", "gallery", "prepare", "labels", "train",
    "export", "evaluate",
}  # fmt: skip

_FENCE = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
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


def blocks(page: Path, language: str) -> list[str]:
    """Its fenced blocks in a language, without their indentation."""
    found = _FENCE.findall(page.read_text(encoding="utf-8"))
    return [textwrap.dedent(body) for of, body in found if of == language]


@cache
def repository() -> dict[Path, str]:
    """The texts of the repository, by path from its root."""
    folders = ["src", "tests", "docs", "benchmarks", "examples", "requirements", "web/src", "web/tests"]
    files = [file for folder in folders for file in (ROOT / folder).rglob("*")]
    files += [*ROOT.iterdir(), *(ROOT / "web").iterdir()]
    built = {"node_modules", "__pycache__", "target"}
    wanted = [f for f in files if f.suffix in TEXTS and f.is_file() and not built & set(f.parts)]
    return {f.relative_to(ROOT): f.read_text(encoding="utf-8") for f in wanted}


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
    everywhere = {name for module in PACKAGE.rglob("*.py") for name in names_in(module)}
    for node in texts:
        name = node.text or ""
        assert not missing(name), f"{picture.name} names {name}; {missing(name)}"
        assert module_of(name) or name in everywhere, f"{picture.name} names {name}, which no module has"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_path_exists(page: Path) -> None:
    for span in _SPAN.findall(prose(page)):
        if "NAME" not in span and re.fullmatch(r"(?:src|docs|tests|examples|benchmarks|requirements)/[\w./-]+", span):
            assert (ROOT / span).exists(), f"{page.name} names {span}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_command_is_known(page: Path) -> None:
    for span in _SPAN.findall(prose(page)):
        command = re.fullmatch(r"(?:\./)?interpose ([a-z]\w*)(?: .*)?", span)
        assert command is None or command[1] in COMMANDS, f"{page.name} names `{span}`"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_command_line_is_understood(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its options are parsed by the real parser; the work behind the commands is left out."""
    for module, names in (
        (make_motion, ("demo", "info", "fill", "between", "models", "studio")),
        (train_and_measure, ("prepare", "labels", "train", "export", "evaluate")),
        (gallery, ("build", "query", "plot", "generate")),
    ):
        for name in names:
            monkeypatch.setattr(module, name, wraps(getattr(module, name))(lambda *_, **__: 0))
    for line in command_lines(page):
        arguments = shlex.split(re.split(r" [|>] ", line)[0], comments=True)[1:]
        assert cli.main(arguments) == 0, f"{page.name}: {line}"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_every_program_is_python_with_names_that_exist(page: Path) -> None:
    for body in blocks(page, "python"):
        for node in ast.walk(ast.parse(body)):
            if isinstance(node, ast.ImportFrom):
                imported = __import__(str(node.module), fromlist=["x"])
                for alias in node.names:
                    assert hasattr(imported, alias.name), f"{page.name}: {node.module} has no {alias.name}"


def test_the_command_page_has_every_field_of_the_json() -> None:
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    for field in (*(f.name for f in fields(Info)), "variant", "output"):
        assert f"`{field}`" in page, field


@pytest.mark.parametrize("command", ["demo", "info", "fill", "between", "studio", "models"])
def test_the_command_page_has_every_option(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert cli.main([command, "--help"]) == 0
    for option in set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", capsys.readouterr().out)) - {"--help"}:
        assert option in page, option


def test_the_method_page_covers_the_papers() -> None:
    """Every numbered part of DC-MoE, and every equation of S-CVAE, has a row."""
    page = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("|")]
    for section in ("3.1", "3.1.1", "3.1.2", "3.2", "4", "4.1", "4.2", "5.1", "5.2", "6.1", "6.2", "6.4", "9.1"):
        assert any(re.search(rf"(?:^|, ){re.escape(section)}[ ,]", row) for row in rows), f"section {section}"
    for equation in range(1, 9):
        assert any(re.match(rf"{equation} ", row) for row in rows), f"equation {equation}"
    for picture in ("Figure 1", "Figure 2", "Figure 3", "Figure 4", "Figure 5", "Figure 6", "Table 1", "Table 2"):
        assert any(picture in row for row in rows), picture
    stitching = " ".join(row for row in rows if "equation" in row)
    for equations in ("1, 2", "3", "4 to 10", "11, 12", "13"):
        assert re.search(rf"equations? {equations}\b", stitching), f"equations {equations} of S-CVAE"


def test_every_room_has_its_line_in_the_architecture() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    named = {span for line in page.splitlines() if line.startswith("| `") for span in _SPAN.findall(line)}
    rooms = {p.stem for p in PACKAGE.iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert rooms - named == {"__init__", "__main__"}


def test_the_recipe_for_a_method_works() -> None:
    """The backend in docs/architecture.md, as it stands there."""
    (body,) = (body for body in blocks(ROOT / "docs" / "architecture.md", "python") if "BACKEND" in body)
    scope: dict[str, object] = {}
    exec(body, scope)
    backend = scope["BACKEND"]
    assert isinstance(backend, Backend)
    still = np.zeros((1, 1, 3)), np.tile([0.0, 0.0, 0.0, 1.0], (1, 1, 22, 1))
    made = backend.generate(None, batch_of(still, still, 5))
    assert (made.root.shape, made.local.shape, made.contacts.shape) == ((1, 5, 3), (1, 5, 22, 4), (1, 5, 4))


def test_the_recipes_for_a_rig_and_a_data_set_work() -> None:
    entries = blocks(ROOT / "docs" / "architecture.md", "")
    (rig,) = (body for body in entries if body.startswith("Profile("))
    (profile,) = eval(rig, dict(vars(profiles)))
    assert profile.joints()["LeftFoot"] == "LFoot"
    (entry,) = (body for body in entries if body.startswith('"mine"'))
    (dataset,) = eval("{" + entry + "}", dict(vars(sources))).values()
    assert dataset.labels(sources.PurePosixPath("sad_01.bvh")) == sources.ClipLabels("sad", subject="01")


def test_the_pages_are_short() -> None:
    words = {page.name: len(page.read_text(encoding="utf-8").split()) for page in PAGES}
    assert sum(words.values()) <= MOST_WORDS, words


def test_every_picture_is_used() -> None:
    used = {link for page in PAGES for link in _LINK.findall(page.read_text(encoding="utf-8"))}
    names = {Path(link).name for link in used}
    for picture in (ROOT / "docs").iterdir():
        assert picture.suffix == ".md" or picture.name in names, f"no page shows docs/{picture.name}"


def test_nothing_cites_what_is_not_here() -> None:
    """Working notes outside the repository, pages that do not exist, and labels that only their author knows."""
    for path, text in repository().items():
        assert not re.search(r"\b(?:METHOD|DESIGN|EXAMPLES|WORDING)[.]md", text), path
        for page in re.findall(r"\bdocs/([\w-]+[.]md)\b", text):
            assert (ROOT / "docs" / page).exists(), f"{path} cites docs/{page}"
        assert not re.search(r"[.]md,\s+[A-GS]\d{1,2}\b", text), path


_ODD = (
    "make all others anew", "or no time at all", "the hands are there", "is interpolated, and told so",
    "skip, saying so", "what it is worth", "what this is worth", "is worth what", "its own way", "the model's own way",
    "root's way on the ground", "beside the way that the model foresees", "different answers to write",
    "how long the way takes", "that its frames do not describe", "another's upper body", "of weights and draws",
    "its size is the model's", "for want of a counterpart", "otherwise than this program",
    "how long this takes is not known", "is there and is no model folder", "has no use for it", "brings it",
    "by a fault of its own", "likeliest way", "goes as it likes", "knows no way there", "one key at least has to stay",
    "as far as it goes", "a pose of another rig", "that come along", "made again", "wrong to see", "the tremble goes",
    "all that can be done", "foreign keys", "the paper's letter", "anew",
)  # fmt: skip
"""Phrases that a reader stumbles over; the pages and the help say these things in the usual words."""


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_pages_are_plain_english(page: Path) -> None:
    text = " ".join(page.read_text(encoding="utf-8").lower().split())
    assert [phrase for phrase in _ODD if re.search(rf"\b{re.escape(phrase)}\b", text)] == []


@pytest.mark.parametrize("command", ["", *sorted(COMMANDS)])
def test_help_is_plain_english(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    calls = [[command]] if command else [[]]
    if command == "gallery":
        calls += [["gallery", each] for each in ("build", "query", "plot", "generate")]
    for call in calls:
        assert cli.main([*call, "--help"]) == 0
        text = " ".join(re.sub(r"[^\x20-\x7e]", " ", capsys.readouterr().out.lower()).split())
        assert text
        assert [phrase for phrase in _ODD if re.search(rf"\b{re.escape(phrase)}\b", text)] == []
