"""Preconditioned conjugate gradients for the normal equations of a fit, which are applied and not assembled.

In: two products with a symmetric positive definite matrix (its own, and about its inverse), a right-hand side. Out: x.
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
    """When the iterations end: at whichever comes first."""

    iterations: int
    tolerance: float  # residual relative to the first, in the norm of the preconditioner


def conjugate_gradients(multiply: Product, precondition: Product, right: Array, limits: Limits) -> Array:
    """x of multiply(x) = right, begun at 0; the last x where a residual stops being a number."""
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
