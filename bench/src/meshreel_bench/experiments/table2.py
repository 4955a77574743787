"""Table 2: four people side by side, all of it dynamic, each system near a common D2-PSNR (paper, section 4.5)."""

from __future__ import annotations

from ..study import Study
from .figure6 import SYSTEMS

COMMON_DB = 63.5  # the paper's own is 63.47
STUDY = Study(sequences=("synthetic4",), sweeps=SYSTEMS, common=("d2_psnr_paper", COMMON_DB))
