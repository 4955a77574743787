"""Gauss-Newton steps of an embedded deformation with point-to-plane rows and as-rigid-as-possible rows.

In: a deformation graph at rest (nodes, edges, bound samples), a pose of its nodes, planes. Out: the next pose. A point
p bound to nodes j goes to sum w_j (R_j (p - g_j) + t_j) (Sumner et al. 2007). The normal equations are not assembled:
conjugate gradients multiply with the rows and with their transpose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64
from scipy import sparse

from ...geometry.strict import determinants, inverses, nearest_rotations, products, rotations_of
from ..fit.conjugate_gradients import Limits, conjugate_gradients
from .embedded_graph import Binding

Blocks = Float64[np.ndarray, "B 6 6"]  # diagonal blocks of the normal equations, one for each node
LARGEST_TURN = 0.5  # rad, largest rotation of a node in one step: a guess
FLATTEST = 0.1  # a blend of rotations with a smaller determinant has no usable inverse: a guess
STILL = 1e-4  # squared row weight of a rotation times its lever, for nodes without data or neighbours: a guess


@dataclass(frozen=True, slots=True)
class Pose:
    """Positions of the nodes, and their rotations relative to rest."""

    rotations: Float64[np.ndarray, "N 3 3"]
    positions: Float64[np.ndarray, "N 3"]

    @staticmethod
    def at(nodes: Float64[np.ndarray, "N 3"]) -> Pose:
        """Return the pose of nodes at rest."""
        return Pose(np.tile(np.eye(3), (len(nodes), 1, 1)), nodes.copy())

    @property
    def is_finite(self) -> bool:
        """Whether all numbers are finite; False after a solve has diverged."""
        return bool(np.isfinite(self.rotations).all() and np.isfinite(self.positions).all())


@dataclass(frozen=True, slots=True)
class Planes:
    """N rows w * (n . x_s - value) = 0 on samples."""

    samples: Int64[np.ndarray, " N"]
    normals: Float64[np.ndarray, "N 3"]
    values: Float64[np.ndarray, " N"]
    weights: Float64[np.ndarray, " N"]  # squared row weights

    def __add__(self, other: Planes) -> Planes:
        return Planes(
            np.concatenate([self.samples, other.samples]),
            np.concatenate([self.normals, other.normals]),
            np.concatenate([self.values, other.values]),
            np.concatenate([self.weights, other.weights]),
        )


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
    known = np.abs(determinants(linear)) > FLATTEST
    linear[~known] = np.eye(3)
    return products(inverses(linear), offsets[:, :, None])[:, :, 0], known


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


@dataclass(frozen=True, slots=True)
class RestGraph:
    """Deformation graph at rest: nodes, the edges that keep them rigid, and the samples bound to them."""

    nodes: Float64[np.ndarray, "N 3"]
    edges: Int64[np.ndarray, "E 2"]
    points: Float64[np.ndarray, "S 3"]
    normals: Float64[np.ndarray, "S 3"]
    binding: Binding


class GraphSolver:
    """Solver for the pose of a deformation graph; `held` are initial weights of its edges, 1 by default."""

    def __init__(self, rest: RestGraph, held: Float64[np.ndarray, " E"] | None = None) -> None:
        self.rest = rest
        i, j = rest.edges.T
        self._held = np.ones(len(i)) if held is None else held
        self._arms = rest.nodes[j] - rest.nodes[i]
        square = np.einsum("ed,ed->e", self._arms, self._arms)
        self._lengths = np.maximum(square, 1e-18)  # squared
        degree = np.maximum(np.bincount(i, minlength=len(rest.nodes)), 1)
        lever = np.bincount(i, square, len(rest.nodes)) / degree
        self._lever = np.maximum(lever, 0.1 * (float(np.median(square)) if len(square) else 1e-4))
        self._columns = _edge_columns(rest.edges)

    def step(
        self,
        pose: Pose,
        planes: Planes,
        rigidity: Float64[np.ndarray, " E"],
        place: float,
        limits: Limits,
    ) -> Pose:
        """Return the pose after one Gauss-Newton step.

        `rigidity` and `place` (towards this pose) are squared row weights in units of the mean data weight of a node.
        """
        count = len(self.rest.nodes)
        scale = max(float(planes.weights.sum()) / count, 1e-12)
        prior = np.empty((count, 6))
        prior[:, :3] = (STILL * scale * self._lever)[:, None]
        prior[:, 3:] = place * scale
        data, miss, blocks = self._data_rows(pose, planes)
        rigid, bend, more = self._rigid_rows(pose, np.sqrt(rigidity * scale))
        blocks += more
        blocks[:, range(6), range(6)] += prior
        rows = sparse.csr_array(sparse.vstack([data, rigid], format="csr"))
        right = rows.T @ np.concatenate([miss, bend])
        x = _solved(rows, blocks, prior.reshape(-1), right, limits).reshape(count, 6)
        turn = x[:, :3]
        angle = np.linalg.norm(turn, axis=1, keepdims=True)
        turn = turn * np.minimum(1.0, LARGEST_TURN / np.maximum(angle, 1e-12))
        turns = rotations_of(np.concatenate([np.ones((count, 1)), turn / 2], axis=1))  # right to third order
        return Pose(products(turns, pose.rotations), pose.positions + x[:, 3:])

    def holds(self, pose: Pose, torn: float) -> Float64[np.ndarray, " E"]:
        """Return the weight of each edge: 1 for one as at rest, a quarter for one off by `torn` of its length."""
        i, j = self.rest.edges.T
        gap = np.einsum("eij,ej->ei", pose.rotations[i], self._arms) + pose.positions[i] - pose.positions[j]
        share = np.einsum("ed,ed->e", gap, gap) / self._lengths
        return self._held / np.square(1 + share / torn**2)  # Geman and McClure

    def _data_rows(self, pose: Pose, planes: Planes) -> tuple[sparse.csr_array, Float64[np.ndarray, " N"], Blocks]:
        rest = self.rest
        indices, weights = rest.binding.indices[planes.samples], rest.binding.weights[planes.samples]
        arms = rest.points[planes.samples][:, None] - rest.nodes[indices]
        arms = np.einsum("nkij,nkj->nki", pose.rotations[indices], arms)
        root = np.sqrt(planes.weights)
        place = np.einsum("nk,nkd->nd", weights, arms + pose.positions[indices])
        miss = root * (planes.values - np.einsum("nd,nd->n", planes.normals, place))
        normals = np.broadcast_to(planes.normals[:, None], arms.shape)
        values = np.concatenate([_cross(arms, normals), normals], axis=2) * (root[:, None] * weights)[:, :, None]
        columns = 6 * indices[:, :, None] + np.arange(6)
        starts = np.arange(len(root) + 1) * (6 * indices.shape[1])
        shape = (len(root), 6 * len(rest.nodes))
        rows = sparse.csr_array((values.reshape(-1), columns.reshape(-1), starts), shape)
        return rows, miss, _outer_sums(values.reshape(-1, 6), indices.reshape(-1), len(rest.nodes))

    def _rigid_rows(
        self, pose: Pose, root: Float64[np.ndarray, " E"]
    ) -> tuple[sparse.csr_array, Float64[np.ndarray, " E3"], Blocks]:
        """Return rows of turn x e + step_i - step_j, with two turns and two steps per axis."""
        i, j = self.rest.edges.T
        e = np.einsum("eij,ej->ei", pose.rotations[i], self._arms)
        miss = -root[:, None] * (e + pose.positions[i] - pose.positions[j])
        x, y, z = (root[:, None] * e).T
        values = np.stack([z, -y, root, -root, -z, x, root, -root, y, -x, root, -root], axis=1).reshape(-1, 3, 4)
        starts = np.arange(3 * len(e) + 1) * 4
        count = len(self.rest.nodes)
        rows = sparse.csr_array((values.reshape(-1), self._columns.reshape(-1), starts), (3 * len(e), 6 * count))
        own = np.zeros((len(e), 3, 6))
        np.put_along_axis(own, self._columns[:, :, :3] - 6 * i[:, None, None], values[:, :, :3], axis=2)
        blocks = _outer_sums(own.reshape(-1, 6), np.repeat(i, 3), count)
        blocks[:, range(3, 6), range(3, 6)] += np.bincount(j, root**2, count)[:, None]
        return rows, miss.reshape(-1), blocks


def _outer_sums(vectors: Float64[np.ndarray, "M 6"], nodes: Int64[np.ndarray, " M"], count: int) -> Blocks:
    """Sum v v^T over the vectors of each node."""
    gather = sparse.csr_array((np.ones(len(nodes)), nodes, np.arange(len(nodes) + 1)), (len(nodes), count))
    return (gather.T @ (vectors[:, :, None] * vectors[:, None, :]).reshape(-1, 36)).reshape(-1, 6, 6)


def _edge_columns(edges: Int64[np.ndarray, "E 2"]) -> Int64[np.ndarray, "E 3 4"]:
    i, j = 6 * edges[:, :1], 6 * edges[:, 1:]
    turns = np.array([[1, 2], [0, 2], [0, 1]])
    axes = np.arange(3)
    columns = np.empty((len(edges), 3, 4), np.int64)
    columns[:, :, :2] = i[:, :, None] + turns
    columns[:, :, 2] = i + 3 + axes
    columns[:, :, 3] = j + 3 + axes
    return columns


def _cross(a: Float64[np.ndarray, "... 3"], b: Float64[np.ndarray, "... 3"]) -> Float64[np.ndarray, "... 3"]:
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _solved(
    rows: sparse.csr_array,
    blocks: Blocks,
    prior: Float64[np.ndarray, " M"],
    right: Float64[np.ndarray, " M"],
    limits: Limits,
) -> Float64[np.ndarray, " M"]:
    """Solve (rows^T rows + prior) x = right, preconditioned by the inverse of the nodes' blocks of that matrix."""
    back, inverse = sparse.csr_array(rows.T), inverses(blocks)
    return conjugate_gradients(
        lambda x: back @ (rows @ x) + prior * x,
        lambda r: products(inverse, r.reshape(-1, 6, 1)).reshape(-1),
        right,
        limits,
    )
