"""Preconditioned conjugate gradients for normal equations that are applied rather than assembled.

In: products with a symmetric positive definite matrix and with an approximate inverse, a right-hand side. Out: x.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.strict import dot

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
    p, rz = z.copy(), dot(r, z)
    enough = limits.tolerance**2 * rz
    for _ in range(limits.iterations):
        if not rz > enough:
            break
        product = multiply(p)
        step = rz / dot(p, product)
        x += step * p
        r -= step * product
        z = precondition(r)
        rz, before = dot(r, z), rz
        p = z + rz / before * p
    return x
