"""Ablation: number of volume centers, TSMC as the paper has it (section 4.4)."""

from __future__ import annotations

from ..names import TSMC
from ..study import Study, Sweep

CENTERS = (1000, 2000, 3000, 4000)
M = {"basis_size": (2, 5, 10)}
STUDY = Study(
    sequences=("dancer",),
    sweeps=[Sweep("meshreel", M, {"preset": "paper", "centers": k, "group_size": 10}) for k in CENTERS],
    anchor=TSMC,
)
