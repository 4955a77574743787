"""Table 1: every system on scenes, at its operating point nearest to a common rate (paper, section 4.4)."""

from __future__ import annotations

from ..study import Study
from .figure6 import SCENES, STUDY, SYSTEMS

STUDY = Study(sequences=SCENES, sweeps=SYSTEMS, truths=STUDY.truths, common=("mbps", 1.0))
