"""Version, commit and machine of this process, for rows."""

from __future__ import annotations

import os
import platform
import subprocess
from functools import cache
from pathlib import Path

from meshreel import __version__
from meshreel.encoder.group.digests import processor

from ..rows import Maker

_DIGITS = 12  # of a commit


@cache
def maker() -> Maker:
    """Return the machine and versions that make rows here."""
    machine = (platform.platform(), platform.python_version(), processor(), os.cpu_count())
    return Maker(__version__, _commit(), *machine)


def _commit() -> str:
    """Return the commit of the checkout that this package runs from, with + where files differ."""
    here = Path(__file__).resolve().parent
    try:
        head = _git(here, "rev-parse", "HEAD")
        _git(here, "ls-files", "--error-unmatch", Path(__file__).name)
        changed = _git(here, "status", "--porcelain", "--", ":(top)src", ":(top)bench/src", ":(top)core")
    except (OSError, subprocess.SubprocessError):  # no git, or the package is installed
        return "none: installed"
    return head[:_DIGITS] + ("+" if changed else "")


def _git(folder: Path, *words: str) -> str:
    answer = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=True, timeout=10)
    return answer.stdout.strip()
