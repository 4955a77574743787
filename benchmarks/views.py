"""How much of a scene the placed views see, and what looking costs beside Open3D alone.

python benchmarks/views.py FOLDER   # of a scene's meshes

Shares are of one frame in the middle that may not be among those that the views are placed by. `faces` and `area` are
seen by a pixel at least; `in sight` is the share of the area in some view's field with nothing before it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence

import numpy as np

from meshreel.analysis.scene.views import ViewsOptions, place_views
from meshreel.analysis.scene.votes import primitive_ids
from meshreel.geometry.cameras import PinholeCamera
from meshreel.geometry.raycast import Rays
from meshreel.geometry.topology import face_normals
from meshreel.io.sequence import open_sequence
from meshreel.types import Mesh

SIZES = ((320, 240), (480, 360), (640, 480))  # pixels
COUNTS = (4, 7, 10, 14, 20, 28, 56)
POINTS = 20_000  # of the surface, for what is in sight


def main(arguments: list[str]) -> int:
    """Prints the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    frames = open_sequence(parser.parse_args(arguments).folder)
    mesh = frames[len(frames) // 2 + 1]
    sys.stdout.write(f"{len(frames)} frames; {len(mesh.faces)} faces\n")
    sys.stdout.write("| views | pixels | faces | area | in sight | placing, CPU s |\n")
    sys.stdout.write("| ---: " * 6 + "|\n")
    rays = Rays(mesh)
    for count, (width, height) in [*((count, SIZES[0]) for count in COUNTS), *((14, size) for size in SIZES[1:])]:
        start = time.process_time()
        views = place_views(frames, ViewsOptions(count=count, width=width, height=height))
        spent = time.process_time() - start
        shares = f"{_share_of_faces(mesh, rays, views)} | {_in_sight(mesh, rays, views):.1%}"
        sys.stdout.write(f"| {count} | {width} x {height} | {shares} | {spent:.1f} |\n")
        sys.stdout.flush()
    for size in SIZES[::2]:
        views = place_views(frames, ViewsOptions(width=size[0], height=size[1]))
        ours = _cost(lambda views=views: primitive_ids(Rays(mesh), views))
        peer = _cost(lambda views=views: _open3d(mesh, views))
        sys.stdout.write(f"{len(views)} views of {size[0]} x {size[1]}, CPU s: {ours:.2f}; Open3D alone {peer:.2f}\n")
    return 0


def _share_of_faces(mesh: Mesh, rays: Rays, views: Sequence[PinholeCamera]) -> str:
    ids = primitive_ids(rays, views)
    areas = face_normals(mesh)[1]
    found = np.unique(ids[ids >= 0])
    return f"{len(found) / len(mesh.faces):.1%} | {areas[found].sum() / areas.sum():.1%}"


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


def _open3d(mesh: Mesh, views: Sequence[PinholeCamera]) -> None:
    import open3d as o3d

    tensor = o3d.core.Tensor.from_numpy
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(tensor(mesh.vertices.astype(np.float32)), tensor(mesh.faces.astype(np.uint32)))
    for view in views:
        matrices = tensor(view.intrinsic), tensor(view.extrinsic)
        scene.cast_rays(scene.create_rays_pinhole(*matrices, view.width, view.height))["primitive_ids"].numpy()


def _cost(what: Callable[[], object]) -> float:
    """CPU seconds, the least of five."""
    spent = []
    for _ in range(5):
        start = time.process_time()
        what()
        spent.append(time.process_time() - start)
    return min(spent)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
