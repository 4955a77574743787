"""Experiments by name: declarations of what is run, compared and promised."""

from __future__ import annotations

from meshreel.errors import InputError

from . import ablations, color, figure6, headset, layers, scenes
from .study import Study

# In the order of the report.
EXPERIMENTS: dict[str, Study] = {
    "figure6": figure6.STUDY,
    "mpeg": figure6.MPEG,
    "long": figure6.LONG,
    "table1": figure6.TABLE_1,
    "table2": figure6.TABLE_2,
    "table3": color.TABLE_3,
    "ablation_paper": ablations.PAPER,
    "ablation_centers": ablations.CENTERS,
    "ablation_gof": ablations.GOF,
    "ablation_stages": ablations.STAGES,
    "ablation_scene": ablations.SCENE,
    "broken": ablations.BROKEN,
    "scenes": scenes.STUDY,
    "sensors": scenes.SENSORS,
    "recordings": scenes.RECORDINGS,
    "long_takes": scenes.LONG_TAKES,
    "layers": layers.STUDY,
    "speed": layers.SPEED,
    "tracker": ablations.TRACKERS,
    "headset": headset.STUDY,
    "color": color.STUDY,
}


def find_experiment(name: str) -> Study:
    """Return the experiment of that name. Raises InputError for an unknown one."""
    if name not in EXPERIMENTS:
        raise InputError(f"no experiment is called {name!r}; known: {', '.join(sorted(EXPERIMENTS))}")
    return EXPERIMENTS[name]
