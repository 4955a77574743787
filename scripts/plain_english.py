"""Refuse vague openings of docstrings and vague names in Python, by the lists in CONTRIBUTING.md ("Plain English")."""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("src", "bench/src", "scripts")
Documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def main() -> int:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    files = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py"))
    complaints = [f"{path.relative_to(ROOT)}:{line}" for path in files for line in vague(path, refused(page))]
    print("\n".join(complaints), end="\n" if complaints else "")
    return int(bool(complaints))


def refused(page: str) -> dict[str, list[str]]:
    """Return the lists of CONTRIBUTING.md: `openings` of docstrings, `words` in names, names from `outside`."""
    lines = page.split("```refused\n")[1].split("\n```")[0].splitlines()
    return {
        name: [entry.strip() for entry in entries.split(",")] for name, entries in (line.split(":") for line in lines)
    }


def vague(path: Path, lists: dict[str, list[str]]) -> Iterator[str]:
    """Yield line and complaint for each docstring and name of a file, its own included, that the lists refuse."""
    if set(path.stem.split("_")) & set(lists["words"]):
        yield f"1: the module's name says nothing: {path.stem}"
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, Documented):
            continue
        number, name = getattr(node, "lineno", 1), getattr(node, "name", "")
        if name.strip("_").lower().split("_")[0] in lists["words"] and name not in lists["outside"]:
            yield f"{number}: the name says nothing: {name}"
        first = (ast.get_docstring(node) or "").split("\n")[0]
        if any(re.match(rf"{opening}\b", first) for opening in lists["openings"]):
            yield f"{number}: the docstring opens vaguely: {first}"


if __name__ == "__main__":
    sys.exit(main())
