"""Cut groups by the measured fit of their frames rather than on a fixed grid (paper, section 3.3.2: GoF; decision 15).

In -> out: the symmetric residual of each frame's fit -> the frame before which to cut, or None.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

LIMIT = 2.0  # a frame is lost if its residual is larger than this many times the target (guess)
TOLERANCE = 2.0  # or larger than the target and than this many times the group's median (guess)


def cut_at(residuals: Float64[np.ndarray, " T"]) -> int | None:
    """Return the frame that should begin a second group, or None if one reference follows all frames.

    Residuals are in units of the distance to reach. The cut leaves the residuals on each side most alike (least squares
    on their logarithms), which separates frames that are followed well from those that are not.
    """
    limit = min(LIMIT, max(1.0, TOLERANCE * float(np.median(residuals))))
    if len(residuals) < 2 or residuals.max() <= limit:
        return None
    logs = np.log(np.clip(residuals, 1e-6, 1e6))
    spread = [_scatter(logs[:cut]) + _scatter(logs[cut:]) for cut in range(1, len(logs))]
    return 1 + int(np.argmin(spread))


def _scatter(values: Float64[np.ndarray, " n"]) -> float:
    return float(((values - values.mean()) ** 2).sum())
