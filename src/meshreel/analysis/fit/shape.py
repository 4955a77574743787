"""The strongest components of all trajectories of a fit (paper, eqs. 8-9)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from ...geometry.strict import eigen, products


def strongest_components(positions: Float64[np.ndarray, "T V 3"], key: int, count: int) -> Float64[np.ndarray, "T V 3"]:
    """Rebuild the trajectories relative to the key frame from their `count` strongest components (eqs. 8-9)."""
    frames, vertices, _ = positions.shape
    field = (positions - positions[key]).transpose(1, 0, 2).reshape(vertices, 3 * frames)
    mean = field.mean(axis=0)
    centered = field - mean
    _, vectors = eigen(products(centered.T, centered))
    basis = vectors[:, ::-1][:, :count]
    kept = products(products(centered, basis), basis.T) + mean
    return positions[key] + kept.reshape(vertices, frames, 3).transpose(1, 0, 2)
