"""Pictures to which splats are fitted: renders of a coloured mesh from around it, or a body in colour cameras.

In: a mesh, and the source of its colours -> cameras with pictures of the mesh alone, on white. Pictures are cropped to
the mesh, so that few pixels are empty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from jaxtyping import Float64

from ...geometry.cameras import Camera, CameraPose, Hit, Rays, looking_at, pixels_near
from ...geometry.color_views import ColorPicture, Painted, sampled
from ...types import UP_AXES, Mesh, Up
from .splat_fit import SplatView

GOLDEN = (math.sqrt(5) - 1) / 2  # turns from a frame's cameras to the next frame's, so that no two frames agree
TILTS = (0.1, 0.4)  # rad above the horizon, of alternate cameras (guess)
AWAY = 1.6  # sizes of the mesh between its middle and a camera (guess)
BORDER = 3  # pixels beside the mesh
FINER = 2  # rays a pixel, along both sides
HIDDEN = 0.01  # of the distance: surface that is nearer by more hides the mesh (guess)
Colors = Callable[[Hit, Float64[np.ndarray, "N 3"]], Float64[np.ndarray, "N 3"]]  # of hits at positions


def ring(mesh: Mesh, count: int, size: int, turn: float, up: Up = "y") -> list[Camera]:
    """Return cameras around a mesh, which fills pictures of `size` pixels; `turn`: the first one's angle, turns."""
    extent, cameras = mesh.diagonal, list[Camera]()
    above = np.array(UP_AXES[up])
    axis = int(np.abs(above).argmax())
    along, aside = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    for number in range(count):
        angle, tilt = 2 * math.pi * (number / count + turn), TILTS[number % len(TILTS)]
        way = math.cos(tilt) * (math.cos(angle) * along + math.sin(angle) * aside) + math.sin(tilt) * above
        pose = CameraPose.of_camera(looking_at(mesh.middle + AWAY * extent * way, mesh.middle, axis))
        camera = Camera(size, size, (float(size), float(size)), (0.0, 0.0), pose)
        cameras += [cut] if (cut := cut_to(camera, mesh, size)) else []
    return cameras


def cut_to(camera: Camera, mesh: Mesh, size: int, most: float = math.inf) -> Camera | None:
    """Crop a camera's picture to the mesh, and scale its longer side to `size` pixels; None: out of sight.

    Its pixels become at most `most` times as fine.
    """
    if mesh.is_empty:
        return None
    local = mesh.vertices @ camera.extrinsic[:3, :3].T + camera.extrinsic[:3, 3]
    if local[:, 2].min() <= 0:
        return None
    places = camera.project(local)
    low, high = places.min(axis=0), places.max(axis=0)
    if most < math.inf:  # a real picture ends at its border
        low, high = np.maximum(low, 0), np.minimum(high, [camera.width, camera.height])
    extent = float((high - low).max())
    if (high - low).min() < 1:
        return None
    scale = min((size - 2 * BORDER) / extent, most)
    width, height = (max(math.ceil(scale * side) + 2 * BORDER, 8) for side in (high - low))
    moved = np.array([[scale, 0, BORDER - scale * low[0]], [0, scale, BORDER - scale * low[1]], [0, 0, 1]])
    return Camera.of(width, height, moved @ camera.intrinsic, camera.extrinsic)


def rendered(mesh: Mesh, cameras: Sequence[Camera]) -> tuple[SplatView, ...]:
    """Return unlit pictures of a coloured mesh."""
    rays, painted = Rays(mesh), Painted(mesh)
    return tuple(_view(mesh, rays, camera, lambda hit, _: painted.on(hit.faces, hit.barycentric)) for camera in cameras)


def taken(pictures: Sequence[ColorPicture], body: Mesh, whole: Mesh, size: int) -> tuple[SplatView, ...]:
    """Return a body in colour cameras' pictures, on white; NaN where it is hidden, and beyond the picture.

    `whole` is all surface of the frame.
    """
    rays, hides, views = Rays(body), Rays(whole), list[SplatView]()
    for picture in pictures:
        camera = cut_to(picture.camera.straight, body, size, most=1.0)
        if camera is not None:
            views.append(_view(body, rays, camera, partial(_pictured, picture, hides)))
    return tuple(views)


def _pictured(
    picture: ColorPicture, hides: Rays, _hit: Hit, points: Float64[np.ndarray, "N 3"]
) -> Float64[np.ndarray, "N 3"]:
    eye = picture.camera.eye
    first = hides.cast(np.broadcast_to(eye, points.shape), points - eye).distances  # the points are at 1
    positions, _ = picture.project(points)
    height, width = picture.pixels.shape[:2]
    with np.errstate(invalid="ignore"):
        inside = (positions >= 0).all(axis=1) & (positions <= [width, height]).all(axis=1)
    known = inside & (first > 1 - HIDDEN)
    colors = np.full(points.shape, np.nan)
    colors[known] = sampled(picture.pixels, positions[known]) / picture.gains
    return colors


def _view(mesh: Mesh, rays: Rays, camera: Camera, colors: Colors) -> SplatView:
    """Render a view with `FINER` x `FINER` rays per pixel, whose colours are averaged."""
    fine = camera.resized(FINER * camera.width, FINER * camera.height)
    rows, columns = np.nonzero(pixels_near(fine, mesh))
    _, local = fine.rays(np.column_stack([columns, rows]) + 0.5)
    directions = local @ fine.extrinsic[:3, :3]
    hit = rays.cast(np.broadcast_to(fine.eye, directions.shape), directions)
    met = hit.faces >= 0
    met_hit = Hit(hit.faces[met], hit.distances[met], hit.barycentric[met])
    picture = np.full((fine.height, fine.width, 3), 255.0)
    points = fine.eye + hit.distances[met, None] * directions[met]
    picture[rows[met], columns[met]] = colors(met_hit, points)
    parts = picture.reshape(camera.height, FINER, camera.width, FINER, 3)
    return SplatView(camera, (parts.mean(axis=(1, 3)) / 255).astype(np.float32))
