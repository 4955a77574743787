"""Uniform quantisation: real columns <-> int32 symbols, a step for each column (paper, section 3.3.3).

In -> out: values (N x M, any unit) and steps (M, the same unit) -> symbols (N x M). Law, without a dead zone:
|inverse(forward(x)) - x| <= step / 2.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...shapes import Float64, Int32

LARGEST = 2**31 - 1  # largest magnitude of a symbol, an int32


def forward(
    values: Float64[np.ndarray, "N M"], steps: Float64[np.ndarray, " M"], dead_zone: float = 0.5
) -> Int32[np.ndarray, "N M"]:
    """Round values to multiples of the steps, halves away from zero.

    A magnitude is rounded up if its fraction of a step is at least `dead_zone`, in [0.5, 1) (0.5: nearest); larger
    values are cheaper and less accurate.
    """
    if not 0.5 <= dead_zone < 1:
        raise InputError(f"dead zone {dead_zone}: give a fraction of a step in [0.5, 1)")
    if not np.all((steps > 0) & np.isfinite(steps)):
        raise InputError(f"steps {steps.tolist()}: every step must be positive and finite")
    scaled = values / steps
    magnitudes = np.floor(np.abs(scaled) + (1 - dead_zone))
    if not np.all(magnitudes <= LARGEST):  # false for NaN, too
        raise InputError(
            f"largest |value / step| is {np.max(magnitudes):g}, beyond int32; use finite values, larger steps"
        )
    return np.copysign(magnitudes, scaled).astype(np.int32)


def inverse(symbols: Int32[np.ndarray, "N M"], steps: Float64[np.ndarray, " M"]) -> Float64[np.ndarray, "N M"]:
    """Return the multiples of the steps; one multiplication, so the bits are the same on every platform."""
    return symbols * steps
