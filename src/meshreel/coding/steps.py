"""Ladder of quantiser steps: rung k means 2^(-k/8), exactly the same number on every platform.

In: a rung, an integer of the stream (`step_level` in its records). Out: a step, in units of the diagonal.
"""

from __future__ import annotations

import math

RUNGS = 200  # number of rungs; the finest step is 3e-8, below any use
_EIGHTHS = (  # 2^(-j/8) rounded to 32 bits, so that no platform's pow decides
    4294967296,
    3938502376,
    3611622603,
    3311872529,
    3037000500,
    2784941738,
    2553802834,
    2341847524,
)


def step_of(rung: int) -> float:
    return math.ldexp(_EIGHTHS[rung % 8], -32 - rung // 8)


def rung_of(step: float) -> int:
    """Return the rung whose step is nearest in ratio (encoder only)."""
    return min(max(round(-8 * math.log2(step)), 0), RUNGS - 1)
