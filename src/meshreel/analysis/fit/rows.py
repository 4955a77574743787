"""Weighted linear equations of a fit, made by matching and solved in `system`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64


@dataclass(frozen=True, slots=True)
class Rows:
    """N equations w * (n . sum_k c_k x_k - value) = 0 on the three corners of one template face each."""

    faces: Int64[np.ndarray, " N"]
    corners: Float64[np.ndarray, "N 3"]  # c_k: barycentric weights (sum 1) or an edge (sum 0)
    normals: Float64[np.ndarray, "N 3"]
    values: Float64[np.ndarray, " N"]
    weights: Float64[np.ndarray, " N"]  # squared row weights

    def __add__(self, other: Rows) -> Rows:
        return Rows(
            np.concatenate([self.faces, other.faces]),
            np.concatenate([self.corners, other.corners]),
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.values, other.values]),
            np.concatenate([self.weights, other.weights]),
        )


def no_rows() -> Rows:
    """Return zero rows."""
    return Rows(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
