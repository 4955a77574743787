"""Solve the sparse least-squares problem of one fitting round by its normal equations and conjugate gradients.

In: rows n . (c0 x0 + c1 x1 + c2 x2) = value on the faces of a template, a shape, a place. Out: a step (V x 3).
Point-to-plane rows couple x, y and z, so the matrix has 3 x 3 blocks on the one-ring; it is solved, not factorised:
20-40 block-Jacobi preconditioned iterations cost a tenth of a Cholesky factor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int32, Int64
from scipy import sparse

from ...geometry.strict import inverses
from ...geometry.topology import unique_edges
from .border import border_sides
from .conjugate_gradients import Limits, conjugate_gradients
from .rows import Rows, no_rows


@dataclass(frozen=True, slots=True)
class Problem:
    """Priors of a fitting round: Laplacian coordinates with their stiffness, and positions to stay near."""

    shape: Float64[np.ndarray, "V 3"]
    stiffness: Float64[np.ndarray, " V"]  # row weights
    place: Float64[np.ndarray, "V 3"]
    anchor: float  # row weight


class Template:
    """Connectivity prepared for fitting: its Laplacian, one face per vertex, and the pattern of the matrix blocks."""

    def __init__(self, faces: Int32[np.ndarray, "F 3"], count: int) -> None:
        self.faces = faces.astype(np.int64)
        self.count = count
        self.edges = unique_edges(faces)[0]
        self.border = border_sides(faces)
        self.laplacian = _uniform_laplacian(self.edges, count)
        self._place_blocks()
        corner = np.full(count, -1)
        corner[self.faces.reshape(-1)[::-1]] = np.arange(3 * len(faces))[::-1]
        self.corner = corner  # 3 * face + k of the first corner at each vertex; -1 for a vertex that no face uses

    def _place_blocks(self) -> None:
        rows, columns = np.repeat(self.faces, 3, axis=1).reshape(-1), np.tile(self.faces, (1, 3)).reshape(-1)
        keys, place = np.unique(rows * self.count + columns, return_inverse=True)
        size = len(place)
        self._gather = sparse.csr_array((np.ones(size), (place, np.arange(size))), shape=(len(keys), size))
        self._columns = (keys % self.count).astype(np.int32)
        self._starts = np.searchsorted(keys // self.count, np.arange(self.count + 1)).astype(np.int32)

    def normal_equations(
        self, rows: Rows, at: Float64[np.ndarray, "V 3"]
    ) -> tuple[sparse.bsr_array, Float64[np.ndarray, "V 3"]]:
        """Return matrix and right-hand side of the least-squares problem of the rows, for offsets from `at`."""
        f, c, n = self.faces[rows.faces], rows.corners, rows.normals
        miss = rows.values - np.einsum("nk,nkd,nd->n", c, at[f], n)
        outer = (rows.weights[:, None, None] * n[:, :, None] * n[:, None, :]).reshape(-1, 1, 9)
        pairs = (c[:, :, None] * c[:, None, :]).reshape(-1, 9, 1)
        picked = np.arange(len(rows.faces))
        by_face = sparse.csr_array((np.ones(len(picked)), (rows.faces, picked)), shape=(len(self.faces), len(picked)))
        blocks = self._gather @ (by_face @ (pairs * outer).reshape(-1, 81)).reshape(-1, 9)
        matrix = sparse.bsr_array(
            (blocks.reshape(-1, 3, 3), self._columns, self._starts), shape=(3 * self.count, 3 * self.count)
        )
        pull = (rows.weights * miss)[:, None, None] * c[:, :, None] * n[:, None, :]
        right = np.stack([np.bincount(f.reshape(-1), pull[..., d].reshape(-1), self.count) for d in range(3)], axis=1)
        return matrix, right


def solve(
    template: Template,
    rows: Rows | None,
    at: Float64[np.ndarray, "V 3"],
    problem: Problem,
    limits: Limits,
) -> Float64[np.ndarray, "V 3"]:
    """Compute the step from `at` that fits the rows, keeps the shape and stays near its place."""
    matrix, right = template.normal_equations(no_rows() if rows is None else rows, at)
    laplacian, squared = template.laplacian, problem.stiffness**2
    smooth = laplacian.T @ (sparse.diags_array(squared) @ laplacian)
    smooth = sparse.csr_array(smooth + problem.anchor**2 * sparse.eye_array(template.count))
    right = right + laplacian.T @ (squared[:, None] * (problem.shape - laplacian @ at))
    right = right + problem.anchor**2 * (problem.place - at)
    return _solved(matrix, smooth, right, limits)


def _solved(
    matrix: sparse.bsr_array, smooth: sparse.csr_array, right: Float64[np.ndarray, "V 3"], limits: Limits
) -> Float64[np.ndarray, "V 3"]:
    """Solve (matrix + smooth on each axis) x = right, preconditioned by the blocks of the vertices."""
    count = len(right)
    rows = np.repeat(np.arange(count), np.diff(matrix.indptr))
    on_diagonal = matrix.indices == rows
    blocks = np.zeros((count, 3, 3))
    blocks[rows[on_diagonal]] = matrix.data[on_diagonal]
    blocks[:, range(3), range(3)] += smooth.diagonal()[:, None]
    inverse = inverses(blocks)
    return conjugate_gradients(
        lambda x: (matrix @ x.reshape(-1)).reshape(-1, 3) + smooth @ x,
        lambda r: np.einsum("vij,vj->vi", inverse, r),
        right,
        limits,
    )


def _uniform_laplacian(edges: Int64[np.ndarray, "E 2"], count: int) -> sparse.csr_array:
    i, j = edges[:, 0], edges[:, 1]
    degree = np.bincount(edges.reshape(-1), minlength=count)
    rows, columns = np.concatenate([i, j]), np.concatenate([j, i])
    neighbors = sparse.csr_array((1.0 / degree[rows], (rows, columns)), shape=(count, count))
    return sparse.csr_array(sparse.eye_array(count) - neighbors)
