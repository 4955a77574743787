"""Poisson reconstruction by Open3D, as the paper has it (section 3.3.2). Needs the extra `open3d`.

In: points with normals. Out: the surface through them. Poisson closes all openings: surface far from all points is cut
away.
"""

from __future__ import annotations

import threading

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from ..errors import InputError
from ..types import Mesh
from .topology import clean

_ONE_AT_A_TIME = threading.Lock()  # the library keeps state in static variables: two threads would change the bits


def poisson_surface(
    points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"], depth: int, reach: float
) -> Mesh:
    """Return the surface through points with outward normals, cut off farther than `reach` from all of them.

    `depth` is that of the octree. Runs in one thread, so that the same points give the same bits. Raises InputError
    without Open3D.
    """
    try:
        import open3d as o3d
    except ImportError as error:
        text = "Poisson reconstruction needs the extra `open3d`: pip install 'meshreel[open3d]'"
        raise InputError(f"{text}; or use preset `paper`, which does without") from error
    if len(points) < 10:
        return Mesh.empty()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    quiet = o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error)
    with _ONE_AT_A_TIME, quiet:
        solid, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    mesh = Mesh.of(np.asarray(solid.vertices), np.asarray(solid.triangles))
    near = cKDTree(points).query(mesh.vertices)[0] <= reach
    return clean(Mesh.of(mesh.vertices, mesh.faces[near[mesh.faces].all(axis=1)]))
