"""Ablation: the preset `best` with one of its improvements over `paper` switched off at a time."""

from __future__ import annotations

from ..names import BEST
from ..study import Study, Sweep

PARTS = (
    "no shared detail",
    "middle key, no cuts",
    "flat midpoints",
    "plain rounding",
    "errors along the surface count",
    "no tails",
)
LONG = "crane60"  # groups alone show only where there are several
ALONE = "groups alone"
WHOLE = {"preset": "best"}
AROUND = {"quality": (20.0, 50.0, 80.0)}  # the whole's curve reaches around every variant's
QUALITIES = {"quality": (35.0, 65.0)}
STUDY = Study(
    sequences=("dancer", LONG),
    sweeps=(
        Sweep("meshreel", AROUND, WHOLE),
        *(Sweep("meshreel", QUALITIES, WHOLE | {"variant": part}, only=("dancer",)) for part in PARTS),
        Sweep("meshreel", QUALITIES, WHOLE | {"variant": ALONE}, only=(LONG,)),
    ),
    anchor=BEST,
    frames={LONG: 32},
    notes=("Positive: without the part more rate is needed.",),
)
