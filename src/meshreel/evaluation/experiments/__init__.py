"""The experiments by name; each module declares its points, reference curves, what is promised, and more."""

from __future__ import annotations

from types import ModuleType

from ...errors import InputError
from . import ablation, layers, scenes, targets

# In the order of the report. Each module has points, references, promises, comparisons, shown, sections, COMPARISON.
EXPERIMENTS: dict[str, ModuleType] = {"scenes": scenes, "layers": layers, "ablation": ablation, "targets": targets}


def experiment(name: str) -> ModuleType:
    """The experiment called `name`. Raises InputError for an unknown one."""
    if name not in EXPERIMENTS:
        raise InputError(f"no experiment is called {name!r}; known: {', '.join(sorted(EXPERIMENTS))}")
    return EXPERIMENTS[name]
