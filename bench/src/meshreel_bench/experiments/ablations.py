"""Ablations of TSMC as the paper has it (section 4.4), and of the preset `best` part by part."""

from __future__ import annotations

from ..names import BEST, TSMC
from .study import Study, Sweep

M = {"basis_size": (2, 5, 10)}
CENTERS = Study(
    title="Number of volume centers, TSMC",
    sequences=("dancer",),
    sweeps=[
        Sweep("meshreel", M, {"preset": "paper", "centers": k, "group_size": 10}) for k in (1000, 2000, 3000, 4000)
    ],
    anchor=TSMC,
)
GOF = Study(
    title="Frames of a group, TSMC",
    sequences=("crane60",),
    sweeps=[
        Sweep("meshreel", {"basis_size": (2, 3, 5)}, {"preset": "paper", "centers": 2000, "group_size": size})
        for size in (5, 10, 15)
    ],
    frames={"crane60": 30},
    anchor=TSMC,
)
BASIS = Study(
    title="Number of basis vectors m at several qualities of the rest, TSMC",
    sequences=("dancer",),
    sweeps=[
        Sweep("meshreel", {"basis_size": (1, 2, 3, 5, 8, 10)}, {"preset": "paper", "quality": quality})
        for quality in (20.0, 50.0, 80.0)
    ],
    anchor=TSMC,
)
PARTS = (
    "no shared detail",
    "middle key, no cuts",
    "flat midpoints",
    "plain rounding",
    "errors along the surface count",
    "no tails",
)
LONG = "crane60"  # groups alone show only where there are several
WHOLE = {"preset": "best"}
AROUND = {"quality": (20.0, 50.0, 80.0)}  # the whole's curve reaches around every variant's
QUALITIES = {"quality": (35.0, 65.0)}
STAGES = Study(
    title="Preset `best` with one of its improvements over `paper` switched off at a time",
    sequences=("dancer", LONG),
    sweeps=(
        Sweep("meshreel", AROUND, WHOLE),
        *(Sweep("meshreel", QUALITIES, WHOLE | {"variant": part}, only=("dancer",)) for part in PARTS),
        Sweep("meshreel", QUALITIES, WHOLE | {"variant": "groups alone"}, only=(LONG,)),
    ),
    anchor=BEST,
    frames={LONG: 32},
    notes=("Positive: without the part more rate is needed.",),
)
