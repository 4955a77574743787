"""The experiments by name; each module declares its points, reference curves and what is promised of the rows."""

from __future__ import annotations

from types import ModuleType

from ...errors import InputError
from . import targets

EXPERIMENTS: dict[str, ModuleType] = {"targets": targets}


def experiment(name: str) -> ModuleType:
    """The experiment called `name`. Raises InputError for an unknown one."""
    if name not in EXPERIMENTS:
        raise InputError(f"no experiment is called {name!r}; known: {', '.join(sorted(EXPERIMENTS))}")
    return EXPERIMENTS[name]
