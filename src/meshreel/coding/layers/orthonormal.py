"""Orthonormal bases <-> integers: each vector has coordinates in the orthogonal complement of the earlier ones.

In: M orthonormal vectors of C numbers. Out: C + (C - 1) + ... integers, M terms; from them, exactly orthonormal vectors
again. It saves a third to a half of the integers (docs/decisions/0012-layers-coder.md).
"""

from __future__ import annotations

import numpy as np

from ... import _core
from ...errors import FormatError
from ...geometry.strict import dot, norm, products
from ...shapes import Float64, Int32


def forward(vectors: Float64[np.ndarray, "M C"], scales: Float64[np.ndarray, " M"]) -> Int32[np.ndarray, " N"]:
    """Round vectors to integers, the k-th with a step of 1 / scales[k] (encoder only)."""
    width = vectors.shape[1]
    free = np.eye(width)  # columns: an orthonormal basis of the complement of the vectors so far
    rows = []
    for vector, scale in zip(vectors, scales.tolist(), strict=True):
        inside = products(vector[None], free)[0]
        length = norm(inside)
        symbols = np.rint(inside * (scale / length if length > 1e-6 else 0.0)).astype(np.int32)
        if not symbols.any():
            symbols[int(np.abs(inside).argmax())] = 1
        rows.append(symbols)
        mirror = symbols / norm(symbols.astype(np.float64))
        mirror[0] += -1.0 if mirror[0] < 0 else 1.0
        free = (free - np.outer(products(free, mirror[:, None])[:, 0], 2.0 / dot(mirror, mirror) * mirror))[:, 1:]
    return np.concatenate([np.zeros(0, np.int32), *rows])


def inverse(symbols: Int32[np.ndarray, " N"], count: int, width: int) -> Float64[np.ndarray, "M C"]:
    """Reconstruct the vectors from their integers. Raises FormatError if one of them has no direction."""
    try:
        return _core.orthonormal_inverse(symbols, count, width)
    except ValueError as error:
        raise FormatError("a basis vector without a direction") from error
