"""The experiments by name; each declares its points, and what is promised and told of their rows."""

from __future__ import annotations

from meshreel.errors import InputError

from ..experiment import Experiment
from . import (
    ablation_basis,
    ablation_centers,
    ablation_gof,
    ablation_stages,
    figure6,
    layers,
    scenes,
    table1,
    table2,
    targets,
)

# In the order of the report.
EXPERIMENTS: dict[str, Experiment] = {
    "figure6": figure6.STUDY,
    "table1": table1.STUDY,
    "table2": table2.STUDY,
    "ablation_centers": ablation_centers.STUDY,
    "ablation_gof": ablation_gof.STUDY,
    "ablation_basis": ablation_basis.STUDY,
    "ablation_stages": ablation_stages.STUDY,
    "scenes": scenes,
    "layers": layers,
    "targets": targets,
}


def experiment(name: str) -> Experiment:
    """The experiment called `name`. Raises InputError for an unknown one."""
    if name not in EXPERIMENTS:
        raise InputError(f"no experiment is called {name!r}; known: {', '.join(sorted(EXPERIMENTS))}")
    return EXPERIMENTS[name]
