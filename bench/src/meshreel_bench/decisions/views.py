"""Decision 17: how much of a room the placed views see.

In: the captured scene room2. Out: a row for each number and size of views. Shares are of one frame in the middle; faces
and area are seen by a pixel at least, and area is in sight where it is in some view's field with nothing before it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np

from meshreel.analysis.scene.views import ViewsOptions, place_views
from meshreel.geometry.cameras import PinholeCamera
from meshreel.geometry.raycast import Rays
from meshreel.geometry.topology import face_normals
from meshreel.types import Mesh

from ..datasets.scenes import open_scene
from .rows import Row, Sources

SIZES = ((320, 240), (480, 360), (640, 480))  # pixels
COUNTS = (4, 7, 10, 14, 20, 28, 56)  # views of the smallest size
CHOSEN = 14  # views of the other sizes
POINTS = 20_000  # of the surface, by which the area in sight is estimated


def measure(sources: Sources) -> Iterator[Row]:
    """Yield a row for each number and size."""
    frames = open_scene("room2", sources.data, sources.cache).meshes
    mesh = frames[len(frames) // 2 + 1]
    areas, rays = face_normals(mesh)[1], Rays(mesh)
    for count, (width, height) in [*((count, SIZES[0]) for count in COUNTS), *((CHOSEN, size) for size in SIZES[1:])]:
        start = time.process_time()
        views = place_views(frames, ViewsOptions(count=count, width=width, height=height))
        placed = time.process_time()
        ids = np.stack([rays.look(view).faces for view in views])
        seen = np.unique(ids[ids >= 0])
        yield {
            "views": count,
            "width": width,
            "height": height,
            "faces": len(seen) / len(mesh.faces),
            "area": float(areas[seen].sum() / areas.sum()),
            "in_sight": _in_sight(mesh, rays, views),
            "placing_cpu_s": placed - start,
        }


def _in_sight(mesh: Mesh, rays: Rays, views: Sequence[PinholeCamera]) -> float:
    areas = face_normals(mesh)[1]
    faces = np.random.default_rng(0).choice(len(areas), POINTS, p=areas / areas.sum())
    points = mesh.vertices[mesh.faces[faces]].mean(axis=1)
    found = np.zeros(POINTS, bool)
    for view in views:
        local = points @ view.extrinsic[:3, :3].T + view.extrinsic[:3, 3]
        image = view.project(local)
        with np.errstate(invalid="ignore"):
            within = ((image >= 0) & (image < (view.width, view.height))).all(axis=1)
        hit = rays.cast(np.broadcast_to(view.eye, points.shape), points - view.eye)
        found |= within & ((hit.faces == faces) | (hit.distances > 0.999))
    return float(found.mean())
