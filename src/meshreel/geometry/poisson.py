"""Screened Poisson reconstruction of a surface through oriented points, trimmed (paper, section 3.3.2).

Poisson reconstruction closes whatever is open; the surface that it invents far from the points is cut away by density
and by distance. Needs the extra `encode`.
"""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from ..types import Mesh
from .decimate import decimate
from .topology import clean, connected_faces, large_pieces

_LEAVES = re.compile(rb"\[WARNING\] [^\n]*\n[^\n]*_getValues\n[^\n]*getValue assumes leaf node\n")
_ONE_AT_A_TIME = threading.Lock()  # the library keeps state in static variables: two threads would change the bits


@dataclass(frozen=True, slots=True)
class PoissonOptions:
    """Resolution of the reconstruction, and how much of its result to trust."""

    depth: int = 9  # of the octree
    trim: float = 2.0  # octree levels below the median density at which surface is cut away
    reach: float = 0.01  # surface farther than this from all points is cut away, in units of the points
    hole: float = 0.002  # untrusted patches with less than this share of all faces are kept, to avoid pinholes
    vertices: int = 15_000  # the closed surface is decimated to this many before it is trimmed
    smallest: float = 0.01  # connected components with less than this share of the largest one's faces are dropped


def reconstruct(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], options: PoissonOptions
) -> Mesh:
    """Reconstruct the surface through points with outward normals; fewer than 10 points give the empty mesh.

    Runs in one thread, so that the same points give the same bits.
    """
    import open3d as o3d

    if len(points) < 10:
        return Mesh.empty()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    with _ONE_AT_A_TIME, _without_leaf_warnings():
        build = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson
        solid, density = build(cloud, depth=options.depth, n_threads=1)
    whole = Mesh.of(np.asarray(solid.vertices), np.asarray(solid.triangles))
    mesh = decimate(whole, options.vertices)
    gaps = cKDTree(points).query(mesh.vertices)[0]  # to the nearest point
    levels, nearest = np.asarray(density), cKDTree(whole.vertices).query(mesh.vertices)[1]
    dense = levels[nearest] >= np.median(levels) - options.trim  # the points are not much sparser than in the median
    trusted = dense & (gaps <= options.reach)
    kept = trusted[mesh.faces].all(axis=1)
    kept |= _holes(mesh, ~kept, options.hole) & (gaps <= 3 * options.reach)[mesh.faces].all(axis=1)
    return drop_small(clean(Mesh.of(mesh.vertices, mesh.faces[kept])), options.smallest)


@contextmanager
def _without_leaf_warnings() -> Iterator[None]:
    """Suppress Open3D's warnings about octree leaves on standard error.

    There are thousands of them, they concern nothing that a user could change, and no setting of Open3D ends them.
    """
    with ExitStack() as stack:
        try:
            kept = stack.enter_context(tempfile.TemporaryFile())
            shown = os.dup(2)
        except OSError:  # no space or no standard error: nothing is filtered
            yield
            return
        os.dup2(kept.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(shown, 2)
            os.close(shown)
            kept.seek(0)
            if said := _LEAVES.sub(b"", kept.read()):
                os.write(2, said)


def drop_small(mesh: Mesh, share: float) -> Mesh:
    """Remove connected components that have less than this share of the faces of the largest one."""
    if mesh.is_empty:
        return mesh
    return clean(Mesh.of(mesh.vertices, mesh.faces[large_pieces(mesh.faces, len(mesh.vertices), share)]))


def thin_out(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], cell: float
) -> tuple[Float64[np.ndarray, "M 3"], Float64[np.ndarray, "M 3"]]:
    """Return one mean point and unit mean normal per cell of this size and per side of a thin sheet in it."""
    if len(points) == 0:
        return points, normals
    grid = np.floor((points - points.min(axis=0)) / cell).astype(np.int64)
    side = np.argmax(np.abs(normals), axis=1)
    side = 2 * side + (normals[np.arange(len(normals)), side] < 0)  # opposite sides of a finger do not average out
    size = grid.max(axis=0) + 1
    key = ((grid[:, 0] * size[1] + grid[:, 1]) * size[2] + grid[:, 2]) * 6 + side
    _, group, count = np.unique(key, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    mean = [np.stack([np.bincount(group, a[:, d], len(count)) for d in range(3)], axis=1) for a in (points, normals)]
    length = np.linalg.norm(mean[1], axis=1, keepdims=True)
    return mean[0] / count[:, None], mean[1] / np.where(length > 0, length, 1.0)


def _holes(mesh: Mesh, cut: Bool[np.ndarray, " F"], share: float) -> Bool[np.ndarray, " F"]:
    """Return which of the faces to cut are in patches so small that a hole would be worse than a guessed surface."""
    label = np.zeros(len(mesh.faces), dtype=np.int64)
    label[cut] = 1 + connected_faces(mesh.faces[cut], len(mesh.vertices))
    size = np.bincount(label)
    return cut & (size[label] <= share * len(mesh.faces))
