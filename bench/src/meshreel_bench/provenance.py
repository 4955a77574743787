"""What made a row: the version of the package, the commit of its checkout, the machine.

In: nothing. Out: JSON-ready records. Rows of several makers in one plot are told apart by them.
"""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import ModuleType

from meshreel import __version__

from .rows import Row

MADE_BY = "made_by"  # of a row
_DIGITS = 12  # of a commit


@cache
def commit() -> str | None:
    """The commit of the checkout that this package runs from, with + where files differ; None outside of one."""
    here = Path(__file__).resolve().parent
    try:
        head = _git(here, "rev-parse", "HEAD")
        tracked = _git(here, "ls-files", "--error-unmatch", Path(__file__).name)
        changed = _git(here, "status", "--porcelain", "--", "..", ":(top)core", ":(top)CMakeLists.txt")
    except (OSError, subprocess.SubprocessError):  # no git, or the package is installed
        return None
    return head[:_DIGITS] + ("+" if changed else "") if tracked else None


def _git(folder: Path, *words: str) -> str:
    answer = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=10)
    return answer.stdout.strip()


def sources(package: ModuleType) -> list[Path]:
    """The files of a package, in order."""
    return sorted(path for folder in package.__path__ for path in Path(folder).glob("*.py"))


@cache
def cpu() -> str | None:
    """The processor's model, where the system tells it."""
    with suppress(OSError):
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")  # Linux
        for line in told.splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or None


def made_by() -> Row:
    """For a row: version, commit, and the machine."""
    machine = {"platform": platform.platform(), "python": platform.python_version()}
    return {MADE_BY: {"meshreel": __version__, "commit": commit()} | machine | {"cpu": cpu(), "cores": os.cpu_count()}}


def makers(rows: Sequence[Row]) -> list[str]:
    """The versions and commits that some rows are of, in order of their first row; rows that do not say are one."""
    found = []
    for row in rows:
        made = row.get(MADE_BY)
        found.append("not recorded" if made is None else _version(made))
    return list(dict.fromkeys(found))


def _version(made: Row) -> str:
    return f"{made.get('meshreel', 'unknown version')} {made.get('commit') or '(installed)'}"
