"""Tables 1 and 2: every system on scenes near a common rate, and on four people near a common D2 (paper, 4.4, 4.5)."""

from __future__ import annotations

from . import figure6
from .study import D2, Study

ALL = figure6.STUDY
TABLE_1 = Study(
    title="Scenes near a common rate (table 1)",
    sequences=figure6.SCENES,
    sweeps=ALL.sweeps,
    floors=ALL.floors,
    frames=ALL.frames,
    common_mbps=1.0,
)
TABLE_2 = Study(
    title="Four people near a common quality (table 2)",
    sequences=("synthetic4",),
    sweeps=ALL.sweeps,
    common=(D2, 63.5),  # dB; the paper's own is 63.47
)
