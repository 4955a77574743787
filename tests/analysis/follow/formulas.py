"""One round of an embedded deformation as formulas on arrays, which the core's loops must agree with."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow.embedded_graph import NORMAL_REACH, Binding, Pose, moved, turned
from tests.analysis.fit.formulas import normals_at, pair_weights

STILL = 1e-4  # squared row weight of a turn times its lever
LARGEST_TURN = 0.5  # rad, of a node in one step
STEP = 1e-6  # of the central differences: their error is its square


@dataclass(frozen=True)
class Graph:
    """What `_core.Deformation` takes, in its order."""

    nodes: np.ndarray
    edges: np.ndarray
    held: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    bound: np.ndarray
    weights: np.ndarray

    @property
    def binding(self) -> Binding:
        return Binding(self.bound.astype(np.int64), self.weights)

    @property
    def arms(self) -> np.ndarray:
        return self.nodes[self.edges[:, 1]] - self.nodes[self.edges[:, 0]]


class Pairs(NamedTuple):
    """Samples of the mesh and planes, of normals through points, which they are pulled to; weights are squared."""

    samples: np.ndarray
    normals: np.ndarray
    points: np.ndarray
    weights: np.ndarray


def pairs(graph: Graph, pose: Pose, frame: FrameSurface, count: int, gate: float, least: float) -> Pairs:
    """Pairs of the mesh's samples with the frame's surface, and of `count` samples of the frame with them."""
    points = moved(graph.points, graph.nodes, graph.binding, pose)
    normals = turned(graph.normals, graph.binding, pose)
    hits = frame.surface.closest(points)
    ahead = pair_weights(points - hits.points, normals_at(frame, hits), normals, gate, least) * frame.inside_at(hits)
    some = frame.samples(count)
    some = some[frame.inside[some]]
    theirs, planes = frame.mesh.vertices[some], frame.normals[some]
    own = np.concatenate([points, NORMAL_REACH * normals], axis=1)
    found = cKDTree(own).query(np.concatenate([theirs, NORMAL_REACH * planes], axis=1))[1]
    along = np.abs(np.einsum("nd,nd->n", points[found] - theirs, planes))
    spacing = np.sqrt(frame.surface.areas.sum() / count)
    away = np.maximum(along, np.linalg.norm(points[found] - theirs, axis=1) - spacing)
    return Pairs(
        np.concatenate([np.arange(len(points)), found]),
        np.concatenate([normals_at(frame, hits), planes]),
        np.concatenate([hits.points, theirs]),
        np.concatenate([ahead, pair_weights(away[:, None], planes, normals[found], gate, least)]),
    )


def tears(graph: Graph, pose: Pose) -> np.ndarray:
    i, j = graph.edges.T
    return np.einsum("eij,ej->ei", pose.rotations[i], graph.arms) + pose.positions[i] - pose.positions[j]


def holds(graph: Graph, pose: Pose, torn: float) -> np.ndarray:
    share = (tears(graph, pose) ** 2).sum(axis=1) / (graph.arms**2).sum(axis=1)
    return graph.held / (1 + share / torn**2) ** 2  # Geman and McClure


def stepped(pose: Pose, step: np.ndarray) -> Pose:
    """The pose after a turn and a shift of each node; a turn is the quaternion (1, turn / 2)."""
    turn, shift = step.reshape(-1, 6)[:, :3], step.reshape(-1, 6)[:, 3:]
    turn = turn * np.minimum(1, LARGEST_TURN / np.maximum(np.linalg.norm(turn, axis=1, keepdims=True), 1e-12))
    turns = Rotation.from_quat(np.concatenate([turn / 2, np.ones((len(turn), 1))], axis=1)).as_matrix()
    return Pose(turns @ pose.rotations, pose.positions + shift)


def deformed(graph: Graph, pose: Pose, found: Pairs, rigidity: float, torn: float, place: float) -> Pose:
    """The pose after one Gauss-Newton step, by a direct solution; derivatives are differences."""
    count, squares = len(graph.nodes), (graph.arms**2).sum(axis=1)
    scale = found.weights.sum() / count
    lever = np.bincount(graph.edges[:, 0], squares, count) / np.maximum(np.bincount(graph.edges[:, 0]), 1)
    prior = np.full((count, 6), place * scale)
    prior[:, :3] = STILL * scale * np.maximum(lever, 0.1 * np.median(squares))[:, None]
    edges, data = np.sqrt(rigidity * scale * holds(graph, pose, torn)), np.sqrt(found.weights)

    def rows(step: np.ndarray) -> np.ndarray:
        now = stepped(pose, step)
        off = moved(graph.points, graph.nodes, graph.binding, now)[found.samples] - found.points
        kept = (edges[:, None] * tears(graph, now)).reshape(-1)
        return np.concatenate([data * (found.normals * off).sum(axis=1), kept, np.sqrt(prior.reshape(-1)) * step])

    jacobian = np.stack([(rows(STEP * e) - rows(-STEP * e)) / (2 * STEP) for e in np.eye(6 * count)], axis=1)
    return stepped(pose, np.linalg.lstsq(jacobian, -rows(np.zeros(6 * count)), rcond=None)[0])
