"""One round of a fit as formulas on arrays, which the core's loops must agree with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

from meshreel.analysis.fit.frame import EDGE_SAMPLES, FrameSurface, border_sides, sample_border
from meshreel.geometry.closest_points import Hits, Surface
from meshreel.geometry.strict import nearest_rotations
from meshreel.geometry.topology import border_edges, face_normals, unique_edges, vertex_normals
from meshreel.types import Mesh

SPREAD = 3  # averagings of rotations over the ring


@dataclass(frozen=True)
class Rows:
    """Equations w (n . sum_k c_k x_k - value) = 0 on the corners of one face each; weights are squared."""

    faces: np.ndarray
    corners: np.ndarray
    normals: np.ndarray
    values: np.ndarray
    weights: np.ndarray

    def __add__(self, other: Rows) -> Rows:
        return Rows(*(np.concatenate([a, b]) for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


def laplacian(faces: np.ndarray, count: int) -> sparse.csr_array:
    i, j = unique_edges(faces)[0].T
    degree = np.bincount(np.concatenate([i, j]), minlength=count)
    rows, columns = np.concatenate([i, j]), np.concatenate([j, i])
    return sparse.csr_array(
        sparse.eye_array(count) - sparse.csr_array((1.0 / degree[rows], (rows, columns)), shape=(count, count))
    )


def turned_laplacian(faces: np.ndarray, rest: np.ndarray, now: np.ndarray) -> np.ndarray:
    """Laplacian coordinates of `rest`, each turned by the rotation of its neighbourhood (Kabsch)."""
    edges, apart = unique_edges(faces)[0], laplacian(faces, len(rest))
    i, j = edges.T
    outer = ((rest[j] - rest[i])[:, :, None] * (now[j] - now[i])[:, None, :]).reshape(-1, 9)
    sums = np.zeros((len(rest), 9))
    np.add.at(sums, i, outer)
    np.add.at(sums, j, outer)
    sums = sums / (np.abs(sums).sum(axis=1, keepdims=True) + 1e-30)
    for _ in range(SPREAD):
        sums -= 0.5 * (apart @ sums)
    turns = nearest_rotations(sums.reshape(-1, 3, 3).transpose(0, 2, 1))[0]
    return np.einsum("vij,vj->vi", turns, apart @ rest)


def pair_weights(gaps: np.ndarray, normals: np.ndarray, others: np.ndarray, gate: float, least: float) -> np.ndarray:
    distance = np.linalg.norm(gaps, axis=1) / gate
    agree = np.einsum("nd,nd->n", normals, others) > least
    return np.where(agree & (distance < 1), np.exp(-2 * distance**2), 0.0)


def from_frame(mesh: Mesh, frame: FrameSurface, gate: float, least: float) -> Rows:
    surface, points = Surface(mesh), frame.mesh.vertices
    hits, inside = surface.closest(points), np.ones(len(mesh.vertices))
    inside[border_edges(mesh).reshape(-1)] = 0.0
    there = np.einsum("nk,nk->n", hits.barycentric, inside[mesh.faces[hits.faces]])
    weights = pair_weights(points - hits.points, frame.normals, surface.normals[hits.faces], gate, least)
    weights *= there * frame.inside * len(mesh.vertices) / len(points)
    values = np.einsum("nd,nd->n", frame.normals, points)
    return Rows(hits.faces, hits.barycentric, frame.normals, values, weights)


def normals_at(frame: FrameSurface, hits: Hits) -> np.ndarray:
    """The vertex normals, interpolated at points of the surface; zero where they cancel."""
    n = np.einsum("nk,nkd->nd", hits.barycentric, frame.normals[frame.mesh.faces[hits.faces]])
    length = np.linalg.norm(n, axis=1)
    return n / np.where(length > 0, length, 1.0)[:, None]


def from_template(mesh: Mesh, frame: FrameSurface, gate: float, least: float) -> Rows:
    count, corner = len(mesh.vertices), np.full(len(mesh.vertices), -1)
    corner[mesh.faces.reshape(-1)[::-1]] = np.arange(mesh.faces.size)[::-1]
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])
    faces = np.concatenate([corner // 3, np.arange(len(mesh.faces))])
    corners = np.concatenate([np.eye(3)[corner % 3], np.full((len(mesh.faces), 3), 1 / 3)])
    hits = frame.surface.closest(points)
    normals = normals_at(frame, hits)
    own = np.concatenate([vertex_normals(mesh), face_normals(mesh)[0]])
    weights = pair_weights(points - hits.points, normals, own, gate, least) * frame.inside_at(hits)
    scale = np.where(np.arange(len(points)) < count, 1.0, 0.5)
    return Rows(faces, corners, normals, np.einsum("nd,nd->n", normals, hits.points), weights * scale)


def from_borders(mesh: Mesh, frame: FrameSurface, gate: float, least: float) -> Rows:
    faces, starts = (np.repeat(of_sides, EDGE_SAMPLES) for of_sides in border_sides(mesh.faces))
    (mine, own, out), (theirs, normals, outward) = sample_border(mesh), sample_border(frame.mesh)
    share = np.tile((np.arange(EDGE_SAMPLES) + 0.5) / EDGE_SAMPLES, len(faces) // EDGE_SAMPLES)
    corners = np.zeros((len(faces), 3))
    corners[np.arange(len(faces)), starts], corners[np.arange(len(faces)), (starts + 1) % 3] = 1 - share, share
    ahead, back = cKDTree(theirs).query(mine)[1], cKDTree(mine).query(theirs)[1]
    a, b = np.concatenate([np.arange(len(ahead)), back]), np.concatenate([ahead, np.arange(len(back))])
    weights = pair_weights(mine[a] - theirs[b], own[a], normals[b], gate, least)
    weights *= np.einsum("nd,nd->n", out[a], outward[b]) > least
    weights *= np.where(np.arange(len(a)) < len(ahead), 1.0, len(ahead) / len(back)) / EDGE_SAMPLES
    rows = [
        Rows(faces[a], corners[a], direction, np.einsum("nd,nd->n", direction, theirs[b]), weights)
        for direction in (outward[b], normals[b])
    ]
    return rows[0] + rows[1]


def fitted(
    mesh: Mesh,
    frame: FrameSurface,
    shape: np.ndarray,
    place: np.ndarray,
    gate: float,
    smoothing: float,
    anchor: float,
    least: float,
) -> np.ndarray:
    """Positions after one round, by a direct solution of its equations."""
    rows = from_frame(mesh, frame, gate, least) + from_template(mesh, frame, gate, least)
    if len(border_edges(mesh)) and len(border_edges(frame.mesh)):
        rows = rows + from_borders(mesh, frame, 2 * gate, least)
    count, apart = len(mesh.vertices), laplacian(mesh.faces, len(mesh.vertices))
    at = 3 * np.repeat(mesh.faces[rows.faces], 3, axis=1) + np.tile(np.arange(3), 3)
    values = (rows.corners[:, :, None] * rows.normals[:, None, :]).reshape(-1, 9)
    lines = np.repeat(np.arange(len(rows.faces)), 9)
    a = sparse.csr_array((values.reshape(-1), (lines, at.reshape(-1))), shape=(len(rows.faces), 3 * count))
    w, each = sparse.diags_array(rows.weights), sparse.eye_array(3)
    keep = sparse.kron(smoothing**2 * (apart.T @ apart) + anchor**2 * sparse.eye_array(count), each)
    right = (smoothing**2 * (apart.T @ shape) + anchor**2 * place).reshape(-1) + a.T @ (w @ rows.values)
    return spsolve(sparse.csc_array(a.T @ w @ a + keep), right).reshape(-1, 3)
