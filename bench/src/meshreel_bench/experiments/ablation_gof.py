"""Ablation: frames in a group, TSMC as the paper has it (section 4.4)."""

from __future__ import annotations

from ..names import TSMC
from ..study import Study, Sweep

SIZES = (5, 10, 15)
M = {"basis_size": (2, 3, 5)}
STUDY = Study(
    sequences=("crane60",),
    sweeps=[Sweep("meshreel", M, {"preset": "paper", "centers": 2000, "group_size": size}) for size in SIZES],
    frames={"crane60": 30},
    anchor=TSMC,
)
