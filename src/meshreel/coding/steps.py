"""Scale of quantiser steps: step level k means 2^(-k/8), exactly the same number on every platform.

In: a step level, an integer of the stream. Out: a step, in units of the diagonal.
"""

from __future__ import annotations

import math

LEVELS = 200  # number of step levels; the finest is 3e-8, below any use
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


def step_of(level: int) -> float:
    """Return the step of a step level."""
    return math.ldexp(_EIGHTHS[level % 8], -32 - level // 8)


def level_of(step: float) -> int:
    """Return the step level whose step is nearest in ratio (encoder only)."""
    return min(max(round(-8 * math.log2(step)), 0), LEVELS - 1)
