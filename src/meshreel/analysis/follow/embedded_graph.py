"""Build a graph of nodes on a mesh, and bind points to the nodes that are nearest along the surface.

In: the key frame's mesh. Out: nodes (farthest-point samples), edges between cells that touch, bindings of points.
A hand near a hip shares no node with it: only nodes within two edges of a point's cell may move it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ...geometry.topology import components, unique_edges, vertex_normals
from ...types import Mesh

TURN = 0.01  # diagonals, weight of a difference of unit normals, so that both sides of a thin part get nodes: a guess
SEEDED = 0.25  # largest share of nodes that begin a component: a guess
TOGETHER = 2048  # points that are bound together: bounds memory (guess)


@dataclass(frozen=True, slots=True)
class Binding:
    """Nodes that move each point, with their weights."""

    indices: Int64[np.ndarray, "P k"]
    weights: Float64[np.ndarray, "P k"]  # rows sum to 1


@dataclass(frozen=True, slots=True)
class DeformationGraph:
    """Nodes on a mesh, with edges; every vertex belongs to the cell of the node that is nearest along the surface."""

    nodes: Float64[np.ndarray, "N 3"]
    edges: Int64[np.ndarray, "E 2"]  # both directions of each pair of touching cells
    cells: Int64[np.ndarray, " V"]
    hood: Int64[np.ndarray, "N h"]  # each node and those at most two edges away, padded with -1

    def bind(self, points: Float64[np.ndarray, "P 3"], cells: Int64[np.ndarray, " P"], count: int) -> Binding:
        """Bind each point to the `count` nearest nodes of its cell's hood; weights fall to 0 at the next nearest."""
        blocks = (slice(at, at + TOGETHER) for at in range(0, max(len(points), 1), TOGETHER))
        bound = [self._bound(points[rows], cells[rows], count) for rows in blocks]
        return Binding(*(np.concatenate(parts) for parts in zip(*bound, strict=True)))

    def _bound(
        self, points: Float64[np.ndarray, "P 3"], cells: Int64[np.ndarray, " P"], count: int
    ) -> tuple[Int64[np.ndarray, "P k"], Float64[np.ndarray, "P k"]]:
        hood = self.hood[cells]
        away = np.linalg.norm(self.nodes[hood] - points[:, None], axis=2)
        away[hood < 0] = np.inf
        count = min(count, hood.shape[1])
        nearest = np.argsort(away, axis=1, kind="stable")[:, : count + 1]
        away, indices = np.take_along_axis(away, nearest, axis=1), np.take_along_axis(hood, nearest, axis=1)
        finite = np.where(np.isfinite(away), away, 0.0)
        reach = np.where(np.isfinite(away[:, -1]), away[:, -1], 1.5 * finite.max(axis=1))
        reach = np.maximum(reach, np.finfo(float).tiny)
        weights = np.square(np.maximum(1 - away[:, :count] / reach[:, None], 0))
        weights[:, 0] = np.maximum(weights[:, 0], 1e-12)
        return np.maximum(indices[:, :count], 0), weights / weights.sum(axis=1, keepdims=True)


def farthest_first(mesh: Mesh, candidates: Int64[np.ndarray, " S"], count: int) -> Int64[np.ndarray, " N"]:
    """Choose `count` candidate vertices one by one, each the farthest from the earlier ones; every prefix is even.

    Distances are of positions and normals. The first choices are one vertex of each component, the largest ones first.
    """
    labels = components(mesh.faces, len(mesh.vertices))[candidates]
    _, first, sizes = np.unique(labels, return_index=True, return_counts=True)
    seeds = first[np.argsort(-sizes, kind="stable")][: max(1, int(SEEDED * count))]
    normals = vertex_normals(mesh)[candidates]
    places = np.concatenate([mesh.vertices[candidates], TURN * normals], axis=1)
    nearest = np.full(len(candidates), np.inf)
    chosen = np.empty(min(count, len(candidates)), np.int64)
    for n in range(len(chosen)):
        chosen[n] = seeds[n] if n < len(seeds) else int(np.argmax(nearest))
        offset = places - places[chosen[n]]
        nearest = np.minimum(nearest, np.einsum("ij,ij->i", offset, offset))
    return candidates[chosen]


def build_graph(mesh: Mesh, nodes: Int64[np.ndarray, " N"]) -> DeformationGraph:
    """Build the graph whose nodes are the given vertices of the mesh."""
    edges, _ = unique_edges(mesh.faces)
    cells = _cells(mesh, edges, nodes)
    i, j = cells[edges].T
    count = len(nodes)
    touching = np.unique((np.concatenate([i, j]) * count + np.concatenate([j, i]))[np.concatenate([i != j, i != j])])
    pairs = np.stack([touching // count, touching % count], axis=1)
    return DeformationGraph(mesh.vertices[nodes], pairs, cells, _hoods(pairs, count))


def _cells(mesh: Mesh, edges: Int64[np.ndarray, "E 2"], nodes: Int64[np.ndarray, " N"]) -> Int64[np.ndarray, " V"]:
    """Return the node nearest to each vertex along the edges; the nearest in space if no path leads to a node."""
    size = len(mesh.vertices)
    lengths = np.linalg.norm(mesh.vertices[edges[:, 0]] - mesh.vertices[edges[:, 1]], axis=1)
    roads = sparse.csr_array((np.maximum(lengths, 1e-12), (edges[:, 0], edges[:, 1])), shape=(size, size))
    away, _, source = csgraph.dijkstra(roads, directed=False, indices=nodes, min_only=True, return_predecessors=True)
    rank = np.full(size, -1)
    rank[nodes] = np.arange(len(nodes))
    cells = rank[np.maximum(source, 0)]
    lost = ~np.isfinite(away)
    if lost.any():
        cells[lost] = cKDTree(mesh.vertices[nodes]).query(mesh.vertices[lost])[1]
    return cells


def _hoods(pairs: Int64[np.ndarray, "E 2"], count: int) -> Int64[np.ndarray, "N h"]:
    adjacent = sparse.csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    adjacent = sparse.csr_array(adjacent + sparse.eye_array(count))
    two = sparse.csr_array(adjacent @ adjacent)
    two.sort_indices()
    sizes = np.diff(two.indptr)
    hood = np.full((count, int(sizes.max())), -1, np.int64)
    hood[np.repeat(np.arange(count), sizes), np.arange(len(two.indices)) - np.repeat(two.indptr[:-1], sizes)] = (
        two.indices
    )
    return hood
