"""Poses of a deformation graph, and the points and normals that they move.

A point p bound to nodes j goes to sum w_j (R_j (p - g_j) + t_j) (Sumner et al. 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from scipy import sparse

from ...geometry.strict import determinants, inverses, nearest_rotations, products
from .embedded_graph import Binding

FLATTEST = 0.1  # a blend of rotations with a smaller determinant has no usable inverse: a guess


@dataclass(frozen=True, slots=True)
class Pose:
    """Positions of the nodes, and their rotations relative to rest."""

    rotations: Float64[np.ndarray, "N 3 3"]
    positions: Float64[np.ndarray, "N 3"]

    @staticmethod
    def at(nodes: Float64[np.ndarray, "N 3"]) -> Pose:
        """Return the pose of nodes at rest."""
        return Pose(np.tile(np.eye(3), (len(nodes), 1, 1)), nodes.copy())


def moved(
    points: Float64[np.ndarray, "P 3"], nodes: Float64[np.ndarray, "N 3"], binding: Binding, pose: Pose
) -> Float64[np.ndarray, "P 3"]:
    """Move bound points from the rest of the nodes to a pose."""
    blended = _affine(nodes, binding, pose)
    return np.einsum("pij,pj->pi", blended[:, :, :3], points) + blended[:, :, 3]


def unmoved(
    points: Float64[np.ndarray, "P 3"], nodes: Float64[np.ndarray, "N 3"], binding: Binding, pose: Pose
) -> tuple[Float64[np.ndarray, "P 3"], Bool[np.ndarray, " P"]]:
    """Move bound points from a pose back to rest; also return False for points whose motion has no inverse."""
    blended = _affine(nodes, binding, pose)
    linear, offsets = blended[:, :, :3].copy(), points - blended[:, :, 3]
    invertible = np.abs(determinants(linear)) > FLATTEST
    linear[~invertible] = np.eye(3)
    return products(inverses(linear), offsets[:, :, None])[:, :, 0], invertible


def _affine(nodes: Float64[np.ndarray, "N 3"], binding: Binding, pose: Pose) -> Float64[np.ndarray, "P 3 4"]:
    """Blend the nodes' motions at each bound point."""
    offsets = pose.positions - np.einsum("nij,nj->ni", pose.rotations, nodes)
    affine = np.concatenate([pose.rotations, offsets[:, :, None]], axis=2).reshape(-1, 12)
    return _blend(affine, binding).reshape(-1, 3, 4)


def turned(vectors: Float64[np.ndarray, "P 3"], binding: Binding, pose: Pose) -> Float64[np.ndarray, "P 3"]:
    """Rotate unit vectors (normals) of bound points with their nodes."""
    blended = _blend(pose.rotations.reshape(-1, 9), binding).reshape(-1, 3, 3)
    result = np.einsum("pij,pj->pi", blended, vectors)
    length = np.linalg.norm(result, axis=1, keepdims=True)
    return result / np.where(length > 0, length, 1.0)


def rotation(binding: Binding, pose: Pose) -> Float64[np.ndarray, "P 3 3"]:
    """Return the rotation nearest to the blend of the nodes' rotations at each bound point."""
    return nearest_rotations(_blend(pose.rotations.reshape(-1, 9), binding).reshape(-1, 3, 3))[0]


def _blend(rows: Float64[np.ndarray, "N n"], binding: Binding) -> Float64[np.ndarray, "P n"]:
    points, count = binding.indices.shape
    starts = np.arange(points + 1) * count
    shares = sparse.csr_array((binding.weights.reshape(-1), binding.indices.reshape(-1), starts), (points, len(rows)))
    return shares @ rows
