"""CONTRIBUTING.md is true: its diagrams are the contracts that lint-imports checks, and the paths in the docs exist."""

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from scripts.plain_english import refused, vague
from tests.run_page import blocks

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "CONTRIBUTING.md"
DECISIONS = sorted((ROOT / "docs" / "decisions").glob("0*.md"))
PRESETS = ("best", "paper")
NAMING_PATHS = [PAGE, ROOT / "README.md", ROOT / "docs" / "pipeline.md", *DECISIONS]


def _answers() -> list[str]:
    """The rows of the table below "Where to find things"."""
    part = PAGE.read_text(encoding="utf-8").split("## Where to find things")[1].split("\n## ")[0]
    return [line for line in part.splitlines() if line.startswith("| Where")]


def test_the_diagram_shows_the_layers_that_are_checked() -> None:
    (layers,) = [contract for contract in _contracts("layers") if contract["containers"] == ["meshreel"]]
    assert _floors("layers") == [_names(floor) for floor in layers["layers"]]


def test_the_diagram_shows_the_siblings_that_are_checked() -> None:
    checked = [{name.removeprefix("meshreel.") for name in found["modules"]} for found in _contracts("independence")]
    assert [floor for floor in _floors("siblings") if floor not in checked] == []
    assert [modules for modules in checked if modules not in _floors("siblings")] == []


@pytest.mark.parametrize("page", NAMING_PATHS, ids=lambda page: page.name)
def test_paths_of_code_in_the_docs_exist(page: Path) -> None:
    named = re.findall(r"`([\w./{},*-]+/[\w.{},*-]*\.(?:py|cpp|h|ts|md))`", page.read_text(encoding="utf-8"))
    assert [path for path in named if not all(map(_exists, _spelled_out(path)))] == []


@pytest.mark.parametrize("row", _answers(), ids=lambda row: row.split("|")[1].strip())
def test_functions_are_where_the_page_says(row: str) -> None:
    named = re.findall(r"`([^`]+)`", row.split("|")[2])
    files = [path for name in named for path in (ROOT / "src" / "meshreel").glob(name) if path.is_file()]
    code = "\n".join(path.read_text(encoding="utf-8") for path in files)
    functions = [name for name in named if re.fullmatch(r"[a-z]+_?[a-z_]*", name) and name not in PRESETS]
    assert [name for name in functions if not re.search(rf"def {name}\b", code)] == []


@pytest.mark.parametrize("page", DECISIONS, ids=lambda page: page.name)
def test_a_decision_says_whether_it_holds(page: Path) -> None:
    status = re.search(r"^Status: (.+)\.$", page.read_text(encoding="utf-8"), re.MULTILINE)
    assert status is not None
    short = status[1].split(": ")[0]
    assert re.fullmatch(r"accepted|(accepted; in part )?superseded by \[\d+\]\(\S+\)", short)
    index = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    assert re.search(rf"\({re.escape(page.name)}\) \| .* \| {re.escape(short)} \|$", index, re.MULTILINE)


@pytest.mark.parametrize(
    ("code", "line"),
    [
        ('"""What is to be encoded."""', 1),
        ('class Job:\n    """Who is told of progress."""', 1),
        ('x = 1\n\ndef find():\n    """Return what was found."""', 3),
        ("def process_frames(): ...", 1),
        ("class _Helper: ...", 1),
        ('def find():\n    """Return whether a frame is empty. What it costs."""', None),
        ("def handle_exit(): ...", None),
        ("def unprocessed(): ...", None),
    ],
)
def test_vague_openings_and_names_are_refused(code: str, line: int | None, tmp_path: Path) -> None:
    path = tmp_path / "frames.py"
    path.write_text(code, encoding="utf-8")
    complaints = list(vague(path, refused(PAGE.read_text(encoding="utf-8"))))
    assert [complaint.split(":")[0] for complaint in complaints] == ([] if line is None else [str(line)])


def test_a_module_of_all_and_sundry_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mesh_utils.py"
    path.write_text("", encoding="utf-8")
    assert len(list(vague(path, refused(PAGE.read_text(encoding="utf-8"))))) == 1


def _contracts(kind: str) -> list[dict[str, Any]]:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return [contract for contract in settings["tool"]["importlinter"]["contracts"] if contract["type"] == kind]


def _floors(language: str) -> list[set[str]]:
    """The names in each line of a diagram, without the remark to their right."""
    return [_names(re.split(r"\s{2,}", line)[0]) for line in blocks(PAGE, language).splitlines() if line]


def _names(floor: str) -> set[str]:
    return {name.strip() for name in re.split("[|:]", floor)}


def _spelled_out(path: str) -> list[str]:
    """A path with braces as all paths that it stands for."""
    found = re.search(r"\{([^}]*)\}", path)
    if found is None:
        return [path]
    return [made for name in found[1].split(",") for made in _spelled_out(path.replace(found[0], name, 1))]


def _exists(path: str) -> bool:
    """From the root of the repository, or from the package's."""
    return any(True for base in (ROOT, ROOT / "src" / "meshreel") for _ in base.glob(path))
