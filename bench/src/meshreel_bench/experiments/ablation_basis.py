"""Ablation: number of KLT basis vectors m, at several qualities of the rest (paper, section 4.4)."""

from __future__ import annotations

from ..names import TSMC
from ..study import Study, Sweep

M = {"basis_size": (1, 2, 3, 5, 8, 10)}
STUDY = Study(
    sequences=("dancer",),
    sweeps=[Sweep("meshreel", M, {"preset": "paper", "quality": quality}) for quality in (20.0, 50.0, 80.0)],
    anchor=TSMC,
)
