"""Decisions 17 and 19: how much of room2 the placed views see, and its background from depth and from meshes."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from meshreel.analysis.scene.background import BackgroundOptions, fuse_background
from meshreel.analysis.scene.background_depth import Moment, fuse_still_depth
from meshreel.analysis.scene.views import ViewsOptions, place_views
from meshreel.geometry.cameras import PinholeCamera
from meshreel.geometry.raycast import Rays
from meshreel.geometry.topology import drop_unreferenced, face_normals
from meshreel.metrics.scene_accuracy import Scene, scene_row
from meshreel.types import Mesh, evenly

from ..datasets.scenes import FOUND, SceneData, open_scene, true_scene
from .rows import Row, Sources

SIZES = ((320, 240), (480, 360), (640, 480))  # pixels
COUNTS = (4, 7, 10, 14, 20, 28, 56)  # views of the smallest size
CHOSEN = 14  # views of the other sizes
POINTS = 20_000  # of the surface, by which the area in sight is estimated
VOXEL, FRAME = 0.02, 30  # m, as scenes are fused; the frame whose truth is compared
BASE = BackgroundOptions()
MESHES = replace(BASE, depth=False)
KINDS = {
    "meshes, ten frames, nothing past borders": replace(MESHES, frames=10, past=0.0, steady=99.0),
    "meshes, twenty frames, nothing past borders": replace(MESHES, past=0.0, steady=99.0),
    "meshes, half a voxel past borders": replace(MESHES, steady=99.0),
    "meshes, and steady": MESHES,
    "depth, all faces, the frames' voxels": replace(BASE, finer=1.0, facing=0.0),
    "depth, faces seen from the front": replace(BASE, finer=1.0),
    "depth, and finer voxels": BASE,
}
SHOWN = ("median_m", "covered", "d2_psnr_backward", "normal_error_deg")


def measure_views(sources: Sources) -> Iterator[Row]:
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


def measure_backgrounds(sources: Sources) -> Iterator[Row]:
    """Yield a row for each kind."""
    scene = open_scene("room2", sources.data, sources.cache)
    numbers = {*evenly(len(scene.meshes), BASE.frames), *evenly(len(scene.meshes), 10)}
    labels = {number: scene.labels(number, FOUND) for number in sorted(numbers)}
    clean = true_scene(scene.truth, FRAME)
    for kind, options in KINDS.items():
        start = time.process_time()
        mesh = background(scene, options, labels)
        seconds = time.process_time() - start
        found = scene_row(clean, Scene(mesh, np.zeros(len(mesh.faces), bool), clean.sights, clean.options))
        shown = {name: found[f"background_{name}"] for name in SHOWN}
        yield {"kind": kind, "faces": len(mesh.faces), "cpu_s": seconds} | shown


def background(scene: SceneData, options: BackgroundOptions, labels: dict[int, np.ndarray]) -> Mesh:
    """Fuse the background as the encoder does, with labels that are known."""
    numbers = evenly(len(scene.meshes), options.frames)
    if options.depth:
        moments = (Moment(scene.meshes.depth[k], scene.meshes[k], ~labels[k]) for k in numbers)
        return fuse_still_depth(moments, VOXEL, options)
    still = (Mesh(mesh.vertices, mesh.faces[~labels[k]]) for k, mesh in ((k, scene.meshes[k]) for k in numbers))
    return fuse_background((drop_unreferenced(mesh) for mesh in still), VOXEL, options)
