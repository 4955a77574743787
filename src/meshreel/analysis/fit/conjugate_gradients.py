"""Preconditioned conjugate gradients for normal equations that are applied rather than assembled.

In: products with a symmetric positive definite matrix and with an approximate inverse, a right-hand side. Out: x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

Array = Float64[np.ndarray, "..."]
Product = Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of the iteration, which ends at whichever is reached first."""

    iterations: int
    tolerance: float  # residual relative to the first, in the norm of the preconditioner


def conjugate_gradients(multiply: Product, precondition: Product, right: Array, limits: Limits) -> Array:
    """Solve multiply(x) = right from x = 0; return the last x if the residual becomes NaN."""
    x, r = np.zeros_like(right), right.copy()
    z = precondition(r)
    p, rz = z.copy(), float(np.vdot(r, z))
    enough = limits.tolerance**2 * rz
    for _ in range(limits.iterations):
        if not rz > enough:
            break
        product = multiply(p)
        step = rz / float(np.vdot(p, product))
        x += step * p
        r -= step * product
        z = precondition(r)
        rz, before = float(np.vdot(r, z)), rz
        p = z + rz / before * p
    return x
