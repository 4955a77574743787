"""Midpoint subdivision as levels: temporary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..types import Mesh
from .topology import subdivide_midpoint, unique_edges, vertex_normals


@dataclass(frozen=True, slots=True)
class Level:
    count: int
    faces: np.ndarray
    edges: np.ndarray
    finer: np.ndarray


def levels_of(faces, count, levels):
    out = []
    for _ in range(levels):
        edges = unique_edges(faces)[0]
        finer = subdivide_midpoint(Mesh.of(np.zeros((count, 3)), faces), 1).faces
        out.append(Level(count, faces, edges, finer))
        faces, count = finer, count + len(edges)
    return tuple(out)


def _frames(x, level, k):
    N = vertex_normals(Mesh(np.ascontiguousarray(x), level.faces))
    a, b = level.edges.T
    n = N[a] + N[b]
    n = n / np.maximum(np.linalg.norm(n, axis=1), 1e-30)[:, None]
    e = x[b] - x[a]
    L = np.linalg.norm(e, axis=1)
    sag = np.clip(((N[b] - N[a]) * e).sum(1) / 8, -0.15 * L, 0.15 * L)
    return (x[a] + x[b]) / 2 + (k * sag)[:, None] * n, n


def edge_frames(positions, level, curvature):
    r = [_frames(x, level, curvature) for x in positions]
    return np.stack([a for a, _ in r]), np.stack([b for _, b in r])


def heights(mid, dirs, wanted, level):
    out = np.zeros(mid.shape[:2])
    for t in range(len(mid)):
        Np = vertex_normals(Mesh(np.ascontiguousarray(wanted[t]), level.finer))[level.count :]
        off = wanted[t][level.count :] - mid[t]
        den = (dirs[t] * Np).sum(1)
        s = np.where(den > 0.3, (off * Np).sum(1) / np.maximum(den, 0.3), (off * dirs[t]).sum(1))
        L = np.linalg.norm(wanted[t][level.edges[:, 0]] - wanted[t][level.edges[:, 1]], axis=1)
        out[t] = np.clip(s, -L, L)
    return out


def refine(positions, level, scalars, curvature):
    m, d = edge_frames(positions, level, curvature)
    return np.concatenate([positions, m + scalars[..., None] * d], axis=1)
