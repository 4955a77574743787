"""Graph of nodes on a mesh, bindings of points to the nodes nearest along the surface, and poses that move them.

In: the key frame's mesh. Out: nodes (farthest-point samples), edges between cells that touch, bindings of points.
A hand near a hip shares no node with it: only nodes within two edges of a point's cell may move it. A point p bound to
nodes j goes to sum w_j (R_j (p - g_j) + t_j) (Sumner et al. 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from ...geometry.strict import determinants, inverses, nearest_rotations, products
from ...geometry.topology import clean, components, unique_edges, vertex_normals
from ...types import Mesh

Points = Float64[np.ndarray, "P 3"]
Nodes = Float64[np.ndarray, "N 3"]
SEEDED = 0.25  # largest share of nodes that begin a component (guess)
TOGETHER = 2048  # points that are bound together: bounds memory (guess)
NORMAL_REACH = 0.01  # diagonals, weight of a difference of unit normals: both sides of a thin part are apart (guess)
BACK_ROUNDS = 2  # rounds of the inverse, the first of which only estimates the nodes that move a point (guess)
NEIGHBOURS = 4  # nodes that move a point (guess)
STRETCHED = 2.0  # times its length: a face with an edge that the motion makes longer is left out (decision 28)
FLATTEST = 0.1  # a blend of rotations with a smaller determinant has no usable inverse (guess)


@dataclass(frozen=True, slots=True)
class Binding:
    """Nodes that move each point, with their weights."""

    indices: Int64[np.ndarray, "P k"]
    weights: Float64[np.ndarray, "P k"]  # rows sum to 1


@dataclass(frozen=True, slots=True)
class DeformationGraph:
    """Nodes on a mesh, with edges; every vertex belongs to the cell of the node that is nearest along the surface."""

    nodes: Nodes
    edges: Int64[np.ndarray, "E 2"]  # both directions of each pair of touching cells
    cells: Int64[np.ndarray, " V"]
    hood: Int64[np.ndarray, "N h"]  # each node and those at most two edges away, padded with -1

    def bind(self, points: Points, cells: Int64[np.ndarray, " P"]) -> Binding:
        """Bind points to the nearest `NEIGHBOURS` nodes of their cells' hoods; weights fall to 0 at the next one."""
        count, bound = min(NEIGHBOURS, self.hood.shape[1]), list[tuple[np.ndarray, np.ndarray]]()
        for at in range(0, max(len(points), 1), TOGETHER):
            hood = self.hood[cells[at : at + TOGETHER]]
            away = np.linalg.norm(self.nodes[hood] - points[at : at + TOGETHER, None], axis=2)
            away[hood < 0] = np.inf
            nearest = np.argsort(away, axis=1, kind="stable")[:, : count + 1]
            away, indices = np.take_along_axis(away, nearest, axis=1), np.take_along_axis(hood, nearest, axis=1)
            finite = np.where(np.isfinite(away), away, 0.0)
            reach = np.where(np.isfinite(away[:, -1]), away[:, -1], 1.5 * finite.max(axis=1))
            reach = np.maximum(reach, np.finfo(float).tiny)
            weights = np.square(np.maximum(1 - away[:, :count] / reach[:, None], 0))
            weights[:, 0] = np.maximum(weights[:, 0], 1e-12)
            bound.append((np.maximum(indices[:, :count], 0), weights / weights.sum(axis=1, keepdims=True)))
        return Binding(*(np.concatenate(parts) for parts in zip(*bound, strict=True)))


def farthest_first(mesh: Mesh, candidates: Int64[np.ndarray, " S"], count: int) -> Int64[np.ndarray, " N"]:
    """Choose `count` candidate vertices one by one, each the farthest from the earlier ones; every prefix is even.

    Distances are of positions and normals. The first choices are one vertex of each component, the largest ones first.
    """
    labels = components(mesh.faces, len(mesh.vertices))[candidates]
    _, first, sizes = np.unique(labels, return_index=True, return_counts=True)
    seeds = first[np.argsort(-sizes, kind="stable")][: max(1, int(SEEDED * count))]
    normals = vertex_normals(mesh)[candidates]
    places = np.concatenate([mesh.vertices[candidates], NORMAL_REACH * normals], axis=1)
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
    adjacent = sparse.csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    adjacent = sparse.csr_array(adjacent + sparse.eye_array(count))
    two = sparse.csr_array(adjacent @ adjacent)  # nodes at most two edges away
    two.sort_indices()
    sizes = np.diff(two.indptr)
    hood = np.full((count, int(sizes.max())), -1, np.int64)
    hood[np.arange(hood.shape[1]) < sizes[:, None]] = two.indices  # row by row
    return DeformationGraph(mesh.vertices[nodes], pairs, cells, hood)


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


@dataclass(frozen=True, slots=True)
class Pose:
    """Positions of the nodes, and their rotations relative to rest."""

    rotations: Float64[np.ndarray, "N 3 3"]
    positions: Nodes

    @staticmethod
    def at(nodes: Nodes) -> Pose:
        """Return the pose of nodes at rest."""
        return Pose(np.tile(np.eye(3), (len(nodes), 1, 1)), nodes.copy())


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of the key mesh through T frames."""

    mesh: Mesh  # the key frame's
    graph: DeformationGraph
    rotations: Float64[np.ndarray, "T N 3 3"]
    positions: Float64[np.ndarray, "T N 3"]
    residuals: Float64[np.ndarray, " T"]  # symmetric RMS; 0 at the key, infinite at an empty frame

    def bound(self, points: Points, normals: Points | None = None) -> Binding:
        """Bind points on or near the key mesh to the nodes of the nearest vertices.

        Normals prevent binding to a near sheet that faces away.
        """
        key_vertices = np.concatenate([self.mesh.vertices, NORMAL_REACH * vertex_normals(self.mesh)], axis=1)
        queries = points if normals is None else np.concatenate([points, NORMAL_REACH * normals], axis=1)
        vertices = cKDTree(key_vertices[:, : queries.shape[1]]).query(queries)[1].reshape(-1)
        return self.graph.bind(points, self.graph.cells[vertices])

    def back(self, frame: int, mesh: Mesh) -> Mesh:
        """Move a mesh on or near a frame to the pose of the key frame, by the inverse of `moved`.

        Faces with a vertex at which the motion has no inverse are left out.
        """
        pose = Pose(self.rotations[frame], self.positions[frame])
        binding = self.graph.bind(self.mesh.vertices, self.graph.cells)
        vertices = moved(self.mesh.vertices, self.graph.nodes, binding, pose)
        facing = turned(vertex_normals(self.mesh), binding, pose)
        queries = np.concatenate([mesh.vertices, NORMAL_REACH * vertex_normals(mesh)], axis=1)
        near = cKDTree(np.concatenate([vertices, NORMAL_REACH * facing], axis=1)).query(queries)[1].reshape(-1)
        points, cells = self.mesh.vertices[near], self.graph.cells[near]
        for _ in range(BACK_ROUNDS):
            binding = self.graph.bind(points, cells)
            blended = _affine(self.graph.nodes, binding, pose)
            linear, offsets = blended[:, :, :3].copy(), mesh.vertices - blended[:, :, 3]
            invertible = np.abs(determinants(linear)) > FLATTEST
            linear[~invertible] = np.eye(3)
            points = products(inverses(linear), offsets[:, :, None])[:, :, 0]
        kept = invertible[mesh.faces].all(axis=1) & (_stretch(points, mesh) <= STRETCHED)
        return clean(Mesh(points, mesh.faces[kept]))


def _stretch(points: Points, mesh: Mesh) -> Float64[np.ndarray, " F"]:
    """Return how many times longer each face's edges become, at most, when the vertices of a mesh go to `points`."""
    sides = (corners - np.roll(corners, 1, axis=1) for corners in (points[mesh.faces], mesh.vertices[mesh.faces]))
    after, before = (np.einsum("fed,fed->fe", side, side) for side in sides)
    return np.sqrt((after / np.maximum(before, np.finfo(float).tiny)).max(axis=1, initial=0))


def moved(points: Points, nodes: Nodes, binding: Binding, pose: Pose) -> Points:
    """Move bound points from the rest of the nodes to a pose."""
    blended = _affine(nodes, binding, pose)
    return np.einsum("pij,pj->pi", blended[:, :, :3], points) + blended[:, :, 3]


def _affine(nodes: Nodes, binding: Binding, pose: Pose) -> Float64[np.ndarray, "P 3 4"]:
    """Blend the nodes' motions at each bound point."""
    offsets = pose.positions - np.einsum("nij,nj->ni", pose.rotations, nodes)
    affine = np.concatenate([pose.rotations, offsets[:, :, None]], axis=2).reshape(-1, 12)
    return _blend(affine, binding).reshape(-1, 3, 4)


def turned(vectors: Points, binding: Binding, pose: Pose) -> Points:
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
