"""Table 1: every system on scenes, at its operating point nearest to a common rate (paper, section 4.4)."""

from __future__ import annotations

from ..study import Study
from . import figure6

ALL = figure6.STUDY
STUDY = Study(sequences=figure6.SCENES, sweeps=ALL.sweeps, truths=ALL.truths, frames=ALL.frames, common=("mbps", 1.0))
