"""Algebra and elementary functions whose bits depend neither on the processor nor on the number of threads.

BLAS and LAPACK choose the order of sums by processor and number of threads, and NumPy's exp, log2 and angles differ
between processors. Results of an encode become bytes, so they are computed by these functions, in core/. NumPy's
`+ - * /`, `sqrt`, `sum` and `einsum` without `optimize` are the same everywhere.
"""

from __future__ import annotations

import math

import numpy as np

from .. import _core
from ..shapes import Float, Float64

Matrices = Float64[np.ndarray, "N 3 3"]
Array = Float[np.ndarray, "..."]  # of float32 or float64


def products(a: Array, b: Array) -> Float64[np.ndarray, "..."]:
    """Return `a @ b` of two matrices, or of two batches of equal length, summed in order."""
    if a.ndim == 2:
        return _core.products(_plain(a)[None], _plain(b)[None])[0]
    return _core.products(_plain(a), _plain(b))


def dot(a: Array, b: Array) -> float:
    """Return the sum of the products of the numbers of two arrays of one shape."""
    return float((a * b).sum())


def norm(a: Array) -> float:
    """Return the root of the sum of squares of all numbers of an array."""
    return math.sqrt(dot(a, a))


def inverses(matrices: Float64[np.ndarray, "N n n"]) -> Float64[np.ndarray, "N n n"]:
    """Invert each matrix; the result of a singular matrix is not finite."""
    return _core.inverses(_plain(matrices))


def inverse(matrix: Float64[np.ndarray, "n n"]) -> Float64[np.ndarray, "n n"]:
    return inverses(matrix[None])[0]


def determinants(matrices: Matrices) -> Float64[np.ndarray, " N"]:
    (a, b, c), (d, e, f), (g, h, i) = np.moveaxis(matrices, 0, 2)
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def eigen(matrix: Float64[np.ndarray, "n n"]) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n n"]]:
    """Return eigenvalues, in ascending order, and eigenvectors, in columns, of a symmetric matrix."""
    values, vectors = _core.eigen(_plain(matrix)[None])
    return values[0], vectors[0]


def nearest_rotations(matrices: Matrices) -> tuple[Matrices, Float64[np.ndarray, "N 2"]]:
    """Return the rotation nearest to each matrix, and the two largest singular values of the matrix.

    The rotation's quaternion is an eigenvector (Horn 1987). It is not unique where the second value is 0, and none for
    a matrix of zeros.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = np.moveaxis(matrices, 0, 2)
    rows = [  # w last: among equal values the last counts as the largest
        [xx - yy - zz, xy + yx, xz + zx, zy - yz],
        [xy + yx, yy - xx - zz, yz + zy, xz - zx],
        [xz + zx, yz + zy, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    values, vectors = _core.eigen(np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0)))
    sizes = np.stack([values[:, 3] + values[:, 2], values[:, 3] + values[:, 1]], axis=1) / 2
    return rotations_of(np.roll(vectors[:, :, 3], 1, axis=1)), sizes


def rotations_of(quaternions: Float64[np.ndarray, "N 4"]) -> Matrices:
    """Return the rotations of quaternions (w, x, y, z) of any length above 0."""
    w, x, y, z = (quaternions / np.sqrt((quaternions**2).sum(axis=1, keepdims=True))).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))


def exp(x: Array) -> Float64[np.ndarray, "..."]:
    return _core.exp(_plain(x).reshape(-1)).reshape(x.shape)


def log2(x: Array) -> Float64[np.ndarray, "..."]:
    """Return the binary logarithm of each number; exact for powers of two."""
    return _core.log2(_plain(x).reshape(-1)).reshape(x.shape)


def rounded(value: float) -> float:
    """Round a number to 12 significant digits: results of `**` differ between libraries in the last bits."""
    return float(f"{value:.12g}")


def ceil_log2(value: float) -> int:
    """Return the smallest whole exponent of two whose power is not below a number above 0."""
    fraction, exponent = math.frexp(value)
    return exponent - 1 if fraction == 0.5 else exponent


def angle(y: Array, x: Array) -> Float64[np.ndarray, "..."]:
    """Return the angle of each point (x, y) with the x-axis, rad; neither is negative."""
    return _core.angle(_plain(y).reshape(-1), _plain(x).reshape(-1)).reshape(y.shape)


def _plain(a: Array) -> Float64[np.ndarray, "..."]:
    return np.ascontiguousarray(a, dtype=np.float64)
